//! `[mapping]`: from phase to width.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Serialize, Serializer};

use super::cell::read_band;
use super::lens::WAVELENGTH;
use super::{ArraySpec, CellSpec, LensSpec, MappingIdentity, SteeredMapping, SteeringSteps};
use metalith_cell::{
    Basis, CellStack, InversePolynomial, MappingTable, PhaseConvention, PillarLibrary, RotationMapping, SolvedMapping,
    UnitCellTable,
};
use metalith_core::document::{Limits, Section};
use metalith_core::file::check_unaltered;
use metalith_core::{Error, Progress, Result};
use metalith_pillars::PolarisationBasis;

pub(super) const COEFFICIENT: Limits = Limits::new(-100.0..=100.0, "(duty cycle over turns)");

/// State of the library of upright rectangles, or of the mapping that is solved from the cell, that a reader requires.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LibraryFile {
    Needed,
    /// Library or mapping that the caller makes; until then a design has no pillars.
    ToBeMade,
}

/// Mapping from phase to width.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MappingSpec {
    /// Wavelength lambda_0 that the mapping is made for (um).
    pub wavelength_um: f64,
    /// Duty cycle over phase.
    pub polynomial: InversePolynomial,
    /// File of a table that stands in its place: a mapping such as `metalith cells` writes, or unit cells of another program.
    #[serde(skip)]
    pub table_file: Option<PathBuf>,
    /// Convention of the phases of that file, where the design says it.
    #[serde(skip)]
    pub phase_convention: Option<PhaseConvention>,
    /// Contents of that file, or the mapping that was solved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub table: Option<MappingTable>,
    /// True if the mapping is solved from the cell of the design.
    #[serde(skip)]
    pub from_cells: bool,
    /// Mapping that was solved from the cell, or made from a table of unit cells; the layout depends on its table alone.
    #[serde(skip)]
    pub solved: Option<SolvedMapping>,
    /// File of the library of upright rectangles, such as `metalith cells` writes.
    #[serde(skip)]
    pub pillar_library_file: Option<PathBuf>,
    /// Contents of that file.
    #[serde(
        rename = "library",
        serialize_with = "library_itself",
        skip_serializing_if = "Option::is_none"
    )]
    pub pillar_library: Option<Arc<PillarLibrary>>,
    /// Reason why a library that is to be made anew was not read.
    #[serde(skip)]
    pub pillar_library_refused: Option<String>,
    /// Rotation of rotated rectangles other than half of the phase.
    #[serde(skip_serializing_if = "RotationMapping::is_half")]
    pub rotation: RotationMapping,
    /// Mappings of steered elements, where they have their own.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub steered: Vec<SteeredMapping>,
    /// Settings over which mappings are compared. Decides nothing of the layout.
    #[serde(skip)]
    pub comparison: MappingComparison,
    /// The cell that the mapping is for.
    #[serde(skip)]
    pub identity: MappingIdentity,
}

/// Wavelengths that a study compares mappings at, where the design says them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MappingComparison {
    /// Band that a mapping should send light to the first order in (um).
    pub band_um: Option<(f64, f64)>,
    /// Single wavelengths that are shown (um).
    pub wavelengths_um: Vec<f64>,
}

impl MappingComparison {
    fn read(s: &Section<'_, '_>) -> Self {
        Self {
            band_um: read_band(s),
            wavelengths_um: if s.has("compared_nm") {
                s.floats("compared_nm", WAVELENGTH).iter().map(|nm| nm * 1e-3).collect()
            } else {
                Vec::new()
            },
        }
    }
}

/// The cell that there is a published mapping of, in words.
const PUBLISHED_CELL: &str = "only square pillars of `sin_luke_2015`, 700 nm high, 350 nm apart, on fused silica in air have a published mapping";

impl MappingSpec {
    /// True if the mapping is solved from the cell: a section says so, or says none to whoever makes it.
    pub(crate) fn is_from_cells(s: &Section<'_, '_>, cell: &CellSpec, library: LibraryFile) -> bool {
        let says_none = !s.has("coefficients") && !s.has("table") && !cell.is_of_the_paper();
        match cell.shape.basis() {
            None => s.has("source") || (library == LibraryFile::ToBeMade && says_none),
            Some(PolarisationBasis::Linear) => s.has("source"),
            Some(PolarisationBasis::Circular) => false,
        }
    }

