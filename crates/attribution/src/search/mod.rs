//! Search for the effects that explain a residual: stepwise selection, pair search, refinement and alternatives.

mod alternatives;
mod attribute;
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

pub use alternatives::{Alternative, REFERENCES_DECIDE};
pub use attribute::Finding;
pub use evidence::{Evidence, RandomNoise, attribute_set};
pub use patterns::Pattern;
pub use residual::{EXPLAINED, LEAST_GAIN, may_leave};
pub use signatures::cosines;
pub use state::{EndsSearch, SearchState};
pub use stepwise::{Rejection, TriedEffect, fit_of};
