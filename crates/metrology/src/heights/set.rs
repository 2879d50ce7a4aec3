//! A set of kind `heights`: drawn maps and measured maps on one grid.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use metalith_core::document::{Document, KeyTable, Limits, Section, explore, load};
use metalith_core::text::quoted;
use metalith_core::{Result, csv_rows};
use ndarray::Array2;

use super::far_field::FarField;
use super::{map, screening};
use crate::pattern::{NamePattern, Named};

/// Nuisances of each field.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FieldNuisances {
    /// A level of each line along x, as a scanning probe has it.
    pub lines: bool,
    /// Slopes along x and y.
    pub plane: bool,
    /// A displacement of the measured map along x and y.
    pub shift: bool,
}

/// A field: what was drawn and what was measured of it.
#[derive(Clone, Debug)]
pub struct HeightField {
    /// Name of the measured file without its ending.
    pub name: String,
    /// Drawn heights (nm).
    pub drawn: Array2<f32>,
    /// Measured heights (nm).
    pub measured: Array2<f32>,
    /// Number of its group.
    pub group: usize,
    /// True if it is fitted; if not, it judges.
    pub fitted: bool,
}

/// A set of height maps.
#[derive(Clone, Debug)]
pub struct HeightSet {
    pub path: PathBuf,
    pub title: String,
    /// Edge of a sample (um).
    pub sample_um: f64,
    /// Samples at the rim that are not used.
    pub rim: usize,
    pub nuisances: FieldNuisances,
    /// Common noun of a group, as the pattern has it.
    pub group_name: String,
    /// Names of the groups.
    pub groups: Vec<String>,
    pub fields: Vec<HeightField>,
    pub far_field: Option<FarField>,
    /// What was found in the maps before any fit.
    pub remarks: Vec<String>,
}

/// Most samples of all fields: a map of drawn heights takes 20 bytes for each.
const MOST_SAMPLES: usize = 100_000_000;

/// Largest height (nm): a square of it and sums of squares are numbers.
const HIGHEST_NM: f32 = 1e9;

