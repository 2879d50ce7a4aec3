//! State of all shards of a plan: what is there, and what has to be made again.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use metalith_core::{Error, Progress, Result};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::shard_file::ShardState;
use crate::sharding::{Shard, Sharding, ranges};

/// Most files that a refusal names.
const MOST_NAMED: usize = 20;

/// Progress of the work.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Status {
    pub shards: u64,
    /// Draws of a study, pairs of a set for learning.
    pub parts: u64,
    pub finished: u64,
    /// Numbers of the shards that are not there whole.
    pub missing: Vec<u64>,
    /// Files of shards that were cut or changed, with the reason. They count as missing: a run makes them again.
    pub damaged: Vec<(PathBuf, String)>,
    /// Files that cannot be used and that no run replaces, with the reason.
    pub unusable: Vec<(PathBuf, String)>,
    /// Shards by the processor and vector instructions that made them.
    pub instructions: BTreeMap<String, u64>,
    /// Identity of the refusal of the first of the files that cannot be used.
    #[serde(skip)]
    refused_as: Option<&'static str>,
}

impl Sharding {
    /// Progress of the work. All shards are read, and their digests compared.
    ///
    /// # Errors
    /// If their folder cannot be read.
    pub fn status(&self) -> Result<Status> {
        self.survey(&mut |_, _, _| Ok(()))
    }

    /// All parts, each once, in the order of their numbers; `number` is what a part says of itself, if it does. `progress` is warned
    /// of shards from several kinds of processors.
    ///
    /// # Errors
    /// If shards are missing, damaged or of another plan, all named.
    pub fn whole<T: DeserializeOwned>(
        &self,
        number: &dyn Fn(&T) -> Option<u64>,
        progress: &dyn Progress,
    ) -> Result<Vec<T>> {
        let mut parts = Vec::new();
        let found = self.survey(&mut |shard, path, text| {
            for (k, line) in text.lines().skip(1).enumerate() {
                let fault = |what: String| {
                    let remedy = "remove the file; its shard is then made again";
                    Err(Error::table(path, Some(k + 2), what, remedy))
                };
                let own = shard.first + k as u64;
                match serde_json::from_str::<T>(line) {
                    Ok(part) if number(&part).is_none_or(|told| told == own) => parts.push(part),
                    Ok(_) => return fault(format!("this is not {} {own}", self.part)),
                    Err(error) => return fault(format!("this is no {}: {error}", self.part)),
                }
            }
            Ok(())
        })?;
        if let Some(error) = self.refusal(&found) {
            return Err(error);
        }
        if let Some(words) = found.of_several_processors() {
            progress.warn(&words);
        }
        Ok(parts)
    }

    /// Progress of the work; the text of each shard that is whole is given to `whole`, in the order of their numbers.
    fn survey(&self, whole: &mut dyn FnMut(Shard, &Path, &str) -> Result<()>) -> Result<Status> {
        let (there, others) = self.files()?;
        let mut status = Status {
            shards: self.shards(),
            parts: self.parts,
            finished: 0,
            missing: Vec::new(),
            damaged: Vec::new(),
            unusable: Vec::new(),
            instructions: BTreeMap::new(),
            refused_as: None,
        };
        for number in 0..status.shards {
            if !there.contains(&number) {
                status.missing.push(number);
                continue;
            }
            let (shard, path) = (self.shard(number)?, self.path(number));
            match ShardState::of(self, &path, Some(shard))? {
                ShardState::Whole { text, instructions } => {
                    status.finished += 1;
                    *status.instructions.entry(instructions).or_default() += 1;
                    whole(shard, &path, &text)?;
                }
                other => {
                    status.missing.push(number);
                    status.take(path, other);
                }
            }
        }
        for path in others {
            let state = ShardState::of(self, &path, None)?;
            status.take(path, state);
        }
        Ok(status)
    }

