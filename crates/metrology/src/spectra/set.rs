//! A set of kind `spectra`: reflectance or transmission of film stacks with an object of known height.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use metalith_core::document::{Document, KeyTable, Limits, Section, explore, load};
use metalith_core::text::{quoted, without_mark};
use metalith_rcwa::{CellLattice, Material};

use super::pads::{LARGEST_APERTURE, PadBank};
use super::screening;
use crate::number_rows::numbers;
use crate::pattern::NamePattern;

/// A layer as it was stated.
#[derive(Clone, Debug)]
pub struct StatedLayer {
    pub name: String,
    /// None of an object that its medium fills; of pillars, their material.
    pub material: Option<Material>,
    /// Thickness (nm); none of the object, which differs by measurement.
    pub thickness_nm: Option<f64>,
}

/// Pillars of all pads as they were stated; their widths differ by measurement.
#[derive(Clone, Debug)]
pub struct StatedPads {
    /// Number of their layer.
    pub layer: usize,
    pub pitch_nm: f64,
    pub lattice: CellLattice,
    /// True if they are circles.
    pub is_round: bool,
    pub height_nm: f64,
    /// Film under the pillars (nm).
    pub residual_nm: f64,
    /// Angle of the walls from upright (degrees), positive if the foot is wider.
    pub taper_deg: f64,
}

/// One measured spectrum.
#[derive(Clone, Debug)]
pub struct Spectrum {
    /// Name of the file without its ending.
    pub name: String,
    /// Height of the object, or width of the pillars as drawn (nm).
    pub size_nm: f64,
    /// Number of the medium in the object, or between the pillars.
    pub medium: usize,
    /// Reflectance, or transmission, at each wavelength of the set.
    pub reflectance: Vec<f64>,
    /// True if it is fitted; if not, it judges.
    pub fitted: bool,
}

/// A set of spectra.
#[derive(Clone, Debug)]
pub struct SpectrumSet {
    pub path: PathBuf,
    pub title: String,
    pub wavelengths_nm: Vec<f64>,
    /// True if the light was measured that the substrate receives, and not what comes back.
    pub is_transmission: bool,
    pub ambient_index: f64,
    /// Layers from the light inwards; one is the object.
    pub layers: Vec<StatedLayer>,
    /// The object, if it is pads of pillars.
    pub pads: Option<StatedPads>,
    pub substrate: Option<Material>,
    /// Stated numerical aperture of the objective; zero for normal incidence.
    pub numerical_aperture: f64,
    /// Media of the object, each with its name.
    pub media: Vec<(String, Material)>,
    pub spectra: Vec<Spectrum>,
    /// What was found in the spectra before any fit.
    pub remarks: Vec<String>,
}

/// Longest table of a spectrum (rows).
const MOST_ROWS: usize = 100_000;

impl SpectrumSet {
    /// Read a set from its `measurement.toml`.
    ///
    /// # Errors
    /// All mistakes of the text and of the files that it names, each at its line.
    pub fn read(path: &Path) -> metalith_core::Result<Self> {
        let text = load(path)?;
        Document::read(path, &text, |root| sections(path, root))
    }

    /// The keys of the `measurement.toml` of such a set.
    pub fn keys() -> KeyTable {
        explore(&[], |root, path| sections(path, root))
    }

    /// Root mean square by which repeats of one object differ from their mean; none without repeats.
    pub fn repeat_rms(&self) -> Option<f64> {
        let (mut squares, mut degrees) = (0.0, 0.0);
        for own in self.repeats() {
            for k in 0..self.wavelengths_nm.len() {
                let values = || own.iter().map(|&s| self.spectra[s].reflectance[k]);
                let mean = values().sum::<f64>() / own.len() as f64;
                squares += values().map(|v| (v - mean).powi(2)).sum::<f64>();
                degrees += own.len() as f64 - 1.0;
            }
        }
        (degrees > 0.0).then(|| (squares / degrees).sqrt())
    }

    /// Numbers of the spectra of each object in each medium.
    pub(crate) fn repeats(&self) -> Vec<Vec<usize>> {
        let mut out: Vec<Vec<usize>> = Vec::new();
        for (k, s) in self.spectra.iter().enumerate() {
            let same = |own: &&mut Vec<usize>| {
                let first = &self.spectra[own[0]];
                first.size_nm == s.size_nm && first.medium == s.medium
            };
            match out.iter_mut().find(same) {
                Some(own) => own.push(k),
                None => out.push(vec![k]),
            }
        }
        out
    }
}

