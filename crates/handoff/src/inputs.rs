//! Inputs of a hand-off of a design, each read once, with the bytes that were read.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::lab::{InputCopy, Lab};
use super::options::{DesignSource, HandoffOptions};
use super::process::Process;
use metalith_core::file::{InputFiles, read_at_most};
use metalith_core::{Error, Progress, Result};
use metalith_design::Design;
use metalith_optics::CalibratedModel;
use metalith_rcwa::Material;
use metalith_sensor::Camera;
use metalith_verify::compensate::compensated_name;

/// Longest input that is kept; tables of the phase of a 10 mm lens have 1 MB.
const LONGEST: u64 = 256 << 20;

/// The inputs of a hand-off of a design.
pub(super) struct Sources {
    pub design: Design,
    pub lab: Lab,
    /// Model that the layout is compensated for.
    pub model: Option<CalibratedModel>,
    /// Model whose biases are undone by dose classes.
    pub dose_model: Option<CalibratedModel>,
}

impl Sources {
    /// Read all inputs.
    ///
    /// # Errors
    /// Mistakes in one of them; a file that cannot be read, is no ordinary file, or changes while it is read.
    pub(crate) fn read(source: &DesignSource, options: &HandoffOptions, progress: &dyn Progress) -> Result<Self> {
        let (mut design, kept) = read_design(&source.path, &options.out, progress)?;
        let cell = &design.cell;
        let process = match &options.process {
            Some(path) => Process::read(path)?,
            None => Process::of_film(&cell.pillar_material, cell.pillar_height_nm),
        };
        let process = process.with_rules_for(cell.shape);
        let checks = process.checks.clone();
        let mut lab = Lab::read(
            process,
            (cell.shape, cell.database_unit),
            &checks.decks(cell.shape),
            |_, deck| deck.for_pillars_of(&design),
            options.waivers.as_deref(),
            kept,
        )?;
        let mut model =
            |path: &Option<PathBuf>, kind: &str, purpose: &'static str| -> Result<Option<CalibratedModel>> {
                let Some(path) = path else { return Ok(None) };
                let (model, text) = CalibratedModel::read_with_text(path)?;
                lab.keep_copy(InputCopy::new(kind, path, purpose, text.as_bytes()));
                Ok(Some(model))
            };
        let compensated = model(
            &source.compensate,
            "model_",
            "the calibrated model that the layout is compensated for",
        )?;
        if compensated.is_some() {
            design.name = compensated_name(&design.name);
        }
        let dose_model = model(
            &source.dose_classes,
            "dose_model_",
            "the calibrated model that dose classes are made by",
        )?;
        Ok(Self {
            design,
            lab,
            model: compensated,
            dose_model,
        })
    }
}

/// Read the design and the files it names. What is kept is what was read: the files are read before and after the
/// design is, and must not change in between.
fn read_design(path: &Path, out: &Path, progress: &dyn Progress) -> Result<(Design, Vec<InputCopy>)> {
    let named = files_of(path, &Design::read_with(path, progress)?)?;
    // The folder is replaced as a whole.
    InputFiles::of(named.iter().map(|(path, ..)| path.as_path())).check_outside(out)?;
    let before = bytes_of(&named)?;
    let design = Design::read_with(path, progress)?;
    let same_files = files_of(path, &design)? == named;
    for ((path, ..), bytes) in named.iter().zip(&before) {
        if !same_files || read_at_most(path, LONGEST, "an input of a hand-off")? != *bytes {
            return Err(Error::refused(
                "file/changed-meanwhile",
                format!("{} changed while it was read", path.display()),
                "try again when nothing writes to it",
            ));
        }
    }
    let kept = named.iter().zip(&before);
    let kept = kept.map(|((path, kind, purpose), bytes)| InputCopy::new(kind, path, purpose, bytes));
    Ok((design, kept.collect()))
}

/// Path, what its name begins with, purpose.
type Named = (PathBuf, &'static str, &'static str);

fn bytes_of(files: &[Named]) -> Result<Vec<Vec<u8>>> {
    files
        .iter()
        .map(|(path, ..)| read_at_most(path, LONGEST, "an input of a hand-off"))
        .collect()
}

/// The design file and the tables that it names: those that are read as tables, whatever else lies there.
fn files_of(path: &Path, design: &Design) -> Result<Vec<Named>> {
    let mut files: Vec<Named> = vec![(path.to_owned(), "design_", "the design")];
    let tables = design.tables().into_iter();
    files.extend(tables.map(|(file, purpose)| (file.to_owned(), "", purpose)));
    if let Some(camera) = &design.verify.camera {
        for file in Camera::read(camera)?.files {
            files.push((file, "camera_", "the camera that white light was simulated for"));
        }
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let cell = &design.cell;
    let others = cell
        .ambient_material
        .iter()
        .chain(cell.under.iter().map(|layer| &layer.material));
    for text in [&cell.pillar_material, &cell.substrate_material]
        .into_iter()
        .chain(others)
    {
        // Judging a hand-off and choosing its etch needs to know them, at any fidelity.
        Material::resolve(text, folder)?;
        if Material::named(text).is_err() {
            files.push((folder.join(text), "", "index of a material of the cell"));
        }
    }
    // A file that is named twice is kept once.
    let mut known = BTreeSet::new();
    files.retain(|(path, ..)| known.insert(path.clone()));
    Ok(files)
}
