//! Errors of cells, in intervals and for claims.
//!
//! Two correct programs do not predict the same image. They differ in the transmission of pillars, by a smooth function
//! of width, and in what an effect changes, by a small share of it. A fit takes such a difference for its parameters:
//! it makes some `cd_bias` and `sidewall_taper` of it, that cancel almost.

use metalith_attribution::ModelError;

/// Errors of a cell and of the model around it, as one standard deviation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CellError {
    /// Error of each polynomial over width of the relative amplitude that a cell transmits.
    pub amplitude: f64,
    /// Error of each polynomial of the phase (rad).
    pub phase_rad: f64,
    /// What such errors make of the numbers of a fit, over what polynomials at random of the same size would.
    pub likeness: f64,
    /// Shapes that the error of what effects change is spread over.
    pub shapes: f64,
    /// True if an effect is seen beside the error of the cell where that was simulated, about the stated chip.
    pub by_effect: bool,
}

impl CellError {
    /// Errors as measured. Amplitude and phase are those of the truncation of the stated cell, in the mean of the spectrum of
    /// an LED (test `the_error_of_a_cell_in_intervals_is_that_of_its_truncation`). The likeness and the shapes are the most
    /// likely ones for what 156 numbers in synthetic sets err by, whose cells have 11 and 15 orders: 0.38, and 0.33 of what 900
    /// shapes would make. Sets by a program that shares nothing with this one err by less.
    pub(crate) const MEASURED: Self = Self {
        amplitude: 0.0005,
        phase_rad: 0.0026,
        likeness: 0.4,
        shapes: 8000.0,
        by_effect: true,
    };

    /// Errors in spite of which a claim must hold: the cell errs by the whole of its truncation in amplitude as well, and what
    /// effects change errs in the smooth shapes alone, which are most like effects.
    pub(crate) const CAUTIOUS: Self = Self {
        amplitude: 0.003,
        phase_rad: 0.003,
        likeness: 1.0,
        shapes: 0.0,
        by_effect: false,
    };

    /// Relative error of images: light is the square of the field, whose relative error doubles at most.
    pub(crate) fn of_images(&self) -> f64 {
        2.0 * self.amplitude.hypot(self.phase_rad)
    }

    /// Errors in the form of the statistics: amplitudes and phases, as [`SmoothShape`](crate::smooth_shape::SmoothShape) has them.
    pub(crate) fn of_model(&self) -> ModelError {
        ModelError {
            sizes: vec![self.amplitude, self.phase_rad],
            likeness: self.likeness,
            shapes: self.shapes,
            by_effect: self.by_effect,
        }
    }
}
