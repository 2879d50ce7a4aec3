//! Helpers that the tests of several crates share: golden files, layouts made byte by byte, small measured sets.

pub mod gds;
mod golden;
#[cfg(feature = "session")]
pub mod layouts;
pub mod lens;
pub mod mutate;
pub mod oasis;
pub mod rectangles;
#[cfg(feature = "session")]
pub mod session;

use std::fmt::Display;
use std::path::Path;

pub use golden::{accepting, changed, design, golden, npy, optimised, replaced, root, rows};

/// The text of an error without the folder that its files are in, which differs from machine to machine.
pub fn without_folder(error: impl Display, folder: &Path) -> String {
    error.to_string().replace(&format!("{}/", folder.display()), "")
}

/// CPU time of this thread (s); none where the system does not tell it.
pub fn cpu_s() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(text.split_whitespace().next()?.parse::<f64>().ok()? * 1e-9)
}
