//! From what the bench recorded to what the model lacks.
//!
//! A [`MeasuredSet`] is read and checked, its layout extracted. A bench in the computer predicts each capture
//! from the pillars as written; nuisances of the bench are fitted; what is left is compared with what every
//! effect in `effects/` would leave, and an effect is named if it predicts captures that were not fitted.

mod bench;
mod cells;
mod density;
mod departure;
mod diagnosis;
mod effects;
mod fit;
mod model;
mod optics;
mod page;
mod run;
mod search;
mod session;
mod set;
mod simulator;
mod surrogate;
mod validate;
mod zernike;

pub use bench::Sampling;
pub use density::fill;
pub use departure::{CameraChange, CellChange, Departure, Geometry, LightChange, PathChange};
pub use diagnosis::{Diagnosis, ErrorPair, ErrorReport, FoundEffect, LeftOut, Ranked, Rung, SetVerdict};
pub use model::{CalibratedModel, MadeCell};
pub use run::{Calibration, calibrate};
pub use session::{Session, Settings};
pub use set::{Camera, Capture, Led, MeasuredElement, MeasuredSet, SemSite, Stack};
pub use surrogate::Surrogate;
pub use validate::synthetic::{Synthesizer, SyntheticImages, UnlistedEffect};
pub use validate::{DetectionLimit, Trial, Validation, ValidationPlan, validate, write_validation};
