//! The designs of a study: its design file with the values of each point of the grid.

use metalith_core::document::{NoPlace, Scalar, Section, load, with_values};
use metalith_core::{Error, Progress, Result};
use metalith_design::Design;

use crate::study_file::Tolerance;

/// Designs of a study at the most: each is a layout and, mostly, separate tables of cells.
const MOST_DESIGNS: u64 = 1000;

/// Sections and keys of a design that do not vary in a study, with the reason.
const FIXED: [(&str, &str); 5] = [
    ("schema", "it is the version of the format"),
    ("name", "it names files, and is no part of a chip"),
    ("title", "it is for people, and is no part of a chip"),
    (
        "verify",
        "all draws of a study are judged alike; limits stand in [[limit]]",
    ),
    (
        "optimise",
        "a study does not search for a phase; name its files with the key of the phase",
    ),
];

/// A number, choice or switch of the design file at each of some values.
#[derive(Clone, Debug, PartialEq)]
pub struct DesignGrid {
    /// Path of the key from the top of the design file, such as `cell.pillar_height_nm`.
    pub key: String,
    pub values: Vec<Scalar>,
}

impl DesignGrid {
    /// One value as an amount: itself if it is a number, else its place among the values.
    pub(crate) fn amount(&self, place: usize) -> f64 {
        self.values[place].number().unwrap_or(place as f64)
    }
}

impl Tolerance {
    /// Designs that the study is of: one, or every combination of the values of design keys, the first key fastest.
    pub fn designs(&self) -> u64 {
        count(&self.design_grids)
    }

    /// The values of design keys of one of them, by number.
    pub fn setting(&self, design: u64) -> Vec<(&str, &Scalar)> {
        setting(&self.design_grids, design)
    }

    /// Design by its number, with progress of a mapping that is solved from the cell.
    ///
    /// # Errors
    /// As [`Design::read`].
    pub fn design(&self, number: u64, progress: &dyn Progress) -> Result<Design> {
        if self.design_grids.is_empty() {
            return Design::read_with(&self.design, progress);
        }
        let text = with_values(&load(&self.design)?, &self.setting(number))
            .map_err(|NoPlace { what, hint, .. }| Error::refused("study/key-not-in-design", what, hint))?;
        Design::parse_with(&self.design, &text, progress)
    }
}

/// Combinations of the values of these keys.
pub(crate) fn count(grids: &[DesignGrid]) -> u64 {
    let sizes = grids.iter().map(|g| g.values.len() as u64);
    sizes.fold(1, u64::saturating_mul)
}

fn setting(grids: &[DesignGrid], mut number: u64) -> Vec<(&str, &Scalar)> {
    let one = |grid: &'_ DesignGrid| {
        let size = grid.values.len() as u64;
        let place = (number % size) as usize;
        number /= size;
        place
    };
    let places: Vec<usize> = grids.iter().map(one).collect();
    let each = grids.iter().zip(places);
    each.map(|(g, k)| (g.key.as_str(), &g.values[k])).collect()
}

/// A `[[grid]]` over a key of the design.
pub(crate) fn design_grid(s: &Section<'_, '_>) -> DesignGrid {
    let key = s.text("key");
    let top = key.split('.').next().unwrap_or_default();
    if let Some((_, why)) = FIXED.iter().find(|(fixed, _)| *fixed == top) {
        s.fault(
            "key",
            format!("`{key}` does not vary: {why}"),
            "name a key of another section",
        );
    }
    let values = s.scalars("values");
    if values.is_empty() {
        s.fault(
            "values",
            "a grid without values",
            "give those of the design, such as `values = [650, 700, 750]`",
        );
    }
    DesignGrid { key, values }
}

/// Checks that all designs can be read; the error names the place of the values that make one that cannot. `sections`:
/// where each of the grids stands.
pub(crate) fn check(
    design: &std::path::Path,
    root: &Section<'_, '_>,
    sections: &[Section<'_, '_>],
    grids: &[DesignGrid],
) {
    // The reader of the file reports its other mistakes.
    let (Ok(text), true) = (load(design), root.sound(&["design"])) else {
        return;
    };
    if grids.iter().any(|g| g.values.is_empty()) || Design::parse_without_library(design, &text).is_err() {
        return;
    }
    let designs = count(grids);
    if designs > MOST_DESIGNS {
        sections[0].fault(
            "values",
            format!("{designs} designs: each combination of these values is one"),
            format!("give fewer values; a study is of {MOST_DESIGNS} designs at the most"),
        );
        return;
    }
    let mut faulty = false;
    for (section, grid) in sections.iter().zip(grids) {
        for value in &grid.values {
            let fault = match with_values(&text, &[(&grid.key, value)]) {
                Err(NoPlace { what, hint, .. }) => Some(("key", what, hint)),
                Ok(text) => told(Design::parse_without_library(design, &text)).map(|(what, hint)| {
                    let key = &grid.key;
                    (
                        "values",
                        format!("with `{key} = {value}` the design has a mistake: {what}"),
                        hint,
                    )
                }),
            };
            if let Some((at, what, hint)) = fault {
                let file = design.file_name().unwrap_or_default().to_string_lossy();
                let place = if at == "key" {
                    format!("in {file}, ")
                } else {
                    String::new()
                };
                section.fault(at, format!("{place}{what}"), hint);
                faulty = true;
                break;
            }
        }
    }
    if faulty || grids.len() < 2 {
        return;
    }
    for number in 0..designs {
        let setting = setting(grids, number);
        let fault = match with_values(&text, &setting) {
            Err(NoPlace { change, what, hint, .. }) => Some((change, what, hint)),
            Ok(text) => told(Design::parse_without_library(design, &text)).map(|(what, hint)| {
                let words: Vec<String> = setting.iter().map(|(k, v)| format!("`{k} = {v}`")).collect();
                (
                    grids.len() - 1,
                    format!("with {} the design has a mistake: {what}", words.join(" and ")),
                    hint,
                )
            }),
        };
        if let Some((grid, what, hint)) = fault {
            sections[grid].fault("values", what, hint);
            return;
        }
    }
}

/// The first mistake of a design, and its remedy.
fn told(design: Result<Design>) -> Option<(String, String)> {
    match design.err()? {
        Error::Text(faults) => {
            let first = &faults.faults()[0];
            Some((first.what.clone(), first.hint.clone()))
        }
        Error::Invalid { what, hint, .. } | Error::Table { what, hint, .. } => Some((what, hint)),
        other => Some((other.to_string(), "give other values".into())),
    }
}
