//! `[mapping.cell]`: the cell that a mapping is for.

use std::path::Path;

use super::cell::TALLEST_NM;
use super::lens::WAVELENGTH;
use super::{CellSpec, LibraryFile};
use metalith_cell::{InversePolynomial, MappedCell, MappedDifference, MappedValue};
use metalith_core::document::{Limits, Section};
use metalith_core::{Error, Result, Warning};
use metalith_pillars::LatticeKind;

/// The cell that the mapping of a design is for, compared with its `[cell]`. It decides nothing of the layout.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MappingIdentity {
    /// True if the mapping, its table or its library states the cell that it is for, or is published, or is of every cell.
    pub is_stated: bool,
    /// Reason why a mapping of another cell is taken.
    pub accept: Option<String>,
    /// Differences from the cell of the design that are taken.
    pub differences: Vec<MappedDifference>,
}

impl CellSpec {
    /// The cell as a mapping for this wavelength (um) states it.
    pub fn mapped(&self, wavelength_um: f64) -> MappedCell {
        let mut values: Vec<(&'static str, MappedValue)> = vec![
            ("shape", self.shape.design_name().into()),
            ("lattice", lattice_word(self.lattice).into()),
            ("pitch_nm", f64::from(self.pitch_nm).into()),
            ("pillar_height_nm", self.pillar_height_nm.into()),
            ("pillar_material", self.pillar_material.as_str().into()),
            ("substrate_material", self.substrate_material.as_str().into()),
            // As a person writes it.
            ("wavelength_nm", ((wavelength_um * 1e9).round() / 1e6).into()),
        ];
        if let Some(pillars) = self.shape.rotated() {
            values.push(("pillar_width_nm", f64::from(pillars.width_nm).into()));
            values.push(("pillar_length_nm", f64::from(pillars.length_nm).into()));
        }
        match &self.ambient_material {
            Some(material) => values.push(("ambient_material", material.as_str().into())),
            None if self.ambient_index != 1.0 => values.push(("ambient_index", self.ambient_index.into())),
            None => {}
        }
        // A film that the etch left is of the material of the pillars, and the last.
        let (mut spacers, residual) = match self.under.split_last() {
            Some((last, rest)) if last.material == self.pillar_material => (rest.iter(), Some(last)),
            _ => (self.under.iter(), None),
        };
        if let Some(spacer) = spacers.next() {
            values.push(("spacer_nm", spacer.height_nm.into()));
            values.push(("spacer_material", spacer.material.as_str().into()));
        }
        if let Some(film) = residual {
            values.push(("residual_nm", film.height_nm.into()));
        }
        MappedCell::new(values)
    }
}

fn lattice_word(lattice: LatticeKind) -> &'static str {
    let word = LatticeKind::CHOICES.into_iter().find(|(_, kind)| *kind == lattice);
    word.map_or("square", |(word, _)| word)
}

impl MappingIdentity {
    /// Cell that `[mapping]`, whose section is `s`, states; another cell than that of the design is a fault
    /// for who needs the mapping and does not accept it.
    pub(super) fn read(
        s: &Section<'_, '_>,
        cell: &CellSpec,
        polynomial: &InversePolynomial,
        need: LibraryFile,
    ) -> Self {
        let own = cell.mapped(polynomial.wavelength_um);
        let accept = s.optional_text("accept");
        let stated = s.optional_section("cell").map(|section| {
            let stated = read_cell(&section);
            (section, stated)
        });
        let is_refused = need == LibraryFile::Needed && accept.is_none();
        let mut differences = Vec::new();
        if let Some((section, stated)) = &stated {
            differences = stated.differences(&own);
            differences.retain(|difference| {
                let stated = format!("mapping.cell.{}", difference.key);
                // A spacer without a material is one mistake.
                section.sound(&["mapping.cell", &stated, &place(difference.key), "cell.spacer_nm"])
            });
            for difference in differences.iter().filter(|_| is_refused) {
                let key = if section.has(difference.key) {
                    difference.key
                } else {
                    "pitch_nm"
                };
                section.fault(key, difference.to_string(), MappedCell::REMEDY);
            }
        }
        let by_coefficients = !s.has("table") && cell.shape.basis().is_none();
        let published = InversePolynomial::published();
        let is_published = by_coefficients
            && polynomial.basis == published.basis
            && polynomial.coefficients == published.coefficients
            && (s.has("coefficients") || cell.is_of_the_paper())
            && s.sound(&["mapping.coefficients"])
            && stated.is_none();
        if is_published {
            differences = MappedCell::published().differences(&own);
            differences.retain(|difference| s.sound(&[&place(difference.key)]));
            if is_refused && !differences.is_empty() {
                let key = if s.has("coefficients") {
                    "coefficients"
                } else {
                    "wavelength_nm"
                };
                s.fault(
                    key,
                    format!("the published mapping is of another cell: {}", words(&differences)),
                    MappedCell::REMEDY,
                );
            }
        }
        let is_of_every_cell =
            cell.shape.rotated().is_some() && !s.has("rotation_sines_deg") && !s.has("rotation_cosines_deg");
        if accept.as_deref().is_some_and(|reason| reason.trim().is_empty()) {
            s.fault(
                "accept",
                "no reason to accept a mapping of another cell",
                "say why it is good enough",
            );
        }
        Self {
            is_stated: stated.is_some() || is_published || is_of_every_cell,
            accept,
            differences,
        }
    }

