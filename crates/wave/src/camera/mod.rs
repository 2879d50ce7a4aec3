//! From light on the sensor's plane to what a camera gives out.
//!
//! | question | file |
//! | --- | --- |
//! | what source, blur and pixel area do to intensity | `optic` |
//! | intensity on fine samples, read on pixels | `pixels` |
//! | the photons and reading | `noise` |

mod noise;
mod optic;
mod pixels;

pub use noise::Noise;
pub use optic::Optic;
pub use pixels::{PixelGrid, Reading};