fn sections(path: &Path, root: &Section<'_, '_>) -> SpectrumSet {
    root.integer("schema", 1..=1, "");
    root.choice("kind", &[("spectra", ())], None);
    let title = root.text("title");
    let folder = crate::run::folder_of(path, root);
    let range = root.section("range");
    let nm = || Limits::new(100.0..=20_000.0, "nm");
    let (from, to) = (range.float("from_nm", nm()), range.float("to_nm", nm()));
    let step = range.float("step_nm", Limits::new(0.05..=100.0, "nm"));
    let count = ((to - from) / step).floor();
    if !(8.0..=5000.0).contains(&count) {
        range.fault(
            "to_nm",
            "the range has less than 9 or more than 5001 steps",
            "check `from_nm`, `to_nm` and `step_nm`",
        );
    }
    range.finish();
    let wavelengths_nm: Vec<f64> = (0..=count.clamp(0.0, 5000.0) as usize)
        .map(|k| from + k as f64 * step)
        .collect();
    let stack = root.section("stack");
    let ambient_index = stack.float_or("ambient_index", Limits::new(1.0..=3.0, ""), 1.0);
    let measured = [("reflectance", false), ("transmission", true)];
    let is_transmission = stack.choice("measured", &measured, Some(false));
    let substrate = material(&stack, "substrate", &folder, &wavelengths_nm);
    let numerical_aperture = stack.float_or("numerical_aperture", Limits::new(0.0..=0.98, ""), 0.0);
    stack.finish();
    let (layers, pads) = layers(root, &folder, &wavelengths_nm);
    let largest = pads.as_ref().map_or(0.98, |_| LARGEST_APERTURE);
    if numerical_aperture > largest {
        let what = format!("the numerical aperture of pads of pillars is at most {largest}");
        root.fault("stack", what, "measure pads through an objective of a lower aperture");
    }
    let reference = root.section("reference");
    let of_mirror = unit(&reference);
    let mirror = table(&reference, "file", &folder.join(reference.text("file")), 0, of_mirror);
    reference.finish();
    let (media, spectra) = captures(root, (&folder, pads.as_ref()), &wavelengths_nm, &mirror);
    let mut set = SpectrumSet {
        path: path.to_owned(),
        title,
        wavelengths_nm,
        is_transmission,
        ambient_index,
        layers,
        pads,
        substrate,
        numerical_aperture,
        media,
        spectra,
        remarks: Vec::new(),
    };
    if let Some((what, hint)) = screening::wrong_as_a_whole(&set) {
        root.fault("captures", what, hint);
    }
    set.remarks = screening::leave_out_far_repeats(&mut set);
    set
}

/// A share of the range by which wavelengths may be scaled, which materials must cover too.
pub(super) const SCALED_BY: f64 = 0.01;

/// A material by name, file or constant index.
fn material(s: &Section<'_, '_>, key: &str, folder: &Path, wavelengths_nm: &[f64]) -> Option<Material> {
    let text = s.text(key);
    if text.is_empty() {
        return None;
    }
    let found = match text.parse::<f64>() {
        Ok(n) => Material::constant(n, 0.0),
        Err(_) => Material::resolve(&text, folder),
    };
    let hint = "name a material, a table (wavelength_nm,n,k), or an index in quotes";
    let found = found.map_err(|e| s.fault(key, e.to_string(), hint)).ok()?;
    let (low, high) = found.range_um();
    let ends = [wavelengths_nm.first()?, wavelengths_nm.last()?].map(|nm| nm * 1e-3);
    if ends[0] * (1.0 - SCALED_BY) < low || ends[1] * (1.0 + SCALED_BY) > high {
        let what = format!(
            "{found} is known from {low} to {high} um, {} to {} um are simulated",
            ends[0], ends[1]
        );
        s.fault(
            key,
            what,
            "shorten [range], with one per cent beyond its ends, or give a longer table",
        );
        return None;
    }
    Some(found)
}

/// Kind of a layer.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Film,
    Object,
    Pillars,
}

fn layers(root: &Section<'_, '_>, folder: &Path, wavelengths_nm: &[f64]) -> (Vec<StatedLayer>, Option<StatedPads>) {
    let (mut out, mut pads) = (Vec::new(), None);
    let kinds = [("yes", Kind::Object), ("no", Kind::Film), ("pillars", Kind::Pillars)];
    for s in root.sections("layer") {
        let name = s.text("name");
        let kind = s.choice("object", &kinds, Some(Kind::Film));
        if kind == Kind::Pillars {
            pads = Some(pillars(&s, out.len()));
        }
        out.push(StatedLayer {
            name,
            material: (kind != Kind::Object)
                .then(|| material(&s, "material", folder, wavelengths_nm))
                .flatten(),
            thickness_nm: (kind == Kind::Film).then(|| s.float("thickness_nm", Limits::new(0.0..=100_000.0, "nm"))),
        });
        s.finish();
    }
    if out.iter().filter(|l| l.thickness_nm.is_none()).count() != 1 {
        root.fault(
            "layer",
            "not one layer is the object",
            "give [[layer]] sections from the light inwards, one with `object = \"yes\"` or `object = \"pillars\"`",
        );
    }
    (out, pads)
}

