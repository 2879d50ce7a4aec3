//! Files that a person has put into the folder of a planned session, and a new plan would take away.

use std::collections::BTreeMap;
use std::path::Path;

use metalith_core::file::{file_digest, read_at_most};
use metalith_core::text::hex;
use metalith_core::{Error, Result};

/// Files of a session that a person fills in.
const FILLED_IN: [&str; 2] = ["measurement.toml", "cd_sem.csv"];
/// Longest `plan.json` that is read (bytes).
const LONGEST: u64 = 1 << 26;

/// SHA-256 in hexadecimal of the files that a person fills in, as far as they are there.
///
/// # Errors
/// If one cannot be read.
pub(super) fn digests(folder: &Path) -> Result<BTreeMap<String, String>> {
    let there = FILLED_IN.into_iter().filter(|name| folder.join(name).exists());
    there
        .map(|name| Ok((name.to_owned(), hex(&file_digest(&folder.join(name))?))))
        .collect()
}

/// Refuse the folder of a session that was begun: exposures and frames would no longer be those of its plan, and widths that
/// were filled in would be lost.
///
/// # Errors
/// If there are frames in it, or a file that a person fills in is not as it was planned.
pub fn check_not_begun(folder: &Path) -> Result<()> {
    let refuse = |what: String| {
        Err(Error::refused(
            "plan/folder-in-use",
            what,
            "give another folder with --out, or move what is there away",
        ))
    };
    let frames = folder.join("captures");
    if std::fs::read_dir(&frames).is_ok_and(|mut files| files.next().is_some()) {
        return refuse(format!("there are frames in {}", frames.display()));
    }
    let planned = read_at_most(&folder.join("plan.json"), LONGEST, "a plan").unwrap_or_default();
    let planned: serde_json::Value = serde_json::from_slice(&planned).unwrap_or_default();
    let changed = digests(folder)?
        .into_iter()
        .find(|(name, digest)| planned["written"][name] != digest.as_str());
    match changed {
        Some((name, _)) => refuse(format!("{} is not as it was planned", folder.join(name).display())),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::write;

    #[test]
    fn what_was_filled_in_is_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        assert!(check_not_begun(&folder.join("none")).is_ok());
        let table = folder.join("cd_sem.csv");
        write(&table, "measured_nm\n").unwrap();
        assert!(check_not_begun(folder).is_err(), "of whom it is is not known");
        let plan = serde_json::json!({ "plan": 1, "written": digests(folder).unwrap() });
        write(folder.join("plan.json"), plan.to_string()).unwrap();
        assert!(check_not_begun(folder).is_ok());
        write(&table, "measured_nm\n151.2\n").unwrap();
        let error = check_not_begun(folder).unwrap_err().to_string();
        assert!(error.contains("cd_sem.csv"), "{error}");
        write(&table, "measured_nm\n").unwrap();
        write(folder.join("measurement.toml"), "schema = 1\n").unwrap();
        assert!(check_not_begun(folder).is_err());
    }

    #[test]
    fn frames_are_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("captures")).unwrap();
        assert!(check_not_begun(folder.path()).is_ok());
        write(folder.path().join("captures/one.png"), "").unwrap();
        let error = check_not_begun(folder.path()).unwrap_err();
        assert_eq!(error.id(), "plan/folder-in-use");
    }
}
