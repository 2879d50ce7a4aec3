//! Measured heights: maps of a printed or etched relief beside the maps that were drawn.

mod far_field;
pub(crate) mod fft;
mod map;
mod model;
mod page;
mod screening;
mod set;

pub(crate) use model::CONDITIONAL;
pub use model::HeightModel;
pub(crate) use page::figures;
pub use set::{HeightField, HeightSet};