    /// The wavelength that the mapping is made for (um), which other sections go by.
    ///
    /// A mapping that is solved from the cell is one for the light that the lens focuses, if the section does not say another.
    pub(crate) fn read_wavelength(s: &Section<'_, '_>, cell: &CellSpec, lens: &LensSpec, from_cells: bool) -> f64 {
        if from_cells
            && !s.has("wavelength_nm")
            && let Some(um) = lens.focused_um()
        {
            return um;
        }
        if cell.is_known_to_be_another(s) {
            let expected = format!("the wavelength in nm that the mapping is made for; {PUBLISHED_CELL}");
            s.must_have("wavelength_nm", &expected);
        }
        s.optional_float("wavelength_nm", WAVELENGTH)
            .map_or(InversePolynomial::published().wavelength_um, |nm| nm * 1e-3)
    }

    /// The mapping, made for a wavelength (um).
    pub(crate) fn read(
        s: &Section<'_, '_>,
        wavelength_um: f64,
        cell: &CellSpec,
        array: &ArraySpec,
        library: LibraryFile,
        from_cells: bool,
    ) -> Self {
        let published = InversePolynomial::published();
        let rotated = cell.shape.basis() == Some(PolarisationBasis::Circular);
        let upright = cell.shape.basis() == Some(PolarisationBasis::Linear);
        if s.has("source") {
            s.choice("source", &[("cells", ())], None);
        }
        if !rotated && !upright && !from_cells && !s.has("table") && cell.is_known_to_be_another(s) {
            let [least, greatest] = [cell.width_range_nm.0, cell.width_range_nm.1].map(f64::from);
            let pitch = f64::from(cell.pitch_nm);
            let expected = format!(
                "those of this cell, or a `table`, as `metalith cells` finds them ({PUBLISHED_CELL}), or `source = \"cells\"` in their \
                 place: the mapping is then solved from [cell]; it can begin with `coefficients = [{:.5}, {:.5}]`, a straight line over \
                 the widths",
                least / pitch,
                (greatest - least) / pitch
            );
            s.must_have("coefficients", &expected);
        }
        let basis = s.choice(
            "basis",
            &[("all_powers", Basis::AllPowers), ("even_powers", Basis::EvenPowers)],
            Some(published.basis),
        );
        let coefficients = if s.has("coefficients") {
            s.floats("coefficients", COEFFICIENT)
        } else {
            published.coefficients
        };
        if coefficients.is_empty() {
            s.fault(
                "coefficients",
                "a mapping of no coefficients gives no width",
                if cell.is_of_the_paper() {
                    "list those of u^0, u^1, ..., or leave `coefficients` out for the published ones"
                } else {
                    "list those of u^0, u^1, ..."
                },
            );
        }
        let polynomial = InversePolynomial {
            wavelength_um,
            basis,
            coefficients,
        };
        let refuse_all = |why: &str, instead: &str| {
            for key in [
                "coefficients",
                "table",
                "basis",
                "steered",
                "source",
                "phase_convention",
            ]
            .into_iter()
            .filter(|key| s.has(key) && !(upright && *key == "source"))
            {
                s.fault(key, why, format!("leave `{key}` out{instead}"));
            }
        };
        if rotated {
            refuse_all(
                "rectangles have no widths to map to: the phase is twice their rotation",
                ", or use squares or circles; `rotation_sines_deg` and `rotation_cosines_deg` correct it",
            );
        }
        if upright {
            refuse_all(
                "upright rectangles have two widths, one for the phase of light along each axis",
                ": pillars are chosen from the `library`, or from one that `source = \"cells\"` solves",
            );
        } else if s.has("library") {
            s.fault_given(
                &["cell.shape"],
                "library",
                format!(
                    "a library of upright rectangles, and the pillars are {}",
                    cell.shape.plural()
                ),
                "leave `library` out, or use `shape = \"upright_rectangle\"`",
            );
        }
        let pillar_library_file = (upright && !from_cells).then(|| match library {
            LibraryFile::Needed => s.file_else(
                "library",
                "make it: `metalith cells DESIGN` writes `library.csv` into its folder; copy that to this name; or give `source = \"cells\"` in its place",
            ),
            LibraryFile::ToBeMade => s.path("library"),
        });
        let rotation = read_rotation(s, rotated);
        // A table is held to the widths of the cell when it is read.
        if !s.has("table") && !from_cells && !rotated && !upright {
            check_widths(s, cell, &polynomial);
        }
        let table_file = s.optional_file("table");
        if table_file.is_some() && s.has("coefficients") {
            s.fault(
                "table",
                "a mapping that is a table has no coefficients",
                "keep one of `table` and `coefficients`",
            );
        }
        let phase_convention = s
            .has("phase_convention")
            .then(|| s.choice("phase_convention", &PhaseConvention::CHOICES, None));
        if phase_convention.is_some() && table_file.is_none() && !rotated && !upright {
            s.fault(
                "phase_convention",
                "a convention of phases, and no table of them",
                "leave `phase_convention` out, or give a `table` of unit cells",
            );
        }
        if from_cells {
            refuse_beside_source(s, upright);
        }
        let steered = s.sections("steered");
        let steered: Vec<_> = steered
            .iter()
            .map(|s| SteeredMapping::read(s, cell, array, &polynomial))
            .collect();
        let twice = (1..steered.len()).find(|i| steered[..*i].iter().any(|m| m.steps == steered[*i].steps));
        if let Some(i) = twice {
            s.sections("steered")[i].fault(
                "steps",
                "these elements have a mapping already",
                "give one `[[mapping.steered]]` for each pair of steps",
            );
        }
        let comparison = MappingComparison::read(s);
        let identity = if from_cells {
            MappingIdentity::of_this_cell()
        } else {
            MappingIdentity::read(s, cell, &polynomial, library)
        };
        s.finish();
        Self {
            wavelength_um,
            identity,
            polynomial,
            table_file,
            phase_convention,
            table: None,
            from_cells,
            solved: None,
            pillar_library_file,
            pillar_library: None,
            pillar_library_refused: None,
            rotation,
            steered,
            comparison,
        }
    }

