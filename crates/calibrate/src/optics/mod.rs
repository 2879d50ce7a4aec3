//! Optics from the pillars of an element to the pixels of a camera, planned once and run many times.

mod spectrum;

pub(crate) use metalith_sensor::{Optic, PixelGrid, Reading};
pub(crate) use spectrum::Quadrature;
