//! A set of kind `psf_stack`: stacks of point spread functions of known objects.

use std::path::{Path, PathBuf};

use metalith_core::Result;
use metalith_core::document::{Document, KeyTable, Limits, Section, explore, load};
use metalith_core::text::quoted;
use metalith_rcwa::Material;
use ndarray::Array2;

use super::bench::{self, StackBench};
use super::files;
use super::frames::{self, Frames};

/// A transmission: phase (rad) of each sample, before a factor for each wavelength, and amplitude.
#[derive(Clone, Debug)]
pub struct Transmission {
    pub phase: Array2<f32>,
    pub amplitude: Option<Array2<f32>>,
    /// Factor of the phase at each wavelength of the bench.
    pub factors: Vec<f64>,
    /// Edge of a sample (um).
    pub sample_um: f64,
    /// True if a factor of the whole phase means a depth: of a relief or a phase, not of complex values.
    pub has_depth: bool,
}

/// A measured plane.
#[derive(Clone, Debug)]
pub struct StackPlane {
    /// Object and position, for people.
    pub name: String,
    /// Number of the object.
    pub object: usize,
    /// Place in the stack, from zero.
    pub number: usize,
    /// Position from the stated distance of the sensor (um), larger farther from the object.
    pub position_um: f64,
    pub frame: Array2<f32>,
    /// False for pixels that are not used.
    pub used: Array2<bool>,
    pub fitted: bool,
}

/// An object; without a transmission the open aperture.
#[derive(Clone, Debug)]
pub struct StackObject {
    pub name: String,
    pub transmission: Option<Transmission>,
}

/// A set of stacks.
#[derive(Clone, Debug)]
pub struct StackSet {
    pub path: PathBuf,
    pub title: String,
    pub bench: StackBench,
    pub objects: Vec<StackObject>,
    pub planes: Vec<StackPlane>,
    /// What was found in the frames before any fit.
    pub remarks: Vec<String>,
}

impl StackSet {
    /// Read a set from its `measurement.toml`.
    ///
    /// # Errors
    /// All mistakes of the text and of the files that it names, each at its line.
    pub fn read(path: &Path) -> Result<Self> {
        let text = load(path)?;
        Document::read(path, &text, |root| sections(path, root))
    }

    /// The keys of the `measurement.toml` of such a set.
    pub fn keys() -> KeyTable {
        explore(&[], |root, path| sections(path, root))
    }
}

fn sections(path: &Path, root: &Section<'_, '_>) -> StackSet {
    root.integer("schema", 1..=1, "");
    if root.is_one_of("kind", &["psf"]) || !root.has("kind") {
        root.must_have("kind", "`kind = \"psf_stack\"`");
        root.fault(
            "kind",
            "a set with [[object]] has the kind `psf_stack`",
            "write kind = \"psf_stack\"; `psf` is for pillars of a `layout`",
        );
        root.optional_text("kind");
    } else {
        root.choice("kind", &[("psf_stack", ())], None);
    }
    if root.optional_text("layout").is_some() {
        root.fault(
            "layout",
            "a set of kind `psf_stack` has no layout",
            "use kind = \"psf\" for pillars of a layout",
        );
    }
    let title = root.text("title");
    let folder = crate::run::folder_of(path, root);
    let bench = bench::read(root, &folder);
    let mut frames = Frames::read(root, &folder);
    let (mut objects, mut planes) = (Vec::new(), Vec::new());
    root.must_have("object", "one or more sections [[object]]");
    for s in root.sections("object") {
        let name = s.text("name");
        let number = objects.len();
        if objects.iter().any(|o: &StackObject| o.name == name) {
            s.fault(
                "name",
                format!("two objects are called `{}`", quoted(&name)),
                "give each its own name",
            );
        }
        let transmission = transmission(&s, &folder, &bench.wavelengths);
        let fitted = s.choice("fitted", &[("yes", true), ("no", false)], Some(true));
        planes.extend(frames.stack(&s, &name, number, fitted));
        s.finish();
        objects.push(StackObject { name, transmission });
    }
    frames.check(root, &planes, objects.len());
    let mut set = StackSet {
        path: path.to_owned(),
        title,
        bench,
        objects,
        planes,
        remarks: Vec::new(),
    };
    set.remarks = frames::mask_defects(&mut set.planes, frames.saturation_dn);
    set
}

