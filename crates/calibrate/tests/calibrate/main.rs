//! Measured sets: all faults are named at once, effects are found, and nothing is found where there is none.

mod bench;
mod listed;
mod recorded;
mod set;
mod spoiled;
mod unlisted;
mod validation;
