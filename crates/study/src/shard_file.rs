//! One shard as a file: a header, a line for each part, and last the SHA-256 of all that precedes it.

use std::fs;
use std::io::ErrorKind;
use std::path::Path;

use metalith_core::file::{file_digest, read_at_most};
use metalith_core::text::hex;
use metalith_core::{Error, Result};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::sharding::{FilesOfPart, Shard, Sharding};

/// Longest shard that is read (bytes): hundreds of times one of ten minutes, and it is held in memory.
const LONGEST: u64 = 1 << 30;

/// Line around the digest of a shard. No part is such a line: parts have other keys.
const BEFORE: &str = "{\"sha256\":\"";
const AFTER: &str = "\"}\n";
/// Digits of a SHA-256.
const DIGITS: usize = 64;

/// First line of a shard.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Header {
    pub plan: String,
    pub shard: u64,
    pub first: u64,
    pub end: u64,
    /// Processor and vector instructions that made it: see [`vector_instructions`](metalith_core::vector_instructions).
    pub instructions: String,
}

/// State of the file of a shard.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum ShardState {
    /// A shard of this plan at its place: its text without the digest, and the instructions that it was made with.
    Whole {
        text: String,
        instructions: String,
    },
    Absent,
    /// The file ends before its digest, or has none.
    Truncated,
    /// The digest is another.
    Damaged,
    /// Files of these parts are damaged or missing.
    PartsDamaged(Vec<u64>),
    /// A file that is no shard of this plan with this number: identity of the refusal, and what it is.
    Foreign(&'static str, String),
}

/// The digest line of a text.
pub(crate) fn digest_line(text: &str) -> String {
    format!("{BEFORE}{}{AFTER}", hex(&Sha256::digest(text)))
}

/// Numbers of the parts of a shard whose files are not what their lines state.
fn damaged_parts(plan: &Sharding, text: &str, files_of: FilesOfPart) -> Vec<u64> {
    let is = |(name, digest): &(String, String)| {
        file_digest(&plan.folder.join(name)).is_ok_and(|found| hex(&found) == *digest)
    };
    let mut lines = text.lines();
    let header = lines.next().and_then(|line| serde_json::from_str::<Header>(line).ok());
    let numbers = header.map_or(0..0, |header| header.first..header.end);
    let damaged = |line: &str| !files_of(line).is_some_and(|files| files.iter().all(is));
    let all = numbers.zip(lines);
    all.filter(|(_, line)| damaged(line))
        .map(|(number, _)| number)
        .collect()
}

/// Length of the text before the line of its digest, and whether the digest is right; none without such a line.
pub(crate) fn split(bytes: &[u8], before: &str, after: &str) -> Option<(usize, bool)> {
    let at = bytes.len().checked_sub(before.len() + DIGITS + after.len())?;
    let (text, line) = bytes.split_at(at);
    let digits = line.strip_prefix(before.as_bytes())?.strip_suffix(after.as_bytes())?;
    Some((at, hex(&Sha256::digest(text)).as_bytes() == digits))
}

