//! From what the bench recorded to what the model lacks.
//!
//! A [`MeasuredSet`] is read and checked, its layout extracted. A bench in the computer predicts each capture
//! from the pillars as written; nuisances of the bench are fitted; what is left is compared with what every
//! effect in `effects/` would leave, and an effect is named if it predicts captures that were not fitted.

mod approach;
mod atlas;
mod attribute;
mod bench;
mod cells;
mod couple;
mod curve;
mod diagnosis;
mod effects;
mod fit;
mod forward;
mod free;
mod heldout;
mod nuisance;
mod optics;
mod page;
mod placebo;
mod placement;
mod proof;
mod quadratic;
mod rivals;
mod run;
mod session;
mod set;
mod signature;
mod simulator;
mod speckle;
mod standing;
mod twin;
mod unfit;

pub use atlas::Atlas;
pub use bench::{Bench, Sampling};
pub use diagnosis::{Diagnosis, ErrorPair, ErrorReport, FoundEffect, LeftOut, Ranked, Rung, SetVerdict};
pub use effects::{Effect, Parameter, Stage, all as all_effects};
pub use proof::{Extent, Limit, Proof, Trial, prove, write_proof};
pub use run::{Calibration, calibrate};
pub use session::{Session, Settings};
pub use set::{Camera, Capture, Led, MeasuredElement, MeasuredSet, SemSite, Stack};
pub use twin::{Exposed, OffList, Twins};
