//! Options of a hand-off.

use std::path::PathBuf;

use metalith_cell::Fidelity;
use metalith_core::LayerNumber;
use metalith_layout::LayoutFormat;
use metalith_wave::Accuracy;

/// Inputs and destination of a hand-off.
#[derive(Clone, Debug)]
pub struct HandoffOptions {
    pub source: HandoffSource,
    /// The process file; of a design the program's own if left out, of a layout it is required.
    pub process: Option<PathBuf>,
    /// Folder to write; the archive is beside it, with `.zip` appended to the name.
    pub out: PathBuf,
    /// The command as it was given, for the manifest.
    pub command: String,
    /// Format of all layouts that are made.
    pub format: LayoutFormat,
    /// Violations of the rules that have been accepted.
    pub waivers: Option<PathBuf>,
}

/// Source of the pillars that are handed over.
#[derive(Clone, Debug)]
pub enum HandoffSource {
    Design(DesignSource),
    Layout(LayoutSource),
}

/// A design, from which all layouts are made.
#[derive(Clone, Debug)]
pub struct DesignSource {
    /// The design file.
    pub path: PathBuf,
    /// The cell that the layout is judged by, that of the design if left out; the published polynomials are shown beside
    /// it.
    pub fidelity: Option<Fidelity>,
    /// Accuracy with which the layout is simulated.
    pub accuracy: Accuracy,
    /// The calibrated model that the layout is compensated for, and judged by, if any.
    pub compensate: Option<PathBuf>,
    /// The calibrated model whose biases are undone by dose classes; the layout stays as intended.
    pub dose_classes: Option<PathBuf>,
}

/// A layout of any program, which is handed over as it is.
#[derive(Clone, Debug)]
pub struct LayoutSource {
    /// The layout: GDSII or OASIS, also compressed by gzip.
    pub path: PathBuf,
    /// Cell to expose; the top cell if there is one only.
    pub top: Option<String>,
    /// Layer of the pillars; if left out the only layer with shapes, else 1/0.
    pub layer: Option<LayerNumber>,
    /// Further layers of the first step, such as marks.
    pub exposed: Vec<LayerNumber>,
}
