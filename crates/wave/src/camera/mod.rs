//! Model of a camera: from light on the sensor's plane to the values that the camera records.
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