    /// Identity of a mapping that is solved from the cell of its design.
    pub(super) fn of_this_cell() -> Self {
        Self {
            is_stated: true,
            accept: None,
            differences: Vec::new(),
        }
    }

    /// Compare the head of a table or library with the cell of the design, which is `own`.
    ///
    /// # Errors
    /// If it states another cell, which is neither accepted nor to be made anew.
    pub(super) fn load(&mut self, file: &Path, own: &MappedCell, need: LibraryFile) -> Result<()> {
        let Some((stated, places)) = MappedCell::read_comments(file)? else {
            return Ok(());
        };
        self.is_stated = true;
        let differences = stated.differences(own);
        if let Some(first) = differences.first()
            && self.accept.is_none()
            && need == LibraryFile::Needed
        {
            let line = places.get(first.key).or(places.values().next());
            return Err(Error::refused(
                "mapping/cell-differs",
                format!(
                    "{}, line {}: {}",
                    file.display(),
                    line.copied().unwrap_or(1),
                    words(&differences)
                ),
                MappedCell::REMEDY,
            ));
        }
        self.differences.extend(differences);
        Ok(())
    }

    /// Warnings about the cell that the mapping is for.
    pub(crate) fn warnings(&self, own: &MappedCell) -> impl Iterator<Item = Warning> {
        let differences = words(&self.differences);
        let unknown = (!self.is_stated && self.accept.is_none()).then(|| {
            let cell = own.to_toml().replacen('\n', " ", 1).replace('\n', "; ");
            Warning::new(
                "mapping/cell-not-stated",
                "the mapping does not state the cell that it is for, so it cannot be compared with [cell]",
                format!("make it again with `metalith cells`. If it is for this cell, state it: {cell}"),
            )
        });
        let other = (!self.differences.is_empty()).then(|| match &self.accept {
            Some(reason) => Warning::new(
                "mapping/difference-accepted",
                format!("{differences}; accepted: {reason}"),
                "`metalith cells` finds a mapping for this cell",
            ),
            None => Warning::new("mapping/cell-differs", differences, MappedCell::REMEDY),
        });
        unknown.into_iter().chain(other)
    }
}

fn words(differences: &[MappedDifference]) -> String {
    let each: Vec<_> = differences.iter().map(MappedDifference::to_string).collect();
    each.join("; ")
}

/// Path of the key of a design that a key of a mapped cell is compared with.
fn place(key: &str) -> String {
    let section = if key == "wavelength_nm" { "mapping" } else { "cell" };
    format!("{section}.{key}")
}

/// The keys of the section.
fn read_cell(s: &Section<'_, '_>) -> MappedCell {
    const LENGTH: Limits = Limits::new(0.0..=TALLEST_NM, "nm");
    let mut values: Vec<(&'static str, MappedValue)> = Vec::new();
    for key in MappedCell::KEYS {
        let name = key.name;
        let number = |limits| s.optional_float(name, limits).map(MappedValue::Number);
        let value = match name {
            "wavelength_nm" => number(WAVELENGTH),
            "ambient_index" => number(Limits::new(1.0..=3.0, "")),
            _ if name.ends_with("_nm") => number(LENGTH),
            _ => s.optional_text(name).map(MappedValue::Text),
        };
        values.extend(value.map(|value| (name, value)));
    }
    let cell = MappedCell::new(values);
    for name in cell.missing() {
        s.must_have(
            name,
            "that of the cell that the mapping is for, as `metalith cells` prints it",
        );
    }
    s.finish();
    cell
}
