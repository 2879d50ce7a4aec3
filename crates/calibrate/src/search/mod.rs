//! Which effects explain a residual: stepwise selection, pair search, refinement and alternatives.

mod alternatives;
mod attribution;
mod capture_screening;
mod course;
mod defect_noise;
mod evidence;
mod exchange;
mod pairs;
mod patterns;
mod recentred_leaders;
mod refinement;
mod residual;
mod signatures;
mod state;
mod stepwise;
mod window_offsets;

pub use alternatives::SEM_DECIDES;
pub use attribution::Finding;
pub use capture_screening::{UnusableCapture, unusable_captures};
pub use course::Course;
pub use defect_noise::DefectNoise;
pub use evidence::{Evidence, attribute_set};
pub use patterns::{Grouping, Pattern};
pub use residual::{EXPLAINED, LEAST_GAIN, may_leave};
pub use signatures::cosines;
pub use state::{EndsSearch, SearchState};
pub use stepwise::{Rejection, TriedEffect, fit_of};
