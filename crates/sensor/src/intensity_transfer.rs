//! Effect of source, blur and pixel area on intensity.

use metalith_wave::kernels::{jinc, sinc};

/// Filters that intensity passes on its way to the pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optic {
    /// Edge of a pixel (um).
    pub pixel_um: f64,
    /// The images of the source disc's two radii, as the columns of a matrix (um).
    pub disc_um: [[f64; 2]; 2],
    /// Standard deviation of a Gaussian blur (um).
    pub blur_um: f64,
}

impl Optic {
    /// Factor of the intensity's spectrum at a frequency (cycles / um).
    pub(crate) fn transfer(&self, fx: f64, fy: f64) -> f64 {
        let [u, v] = self.disc_um;
        let disc = jinc(std::f64::consts::TAU * (fx * u[0] + fy * u[1]).hypot(fx * v[0] + fy * v[1]));
        let blur = (-2.0 * (std::f64::consts::PI * self.blur_um).powi(2) * (fx * fx + fy * fy)).exp();
        sinc(fx * self.pixel_um) * sinc(fy * self.pixel_um) * disc * blur
    }
}