impl HeightSet {
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

fn sections(path: &Path, root: &Section<'_, '_>) -> HeightSet {
    root.integer("schema", 1..=1, "");
    root.choice("kind", &[("heights", ())], None);
    let title = root.text("title");
    let folder = crate::run::folder_of(path, root);
    let grid = root.section("grid");
    let sample_um = grid.float("sample_um", Limits::new(1e-4..=1e3, "um"));
    let rim = grid.integer_or("rim", 0..=1000, "samples", 0) as usize;
    grid.finish();
    let nuisances = field_nuisances(root);
    let groups = root.section("groups");
    let group_name = groups.text("by");
    let not_fitted = groups.texts("not_fitted");
    let mut remarks = Vec::new();
    let (fields, names) = fields(root, &folder, &group_name, &not_fitted, rim, (&groups, &mut remarks));
    if root.sound(&["measured.files", "drawn.files"])
        && let Some((what, hint)) = screening::wrong_maps(&fields, rim, nuisances)
    {
        root.section("measured").fault("files", what, hint);
    }
    for name in &not_fitted {
        if !names.is_empty() && !names.contains(name) {
            let known = names.join(", ");
            groups.fault(
                "not_fitted",
                format!("no {group_name} is `{}`", quoted(name)),
                format!("groups here: {known}"),
            );
        }
    }
    groups.finish();
    let far_field = root.optional_section("far_field").map(|s| {
        let found = FarField {
            wavelength_nm: s.float("wavelength_nm", Limits::new(100.0..=100_000.0, "nm")),
            index_difference: s.float("index_difference", Limits::new(0.001..=5.0, "")),
            orders: s.integer("orders", 1..=1000, "") as usize,
        };
        let least = fields
            .first()
            .map_or(usize::MAX, |f| f.drawn.nrows().min(f.drawn.ncols()));
        if 2 * found.orders + 1 > least.saturating_sub(2 * rim) {
            s.fault(
                "orders",
                "the maps have fewer orders",
                "give at most half of the samples inside the rim",
            );
        }
        s.finish();
        found
    });
    HeightSet {
        path: path.to_owned(),
        title,
        sample_um,
        rim,
        nuisances,
        group_name,
        groups: names,
        fields,
        far_field,
        remarks,
    }
}

fn field_nuisances(root: &Section<'_, '_>) -> FieldNuisances {
    let Some(s) = root.optional_section("nuisances") else {
        return FieldNuisances::default();
    };
    let mut out = FieldNuisances::default();
    for word in s.texts("each_field") {
        match word.as_str() {
            "lines" => out.lines = true,
            "plane" => out.plane = true,
            "shift" => out.shift = true,
            other => s.fault(
                "each_field",
                format!("no nuisance is called `{}`", quoted(other)),
                "known here: lines, plane, shift",
            ),
        }
    }
    s.finish();
    out
}

/// Factor from the numbers of a file to nanometres.
enum Scale {
    Each(f64),
    /// By the field.
    Table(BTreeMap<String, f64>),
}

fn fields(
    root: &Section<'_, '_>,
    folder: &Path,
    group_name: &str,
    not_fitted: &[String],
    rim: usize,
    (groups, remarks): (&Section<'_, '_>, &mut Vec<String>),
) -> (Vec<HeightField>, Vec<String>) {
    let nm = Limits::new(1e-6..=1e6, "nm");
    let drawn = root.section("drawn");
    let drawn_files = pattern(&drawn, folder);
    let drawn_nm = drawn.float("nm_per_level", nm.clone());
    drawn.finish();
    let measured = root.section("measured");
    let measured_files = pattern(&measured, folder);
    let scale = if measured.has("full_scale") {
        let levels = measured.float("full_scale_level", Limits::new(1.0..=1e9, ""));
        Scale::Table(full_scale(&measured, folder, levels))
    } else {
        Scale::Each(measured.float("nm_per_level", nm))
    };
    measured.finish();
    let (Some(drawn_files), Some(measured_files)) = (drawn_files, measured_files) else {
        return (Vec::new(), Vec::new());
    };
    let wanted: Vec<&str> = measured_files.names();
    if let Some(other) = drawn_files.names().iter().find(|n| !wanted.contains(n)) {
        drawn.fault(
            "files",
            format!("{{{other}}} is no name of `files` in [measured]"),
            "use the names of both",
        );
        return (Vec::new(), Vec::new());
    }
    if !group_name.is_empty() && !wanted.contains(&group_name) {
        let known = wanted.join(", ");
        groups.fault(
            "by",
            format!("the names of files have no {{{group_name}}}"),
            format!("they have: {known}"),
        );
        return (Vec::new(), Vec::new());
    }
    let files = match measured_files.files() {
        Ok(files) => files,
        Err(what) => {
            measured.fault("files", what, "check the folder and the pattern");
            return (Vec::new(), Vec::new());
        }
    };
    let mut names: Vec<String> = files.iter().filter_map(|(_, n)| n.get(group_name).cloned()).collect();
    names.sort();
    names.dedup();
    let mut out: Vec<HeightField> = Vec::new();
    let mut samples = 0;
    let used: Vec<PathBuf> = files.iter().map(|(_, named)| drawn_files.path(named)).collect();
    let drawn_only = drawn_files
        .files()
        .unwrap_or_default()
        .into_iter()
        .map(|(path, _)| path);
    let drawn_only: Vec<String> = drawn_only
        .filter(|path| !used.contains(path))
        .map(|path| stem(&path))
        .collect();
    if !drawn_only.is_empty() {
        remarks.push(format!(
            "No measured map belongs to these drawn ones: {}",
            drawn_only.join(", ")
        ));
    }
    for (path, named) in files {
        match field(&path, &named, &drawn_files, drawn_nm, &scale, remarks) {
            Ok(mut field) => {
                let group = named.get(group_name).cloned().unwrap_or_default();
                field.group = names.iter().position(|n| *n == group).unwrap_or(0);
                field.fitted = !not_fitted.contains(&group);
                let (rows, cols) = field.drawn.dim();
                if let Some(first) = out.first().filter(|f| f.drawn.dim() != field.drawn.dim()) {
                    let (r, c) = first.drawn.dim();
                    let what = format!(
                        "{} has {rows} x {cols} samples, {} has {r} x {c}",
                        field.name, first.name
                    );
                    measured.fault("files", what, "all fields of a set have one size");
                    break;
                }
                if rows.min(cols) < 2 * rim + 16 {
                    let what = format!("a rim of {rim} leaves less than 16 of {rows} x {cols} samples");
                    measured.fault("files", what, "give a smaller `rim`");
                    break;
                }
                samples += field.drawn.len();
                if samples > MOST_SAMPLES {
                    let what = format!("the fields have more than {MOST_SAMPLES} samples together");
                    measured.fault("files", what, "give fewer fields to one set");
                    break;
                }
                out.push(field);
            }
            Err((is_drawn, what)) => {
                let s = if is_drawn { &drawn } else { &measured };
                s.fault("files", what, "check this file, or leave it out by the pattern");
            }
        }
    }
    if out.iter().filter(|f| f.fitted).count() < out.len().min(2) {
        groups.fault(
            "not_fitted",
            "fewer than two fields are fitted",
            "leave fewer groups out of the fit",
        );
    }
    (out, names)
}

fn field(
    path: &Path,
    named: &Named,
    drawn_files: &NamePattern,
    drawn_nm: f64,
    scale: &Scale,
    remarks: &mut Vec<String>,
) -> std::result::Result<HeightField, (bool, String)> {
    let name = stem(path);
    let drawn_path = drawn_files.path(named);
    let read = |path: &Path| map::read(path).map_err(|what| format!("{}: {what}", path.display()));
    let drawn = read(&drawn_path).map_err(|what| (true, what))?;
    let mut measured = read(path).map_err(|what| (false, what))?;
    if drawn.dim() != measured.dim() {
        let [d, m] = [drawn.dim(), measured.dim()];
        let what = format!(
            "{name} was drawn on {} x {} samples and measured on {} x {}: resample one of them on the grid of the other",
            d.0, d.1, m.0, m.1
        );
        return Err((false, what));
    }
    if screening::is_cut(&measured) {
        remarks.push(format!(
            "{name} has many samples of the largest number of its format: heights above it were cut"
        ));
    }
    let wrong = drawn.iter().filter(|v| !v.is_finite()).count();
    if wrong > 0 {
        let all = drawn.len();
        let what = format!(
            "{}: {wrong} of its {all} samples are not finite numbers",
            drawn_path.display()
        );
        return Err((true, what));
    }
    match screening::mend(&drawn, &mut measured) {
        Ok(0) => {}
        Ok(n) => remarks.push(format!(
            "{name} has {n} dead samples; the median of their neighbours stands for them"
        )),
        Err(what) => return Err((false, format!("{}: {what}", path.display()))),
    }
    let nm = match scale {
        Scale::Each(nm) => *nm,
        Scale::Table(table) => *table
            .get(&name)
            .ok_or((false, format!("`full_scale` has no row for {name}")))?,
    };
    let drawn = drawn.mapv(|v| v * drawn_nm as f32);
    let measured = measured.mapv(|v| v * nm as f32);
    for (is_drawn, heights) in [(true, &drawn), (false, &measured)] {
        if !heights.iter().all(|nm| nm.abs() <= HIGHEST_NM) {
            return Err((is_drawn, format!("{name} has heights beyond {HIGHEST_NM} nm")));
        }
    }
    Ok(HeightField {
        name,
        drawn,
        measured,
        group: 0,
        fitted: true,
    })
}

fn stem(path: &Path) -> String {
    path.file_stem()
        .map_or_else(String::new, |n| n.to_string_lossy().into())
}

fn pattern(s: &Section<'_, '_>, folder: &Path) -> Option<NamePattern> {
    let text = s.text("files");
    if text.is_empty() {
        return None;
    }
    NamePattern::parse(&text, folder)
        .map_err(|what| {
            s.fault(
                "files",
                what,
                "write names in braces in the last part: maps/F{plate}{field}.tif",
            );
        })
        .ok()
}

/// Nanometres of a level of each field, from a table `field,full_scale_nm`.
fn full_scale(s: &Section<'_, '_>, folder: &Path, levels: f64) -> BTreeMap<String, f64> {
    let path = folder.join(s.text("full_scale"));
    let hint = "give a CSV table with the header field,full_scale_nm";
    let text = match load(&path) {
        Ok(text) => text,
        Err(error) => {
            s.fault("full_scale", error.to_string(), hint);
            return BTreeMap::new();
        }
    };
    let refuse = |line: Option<usize>, what: String| {
        let line = line.map_or_else(String::new, |line| format!(", line {line}"));
        format!("{}{line}: {what}", path.display())
    };
    let rows = csv_rows(&text, "full_scale_nm,field", &refuse).and_then(|rows| {
        rows.map(|row| {
            let row = row?;
            let [nm] = row.numbers()?;
            if nm > 0.0 {
                Ok((row.field(1).to_owned(), nm / levels))
            } else {
                Err(row.refused(format!("a full scale of {nm} nm")))
            }
        })
        .collect()
    });
    rows.unwrap_or_else(|what: String| {
        s.fault("full_scale", what, hint);
        BTreeMap::new()
    })
}
