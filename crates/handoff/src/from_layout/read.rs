//! Inputs of a hand-off of a layout: the layout with its pillars, and the lab.

use std::fs::File;
use std::io::{BufReader, Read, Write};
use std::path::{Path, PathBuf};

use flate2::read::MultiGzDecoder;
use sha2::{Digest, Sha256};

use crate::lab::{Lab, legal_name};
use crate::layout_statistics::LayoutStatistics;
use crate::options::{HandoffOptions, LayoutSource};
use crate::preconditions::{has_rules, layer_is_free, makes_pillars};
use crate::process::Process;
use metalith_core::file::InputFiles;
use metalith_core::text::hex;
use metalith_core::{AtomicFile, Error, LayerNumber, Progress, Result};
use metalith_drc::{Deck, LayoutLayers};
use metalith_gds::extract::{Extraction, ExtractionPlan, LeftOut, extract};
use metalith_gds::{FileFormat, Layout, ReadLimits};
use metalith_pillars::{DatabaseUnit, PillarShape};
use metalith_report::{count, counted};

/// Layers of marks and labels in the dose matrix, as the shipped decks have them.
pub(super) const DOSE_MARKS: LayerNumber = LayerNumber { layer: 3, datatype: 0 };
pub(super) const DOSE_LABEL: LayerNumber = LayerNumber { layer: 11, datatype: 0 };

/// Checks about what a design holds: cell, marks and layers.
const OF_A_DESIGN: [&str; 5] = [
    "width_library",
    "on_lattice",
    "marks_complete",
    "layers_known",
    "active_area",
];
/// Checks about marks, for a layout whose marks are not named.
const OF_MARKS: &str = "mark_keep_out";
/// Checks about pillars and lenses, which a layout without pillars cannot keep.
const OF_PILLARS: [&str; 14] = [
    "square",
    "circle",
    "rectangle",
    "manhattan",
    "acute_angle",
    "width_min",
    "width_max",
    "aspect_max",
    "gap_aspect_max",
    "exposure_grid",
    "fill",
    "fill_gradient",
    "field_cut",
    "field_in_lens",
];

const BLOCK: usize = 1 << 20;

/// The inputs of a hand-off of a layout.
pub(crate) struct LayoutInputs {
    /// Name of the hand-off, from the name of the file.
    pub name: String,
    /// SHA-256 of the layout, unpacked.
    pub digest: String,
    path: PathBuf,
    /// The layout below the cell that is exposed.
    pub layout: Layout,
    pub statistics: LayoutStatistics,
    /// Exposed layers, the pillars first.
    pub exposed: Vec<LayerNumber>,
    pub pattern: Pattern,
    /// Shapes of elements that are no pillars, if there are any.
    pub left_out: Option<LeftOut>,
    /// Checks of the decks that are not in force.
    pub waiting: Vec<&'static str>,
    pub lab: Lab,
}

/// Content of the layer of the pillars.
pub(crate) enum Pattern {
    Pillars(Box<Extraction>),
    /// Shapes that are no pillars, with the reason in words.
    Shapes {
        why: String,
    },
}

impl Pattern {
    /// Shape of the pillars, if there are some.
    pub(super) fn shape(&self) -> Option<PillarShape> {
        match self {
            Self::Pillars(found) => Some(found.shape),
            Self::Shapes { .. } => None,
        }
    }

    /// What is on a layer, and the shapes of its elements that are no pillars.
    fn read(layout: &Layout, layer: LayerNumber, progress: &dyn Progress) -> Result<(Self, Option<LeftOut>)> {
        let found = match extract(layout, &ExtractionPlan::discover(layer), progress) {
            Ok(found) => found,
            Err(metalith_gds::Error::Extraction { cause, .. }) => {
                let why = format!("{cause} ({})", cause.id());
                return Ok((Self::Shapes { why }, None));
            }
            Err(error) => return Err(error.into()),
        };
        let left_out = LeftOut::of(&found, layer);
        let (pillars, shapes) = (count(found.pillars), found.shape.plural());
        let pattern = if found.shape == PillarShape::Mixed {
            // No deck has rules for both.
            Self::Shapes {
                why: format!("the {pillars} pillars on layer {layer} are {shapes}, and rules are for one of them"),
            }
        } else if found.pillars >= found.oddities.total().max(1) {
            Self::Pillars(Box::new(found))
        } else {
            // Pads and pitch from a few of the shapes would be of something else.
            let all = count(found.pillars + found.oddities.total());
            Self::Shapes {
                why: format!("only {pillars} of {all} shapes on layer {layer} are {shapes} on a lattice"),
            }
        };
        Ok((pattern, left_out))
    }
}

