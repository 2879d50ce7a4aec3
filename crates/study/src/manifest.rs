//! The manifest of work that is cut into shards: one file in its folder.

use std::fs;
use std::path::{Path, PathBuf};

use metalith_core::file::read_at_most;
use metalith_core::{Error, Result};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Name of the manifest within the folder.
pub const MANIFEST: &str = "plan.json";
/// Longest manifest.
const LONGEST: u64 = 64 << 20;

/// Manifest of one kind of work.
pub(crate) trait Manifest: Serialize + DeserializeOwned {
    /// SHA-256 of all that decides the answers, in hexadecimal.
    fn key(&self) -> &str;

    /// True if this version of the program can go by it.
    fn is_known(&self) -> bool;

    /// Remember where it was read.
    fn place(&mut self, folder: &Path);

    /// Manifest of a folder.
    ///
    /// # Errors
    /// If there is none, or it cannot be read.
    fn open_in(folder: &Path) -> Result<Self> {
        let mut found: Self = read(folder)?;
        if !found.is_known() {
            return Err(Error::refused(
                "study/version-differs",
                format!(
                    "{} is a manifest of another version of the program",
                    folder.join(MANIFEST).display()
                ),
                PLAN_AGAIN,
            ));
        }
        found.place(folder);
        Ok(found)
    }

    /// Manifest of a folder if it holds one, which must be of this key.
    ///
    /// # Errors
    /// If it cannot be read, or is another.
    fn known_in(folder: &Path, key: &str) -> Result<Option<Self>> {
        fs::create_dir_all(folder).map_err(Error::io("create the folder", folder))?;
        if !is_planned(folder) {
            return Ok(None);
        }
        let known = Self::open_in(folder)?;
        if known.key() == key {
            Ok(Some(known))
        } else {
            Err(another_plan(folder))
        }
    }

    /// Write it into a folder: the last thing that a plan does.
    ///
    /// # Errors
    /// If the file cannot be written.
    fn write_in(&self, folder: &Path) -> Result<()> {
        metalith_report::write_plain_json(&folder.join(MANIFEST), self)
    }
}

/// The manifest of a plan with a key, a version and a folder, of work that may be `known` further.
macro_rules! manifest {
    ($plan:ident, $known:expr) => {
        impl crate::manifest::Manifest for $plan {
            fn key(&self) -> &str {
                &self.key
            }

            fn is_known(&self) -> bool {
                let known: fn(&Self) -> bool = $known;
                self.schema == SCHEMA && known(self)
            }

            fn place(&mut self, folder: &std::path::Path) {
                self.folder = folder.to_owned();
            }
        }

        impl $plan {
            /// The plan in a folder.
            ///
            /// # Errors
            /// If there is none, or its manifest cannot be read.
            pub fn open(folder: &std::path::Path) -> metalith_core::Result<Self> {
                <Self as crate::manifest::Manifest>::open_in(folder)
            }
        }
    };
}
pub(crate) use manifest;

const PLAN_AGAIN: &str =
    "plan it again: `metalith study plan`, or `--plan` of `metalith dataset`, `compare`, `optimise`";

/// True if a folder holds a plan, of whatever work.
pub fn is_planned(folder: &Path) -> bool {
    folder.join(MANIFEST).is_file()
}

/// The manifest of a folder.
///
/// # Errors
/// If there is none, or it is no manifest.
pub(crate) fn read<T: DeserializeOwned>(folder: &Path) -> Result<T> {
    let bytes = read_at_most(&folder.join(MANIFEST), LONGEST, "the manifest of a plan")?;
    serde_json::from_slice(&bytes).map_err(|e| fault(folder, e.to_string()))
}

fn fault(folder: &Path, what: String) -> Error {
    Error::table(&folder.join(MANIFEST), None, what, PLAN_AGAIN)
}

/// Error for a folder whose plan is not the plan of these files.
pub(crate) fn another_plan(folder: &Path) -> Error {
    Error::refused(
        "study/plan-differs",
        format!(
            "{} contains another plan, or a file of the plan has changed, or another version of the program planned it",
            folder.display()
        ),
        "plan into another folder with --out, or remove this one",
    )
}

/// A path that holds wherever a shard is made.
pub(crate) fn absolute(path: &Path) -> Result<PathBuf> {
    std::path::absolute(path).map_err(Error::io("find", path))
}
