//! From the pillars of an element to the pixels of a camera, planned once and run many times.

mod camera;
mod cis;
mod planes;
mod spectrum;

pub use camera::{Optic, PixelGrid, Reading};
pub use planes::{Passed, Planes, Planned, Scratch};
pub use spectrum::Quadrature;
