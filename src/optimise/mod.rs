//! The radial phase that all elements share, optimised ring by ring.

mod adam;
mod bessel;
mod exchange;
mod field;
mod focus;
mod kernel;
mod limit;
mod mapping;
mod planes;
mod rings;
mod score;
mod start;

pub use adam::Adam;
pub use bessel::Bessel;
pub use exchange::{Exchange, Schedule};
pub use field::{Condition, FieldProblem, Kind, Row};
pub use focus::{FabricationError, Lens, Strehl, judging_wavelengths, wavelengths};
pub use kernel::RingField;
pub use limit::{StepLimit, largest_step, largest_step_in_layout};
pub use mapping::{Choice, Mapping, step};
pub use rings::Rings;
pub use start::Start;
