//! Work that is cut into shards: files with a line for each part, whole or not there.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

use metalith_core::{AtomicFile, Error, Progress, Result, vector_instructions};
use serde::{Deserialize, Serialize};

use crate::manifest::MANIFEST;
use crate::shard_file::{Header, ShardState, digest_line};

/// Folder of the shards within that of the plan.
const FOLDER: &str = "shards";

/// Most parts of any work: as many as a study may have draws. Lists of all of them fit into memory.
pub(crate) const MOST_PARTS: u64 = 10_000_000;

/// Time after which a run looks again at the shards that other runs make.
const PAUSE: Duration = Duration::from_millis(200);

/// Time that a shard shall take (s): long enough for a queue to be worth it, short enough to lose one.
const SHARD_SECONDS: f64 = 600.0;

/// Work of many parts, each known by its number.
#[derive(Clone, Debug)]
pub struct Sharding {
    /// SHA-256 of all that decides the answers, in hexadecimal.
    pub key: String,
    /// Name of a part.
    pub part: &'static str,
    pub parts: u64,
    pub per_shard: u64,
    /// Folder of the plan.
    pub folder: PathBuf,
    /// Files of a part besides its line, if parts have some.
    pub files_of: Option<FilesOfPart>,
}

/// Names from the folder of the plan and SHA-256 of the files that the line of a part states; none if it is no such line.
pub type FilesOfPart = fn(&str) -> Option<Vec<(String, String)>>;

/// Some of the parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shard {
    pub number: u64,
    /// Parts: from the first up to the one before `end`.
    pub first: u64,
    pub end: u64,
}

/// Parts of a shard that takes ten minutes if one takes so many seconds, unless somebody has asked for another number.
pub(crate) fn parts_per_shard(asked: Option<u64>, seconds: f64, parts: u64) -> u64 {
    let by_time = (SHARD_SECONDS / seconds.max(1e-3)).floor().max(1.0) as u64;
    asked.unwrap_or(by_time).clamp(1, parts.max(1))
}

impl Sharding {
    /// Number of shards.
    pub fn shards(&self) -> u64 {
        self.parts.div_ceil(self.per_shard)
    }

    /// One shard.
    ///
    /// # Errors
    /// If there is none of this number.
    pub fn shard(&self, number: u64) -> Result<Shard> {
        if number >= self.shards() {
            return Err(Error::refused(
                "study/unknown-shard",
                format!("there is no shard {number}"),
                format!("this plan has shards 0 to {}", self.shards() - 1),
            ));
        }
        let first = number * self.per_shard;
        Ok(Shard {
            number,
            first,
            end: (first + self.per_shard).min(self.parts),
        })
    }

    /// Folder of the shards.
    pub fn shards_folder(&self) -> PathBuf {
        self.folder.join(FOLDER)
    }

    /// Path where a shard is, or will be.
    pub fn path(&self, number: u64) -> PathBuf {
        self.shards_folder().join(format!("{number:06}.jsonl"))
    }

    pub(crate) fn header(&self, shard: Shard, instructions: &str) -> Header {
        Header {
            plan: self.key.clone(),
            shard: shard.number,
            first: shard.first,
            end: shard.end,
            instructions: instructions.to_owned(),
        }
    }

    /// Check that the numbers of a plan are such as plans have.
    ///
    /// # Errors
    /// If it has no parts or too many, or a shard has none.
    pub(crate) fn check(&self) -> Result<()> {
        if (1..=MOST_PARTS).contains(&self.parts) && self.per_shard > 0 {
            return Ok(());
        }
        Err(Error::refused(
            "study/plan-out-of-range",
            format!(
                "{} says {} {}s, {} in a shard",
                self.folder.join(MANIFEST).display(),
                self.parts,
                self.part,
                self.per_shard
            ),
            format!("plan it again: a plan has 1 to {MOST_PARTS} {}s", self.part),
        ))
    }

    /// Make shards, those first that no other run makes at the same time; then wait for those, and make what they leave.
    ///
    /// # Errors
    /// As [`Self::make`].
    pub(crate) fn make_all<T: Serialize>(
        &self,
        shards: &[u64],
        part: &dyn Fn(u64) -> Result<T>,
        progress: &dyn Progress,
    ) -> Result<()> {
        let mut missing = shards.to_vec();
        let mut is_told = false;
        loop {
            let mut held = Vec::new();
            for number in missing {
                if !self.make(number, part, progress)? {
                    held.push(number);
                }
            }
            if held.is_empty() {
                return Ok(());
            }
            if !is_told {
                progress.begin("waiting for shards that other runs make", held.len() as u64);
                is_told = true;
            }
            progress.check_stopped()?;
            std::thread::sleep(PAUSE);
            missing = held;
        }
    }

