//! Measured spectra: reflectance of film stacks against a reference, through an objective.

mod film_reflectance;
mod model;
mod page;
mod screening;
mod set;

pub(crate) use model::CONDITIONAL;
pub use model::SpectrumModel;
pub(crate) use page::figures;
pub use set::{Spectrum, SpectrumSet, StatedLayer};
