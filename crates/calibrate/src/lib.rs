//! Calibration: from what the bench recorded to what the model lacks.
//!
//! A [`MeasuredSet`] is read and checked, and its layout extracted. A simulated bench predicts each measurement from
//! the pillars as written; nuisances of the bench are fitted; the residual is compared with what each effect in
//! `effects/` would leave, and an effect is named if it predicts measurements that were not fitted.
//!
//! | folder | holds | may use |
//! | --- | --- | --- |
//! | `set` | the measured set and its files | |
//! | `effects` | what chips and benches are known to do to light | `set` |
//! | `bench`, `cells`, `optics`, `simulator`, `search_work` | the simulated bench, and the bound of a search | `set`, `effects` |
//! | `data`, `screening`, `speckle`, `grouping` | measurements, nuisances and noise as `metalith-attribution` needs them | `bench` |
//! | `simulator_model`, `smooth_shape`, `cell_error` | the simulated bench as its forward model | `data` |
//! | `statistics` | the types of `metalith-attribution` for these measurements | `data` |
//! | `proposal` | effects for the residual | `statistics`, `session` |
//! | `session`, `diagnosis`, `boundary_search`, `page`, `run`, `whole_progress` | a set from its files to its answer | all above |
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
mod interval_parts;
mod optics;
mod page;
mod proposal;
mod run;
mod screening;
mod search_work;
mod session;
mod set;
mod simulator;
mod simulator_model;
mod smooth_residual;
mod smooth_shape;
mod speckle;
mod statistics;
mod validate;
mod whole_progress;

pub use bench::{Bench, BenchSampling};
pub use cells::{CellSource, RigorousCells};
pub use data::{Data, Nuisances};
pub use diagnosis::{
    Diagnosis, ErrorPair, ErrorReport, FoundEffect, FreePattern, GroupValue, LeftOut, PatternTrend, Proposal, Ranked,
    Remainder, Slope,
};
pub use effects::{DeclaredEffect, DeclaredParameter, Effect, Parameter, Stage, all as all_effects, of_any_chip};
pub use fidelity::FidelityError;
pub use interval_parts::WidthParts;
pub use metalith_attribution::{RENAMED as RENAMED_EFFECTS, SetVerdict};
pub use proposal::{FieldBoundary, Proposed, boundary_of_fields, propose};
pub use run::{Calibration, calibrate};
pub use search_work::{MOST_SIMULATIONS, SearchWork};
pub use session::{Screening, Session, Settings, Simulations, check_effects};
pub use set::SEM_COLUMNS;
pub use set::read as set_format;
pub use set::{BenchLed, MeasuredElement, MeasuredSet, Measurement, SemSite, Stack};
pub use set::{ElementIndex, LedIndex, MeasurementIndex, PerElement, PerLed, PerMeasurement};
pub use simulator::{Simulator, WIDTH_ROOM_NM};
pub use simulator_model::separating_measurement;
pub use statistics::{Evidence, Fit, FitProblem, Surrogate, check_calibration_fits};
pub use validate::synthetic::{Synthesizer, SyntheticImages, UnlistedEffect};
pub use validate::{
    ClaimedNumber, Coverage, DetectionLimit, Validation, ValidationPlan, ValidationTrial, validate, write_validation,
};
