//! Which effects explain a residual: stepwise selection, pair search, refinement and alternatives.

pub mod alternatives;
pub mod attribution;
pub mod pairs;
pub mod refinement;
pub mod signatures;
pub mod state;
pub mod stepwise;
