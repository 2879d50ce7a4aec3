//! Job scripts of what is missing: Slurm does the scheduling, this writes what it is given.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use metalith_core::document::{Document, KeyTable, Section, explore, load};
use metalith_core::file::read_at_most;
use metalith_core::text::hex;
use metalith_core::{AtomicFile, Error, Result};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::manifest::absolute;
use crate::sharding::Sharding;
use crate::shell::quoted;

/// Folder of the scripts, lists and logs within that of the plan.
const FOLDER: &str = "slurm";
/// Beginning of the names of all jobs; the digest of what they do follows.
pub const JOB_NAME: &str = "metalith-";
/// Digits of a digest in names of jobs and files: two lists with the same sixteen are not met.
const DIGITS: usize = 16;
/// Longest list of shards and longest record of submissions (bytes).
const LONGEST: u64 = 1 << 28;

/// Requirements of the jobs of a cluster.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Slurm {
    /// Command of the program as the nodes see it, in words of the shell.
    pub program: String,
    pub partition: Option<String>,
    pub account: Option<String>,
    /// Time limit as `--time` takes it.
    pub time: String,
    pub cpus_per_task: u64,
    pub memory_mb: Option<u64>,
    /// `MaxArraySize` of the cluster: indices of an array are below it.
    pub max_array_size: u64,
    /// Most tasks of an array that run at the same time.
    pub throttle: Option<u64>,
    /// Lines of shell before the program is started.
    pub preamble: Vec<String>,
    /// Further lines for `#SBATCH`.
    pub options: Vec<String>,
}

/// One job to submit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Job {
    /// Name in the queue, from the digest of what the job does.
    pub name: String,
    /// The job script.
    pub script: PathBuf,
    /// Path of the log, as `--output` takes it.
    pub log: String,
    /// Shards that it makes, by the index of their task; none if it is no array.
    pub shards: Vec<u64>,
}

/// Tasks in a queue: names of jobs with the index of a task, if it is an array.
pub type Queued = BTreeSet<(String, Option<u64>)>;

/// One line of the record of submissions.
#[derive(Serialize, Deserialize)]
struct Submitted {
    job: String,
    name: String,
}

impl Default for Slurm {
    fn default() -> Self {
        Self {
            program: "metalith".into(),
            partition: None,
            account: None,
            time: "01:00:00".into(),
            cpus_per_task: 1,
            memory_mb: None,
            max_array_size: 1001,
            throttle: None,
            preamble: Vec::new(),
            options: Vec::new(),
        }
    }
}

impl Slurm {
    /// Read the file at `path`.
    ///
    /// # Errors
    /// Every mistake of the file at once, each with line, column and remedy.
    pub fn read(path: &Path) -> Result<Self> {
        let text = load(path)?;
        Document::read(path, &text, Self::section)
    }

    /// The keys of such a file.
    pub fn keys() -> KeyTable {
        explore(&[], |root, _| Self::section(root))
    }

    fn section(s: &Section<'_, '_>) -> Self {
        let whole = |key: &str, most: i64, unit| s.optional_integer(key, 1..=most, unit).map(|v| v as u64);
        let whole_or = |key, most, unit, default: u64| s.integer_or(key, 1..=most, unit, default as i64) as u64;
        // A line break would begin a line of shell.
        let line = |key: &str, text: &str| {
            if text.contains(char::is_control) {
                s.fault(key, "line break or control character", "give one line for each text");
            }
        };
        let text = |key: &str| {
            let found = s.optional_text(key);
            found.iter().for_each(|text| line(key, text));
            found
        };
        let text_or = |key: &str, default: &str| {
            let found = s.text_or(key, default);
            line(key, &found);
            found
        };
        let texts = |key: &str| {
            let found = s.texts(key);
            found.iter().for_each(|text| line(key, text));
            found
        };
        let default = Self::default();
        Self {
            program: text_or("program", &default.program),
            partition: text("partition"),
            account: text("account"),
            time: text_or("time", &default.time),
            cpus_per_task: whole_or("cpus_per_task", 1024, "threads", default.cpus_per_task),
            memory_mb: whole("memory_mb", 1 << 24, "MB"),
            max_array_size: whole_or("max_array_size", 1 << 24, "", default.max_array_size),
            throttle: whole("throttle", 1 << 24, "tasks"),
            preamble: texts("preamble"),
            options: texts("options"),
        }
    }

