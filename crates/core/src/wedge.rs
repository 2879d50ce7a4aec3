//! The wedge that steers an element, and where the element looks by it.

use serde::Serialize;

/// A linear phase over an element: Eq. 3 of Chakravarthula et al. 2023.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Wedge {
    /// Wavelength lambda_w at which it steers by its angles (um).
    pub wavelength_um: f64,
    /// Sine of the steering angle along x and y.
    pub sin_x: f64,
    pub sin_y: f64,
}

impl Wedge {
    /// Direction sines of the light that this wedge brings to the axis: the middle of the element's field.
    pub fn looks_at(&self, wavelength_um: f64) -> (f64, f64) {
        let dispersion = -wavelength_um / self.wavelength_um;
        (self.sin_x * dispersion, self.sin_y * dispersion)
    }
}
