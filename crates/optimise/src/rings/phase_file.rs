//! The optimised phase as a file that a design reads.

use std::fmt::Write as _;
use std::path::Path;

use crate::rings::sites::Rings;
use metalith_core::{AtomicFile, Result};

/// Write the phase of each ring (waves) as `r_um,phase_rad`, one row in the middle of each ring. A design
/// reads it with `source = "table"` and `interpolation = "nearest"`. `remarks` go before it as comments.
///
/// # Errors
/// If the file cannot be written.
pub fn write_phase_table(path: &Path, rings: &Rings, waves: &[f64], remarks: &[String]) -> Result<()> {
    let mut text = String::new();
    for remark in remarks {
        let _ = writeln!(text, "# {remark}");
    }
    text.push_str("r_um,phase_rad\n");
    for (ring, waves) in waves.iter().enumerate() {
        let phase = waves.rem_euclid(1.0) * std::f64::consts::TAU;
        let _ = writeln!(text, "{:.3},{phase:.6}", rings.middle_um(ring));
    }
    AtomicFile::write(path, text.as_bytes())
}