fn pillars(s: &Section<'_, '_>, layer: usize) -> StatedPads {
    let pitch_nm = s.float("pitch_nm", Limits::new(50.0..=20_000.0, "nm"));
    let is_round = s.choice("shape", &[("square", false), ("circle", true)], Some(false));
    let is_hexagonal = s.choice("lattice", &[("square", false), ("hexagonal", true)], Some(false));
    if is_hexagonal && !is_round {
        s.fault(
            "lattice",
            "pillars of a hexagonal lattice are circles",
            "write shape = \"circle\"",
        );
    }
    let pads = StatedPads {
        layer,
        pitch_nm,
        lattice: if is_hexagonal {
            CellLattice::hexagonal(pitch_nm)
        } else {
            CellLattice::Square
        },
        is_round,
        height_nm: s.float("height_nm", Limits::new(10.0..=50_000.0, "nm")),
        residual_nm: s.float_or("residual_nm", Limits::new(0.0..=50_000.0, "nm"), 0.0),
        taper_deg: s.float_or("taper_deg", Limits::new(-10.0..=10.0, "degrees"), 0.0),
    };
    let [_, (low, high), _] = PadBank::ranges(&pads);
    if !(low..=high).contains(&pads.taper_deg) {
        s.fault(
            "taper_deg",
            format!("walls of this height lean by {low:.2} to {high:.2} degrees at most"),
            "state a taper in this range: pads are solved for no other",
        );
    }
    pads
}

fn captures(
    root: &Section<'_, '_>,
    (folder, pads): (&Path, Option<&StatedPads>),
    wavelengths_nm: &[f64],
    mirror: &[[f64; 2]],
) -> (Vec<(String, Material)>, Vec<Spectrum>) {
    let (mut media, mut spectra) = (Vec::new(), Vec::new());
    root.must_have("captures", "one or more sections [[captures]]");
    for s in root.sections("captures") {
        let text = s.text("files");
        let header = s.integer_or("header_lines", 0..=1000, "", 0) as usize;
        let name = s.text("medium_name");
        let medium = material(&s, "medium", folder, wavelengths_nm);
        let all_fitted = s.choice("fitted", &[("yes", true), ("no", false)], Some(true));
        let not_fitted = s.texts("not_fitted");
        let unit = unit(&s);
        s.finish();
        let (what, key, most) = match pads {
            None => ("height", "height_nm", 100_000.0),
            Some(pads) => ("width", "width_nm", pads.nearest_nm()),
        };
        let hint = format!("write the {what} in nm and the repeat in braces: captures/{{{key}}}_{{repeat}}.csv");
        let pattern = match NamePattern::parse(&text, folder) {
            Ok(pattern) if pattern.names().contains(&key) => pattern,
            Ok(_) => {
                s.fault("files", format!("the names of files have no {{{key}}}"), hint);
                continue;
            }
            Err(what) => {
                s.fault("files", what, hint);
                continue;
            }
        };
        let files = match pattern.files() {
            Ok(files) => files,
            Err(what) => {
                s.fault("files", what, "check the folder and the pattern");
                continue;
            }
        };
        let number = media.len();
        let Some(medium) = medium else { continue };
        media.push((name, medium));
        let mut known = BTreeSet::new();
        for (path, named) in files {
            let size = &named[key];
            known.insert(size.clone());
            let Some(size_nm) = size.parse::<f64>().ok().filter(|v| (0.0..=most).contains(v)) else {
                let what = format!("{}: `{size}` is no {what} from 0 to {most} nm", path.display());
                s.fault("files", what, &hint);
                continue;
            };
            let capture = table(&s, "files", &path, header, unit);
            let values: Option<Vec<f64>> = wavelengths_nm
                .iter()
                .map(|&nm| Some(at(&capture, nm)? * at(mirror, nm)?))
                .collect();
            let Some(reflectance) = values else {
                if !capture.is_empty() && !mirror.is_empty() {
                    let covers = |rows: &[[f64; 2]]| format!("{} to {} nm", rows[0][0], rows[rows.len() - 1][0]);
                    let what = format!(
                        "{} has {}, the reference has {}: [range] is not covered",
                        path.display(),
                        covers(&capture),
                        covers(mirror)
                    );
                    s.fault("files", what, "give wavelengths in nm, or shorten [range]");
                }
                continue;
            };
            spectra.push(Spectrum {
                name: path
                    .file_stem()
                    .map_or_else(String::new, |n| n.to_string_lossy().into()),
                size_nm,
                medium: number,
                reflectance,
                fitted: all_fitted && !not_fitted.contains(size),
            });
        }
        for size in not_fitted.iter().filter(|h| !known.contains(*h)) {
            s.fault(
                "not_fitted",
                format!("no file has the {what} `{}`", quoted(size)),
                format!("write each {what} as the names of files have it"),
            );
        }
    }
    if !spectra.is_empty() && spectra.iter().filter(|s| s.fitted).count() < 2 {
        root.fault(
            "captures",
            "fewer than two spectra are fitted",
            "leave fewer out of the fit",
        );
    }
    (media, spectra)
}

