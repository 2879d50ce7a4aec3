//! Work that is cut into shards: files with a line for each part, whole or not there.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

use metalith_core::{AtomicFile, Error, Progress, Result};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// Folder of the shards within that of the plan.
const FOLDER: &str = "shards";

/// Time that a shard shall take (s): long enough for a queue to be worth it, short enough to lose one.
const SHARD_SECONDS: f64 = 600.0;

/// Work of many parts, each known by its number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sharding {
    /// SHA-256 of all that decides the answers, in hexadecimal.
    pub key: String,
    /// Name of a part.
    pub part: &'static str,
    pub parts: u64,
    pub per_shard: u64,
    /// Folder of the plan.
    pub folder: PathBuf,
}

/// Some of the parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shard {
    pub number: u64,
    /// Parts: from the first up to the one before `end`.
    pub first: u64,
    pub end: u64,
}

/// First line of a shard.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    plan: String,
    shard: u64,
    first: u64,
    end: u64,
}

/// Progress of the work.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Status {
    pub shards: u64,
    /// Draws of a study, pairs of a set for learning.
    pub parts: u64,
    pub finished: u64,
    /// Numbers of the shards that are not there.
    pub missing: Vec<u64>,
    /// Files that cannot be used, with the reason.
    pub unusable: Vec<(PathBuf, String)>,
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

    /// Path where a shard is, or will be.
    pub fn path(&self, number: u64) -> PathBuf {
        self.folder.join(FOLDER).join(format!("{number:06}.jsonl"))
    }

    fn header(&self, shard: Shard) -> Header {
        Header {
            plan: self.key.clone(),
            shard: shard.number,
            first: shard.first,
            end: shard.end,
        }
    }

    /// Make one shard, if it is not there: a line for each of its parts.
    ///
    /// # Errors
    /// Those of `part`; if the file cannot be written or is of another plan.
    pub fn make<T: Serialize>(
        &self,
        number: u64,
        part: &dyn Fn(u64) -> Result<T>,
        progress: &dyn Progress,
    ) -> Result<()> {
        let shard = self.shard(number)?;
        if self.finished(number)? {
            return Ok(());
        }
        let path = self.path(number);
        let mut file = AtomicFile::create(&path)?;
        let mut text = line(&self.header(shard));
        progress.begin(&format!("shard {number}"), shard.end - shard.first);
        for k in shard.first..shard.end {
            progress.check_stopped()?;
            text.push_str(&line(&part(k)?));
            progress.advance(1);
        }
        file.write_all(text.as_bytes()).map_err(Error::io("write", &path))?;
        file.commit()
    }

    /// True if a shard is there; no more than its first line is read.
    ///
    /// # Errors
    /// If what is there belongs to another plan, or is no shard.
    pub fn finished(&self, number: u64) -> Result<bool> {
        let shard = self.shard(number)?;
        let path = self.path(number);
        let file = match fs::File::open(&path) {
            Ok(file) => file,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(false),
            Err(error) => return Err(Error::io("read", &path)(error)),
        };
        let mut first = String::new();
        BufReader::new(file)
            .read_line(&mut first)
            .map_err(Error::io("read", &path))?;
        match self.refusal(shard, &first) {
            None => Ok(true),
            Some((id, why)) => Err(refused(id, &path, &why)),
        }
    }

    /// The header in the first line of a shard of this plan, or why it is none, with the identity of the refusal.
    fn own_header(&self, first_line: &str) -> std::result::Result<Header, (&'static str, &'static str)> {
        match serde_json::from_str::<Header>(first_line) {
            Err(_) => Err(("study/not-a-shard", "is no shard of a plan")),
            Ok(header) if header.plan != self.key => Err(("study/shard-of-another-plan", "is a part of another plan")),
            Ok(header) => Ok(header),
        }
    }

    /// Identity and text of the refusal of a file with this first line as that shard.
    fn refusal(&self, shard: Shard, first_line: &str) -> Option<(&'static str, String)> {
        match self.own_header(first_line) {
            Err((id, why)) => Some((id, why.into())),
            Ok(header) if header != self.header(shard) => Some((
                "study/shard-range-differs",
                format!(
                    "holds {}s {} to {} as shard {}, of a plan that was cut otherwise",
                    self.part,
                    header.first,
                    header.end.saturating_sub(1),
                    header.shard
                ),
            )),
            Ok(_) => None,
        }
    }

    /// Progress of the work.
    ///
    /// # Errors
    /// If its folder cannot be read.
    pub fn status(&self) -> Result<Status> {
        let mut status = Status {
            shards: self.shards(),
            parts: self.parts,
            finished: 0,
            missing: Vec::new(),
            unusable: Vec::new(),
        };
        for number in 0..self.shards() {
            match self.finished(number) {
                Ok(true) => status.finished += 1,
                Ok(false) => status.missing.push(number),
                Err(error) => {
                    status.missing.push(number);
                    status.unusable.push((self.path(number), error.to_string()));
                }
            }
        }
        Ok(status)
    }

    /// All parts, each once, in the order of their numbers; `number` is what a part says of itself, if it does.
    ///
    /// # Errors
    /// If parts are missing or there twice, all named; if a shard is of another plan.
    pub fn whole<T: DeserializeOwned>(&self, number: &dyn Fn(&T) -> Option<u64>) -> Result<Vec<T>> {
        let folder = self.folder.join(FOLDER);
        let files = files(&folder)?;
        let mut found: Vec<Option<(T, usize)>> = Vec::new();
        found.resize_with(self.parts as usize, || None);
        let mut twice = Vec::new();
        for (file, path) in files.iter().enumerate() {
            for (k, part) in self.read(path, number)? {
                let Some(place) = found.get_mut(k as usize) else {
                    return Err(Error::refused(
                        "study/unknown-draw",
                        format!(
                            "{} holds {} {k}, and the plan has {}",
                            path.display(),
                            self.part,
                            self.parts
                        ),
                        "remove the file",
                    ));
                };
                match place {
                    Some((_, other)) => twice.push((k, *other, file)),
                    None => *place = Some((part, file)),
                }
            }
        }
        if let Some((k, a, b)) = twice.first() {
            return Err(Error::refused(
                "study/draws-twice",
                format!(
                    "{} {}s exist twice, the first is {k}: in {} and in {}",
                    twice.len(),
                    self.part,
                    files[*a].display(),
                    files[*b].display()
                ),
                "remove one of the two files",
            ));
        }
        let missing: Vec<u64> = (0..self.parts).filter(|k| found[*k as usize].is_none()).collect();
        if !missing.is_empty() {
            return Err(Error::refused(
                "study/draws-missing",
                format!(
                    "{} of {} {}s are missing in {}: {}",
                    missing.len(),
                    self.parts,
                    self.part,
                    folder.display(),
                    ranges(&missing)
                ),
                "make them with `metalith study run FOLDER --missing`",
            ));
        }
        Ok(found.into_iter().flatten().map(|(part, _)| part).collect())
    }

    /// The parts of one file, whatever its name, with their numbers.
    fn read<T: DeserializeOwned>(&self, path: &Path, number: &dyn Fn(&T) -> Option<u64>) -> Result<Vec<(u64, T)>> {
        let text = fs::read_to_string(path).map_err(Error::io("read", path))?;
        let mut lines = text.lines();
        let first_line = lines.next().unwrap_or_default();
        let header = self
            .own_header(first_line)
            .map_err(|(id, why)| refused(id, path, why))?;
        let mut parts = Vec::new();
        for (k, line) in lines.enumerate() {
            let part: T = serde_json::from_str(line).map_err(|e| {
                let what = format!("this is no {}: {e}", self.part);
                Error::table(path, Some(k + 2), what, "remove the file; its shard is then made again")
            })?;
            parts.push((header.first + k as u64, part));
        }
        let told = parts.iter().all(|(k, part)| number(part).is_none_or(|own| own == *k));
        if !told || parts.len() as u64 != header.end.saturating_sub(header.first) {
            return Err(refused(
                "study/shard-incomplete",
                path,
                &format!("does not hold the {}s that its first line names", self.part),
            ));
        }
        Ok(parts)
    }
}

fn line(value: &impl Serialize) -> String {
    let mut text = serde_json::to_string(value).expect("plain data serialises");
    text.push('\n');
    text
}

fn refused(id: &'static str, path: &Path, why: &str) -> Error {
    Error::refused(
        id,
        format!("{} {why}", path.display()),
        "remove the file if it came here by mistake; its shard is then made again",
    )
}

/// Files of shards, by name.
fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(Error::io("read", folder)(error)),
    };
    let mut files = Vec::new();
    for entry in entries {
        let path = entry.map_err(Error::io("read", folder))?.path();
        let name = path
            .file_name()
            .map(|n| n.to_string_lossy().into_owned())
            .unwrap_or_default();
        // Hidden ones are being written, or were left by a run that was killed.
        if name.ends_with(".jsonl") && !name.starts_with('.') {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
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