    /// Numbers of the shards whose files are there, and the files with other names.
    fn files(&self) -> Result<(BTreeSet<u64>, Vec<PathBuf>)> {
        let folder = self.shards_folder();
        let entries = match fs::read_dir(&folder) {
            Ok(entries) => entries,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Default::default()),
            Err(error) => return Err(Error::io("read", &folder)(error)),
        };
        let (mut there, mut others) = (BTreeSet::new(), Vec::new());
        for entry in entries {
            let path = entry.map_err(Error::io("read", &folder))?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            // Hidden ones are being written, or were left by a run that was killed.
            let Some(stem) = name.strip_suffix(".jsonl").filter(|stem| !stem.starts_with('.')) else {
                continue;
            };
            match stem.parse() {
                Ok(number) if number < self.shards() && self.path(number) == path => _ = there.insert(number),
                _ => others.push(path),
            }
        }
        others.sort();
        Ok((there, others))
    }

    /// Reason why the shards cannot be put together, if so.
    fn refusal(&self, found: &Status) -> Option<Error> {
        let run = "`metalith study run FOLDER --missing`";
        let folder = self.shards_folder();
        let bad: Vec<String> = found
            .damaged
            .iter()
            .chain(&found.unusable)
            .map(|(path, why)| format!("{} {why}", path.file_name().unwrap_or_default().to_string_lossy()))
            .collect();
        if bad.is_empty() {
            let of = |number: &u64| self.shard(*number).map_or(0..0, |shard| shard.first..shard.end);
            let missing: Vec<u64> = found.missing.iter().flat_map(of).collect();
            if missing.is_empty() {
                return None;
            }
            return Some(Error::refused(
                "study/draws-missing",
                format!(
                    "{} of {} {}s are missing in {}: {}",
                    missing.len(),
                    self.parts,
                    self.part,
                    folder.display(),
                    ranges(&missing)
                ),
                format!("make them with {run}"),
            ));
        }
        let more = match bad.len().saturating_sub(MOST_NAMED) {
            0 => String::new(),
            more => format!(", and {more} more"),
        };
        let named = &bad[..bad.len().min(MOST_NAMED)];
        let id = found.refused_as.unwrap_or("study/shards-damaged");
        let hint = if found.unusable.is_empty() {
            format!("make them again with {run}")
        } else {
            format!("remove files that came here by mistake; what is missing or damaged is made with {run}")
        };
        let what = format!(
            "{} files in {} cannot be used: {}{more}",
            bad.len(),
            folder.display(),
            named.join(", ")
        );
        Some(Error::refused(id, what, hint))
    }
}

impl Status {
    /// Count a file that is not a whole shard at its place.
    fn take(&mut self, path: PathBuf, state: ShardState) {
        match state {
            // Removed between the list and the look.
            ShardState::Whole { .. } | ShardState::Absent => (),
            ShardState::Truncated => self.damaged.push((path, "ends before its digest".into())),
            ShardState::Damaged => self.damaged.push((path, "is damaged: its digest differs".into())),
            ShardState::PartsDamaged(parts) => {
                let why = format!("is of files that are damaged or missing, those of {}", ranges(&parts));
                self.refused_as.get_or_insert("study/damaged-pairs");
                self.damaged.push((path, why));
            }
            ShardState::Foreign(id, why) => {
                self.refused_as.get_or_insert(id);
                self.unusable.push((path, why));
            }
        }
    }

    /// Words on shards that processors of several kinds have made, if so.
    pub fn of_several_processors(&self) -> Option<String> {
        /// Largest difference of a figure between two sets of vector instructions, as far as it was measured: with and without AVX2,
        /// figures of `mini_3x3` differ by 2e-7, and other figures have differed by this much.
        const DIFFERENCE: f64 = 3e-6;
        (self.instructions.len() > 1).then(|| {
            let of = |(name, shards): (&String, &u64)| format!("{name} ({shards})");
            format!(
                "the shards are of processors with different vector instructions: {}; figures differ by up to about {DIFFERENCE:e}, and \
                 another division among the machines gives other bytes",
                self.instructions.iter().map(of).collect::<Vec<_>>().join(", ")
            )
        })
    }