    /// Write the job scripts that make some shards of a plan, each an array below `max_array_size`. A task takes the number
    /// of its shard from a list beside the script, whose name is its digest: a list that queued tasks will read is never
    /// another one.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn arrays(&self, plan: &Sharding, shards: &[u64]) -> Result<Vec<Job>> {
        let folder = absolute(&plan.folder)?;
        // Indices run from zero to below the size.
        let chunks = shards.chunks(self.max_array_size as usize);
        let array = |chunk: &[u64]| {
            let numbers: String = chunk.iter().map(|n| format!("{n}\n")).collect();
            let name = name_of(&folder, "array", &numbers);
            let list = list_of(&folder, &name);
            AtomicFile::write(&list, numbers.as_bytes())?;
            let throttle = self.throttle.map_or_else(String::new, |most| format!("%{most}"));
            let range = format!("--array=0-{}{throttle}", chunk.len() - 1);
            let line = format!(
                "shard=$(sed -n \"$((SLURM_ARRAY_TASK_ID + 1))p\" {})\nexec {}",
                quoted(&list),
                self.shard_command(&folder, "\"$shard\"")
            );
            self.job(&folder, name, Some(range), &line, chunk.to_vec())
        };
        chunks.map(array).collect()
    }

    /// Command that makes one shard of the plan in a folder.
    ///
    /// # Errors
    /// If the folder of the plan has no absolute path.
    pub fn command(&self, plan: &Sharding, shard: u64) -> Result<String> {
        Ok(self.shard_command(&absolute(&plan.folder)?, &shard.to_string()))
    }

    fn shard_command(&self, folder: &Path, shard: &str) -> String {
        format!(
            "{} study run {} --shard {shard} --threads {} --quiet",
            self.program,
            quoted(folder),
            self.cpus_per_task
        )
    }

    /// Write the job script that plans a study into a folder: layout and tables of cells.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn plan_job(&self, tolerance: &Path, folder: &Path, draws_per_shard: u64) -> Result<Job> {
        let folder = absolute(folder)?;
        let line = format!(
            "exec {} study plan {} --out {} --draws-per-shard {draws_per_shard} --threads {} --quiet",
            self.program,
            quoted(&absolute(tolerance)?),
            quoted(&folder),
            self.cpus_per_task
        );
        self.job(&folder, name_of(&folder, "plan", ""), None, &line, Vec::new())
    }

    /// Write the job script that merges all shards of the plan in a folder.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn merge_job(&self, folder: &Path) -> Result<Job> {
        let folder = absolute(folder)?;
        let line = format!(
            "exec {} study merge {} --threads {} --quiet",
            self.program,
            quoted(&folder),
            self.cpus_per_task
        );
        self.job(&folder, name_of(&folder, "merge", ""), None, &line, Vec::new())
    }

    fn job(&self, folder: &Path, name: String, array: Option<String>, line: &str, shards: Vec<u64>) -> Result<Job> {
        let mut text = String::from("#!/bin/bash\n");
        let mut option = |line: &str| _ = writeln!(text, "#SBATCH {line}");
        option(&format!("--job-name={name}"));
        array.iter().for_each(|array| option(array));
        option(&format!("--cpus-per-task={}", self.cpus_per_task));
        option(&format!("--time={}", self.time));
        // A job whose shards fail never begins: it shall not stand in the queue for ever.
        option("--kill-on-invalid-dep=yes");
        for (key, value) in [("partition", &self.partition), ("account", &self.account)] {
            value.iter().for_each(|value| option(&format!("--{key}={value}")));
        }
        self.memory_mb.iter().for_each(|mb| option(&format!("--mem={mb}M")));
        self.options.iter().for_each(|line| option(line));
        self.preamble.iter().for_each(|line| _ = writeln!(text, "{line}"));
        // Behind the preamble: scripts of clusters read variables that are not set.
        let _ = writeln!(text, "set -euo pipefail\n{line}");
        let script = folder.join(FOLDER).join(format!("{name}.sh"));
        AtomicFile::write(&script, text.as_bytes())?;
        let task = if array.is_some() { "%A_%a.log" } else { "%j.log" };
        // Slurm reads a per cent sign as the beginning of a pattern.
        let logs = folder.join(FOLDER).display().to_string().replace('%', "%%");
        Ok(Job {
            name,
            script,
            log: format!("{logs}/{task}"),
            shards,
        })
    }
}

