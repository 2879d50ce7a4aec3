//! Widths of pillars by scanning electron microscope: tables alone, no images.
//!
//! | file | holds |
//! | --- | --- |
//! | `set` | keys of `measurement.toml` |
//! | `table`, `rows` | a CSV table; its rows as sites with repeats |
//! | `screening` | mistakes of a table that no fit shows |
//! | `regions`, `fill` | rectangles or a layout; the area fraction around a place |
//! | `terms`, `model` | effects with their parameters; the forward model |
//! | `calibrated` | what was found as `model.toml` |

mod calibrated;
mod fill;
mod model;
mod page;
mod regions;
mod rows;
mod screening;
mod set;
mod table;
mod terms;

pub(crate) use calibrated::calibrated;
pub use model::WidthModel;
pub(crate) use page::figures;
pub use set::{WidthSet, WidthSite};
pub(crate) use terms::CONDITIONAL;
