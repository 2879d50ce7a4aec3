//! The radial phase that all elements share, optimised ring by ring.

mod adam;
mod bessel;
mod deconvolution;
mod exchange;
mod field;
mod focus;
mod imaging;
mod kernel;
mod limit;
mod mapping;
mod objective;
mod planes;
mod pupil;
mod rings;
mod score;
mod start;
mod wiener;

pub use adam::Adam;
pub use bessel::Bessel;
pub use deconvolution::{Deconvolution, Views};
pub use exchange::{Exchange, Schedule};
pub use field::{Condition, FieldProblem, Kind, Row};
pub use focus::{FabricationError, Lens, Strehl, judging_wavelengths, wavelengths};
pub use kernel::RingField;
pub use limit::{StepLimit, largest_step, largest_step_in_layout};
pub use mapping::{Choice, Mapping, step};
pub use objective::{Objective, Sum};
pub use pupil::{Pupil, Window};
pub use rings::Rings;
pub use start::Start;
pub use wiener::{Scene, Spectrum};