    /// The mapping of the elements that are so many steps from the middle of the array, if they have their own.
    pub fn steered(&self, steps: SteeringSteps) -> Option<&SteeredMapping> {
        self.steered.iter().find(|m| m.steps == steps)
    }

    /// Read the table or the library, if there is one. A library that is to be made may be of other sizes: it is left out.
    pub(crate) fn load(&mut self, cell: &CellSpec, library: LibraryFile) -> Result<()> {
        let own = cell.mapped(self.wavelength_um);
        let read = self
            .pillar_library_file
            .iter()
            .filter(|_| library == LibraryFile::Needed);
        let mut tables = self.table_file.iter().chain(read);
        tables.try_for_each(|file| check_unaltered(file))?;
        match self.table_file.as_ref().or(self.pillar_library_file.as_ref()) {
            // A library that is to be made is for this cell.
            Some(file) if library == LibraryFile::ToBeMade && !file.exists() => self.identity.is_stated = true,
            Some(file) => self.identity.load(file, &own, library)?,
            None => {}
        }
        if let Some(file) = &self.table_file {
            let allowed: Vec<u16> = cell.widths_nm().collect();
            let table = match UnitCellTable::read(file)? {
                None if self.phase_convention.is_some() => {
                    return Err(Error::refused(
                        "mapping/phase-convention",
                        format!("{}: a mapping, whose phases have no convention", file.display()),
                        "leave `phase_convention` of [mapping] out: it is for tables of unit cells",
                    ));
                }
                None => MappingTable::read_csv(file, &allowed)?,
                Some(cells) => {
                    let convention = self.phase_convention;
                    let (curve, cells) =
                        cells.curve(cell.pillar_height_nm, self.wavelength_um, &allowed, convention)?;
                    let made = SolvedMapping::of_table(&curve, cells)?;
                    let table = made.table.clone();
                    self.solved = Some(made);
                    table
                }
            };
            self.table = Some(table);
        }
        if let (Some(file), Some(pillars)) = (&self.pillar_library_file, cell.shape.upright()) {
            let read = PillarLibrary::read_csv(file, pillars);
            match (read, library) {
                (Ok(read), _) => self.pillar_library = Some(Arc::new(read)),
                (Err(error), LibraryFile::Needed) => return Err(error),
                (Err(error), LibraryFile::ToBeMade) if file.exists() => {
                    self.pillar_library_refused = Some(error.to_string());
                }
                (Err(_), LibraryFile::ToBeMade) => {}
            }
        }
        Ok(())
    }