    /// Make one shard, if it is not there whole: a line for each of its parts. False if another run makes it.
    ///
    /// # Errors
    /// Those of `part`; if the file cannot be written, or another file is in its place.
    fn make<T: Serialize>(
        &self,
        number: u64,
        part: &dyn Fn(u64) -> Result<T>,
        progress: &dyn Progress,
    ) -> Result<bool> {
        let shard = self.shard(number)?;
        if self.finished(number)? {
            return Ok(true);
        }
        let path = self.path(number);
        let Some(mut file) = claimed(&path)? else {
            return Ok(false);
        };
        // Another run may have finished it between the look and the claim.
        if self.finished(number)? {
            return Ok(true);
        }
        let mut text = line(&self.header(shard, &vector_instructions()));
        progress.begin(&format!("shard {number}"), shard.end - shard.first);
        for k in shard.first..shard.end {
            progress.check_stopped()?;
            text.push_str(&line(&part(k)?));
            progress.advance(1);
        }
        text.push_str(&digest_line(&text));
        file.write_all(text.as_bytes()).map_err(Error::io("write", &path))?;
        match file.commit() {
            // On a file system without locks: the other run writes the same parts.
            Err(error) if error.id() == "file/changed-meanwhile" => {
                if !self.finished(number)? {
                    AtomicFile::write(&path, text.as_bytes())?;
                }
                Ok(true)
            }
            other => other.map(|()| true),
        }
    }

    /// True if another run makes a shard at this moment. Without locks of the file system nobody knows.
    ///
    /// # Errors
    /// If its folder cannot be written to.
    pub fn is_held(&self, number: u64) -> Result<bool> {
        Ok(claimed(&self.path(number))?.is_none())
    }

    /// True if a shard is there whole; one that is truncated or damaged counts as missing.
    ///
    /// # Errors
    /// If what is there belongs to another plan, or is no shard.
    pub fn finished(&self, number: u64) -> Result<bool> {
        let shard = self.shard(number)?;
        let path = self.path(number);
        match ShardState::of(self, &path, Some(shard))? {
            ShardState::Whole { .. } => Ok(true),
            ShardState::Absent | ShardState::Truncated | ShardState::Damaged | ShardState::PartsDamaged(_) => Ok(false),
            ShardState::Foreign(id, why) => Err(Error::refused(
                id,
                format!("{} {why}", path.display()),
                "remove the file if it came here by mistake; its shard is then made again",
            )),
        }
    }
}

/// The unfinished file of a shard, locked; none while another run has it.
fn claimed(path: &Path) -> Result<Option<AtomicFile>> {
    match AtomicFile::create(path) {
        Ok(file) => Ok(Some(file)),
        Err(error) if error.id() == "file/busy" => Ok(None),
        Err(error) => Err(error),
    }
}

fn line(value: &impl Serialize) -> String {
    let mut text = serde_json::to_string(value).expect("plain data serialises");
    text.push('\n');
    text
}

/// Rising numbers as `0-3, 7, 9-12`, the first twenty ranges.
pub(crate) fn ranges(numbers: &[u64]) -> String {
    let mut runs: Vec<(u64, u64)> = Vec::new();
    for n in numbers {
        match runs.last_mut() {
            Some((_, end)) if *end + 1 == *n => *end = *n,
            _ => runs.push((*n, *n)),
        }
    }
    let more = runs.len() > 20;
    let words: Vec<String> = runs
        .iter()
        .take(20)
        .map(|(a, b)| if a == b { a.to_string() } else { format!("{a}-{b}") })
        .collect();
    words.join(", ") + if more { ", ..." } else { "" }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_of_numbers_are_named_by_their_ends() {
        assert_eq!(ranges(&[0, 1, 2, 5, 7, 8]), "0-2, 5, 7-8");
        assert_eq!(ranges(&[]), "");
    }

    #[test]
    fn a_shard_takes_ten_minutes_unless_it_is_asked_otherwise() {
        assert_eq!(parts_per_shard(None, 10.0, 1000), 60);
        assert_eq!(parts_per_shard(None, 1e6, 1000), 1);
        assert_eq!(parts_per_shard(None, 1.0, 40), 40);
        assert_eq!(parts_per_shard(Some(7), 1.0, 40), 7);
    }
}
