//! Calibration: from what the bench recorded to what the model lacks.
//!
//! A [`MeasuredSet`] is read and checked, and its layout extracted. A simulated bench predicts each capture from
//! the pillars as written; nuisances of the bench are fitted; the residual is compared with what each effect in
//! `effects/` would leave, and an effect is named if it predicts captures that were not fitted.
//!
//! | folder | holds | may use |
//! | --- | --- | --- |
//! | `set` | the measured set and its files | |
//! | `effects` | what chips and benches are known to do to light, one file each | `set` |
//! | `bench`, `cells`, `optics`, `simulator` | the simulated bench | `set`, `effects` |
//! | `data`, `screening`, `speckle`, `grouping` | captures, nuisances and noise as `metalith-attribution` needs them | `bench` |
//! | `simulator_model`, `smooth_shape`, `cell_error` | the simulated bench as its forward model | `data` |
//! | `statistics` | the types of `metalith-attribution` for these captures | `data` |
//! | `proposal` | effects for what is left | `statistics`, `session` |
//! | `session`, `diagnosis`, `boundary_search`, `page`, `run` | a set from its files to its answer | all above |
//! | `planning` | which captures to take of a design before it is measured | all above |
//! | `validate` | the calibration judged on synthetic sets | all above |

mod bench;
mod boundary_search;
mod cell_error;
mod cells;
mod data;
mod diagnosis;
mod effects;
mod fidelity;
mod grouping;
mod names;
mod optics;
mod page;
mod planning;
mod proposal;
mod run;
mod screening;
mod session;
mod set;
mod simulator;
mod simulator_model;
mod smooth_residual;
mod smooth_shape;
mod speckle;
mod statistics;
mod validate;
mod width_parts;

pub use bench::{Bench, Sampling};
pub use diagnosis::{
    Diagnosis, ErrorPair, ErrorReport, FoundEffect, FreePattern, GroupValue, LeftOut, PatternCourse, Proposal, Ranked,
    SetVerdict, Slope,
};
pub use effects::{DeclaredEffect, DeclaredParameter, Effect, Parameter, Stage, all as all_effects, of_any_chip};
pub use fidelity::Rung;
pub use planning::{
    BenchFile, CapturePlan, Confusion, PlanRequest, PlannedCapture, PlannedEffect, SemOffer, check_not_begun,
    check_plannable, plan,
};
pub use proposal::{FieldBoundary, Proposed, boundary_of_fields, propose};
pub use run::{Calibration, calibrate};
pub use session::{Screening, Session, Settings, Simulations};
pub use set::{Bayer, Capture, Channel, Led, MeasuredElement, MeasuredSet, RelayCamera, SemSite, Stack};
pub use set::{CaptureIndex, ElementIndex, LedIndex, PerCapture, PerElement, PerLed};
pub use statistics::Evidence;
pub use validate::synthetic::{Synthesizer, SyntheticImages, UnlistedEffect};
pub use validate::{
    ClaimedNumber, Coverage, DetectionLimit, Validation, ValidationPlan, ValidationTrial, validate, write_validation,
};
pub use width_parts::WidthParts;
