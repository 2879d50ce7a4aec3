//! Widths of pillars by scanning electron microscope: tables alone, no images.
//!
//! | file | holds |
//! | --- | --- |
//! | `set`, `table` | keys of `measurement.toml`; rows of the CSV table |
//! | `fill` | area fraction around a place, from rectangles or from a layout |
//! | `terms`, `model` | effects with their parameters; the forward model |
//! | `calibrated` | what was found as `model.toml` |

mod calibrated;
mod fill;
mod model;
mod page;
mod set;
mod table;
mod terms;

pub(crate) use calibrated::calibrated;
pub use model::WidthModel;
pub(crate) use page::figures;
pub use set::{WidthSet, WidthSite};
