//! Helpers that the tests of several crates share: golden files, layouts made byte by byte, small measured sets.

pub mod gds;
mod golden;
pub mod lens;
pub mod mutate;
pub mod oasis;
pub mod rectangles;
#[cfg(feature = "session")]
pub mod session;

pub use golden::{design, golden, root};
