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

pub use golden::{accepting, changed, design, golden, npy, replaced, root};

/// The text of an error without the folder that its files are in, which differs from machine to machine.
pub fn without_folder(error: impl Display, folder: &Path) -> String {
    error.to_string().replace(&format!("{}/", folder.display()), "")
}