/// The transmission of an object; none of the open aperture.
fn transmission(s: &Section<'_, '_>, folder: &Path, wavelengths: &[[f64; 2]]) -> Option<Transmission> {
    let kinds = [("height", 0), ("phase", 1), ("complex", 2), ("none", 3)];
    let kind = s.choice("kind", &kinds, None);
    if kind == 3 {
        return None;
    }
    let sample_um = s.float("sample_um", Limits::new(0.01..=100.0, "um"));
    let file = folder.join(s.text("file"));
    let broken = |key: &str, file: &Path, what: String| {
        s.fault(key, format!("{}: {what}", file.display()), "check this file");
    };
    let middle: f64 = wavelengths.iter().map(|[um, weight]| um * weight).sum();
    let mut out = Transmission {
        phase: Array2::zeros((8, 8)),
        amplitude: None,
        factors: vec![1.0; wavelengths.len()],
        sample_um,
        has_depth: kind < 2,
    };
    if kind == 2 {
        match files::fields(&file) {
            Ok(fields) => {
                out.phase = fields.mapv(|v| v.arg() as f32);
                out.amplitude = Some(fields.mapv(|v| v.norm() as f32));
            }
            Err(what) => broken("file", &file, what),
        }
        return Some(out);
    }
    let scale = if kind == 0 {
        s.float_or("nm_per_level", Limits::new(-1e9..=1e9, "nm"), 1.0)
    } else {
        s.float_or("rad_per_level", Limits::new(-1e6..=1e6, "rad"), 1.0)
    };
    match files::map(&file) {
        Ok(map) => out.phase = map.mapv(|v| v * scale as f32),
        Err(what) => broken("file", &file, what),
    }
    if let Some(amplitude) = s.optional_text("amplitude") {
        let path = folder.join(amplitude);
        match files::map(&path) {
            Ok(map) if map.dim() == out.phase.dim() => out.amplitude = Some(map),
            Ok(map) => {
                let [a, p] = [map.dim(), out.phase.dim()];
                broken(
                    "amplitude",
                    &path,
                    format!("{} x {} samples, the phase has {} x {}", a.0, a.1, p.0, p.1),
                );
            }
            Err(what) => broken("amplitude", &path, what),
        }
    }
    let difference = if kind == 0 {
        index_difference(s, folder, wavelengths)
    } else {
        Vec::new()
    };
    out.factors = { wavelengths.iter().enumerate() }
        .map(|(w, [um, _])| {
            let of_height = difference.get(w).map(|n| std::f64::consts::TAU * n / (um * 1e3));
            // A phase is stated at the mean wavelength; its path is equal at all.
            of_height.unwrap_or(middle / um)
        })
        .collect();
    Some(out)
}

/// Index of the relief less the index of the medium, at each wavelength.
fn index_difference(s: &Section<'_, '_>, folder: &Path, wavelengths: &[[f64; 2]]) -> Vec<f64> {
    if !s.has("material") {
        let n = s.float("index_difference", Limits::new(-5.0..=5.0, ""));
        return vec![n; wavelengths.len()];
    }
    let index = |key: &str| -> Vec<f64> {
        let text = s.optional_text(key).unwrap_or_else(|| "1.0".into());
        let found = match text.parse::<f64>() {
            Ok(n) => Material::constant(n, 0.0),
            Err(_) => Material::resolve(&text, folder),
        };
        let all = |m: Material| {
            wavelengths
                .iter()
                .map(|w| Ok(m.index(w[0])?.re))
                .collect::<metalith_rcwa::Result<_>>()
        };
        found.and_then(all).unwrap_or_else(|e| {
            s.fault(
                key,
                e.to_string(),
                "name a material, a table (wavelength_nm,n,k), or an index in quotes",
            );
            vec![1.0; wavelengths.len()]
        })
    };
    index("material")
        .iter()
        .zip(index("medium"))
        .map(|(a, b)| a - b)
        .collect()
}