    /// Solve the mapping from the cell, if that is its source.
    pub(crate) fn solve(
        &mut self,
        cell: &CellSpec,
        stack: &CellStack,
        cache: Option<&Path>,
        progress: &dyn Progress,
    ) -> Result<()> {
        if !self.from_cells {
            return Ok(());
        }
        if let Some(pillars) = cell.shape.upright() {
            let (library, _) = PillarLibrary::solve(stack, pillars, self.wavelength_um, cache, progress)?;
            self.pillar_library = Some(Arc::new(library));
        } else {
            let widths_nm: Vec<u16> = cell.widths_nm().collect();
            let solved = SolvedMapping::solve(stack, self.wavelength_um, &widths_nm, cache, progress)?;
            self.table = Some(solved.table.clone());
            self.solved = Some(solved);
        }
        Ok(())
    }
}

/// A library as it is, whoever shares it.
fn library_itself<S: Serializer>(library: &Option<Arc<PillarLibrary>>, to: S) -> std::result::Result<S::Ok, S::Error> {
    library.as_deref().serialize(to)
}

/// Largest coefficient of a correction of rotations (degrees): what a lattice adds is some degrees at most.
const ROTATION: Limits = Limits::new(-10.0..=10.0, "degrees");

/// Terms of such a correction at most.
const MOST_TERMS: usize = 6;

fn read_rotation(s: &Section<'_, '_>, rotated: bool) -> RotationMapping {
    let read = |key: &str| -> Vec<f64> {
        if !s.has(key) {
            return Vec::new();
        }
        if !rotated {
            s.fault(
                key,
                "a correction of rotations, and the pillars are no rotated rectangles",
                format!("leave `{key}` out, or use `shape = \"rectangle\"`"),
            );
        }
        let list = s.floats(key, ROTATION);
        if list.len() > MOST_TERMS {
            s.fault(
                key,
                format!("{} terms, at most {MOST_TERMS}", list.len()),
                "take the first of them: `metalith cells` says what they leave",
            );
        }
        list.into_iter().map(f64::to_radians).collect()
    };
    RotationMapping {
        sines: read("rotation_sines_deg"),
        cosines: read("rotation_cosines_deg"),
    }
}

/// A mapping must ask for widths that the cell allows.
pub(super) fn check_widths(s: &Section<'_, '_>, cell: &CellSpec, polynomial: &InversePolynomial) {
    if polynomial.coefficients.is_empty() {
        return;
    }
    let (low, high) = polynomial.range();
    let pitch = f64::from(cell.pitch_nm);
    let (narrow, wide) = cell.width_range_nm;
    if !cell.fits(polynomial) {
        s.fault_given(
            &[
                "cell.pitch_nm",
                "cell.width_min_nm",
                "cell.width_max_nm",
                "cell.width_step_nm",
                "mapping.basis",
            ],
            "coefficients",
            format!(
                "this mapping asks for widths from {:.1} to {:.1} nm",
                low * pitch,
                high * pitch
            ),
            format!(
                "the cell allows {narrow} to {wide} nm: change the coefficients or [cell] width_min_nm, width_max_nm"
            ),
        );
    }
}

/// Faults of keys that state a mapping beside `source = "cells"`.
fn refuse_beside_source(s: &Section<'_, '_>, upright: bool) {
    let others: &[&str] = if upright {
        &["library", "cell", "accept"]
    } else {
        &["coefficients", "basis", "table", "cell", "accept"]
    };
    for key in others.iter().copied().filter(|key| s.has(key)) {
        s.fault(
            key,
            "a mapping beside `source = \"cells\"`, by which it is solved from [cell]",
            format!("keep one of `source` and `{key}`"),
        );
    }
}