/// Largest value of a table (per cent).
const LARGEST: f64 = 1e6;

/// Largest share of the rows of a table that may lack a value: neighbours stand for them.
const MOST_MISSING: f64 = 0.1;

/// Values that are all below this are fractions, unless their unit is stated (per cent).
const FRACTIONS: f64 = 1.5;

/// Rows of a wavelength (nm), rising, and a fraction, after some header lines; a fault at the key if there are none. Values are per
/// cent, or fractions if `unit` says so.
fn table(s: &Section<'_, '_>, key: &str, path: &Path, header: usize, unit: Option<f64>) -> Vec<[f64; 2]> {
    let hint = "give rows of a wavelength (nm) and a per cent";
    let rows = load(path)
        .map_err(|e| e.to_string())
        .and_then(|text| rows(&text, header));
    let rows = rows.map_err(|what| format!("{}: {what}", path.display())).and_then(|rows| {
        let largest = rows.iter().map(|row| row[1].abs()).fold(0.0, f64::max);
        if unit.is_none() && largest <= FRACTIONS {
            return Err(format!(
                "{}: no value is above {FRACTIONS} per cent; if these are fractions, state `unit = \"fraction\"`, else `unit = \"percent\"`",
                path.display()
            ));
        }
        Ok(rows)
    });
    match rows {
        Ok(rows) => rows
            .into_iter()
            .map(|[nm, value]| [nm, value * unit.unwrap_or(0.01)])
            .collect(),
        Err(what) => {
            s.fault(key, what, hint);
            Vec::new()
        }
    }
}

/// The unit of the values of a section: its fraction of one; none if it is not stated.
fn unit(s: &Section<'_, '_>) -> Option<f64> {
    s.choice("unit", &[("percent", Some(0.01)), ("fraction", Some(1.0))], Some(None))
}

/// Rows of a text in the order of wavelengths, without those that lack a value; in words what is wrong.
fn rows(text: &str, header: usize) -> Result<Vec<[f64; 2]>, String> {
    let mut out: Vec<[f64; 2]> = Vec::new();
    let mut missing = 0;
    let mut falls = false;
    for (k, line) in without_mark(text).lines().enumerate().skip(header) {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let wrong = |why: &str| format!("line {}: `{}`: {why}", k + 1, quoted(line));
        let Some([nm, value]) = numbers(line).and_then(|row| <[f64; 2]>::try_from(row).ok()) else {
            return Err(wrong(
                "it is not two numbers; `header_lines` counts the lines before the first row",
            ));
        };
        if !nm.is_finite() || value.abs() > LARGEST {
            return Err(wrong("one of its numbers is too large"));
        }
        if value.is_nan() {
            missing += 1;
            continue;
        }
        if let Some(last) = out.last() {
            falls = if out.len() == 1 { nm < last[0] } else { falls };
            if nm == last[0] || (nm < last[0]) != falls {
                return Err(wrong("wavelengths must rise, or fall, from row to row"));
            }
        }
        out.push([nm, value]);
        if out.len() > MOST_ROWS {
            return Err(wrong("the table is too long"));
        }
    }
    if falls {
        out.reverse();
    }
    if out.len() < 2 {
        return Err("it has less than two rows".into());
    }
    if f64::from(missing) > MOST_MISSING * out.len() as f64 {
        return Err(format!("{missing} rows have no value"));
    }
    Ok(out)
}

/// Linear interpolation; none beyond the rows.
fn at(rows: &[[f64; 2]], nm: f64) -> Option<f64> {
    let after = rows.partition_point(|r| r[0] < nm);
    let high = rows.get(after)?;
    if high[0] == nm {
        return Some(high[1]);
    }
    let low = rows.get(after.checked_sub(1)?)?;
    let part = (nm - low[0]) / (high[0] - low[0]);
    Some(low[1] + part * (high[1] - low[1]))
}
