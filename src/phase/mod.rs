//! From a design to the phase of every site: the radial phase that all elements share, and the wedge
//! that steers each of them. Phases are kept in turns, so that the modulo is exact.

mod element;
mod radial;
mod table;

pub use element::{ElementPhase, LensPhase};
pub use radial::{Interpolation, RadialPhase};

use serde::Serialize;

/// A linear phase over an element: Eq. 3 of Chakravarthula et al. 2023.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Wedge {
    /// Wavelength lambda_w at which it steers by its angles [um].
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
