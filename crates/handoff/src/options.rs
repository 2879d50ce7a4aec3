//! Options of a hand-off.

use std::path::PathBuf;

use metalith_cell::Fidelity;
use metalith_layout::LayoutFormat;
use metalith_wave::Accuracy;

/// Inputs and destination of a hand-off.
#[derive(Clone, Debug)]
pub struct HandoffOptions {
    /// The design file.
    pub design: PathBuf,
    /// The process file; the program's own if left out.
    pub process: Option<PathBuf>,
    /// Folder to write; the archive is beside it, with `.zip` appended to the name.
    pub out: PathBuf,
    /// The command as it was given, for the manifest.
    pub command: String,
    /// Format of all layouts.
    pub format: LayoutFormat,
    /// The cell that the layout is judged by, that of the design if left out; the published polynomials are shown beside
    /// it.
    pub fidelity: Option<Fidelity>,
    /// Accuracy with which the layout is simulated.
    pub accuracy: Accuracy,
    /// The calibrated model that the layout is compensated for, and judged by, if any.
    pub compensate: Option<PathBuf>,
    /// The calibrated model whose biases are undone by dose classes; the layout stays as intended.
    pub dose_classes: Option<PathBuf>,
    /// Violations of the rules that have been accepted.
    pub waivers: Option<PathBuf>,
}
