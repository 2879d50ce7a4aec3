//! The camera file: what stands behind a chip, and in which light.
//!
//! | question | file |
//! | --- | --- |
//! | which keys a camera file has | `camera_file`; the table is in `docs/guide/verify.md` |
//! | what a sensor is, and which noise it has | `sensor` |
//! | the camera of a bench, in DN | `relay` |
//! | colour filters over pixels | `filter` |
//! | light at an angle, walls between elements | `arrival` |
//! | photons and reading: one variance for all units | `noise` |
//! | what source, blur and pixel area do to intensity; intensity read on pixels | `intensity_transfer`, `pixels` |
//! | frames from NPY, PNG and TIFF; exposures joined | `frame` |
//! | which light a channel counts | `channel` |
//! | how much light is let in | `exposure` |
//! | the light of the scene | `illuminant` |
//! | lux, radiance and photons: electrons of a pixel | `photometry` |
//! | how a person sees it | `observer` |
//! | curves over wavelength, from CSV | `spectrum` |
//! | a camera cut into wavelengths that are simulated | `wavelength_sampling` |
//!
//! A channel counts photons: what it sees of a wavelength is the spectral power of the illuminant times the wavelength,
//! times its quantum efficiency.

mod arrival;
mod camera_file;
mod channel;
mod exposure;
mod filter;
pub mod frame;
mod illuminant;
mod intensity_transfer;
mod noise;
mod observer;
mod photometry;
mod pixels;
mod relay;
mod sensor;
mod spectrum;
mod wavelength_sampling;

pub use arrival::{AngularResponse, Walls};
pub use camera_file::Camera;
pub use channel::{Channel, Response};
pub use exposure::{Exposure, StatedExposure};
pub use filter::{Colour, ColourFilter, ColourPixels};
pub use illuminant::{Illuminant, Led};
pub use intensity_transfer::Optic;
pub use noise::Noise;
pub use observer::observer;
pub use photometry::{LightLevel, SceneLight, luminous_efficiency};
pub use pixels::{PixelGrid, Reading};
pub use relay::{RelayCamera, SATURATED};
pub use sensor::{Sensor, SensorNoise};
pub use spectrum::Spectrum;
pub use wavelength_sampling::{Blend, ChannelPart, ChannelSampling, Sampling, WavelengthSteps, lagrange};