impl ShardState {
    /// State of the file at a path; `place` is the shard that should be there, none for a file of another name.
    ///
    /// # Errors
    /// If the file is there and cannot be read.
    pub(crate) fn of(plan: &Sharding, path: &Path, place: Option<Shard>) -> Result<Self> {
        let found = match fs::symlink_metadata(path) {
            Ok(found) => found,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Self::Absent),
            Err(error) => return Err(Error::io("read", path)(error)),
        };
        let no_shard = |why: &str| Ok(Self::Foreign("study/not-a-shard", why.into()));
        if !found.is_file() {
            return no_shard("is not an ordinary file");
        }
        if found.len() > LONGEST {
            return no_shard("is longer than any shard");
        }
        let bytes = read_at_most(path, LONGEST, "a shard")?;
        let state = Self::of_bytes(plan, bytes, place);
        match (&state, plan.files_of) {
            (Self::Whole { text, .. }, Some(files_of)) => {
                let damaged = damaged_parts(plan, text, files_of);
                Ok(if damaged.is_empty() {
                    state
                } else {
                    Self::PartsDamaged(damaged)
                })
            }
            _ => Ok(state),
        }
    }

    fn of_bytes(plan: &Sharding, mut bytes: Vec<u8>, place: Option<Shard>) -> Self {
        let Some((length, is_right)) = split(&bytes, BEFORE, AFTER) else {
            return Self::without_digest(plan, &bytes);
        };
        bytes.truncate(length);
        let Some(text) = String::from_utf8(bytes).ok().filter(|_| is_right) else {
            return Self::Damaged;
        };
        let first_line = text.lines().next().unwrap_or_default();
        let Ok(header) = serde_json::from_str::<Header>(first_line) else {
            return Self::Foreign("study/not-a-shard", "is no shard of a plan".into());
        };
        if header.plan != plan.key {
            return Self::of_another_plan();
        }
        let instructions = header.instructions.clone();
        let own = place.map(|shard| plan.header(shard, &instructions));
        if own.as_ref() != Some(&header) {
            let last = header.end.saturating_sub(1);
            return Self::Foreign(
                "study/shard-range-differs",
                format!(
                    "holds {}s {} to {last} as shard {}, of a plan that was cut otherwise or under another name",
                    plan.part, header.first, header.shard
                ),
            );
        }
        // One line is the header.
        let lines = text.bytes().filter(|byte| *byte == b'\n').count() as u64;
        if lines != 1 + header.end - header.first {
            return Self::Damaged;
        }
        Self::Whole { text, instructions }
    }

    /// State of a file that does not end in a digest: a part of a shard, or something else.
    fn without_digest(plan: &Sharding, bytes: &[u8]) -> Self {
        let begin = b"{\"plan\":\"";
        let common = bytes.len().min(begin.len());
        if bytes[..common] != begin[..common] {
            return Self::Foreign("study/not-a-shard", "is no shard of a plan".into());
        }
        let first_line = bytes.split(|byte| *byte == b'\n').next().unwrap_or_default();
        match serde_json::from_slice::<Header>(first_line) {
            Ok(header) if header.plan != plan.key => Self::of_another_plan(),
            _ => Self::Truncated,
        }
    }

    fn of_another_plan() -> Self {
        Self::Foreign("study/shard-of-another-plan", "is a part of another plan".into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(folder: &Path) -> Sharding {
        Sharding {
            key: "ab".repeat(32),
            part: "draw",
            parts: 5,
            per_shard: 2,
            folder: folder.to_owned(),
            files_of: None,
        }
    }

    fn text(plan: &Sharding, number: u64) -> String {
        let header = plan.header(plan.shard(number).unwrap(), "x86_64 avx2");
        let text = format!(
            "{}\n{{\"draw\":0}}\n{{\"draw\":1}}\n",
            serde_json::to_string(&header).unwrap()
        );
        text.clone() + &digest_line(&text)
    }

    /// Every bit that flips, and every place where the file may end, is noticed.
    #[test]
    fn a_shard_is_whole_only_as_it_was_written() {
        let plan = plan(Path::new("s"));
        let own = text(&plan, 0);
        let shard = plan.shard(0).ok();
        let of = |bytes: &[u8]| ShardState::of_bytes(&plan, bytes.to_vec(), shard);
        assert!(matches!(of(own.as_bytes()), ShardState::Whole { .. }));
        for at in 0..own.len() {
            assert_eq!(of(&own.as_bytes()[..at]), ShardState::Truncated, "{at}");
            for bit in 0..8 {
                let mut bytes = own.clone().into_bytes();
                bytes[at] ^= 1 << bit;
                assert!(
                    !matches!(of(&bytes), ShardState::Whole { .. }),
                    "bit {bit} of byte {at}"
                );
            }
        }
    }

    #[test]
    fn a_file_of_another_plan_or_place_is_told_from_a_damaged_one() {
        let plan = plan(Path::new("s"));
        let id = |text: &str, place: u64| match ShardState::of_bytes(&plan, text.into(), plan.shard(place).ok()) {
            ShardState::Foreign(id, _) => id,
            other => panic!("{other:?}"),
        };
        let mut other = plan.clone();
        other.key = "cd".repeat(32);
        assert_eq!(id(&text(&other, 0), 0), "study/shard-of-another-plan");
        let old = text(&other, 0).lines().next().unwrap().to_owned() + "\n";
        assert_eq!(id(&old, 0), "study/shard-of-another-plan");
        assert_eq!(id(&text(&plan, 0), 1), "study/shard-range-differs");
        assert_eq!(id("a letter\n", 0), "study/not-a-shard");
        let letter = "a letter\n".to_owned();
        assert_eq!(id(&(letter.clone() + &digest_line(&letter)), 0), "study/not-a-shard");
        let short = text(&plan, 2);
        assert_eq!(
            ShardState::of_bytes(&plan, short.into(), plan.shard(2).ok()),
            ShardState::Damaged,
            "two lines for one draw"
        );
    }

    #[cfg(unix)]
    #[test]
    fn links_folders_and_devices_are_no_shards() {
        let folder = tempfile::tempdir().unwrap();
        let plan = plan(folder.path());
        let at = |name: &str| folder.path().join(name);
        fs::write(at("whole"), text(&plan, 0)).unwrap();
        std::os::unix::fs::symlink(at("whole"), at("link")).unwrap();
        let of = |path: &Path| ShardState::of(&plan, path, plan.shard(0).ok()).unwrap();
        assert!(matches!(of(&at("whole")), ShardState::Whole { .. }));
        assert_eq!(of(&at("none")), ShardState::Absent);
        for other in [&at("link"), folder.path(), Path::new("/dev/zero")] {
            assert!(
                matches!(of(other), ShardState::Foreign("study/not-a-shard", _)),
                "{other:?}"
            );
        }
    }
}
