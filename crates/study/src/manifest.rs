//! The manifest of work that is cut into shards: one file in its folder.

use std::fs;
use std::path::{Path, PathBuf};

use metalith_core::file::read_at_most;
use metalith_core::text::hex;
use metalith_core::{AtomicFile, Error, Result};
use serde::Serialize;
use serde::de::DeserializeOwned;
use sha2::{Digest, Sha256};

use crate::shard_file::split;
use crate::sharding::Sharding;

/// Name of the manifest within the folder.
pub const MANIFEST: &str = "plan.json";
/// Longest manifest.
const LONGEST: u64 = 64 << 20;

/// End of a manifest around its last field: SHA-256 of all that precedes this end.
const BEFORE: &str = ",\n  \"sha256\": \"";
const AFTER: &str = "\"\n}\n";
/// End of the text of all other fields.
const END: &str = "\n}";

/// Manifest of one kind of work.
pub(crate) trait Manifest: Serialize + DeserializeOwned {
    /// SHA-256 of all that decides the answers, in hexadecimal.
    fn key(&self) -> &str;

    /// True if this version of the program can go by it.
    fn is_known(&self) -> bool;

    /// Remember where it was read.
    fn place(&mut self, folder: &Path);

    /// Division of the work into shards.
    fn sharding(&self) -> Sharding;

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
        found.sharding().check()?;
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
        let text = serde_json::to_string_pretty(self).expect("plain data serialises");
        let fields = text.strip_suffix(END).expect("a manifest has fields");
        let digest = hex(&Sha256::digest(fields));
        AtomicFile::write(
            &folder.join(MANIFEST),
            format!("{fields}{BEFORE}{digest}{AFTER}").as_bytes(),
        )
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

            fn sharding(&self) -> crate::sharding::Sharding {
                self.cut()
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
    "remove this file and plan again: `metalith study plan`, or `--plan` of `metalith dataset`, `compare`, `optimise`";

/// True if a folder holds a plan, of whatever work.
pub fn is_planned(folder: &Path) -> bool {
    folder.join(MANIFEST).is_file()
}

/// The manifest of a folder.
///
/// # Errors
/// If there is none, or it is no manifest.
pub(crate) fn read<T: DeserializeOwned>(folder: &Path) -> Result<T> {
    let path = folder.join(MANIFEST);
    if folder.is_dir() && !is_planned(folder) {
        return Err(Error::refused(
            "study/not-planned",
            format!(
                "{} holds no {MANIFEST}: a plan was not completed there, or none was begun",
                folder.display()
            ),
            "plan into this folder first: `metalith study plan`, or `--plan` of `metalith dataset`, `compare`, `optimise`",
        ));
    }
    let mut bytes = read_at_most(&path, LONGEST, "the manifest of a plan")?;
    let refused = |id, why| {
        let what = format!("{} {why}", path.display());
        Err(Error::refused(id, what, PLAN_AGAIN))
    };
    match split(&bytes, BEFORE, AFTER) {
        None => refused(
            "study/version-differs",
            "has no digest: it was changed, or another version of the program wrote it",
        ),
        Some((_, false)) => refused("study/plan-damaged", "is damaged: its digest differs"),
        Some((length, true)) => {
            bytes.truncate(length);
            bytes.extend_from_slice(END.as_bytes());
            serde_json::from_slice(&bytes).map_err(|e| fault(folder, e.to_string()))
        }
    }
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
