//! The camera file: what stands behind a chip, and in which light.
//!
//! | question | file |
//! | --- | --- |
//! | which keys a camera file has | `file`; the table is in `docs/guide/verify.md` |
//! | what a sensor is, and which noise it has | `sensor` |
//! | the camera of a bench, in DN | `relay` |
//! | colour filters over pixels | `filter` |
//! | photons and reading: one variance for all units | `noise` |
//! | what source, blur and pixel area do to intensity; intensity read on pixels | `optic`, `pixels` |
//! | frames from NPY, PNG and TIFF; exposures joined | `frame` |
//! | which light a channel counts | `channel` |
//! | how much light is let in | `exposure` |
//! | the light of the scene | `illuminant` |
//! | how a person sees it | `observer` |
//! | curves over wavelength, from CSV | `spectrum` |
//! | a camera cut into wavelengths that are simulated | `sampling` |
//!
//! A channel counts photons: what it sees of a wavelength is the spectral power of the illuminant times the wavelength,
//! times its quantum efficiency.

mod channel;
mod exposure;
mod file;
mod filter;
pub mod frame;
mod illuminant;
mod noise;
mod observer;
mod optic;
mod pixels;
mod relay;
mod sampling;
mod sensor;
mod spectrum;

pub use channel::{Channel, Response};
pub use exposure::Exposure;
pub use file::Camera;
pub use filter::{Colour, ColourFilter, ColourPixels};
pub use illuminant::{Illuminant, Led};
pub use noise::Noise;
pub use observer::observer;
pub use optic::Optic;
pub use pixels::{PixelGrid, Reading};
pub use relay::{RelayCamera, SATURATED};
pub use sampling::{Blend, ChannelPart, ChannelSampling, Sampling, WavelengthSteps, lagrange};
pub use sensor::{Sensor, SensorNoise};
pub use spectrum::Spectrum;
