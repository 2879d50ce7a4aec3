//! Optics from the pillars of an element to the pixels of a camera, planned once and run many times.

mod spectrum;

pub use metalith_wave::camera::{Optic, PixelGrid, Reading};
pub use spectrum::Quadrature;
