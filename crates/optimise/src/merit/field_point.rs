//! Points at which a merit takes the field.

use num_complex::Complex32;

/// Condition of a cell at one row: a wavelength and an error of fabrication.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Condition {
    /// Vacuum wavelength (um).
    pub wavelength_um: f64,
    /// Index of the cell among the cells given: they differ in height.
    pub cell: usize,
    /// Made width less designed width (nm).
    pub width_bias_nm: f64,
}

/// A point of the field: its condition, what each ring contributes, and its weight in the merit.
#[derive(Clone, Debug)]
pub struct FieldPoint {
    /// Wavelength and fabrication error.
    pub condition: Condition,
    /// Field of each ring of unit transmission, in units of the matched peak at full transmission.
    pub kernel: Vec<Complex32>,
    /// Weight within its block; logarithms take them all as one.
    pub weight: f32,
}
