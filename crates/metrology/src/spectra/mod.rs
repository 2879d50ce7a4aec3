//! Measured spectra: reflectance of film stacks and of pads of pillars against a reference, through an objective.

mod film_reflectance;
mod forecast;
mod model;
mod pads;
mod page;
mod screening;
mod set;

pub use forecast::{ForecastEffect, SpectrumForecast};
pub(crate) use model::CONDITIONAL;
pub use model::SpectrumModel;
pub(crate) use page::figures;
pub use set::{Spectrum, SpectrumSet, StatedLayer, StatedPads};
