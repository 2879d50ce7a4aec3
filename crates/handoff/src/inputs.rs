//! Inputs of a hand-off, each read once, with the bytes that were read.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::listing::Listing;
use super::options::HandoffOptions;
use super::process::{Process, ShapeRules};
use metalith_core::file::read_at_most;
use metalith_core::text::is_printable;
use metalith_core::{Error, Progress, Result, document};
use metalith_design::Design;
use metalith_drc::{Deck, Waivers};
use metalith_optics::CalibratedModel;
use metalith_rcwa::Material;
use metalith_sensor::Camera;
use metalith_verify::compensate::compensated_name;

/// Longest input that is kept; tables of the phase of a 10 mm lens have 1 MB.
const LONGEST: u64 = 256 << 20;

/// The inputs of a hand-off.
pub(super) struct Sources {
    pub design: Design,
    pub process: Process,
    /// The decks of the process, in its order.
    decks: Vec<(PathBuf, Deck)>,
    pub waivers: Option<Waivers>,
    /// Model that the layout is compensated for.
    pub model: Option<CalibratedModel>,
    /// Model whose biases are undone by dose classes.
    pub dose_model: Option<CalibratedModel>,
    kept: Vec<InputCopy>,
}

/// One input as it was read.
struct InputCopy {
    /// File name with a prefix for its kind; not yet unique.
    name: String,
    purpose: &'static str,
    bytes: Vec<u8>,
}

impl Sources {
    /// Read all inputs.
    ///
    /// # Errors
    /// Mistakes in one of them; a file that cannot be read, is no ordinary file, or changes while it is read.
    pub(crate) fn read(options: &HandoffOptions, progress: &dyn Progress) -> Result<Self> {
        let (design, mut kept) = read_design(&options.design, progress)?;
        let process = match &options.process {
            Some(path) => Process::read(path)?,
            None => Process::of_film(&design.cell.pillar_material, design.cell.pillar_height_nm),
        };
        // The process and its decks may be those of the program, which are no files.
        let (path, text) = process.source();
        kept.push(InputCopy::new("process_", path, "the process values", text.as_bytes()));
        let mut decks: Vec<(PathBuf, Deck)> = Vec::new();
        for rules in process.checks.decks(design.cell.shape) {
            if decks.iter().any(|(known, _)| known == rules) {
                continue;
            }
            let deck = process.deck(rules, design.cell.database_unit)?.for_pillars_of(&design);
            let (path, text) = deck.source();
            kept.push(InputCopy::new(
                "rules_",
                path,
                "rules that layouts were checked with",
                text.as_bytes(),
            ));
            decks.push((rules.to_owned(), deck));
        }
        let waivers = options.waivers.as_deref().map(Waivers::read).transpose()?;
        if let Some(waivers) = &waivers {
            let purpose = "violations that were accepted";
            kept.push(InputCopy::new(
                "waivers_",
                &waivers.path,
                purpose,
                waivers.text.as_bytes(),
            ));
        }
        let mut design = design;
        let model = match &options.compensate {
            None => None,
            Some(path) => {
                let text = document::load(path)?;
                let purpose = "the calibrated model that the layout is compensated for";
                kept.push(InputCopy::new("model_", path, purpose, text.as_bytes()));
                design.name = compensated_name(&design.name);
                Some(CalibratedModel::parse(path, &text)?)
            }
        };
        let dose_model = match &options.dose_classes {
            None => None,
            Some(path) => {
                let text = document::load(path)?;
                let purpose = "the calibrated model that dose classes are made by";
                kept.push(InputCopy::new("dose_model_", path, purpose, text.as_bytes()));
                Some(CalibratedModel::parse(path, &text)?)
            }
        };
        Ok(Self {
            design,
            process,
            decks,
            waivers,
            model,
            dose_model,
            kept,
        })
    }

    /// The decks of the first step for the pillars of the design.
    pub(crate) fn first_step(&self) -> &ShapeRules {
        let rules = self.process.checks.of_shape(self.design.cell.shape);
        rules.expect("a process that has none is refused before")
    }

    /// A deck that the process names.
    pub(crate) fn deck(&self, rules: &Path) -> &Deck {
        let found = self.decks.iter().find(|(path, _)| path == rules);
        &found.expect("all decks of the process are read").1
    }

    /// Write all inputs as they were read, each under a separate name.
    ///
    /// # Errors
    /// If one cannot be written.
    pub(crate) fn keep(&self, files: &mut Listing) -> Result<()> {
        let mut taken = BTreeSet::new();
        for input in &self.kept {
            let name = unique(&taken, &input.name);
            files.write(format!("inputs/{name}"), input.purpose, &input.bytes)?;
            taken.insert(name.to_lowercase());
        }
        Ok(())
    }
}

impl InputCopy {
    fn new(kind: &str, path: &Path, purpose: &'static str, bytes: &[u8]) -> Self {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let legal = |c: char| {
            if is_printable(c) && !r#"/\:*?"<>|"#.contains(c) {
                c
            } else {
                '_'
            }
        };
        Self {
            name: format!("{kind}{name}").chars().map(legal).collect(),
            purpose,
            bytes: bytes.to_owned(),
        }
    }
}

/// The name, with a number before its extension if it is taken. Upper and lower case count as equal, because some file
/// systems do not distinguish them.
fn unique(taken: &BTreeSet<String>, name: &str) -> String {
    let (stem, ending) = match name.rfind('.') {
        Some(dot) if dot > 0 => name.split_at(dot),
        _ => (name, ""),
    };
    std::iter::once(name.to_owned())
        .chain((2u32..).map(|k| format!("{stem}_{k}{ending}")))
        .find(|candidate| !taken.contains(&candidate.to_lowercase()))
        .expect("there are more numbers than names")
}

/// Read the design and the files it names. What is kept is what was read: the files are read before and after the
/// design is, and must not change in between.
fn read_design(path: &Path, progress: &dyn Progress) -> Result<(Design, Vec<InputCopy>)> {
    let named = files_of(path, &Design::read_with(path, progress)?)?;
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
    if let Some(table) = &design.mapping.table_file {
        files.push((table.clone(), "", "phase to width, the mapping of the design"));
    }
    if let Some(library) = &design.mapping.pillar_library_file {
        files.push((
            library.clone(),
            "",
            "phases of upright pillars, the library of the design",
        ));
    }
    let own = design.array.placed.iter().filter_map(|placed| placed.lens.as_ref());
    for lens in std::iter::once(&design.lens).chain(own) {
        files.extend(lens.phase_files().map(|(file, purpose)| (file.to_owned(), "", purpose)));
    }
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