impl LayoutInputs {
    /// Read all inputs.
    ///
    /// # Errors
    /// A layout that cannot be read or has nothing to expose; mistakes in the process file or its decks.
    pub(crate) fn read(source: &LayoutSource, options: &HandoffOptions, progress: &dyn Progress) -> Result<Self> {
        let Some(process) = &options.process else {
            return Err(Error::refused(
                "handoff/process-missing",
                "a layout does not say what film it is for, so that no process can be chosen for it",
                format!(
                    "name one with --process, such as a copy of {}",
                    Process::shipped_names().join(", ")
                ),
            ));
        };
        let process = Process::read(process)?;
        makes_pillars(&process)?;
        let path = source.path.clone();
        // The folder is replaced as a whole.
        InputFiles::of([path.as_path()]).check_outside(&options.out)?;
        let digest = copy_unpacked(&path, &mut std::io::sink(), progress)?;
        let layout = Layout::open_with(&path, ReadLimits::default(), progress)?;
        let layout = match &source.top {
            Some(top) => layout.below(top)?,
            None => layout,
        };
        if layout.is_drawing() {
            return Err(Error::refused(
                "handoff/drawing",
                format!("{} is a drawing in DXF, which writers do not take", path.display()),
                "bring it into GDSII first: metalith convert DRAWING.dxf LAYOUT.gds",
            ));
        }
        let statistics = LayoutStatistics::of(&layout, progress)?;
        let exposed = exposed_layers(source, &layout, &statistics, progress)?;
        say_never_exposed(&statistics, &exposed, progress);
        let (pattern, left_out) = Pattern::read(&layout, exposed[0], progress)?;
        let named = [(DOSE_MARKS, "numbers"), (DOSE_LABEL, "labels")];
        let taken = named.map(|(number, what)| (number.layer as i16, format!("that of its {what}")));
        layer_is_free(taken, &process)?;
        let shape = match pattern.shape() {
            Some(shape) => shape,
            None => process.checks.some_shape(),
        };
        let process = process.with_rules_for(shape);
        has_rules(shape, &process)?;
        let unit = DatabaseUnit::of_nm(layout.unit_nm()).unwrap_or_default();
        let layers = LayoutLayers {
            pillars: exposed[0],
            marks: exposed.get(1).copied(),
        };
        let mut waiting = OF_A_DESIGN.to_vec();
        waiting.extend(layers.marks.is_none().then_some(OF_MARKS));
        if let Pattern::Shapes { .. } = pattern {
            waiting.extend(OF_PILLARS);
        }
        let first = process.checks.of_shape(shape).expect("it was checked").clone();
        let adapted =
            |rules: &Path, deck: Deck| deck.without_design(&waiting, (rules == first.pillar_rules).then_some(layers));
        let lab = Lab::read(
            process,
            (shape, unit),
            &[&first.pillar_rules, &first.dose_rules],
            adapted,
            options.waivers.as_deref(),
            Vec::new(),
        )?;
        Ok(Self {
            name: handoff_name(&path),
            digest,
            path,
            layout,
            statistics,
            exposed,
            pattern,
            left_out,
            waiting,
            lab,
        })
    }

    /// Name of the file that is handed over.
    pub(super) fn file_name(&self) -> String {
        let ending = match self.layout.format() {
            FileFormat::Gds => "gds",
            FileFormat::Oasis => "oas",
        };
        format!("{}.{ending}", self.name)
    }

    /// Copy the layout, unpacked, as it was read.
    ///
    /// # Errors
    /// If it cannot be read or written, or is another file than was read.
    pub(super) fn copy_to(&self, to: &Path, progress: &dyn Progress) -> Result<()> {
        let mut file = AtomicFile::create(to)?;
        if copy_unpacked(&self.path, &mut file, progress)? != self.digest {
            return Err(Error::refused(
                "file/changed-meanwhile",
                format!("{} changed while it was read", self.path.display()),
                "try again when nothing writes to it",
            ));
        }
        file.commit()
    }
}