impl Job {
    /// Arguments of `sbatch`; the job begins when all of `after` have ended well.
    pub fn arguments(&self, after: &[String]) -> Vec<std::ffi::OsString> {
        let mut all = vec!["--parsable".into(), format!("--output={}", self.log).into()];
        if !after.is_empty() {
            all.push(format!("--dependency=afterok:{}", after.join(":")).into());
        }
        all.push(self.script.clone().into());
        all
    }

    /// The same as one line of shell.
    pub fn line(&self, after: &[String]) -> String {
        let log = quoted(Path::new(&format!("--output={}", self.log)));
        let after = match after {
            [] => String::new(),
            ids => format!("--dependency=afterok:{} ", ids.join(":")),
        };
        format!("sbatch --parsable {log} {after}{}", quoted(&self.script))
    }

    /// Keep in the folder of a plan that the job was submitted with this number.
    ///
    /// # Errors
    /// If the record cannot be written.
    pub fn record(&self, folder: &Path, job: &str) -> Result<()> {
        let path = folder.join(FOLDER).join(RECORD);
        let line = Submitted {
            job: job.into(),
            name: self.name.clone(),
        };
        let mut text = record(&path)?;
        let _ = writeln!(text, "{}", serde_json::to_string(&line).expect("plain data serialises"));
        AtomicFile::write(&path, text.as_bytes())
    }
}

/// Name of the record of submissions.
const RECORD: &str = "submitted.jsonl";