    /// Check that nothing is in the way of a run.
    ///
    /// # Errors
    /// If there are files that cannot be used and that no run replaces.
    pub fn check_usable(&self) -> Result<()> {
        match self.unusable.first() {
            None => Ok(()),
            Some((path, why)) => Err(Error::refused(
                "study/shard-unusable",
                format!(
                    "{} files of shards cannot be used, the first is {}: it {why}",
                    self.unusable.len(),
                    path.display()
                ),
                "remove them, then run again",
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_core::Silent;
    use serde_json::{Value, json};
    use std::sync::atomic::{AtomicU64, Ordering};

    fn plan(folder: &Path, parts: u64) -> Sharding {
        Sharding {
            key: "ab".repeat(32),
            part: "draw",
            parts,
            per_shard: 2,
            folder: folder.to_owned(),
            files_of: None,
        }
    }

    fn draw(k: u64) -> Result<Value> {
        Ok(json!({ "draw": k, "figure": k as f64 / 7.0 }))
    }

    fn merged(plan: &Sharding) -> Result<Vec<Value>> {
        plan.whole(&|part: &Value| part["draw"].as_u64(), &Silent)
    }

    /// What `status` says of a file is what a merge refuses and a run makes again.
    #[test]
    fn damaged_shards_are_named_and_made_again() {
        let folder = tempfile::tempdir().unwrap();
        let plan = plan(folder.path(), 7);
        plan.make_all(&[0, 1, 2, 3], &draw, &Silent).unwrap();
        let right = merged(&plan).unwrap();
        assert_eq!(right.len(), 7);
        let own = |k: u64| fs::read(plan.path(k)).unwrap();
        let before = [0, 1, 2, 3].map(own);
        fs::write(plan.path(0), &before[0][..before[0].len() - 3]).unwrap();
        let mut flipped = before[2].clone();
        flipped[100] ^= 4;
        fs::write(plan.path(2), flipped).unwrap();
        fs::remove_file(plan.path(3)).unwrap();
        let found = plan.status().unwrap();
        assert_eq!((found.finished, &found.missing[..]), (1, &[0, 2, 3][..]));
        assert_eq!((found.damaged.len(), found.unusable.len()), (2, 0));
        let refused = merged(&plan).unwrap_err();
        assert_eq!(refused.id(), "study/shards-damaged");
        insta::assert_snapshot!(metalith_testing::without_folder(refused, folder.path()), @r"
        2 files in shards cannot be used: 000000.jsonl ends before its digest, 000002.jsonl is damaged: its digest differs
          help: make them again with `metalith study run FOLDER --missing`
        ");
        plan.make_all(&found.missing, &draw, &Silent).unwrap();
        assert_eq!([0, 1, 2, 3].map(own), before);
        assert_eq!(merged(&plan).unwrap(), right);
        // A shard under the name of another, which nothing replaces.
        fs::copy(plan.path(0), plan.path(9)).unwrap();
        fs::copy(plan.path(0), plan.path(1)).unwrap();
        let found = plan.status().unwrap();
        assert_eq!((found.unusable.len(), found.damaged.len()), (2, 0));
        assert_eq!(found.check_usable().unwrap_err().id(), "study/shard-unusable");
        assert_eq!(merged(&plan).unwrap_err().id(), "study/shard-range-differs");
        assert_eq!(plan.finished(1).unwrap_err().id(), "study/shard-range-differs");
    }

    /// Runs at the same time share the shards: each is made once, and all find them there.
    #[test]
    fn runs_at_once_take_different_shards() {
        let folder = tempfile::tempdir().unwrap();
        let plan = plan(folder.path(), 24);
        let made = AtomicU64::new(0);
        let all: Vec<u64> = (0..plan.shards()).collect();
        let run = || {
            let slow = |k| {
                made.fetch_add(1, Ordering::Relaxed);
                std::thread::sleep(std::time::Duration::from_millis(5));
                draw(k)
            };
            plan.make_all(&all, &slow, &Silent).unwrap();
            assert_eq!(plan.status().unwrap().finished, plan.shards());
        };
        std::thread::scope(|threads| (0..3).for_each(|_| _ = threads.spawn(run)));
        assert_eq!(made.into_inner(), 24);
        assert_eq!(merged(&plan).unwrap().len(), 24);
    }

    /// The shard of a run that failed is free again.
    #[test]
    fn a_shard_is_held_while_it_is_made() {
        let folder = tempfile::tempdir().unwrap();
        let plan = plan(folder.path(), 2);
        let failing = |k| {
            assert!(plan.is_held(0).unwrap());
            match k {
                0 => draw(k),
                _ => Err(Error::Interrupted),
            }
        };
        assert!(plan.make_all(&[0], &failing, &Silent).is_err());
        assert!(!plan.is_held(0).unwrap());
        assert_eq!(plan.status().unwrap().missing, [0]);
    }

    #[test]
    fn numbers_that_no_plan_has_are_refused() {
        for (parts, per_shard) in [(0, 1), (1, 0), (1 << 60, 5), (u64::MAX, u64::MAX)] {
            let plan = Sharding {
                per_shard,
                ..plan(Path::new("s"), parts)
            };
            assert_eq!(plan.check().unwrap_err().id(), "study/plan-out-of-range");
        }
    }
}