/// Name of the hand-off of a layout: that of its file without endings. Quotes and letters that job files or a shell read as more than
/// text become underscores.
pub fn handoff_name(layout: &Path) -> String {
    let name = layout.file_name().unwrap_or_default().to_string_lossy();
    let mut name = name.as_ref();
    for ending in [".gz", ".gds", ".gds2", ".gdsii", ".oas", ".oasis"] {
        let cut = name
            .len()
            .checked_sub(ending.len())
            .filter(|at| *at > 0 && name.is_char_boundary(*at));
        if let Some(at) = cut.filter(|at| name[*at..].eq_ignore_ascii_case(ending)) {
            name = &name[..at];
        }
    }
    let is_more = |c: char| c.is_whitespace() || "'`$&;".contains(c);
    legal_name(name).replace(is_more, "_")
}

/// State the layers with shapes that are not exposed.
fn say_never_exposed(statistics: &LayoutStatistics, exposed: &[LayerNumber], progress: &dyn Progress) {
    let drawn = statistics.layers.iter().filter(|l| l.shapes > 0);
    let never = drawn.filter(|l| !exposed.contains(&LayerNumber::new(l.layer, l.datatype)));
    let never: Vec<String> = never
        .map(|l| {
            format!(
                "{}/{} with {}",
                l.layer,
                l.datatype,
                counted(l.shapes as usize, "shape")
            )
        })
        .collect();
    if !never.is_empty() {
        let never = never.join(", ");
        progress.warn(&format!("note: never exposed: {never}; --expose adds a layer"));
    }
}

/// The exposed layers, the pillars first; all of them have shapes.
fn exposed_layers(
    source: &LayoutSource,
    layout: &Layout,
    statistics: &LayoutStatistics,
    progress: &dyn Progress,
) -> Result<Vec<LayerNumber>> {
    let drawn: Vec<_> = statistics.layers.iter().filter(|l| l.shapes > 0).collect();
    let known: Vec<LayerNumber> = drawn.iter().map(|l| LayerNumber::new(l.layer, l.datatype)).collect();
    let listed = || {
        let of = drawn
            .iter()
            .map(|l| format!("{}/{}: {}", l.layer, l.datatype, counted(l.shapes as usize, "shape")));
        let words: Vec<String> = of.collect();
        format!("layers with shapes: {}", words.join("; "))
    };
    if known.is_empty() {
        return Err(Error::refused(
            "handoff/nothing-drawn",
            format!("{} has no shape on any layer", statistics.file),
            "is this the right file, and the right cell?",
        ));
    }
    let pillars = match source.layer {
        Some(layer) => layer,
        None => layout.pillar_layer(progress)?,
    };
    let mut exposed = vec![pillars];
    for layer in &source.exposed {
        if !exposed.contains(layer) {
            exposed.push(*layer);
        }
    }
    match exposed.iter().find(|layer| !known.contains(layer)) {
        None => Ok(exposed),
        Some(empty) => Err(Error::refused(
            "handoff/layer-empty",
            format!("{} has no shape on layer {empty}; {}", statistics.file, listed()),
            "name a layer that has shapes",
        )),
    }
}

/// Copy a file, unpacked if it is compressed by gzip; the SHA-256 of what was written.
fn copy_unpacked(from: &Path, to: &mut dyn Write, progress: &dyn Progress) -> Result<String> {
    let mut file = BufReader::new(File::open(from).map_err(Error::io("read", from))?);
    let packed = std::io::BufRead::fill_buf(&mut file)
        .map_err(Error::io("read", from))?
        .starts_with(&[0x1f, 0x8b]);
    let mut input: Box<dyn Read> = if packed {
        Box::new(MultiGzDecoder::new(file))
    } else {
        Box::new(file)
    };
    let (mut hash, mut block) = (Sha256::new(), vec![0; BLOCK]);
    loop {
        let n = input.read(&mut block).map_err(Error::io("read", from))?;
        if n == 0 {
            return Ok(hex(&hash.finalize()));
        }
        progress.check_stopped()?;
        hash.update(&block[..n]);
        to.write_all(&block[..n]).map_err(Error::io("copy", from))?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_hand_offs_are_those_of_files_without_endings() {
        for (file, name) in [
            ("lens.gds", "lens"),
            ("a/lens.v2.GDS.gz", "lens.v2"),
            ("lens.oas", "lens"),
            ("my lens.gds", "my_lens"),
            (".gds", ".gds"),
        ] {
            assert_eq!(handoff_name(Path::new(file)), name);
        }
    }
}