fn record(path: &Path) -> Result<String> {
    if fs::symlink_metadata(path).is_err() {
        return Ok(String::new());
    }
    let bytes = read_at_most(path, LONGEST, "the record of submissions")?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// Jobs that were submitted from the folder of a plan: their names, with their numbers.
///
/// # Errors
/// If the record cannot be read.
pub fn submitted(folder: &Path) -> Result<Vec<(String, String)>> {
    let path = folder.join(FOLDER).join(RECORD);
    let line = |(k, text): (usize, &str)| match serde_json::from_str::<Submitted>(text) {
        Ok(line) => Ok((line.name, line.job)),
        Err(error) => Err(Error::table(
            &path,
            Some(k + 1),
            error.to_string(),
            "remove the file when no job of this folder is queued",
        )),
    };
    record(&path)?.lines().enumerate().map(line).collect()
}

/// Shards of a plan that tasks in a queue make. A task without an index stands for all of its array.
///
/// # Errors
/// If a list of shards cannot be read.
pub fn queued_shards(folder: &Path, queued: &Queued) -> Result<BTreeSet<u64>> {
    let folder = absolute(folder)?;
    let mut shards = BTreeSet::new();
    for name in queued.iter().map(|(name, _)| name).collect::<BTreeSet<_>>() {
        let list = list_of(&folder, name);
        // Jobs of other folders have their lists there.
        if !list.is_file() {
            continue;
        }
        let text = String::from_utf8_lossy(&read_at_most(&list, LONGEST, "a list of shards")?).into_owned();
        let is_queued = |k: u64| [None, Some(k)].into_iter().any(|k| queued.contains(&(name.clone(), k)));
        let own = text.lines().zip(0..).filter(|(_, k)| is_queued(*k));
        shards.extend(own.filter_map(|(number, _)| number.parse::<u64>().ok()));
    }
    Ok(shards)
}

/// Name of a job of a folder, by the digest of what it does.
fn name_of(folder: &Path, kind: &str, what: &str) -> String {
    let mut hash = Sha256::new();
    hash.update(folder.as_os_str().as_encoded_bytes());
    hash.update(format!("\0{kind}\0{what}"));
    format!("{JOB_NAME}{}", &hex(&hash.finalize())[..DIGITS])
}

fn list_of(folder: &Path, name: &str) -> PathBuf {
    folder.join(FOLDER).join(format!("{name}.txt"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::Layout;
    use crate::plan::test_plan;

    fn slurm(text: &str) -> Result<Slurm> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("slurm.toml");
        fs::write(&file, text).unwrap();
        Slurm::read(&file)
    }

    fn plan(folder: &Path) -> Sharding {
        test_plan(folder, Layout::Written("layout.gds".into()), 5000, 1).cut()
    }

    #[test]
    fn arrays_stay_below_the_size_and_make_the_shards_of_their_lists() {
        let folder = tempfile::tempdir().unwrap();
        let plan = plan(&folder.path().join("it's 100 %\nSBATCH"));
        let slurm = slurm(
            "partition = \"cpu\"\ncpus_per_task = 4\nmax_array_size = 1001\nthrottle = 20\n\
             preamble = [\"module load x\", \"export A=1\"]\n",
        );
        let slurm = slurm.unwrap();
        let missing: Vec<u64> = (0..5000).filter(|k| k % 2 == 1).collect();
        let all = slurm.arrays(&plan, &missing).unwrap();
        assert_eq!(
            all.iter().map(|s| s.shards.len()).collect::<Vec<_>>(),
            [1001, 1001, 498]
        );
        let script = fs::read_to_string(&all[2].script).unwrap();
        for line in [
            "#SBATCH --array=0-497%20\n",
            "#SBATCH --partition=cpu\n",
            "#SBATCH --cpus-per-task=4\n",
            "\nmodule load x\nexport A=1\nset -euo pipefail\nshard=$(",
            "it\\'s 100 %\\012SBATCH' --shard \"$shard\" --threads 4",
        ] {
            assert!(script.contains(line), "{line} is not in {script}");
        }
        assert!(all[2].log.contains("100 %%\n") && all[2].log.ends_with("/%A_%a.log"));
        let list = fs::read_to_string(all[1].script.with_extension("txt")).unwrap();
        assert_eq!(list.lines().next(), Some("2003"));
        let line = all[0].line(&["7".into(), "8".into()]);
        assert!(
            line.contains("--dependency=afterok:7:8 ") && !line.contains('\n'),
            "{line}"
        );
    }

    /// A list that tasks in the queue read stays as it is, and its shards are known.
    #[test]
    fn what_is_queued_is_known_by_the_digest_of_its_list() {
        let folder = tempfile::tempdir().unwrap();
        let (here, there) = (plan(&folder.path().join("a")), plan(&folder.path().join("b")));
        let slurm = slurm("").unwrap();
        let first = slurm.arrays(&here, &[3, 5, 9]).unwrap().remove(0);
        let second = slurm.arrays(&here, &[5, 9]).unwrap().remove(0);
        let other = slurm.arrays(&there, &[3, 5, 9]).unwrap().remove(0);
        assert_eq!(slurm.arrays(&here, &[3, 5, 9]).unwrap()[0], first);
        assert!(first.name != second.name && first.name != other.name);
        let queued: Queued = [
            (first.name.clone(), Some(0)),
            (first.name.clone(), Some(2)),
            (other.name, None),
        ]
        .into();
        let shards = queued_shards(&here.folder, &queued).unwrap();
        assert_eq!(shards.into_iter().collect::<Vec<_>>(), [3, 9]);
        assert_eq!(queued_shards(&there.folder, &queued).unwrap().len(), 3);
        assert_eq!(submitted(&here.folder).unwrap(), []);
        first.record(&here.folder, "17").unwrap();
        second.record(&here.folder, "18").unwrap();
        let pair = |name: &str, job: &str| (name.to_owned(), job.to_owned());
        assert_eq!(
            submitted(&here.folder).unwrap(),
            [pair(&first.name, "17"), pair(&second.name, "18")]
        );
    }

    #[test]
    fn settings_are_single_lines() {
        let ids = slurm("cpus_per_task = 0\npartitio = \"cpu\"\n").unwrap_err().ids();
        assert_eq!(ids, ["cpus_per_task/out-of-range", "partitio/unknown"]);
        let broken = "partition = \"cpu\\nrm -r x\"\noptions = [\"--nice=1\", \"a\\nb\"]\n";
        assert_eq!(slurm(broken).unwrap_err().ids().len(), 2);
    }
}
