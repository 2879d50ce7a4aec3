//! `metalith study submit`: missing shards for a queue.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::Command;

use clap::Args;
use metalith::study::{
    JOB_NAME, Job, Queued, Sharding, Slurm, Tolerance, Work, is_planned, planned_later, queued_shards, submitted,
};
use metalith::{Error, Result};

use crate::cli::{Outcome, Terminal, print_line};

#[derive(Args)]
pub(super) struct SubmitArgs {
    /// Folder of the study.
    study: PathBuf,

    /// File with the settings of the jobs: program, preamble, partition, time, memory, size of arrays.
    #[arg(long, value_name = "FILE", required_unless_present = "print")]
    slurm: Option<PathBuf>,

    /// Line of shell before the program is started, such as `module load x`; may be given several times. Follows those of the
    /// file.
    #[arg(long, value_name = "LINE")]
    preamble: Vec<String>,

    /// Most tasks of an array at the same time; overrides the file.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1 << 24))]
    throttle: Option<u64>,

    /// Submit also a job that merges the study when all arrays have ended well.
    #[arg(long)]
    merge: bool,

    /// Let a first job plan this study into the folder: layout and tables are made on a node, and the arrays begin when it has
    /// ended well. Nothing of it is needed once the folder holds the plan.
    #[arg(long, value_name = "TOLERANCE", requires = "draws_per_shard")]
    plan: Option<PathBuf>,

    /// Draws in a shard of a study that a first job plans.
    #[arg(long, value_name = "N", requires = "plan", value_parser = clap::value_parser!(u64).range(1..))]
    draws_per_shard: Option<u64>,

    /// Submit also shards of jobs that were submitted before, where squeue cannot be asked which of them are queued.
    #[arg(long)]
    again: bool,

    /// Write the job scripts, print the commands that submit them, and submit nothing.
    #[arg(long)]
    dry_run: bool,

    /// Print one command for each missing shard, for queues other than Slurm, and submit nothing.
    #[arg(long, conflicts_with_all = ["preamble", "throttle", "merge", "plan", "again", "dry_run"])]
    print: bool,
}

impl SubmitArgs {
    fn settings(&self) -> Result<Slurm> {
        let mut slurm = match &self.slurm {
            Some(path) => Slurm::read(path)?,
            None => Slurm::default(),
        };
        slurm.preamble.extend(self.preamble.iter().cloned());
        slurm.throttle = self.throttle.or(slurm.throttle);
        Ok(slurm)
    }

    /// The division of the work, and the tolerance if a first job is to plan it.
    fn work(&self) -> Result<(Sharding, Option<(&PathBuf, u64)>)> {
        match (&self.plan, self.draws_per_shard) {
            (Some(path), Some(per_shard)) if !is_planned(&self.study) => {
                let cut = planned_later(&Tolerance::read(path)?, per_shard, &self.study);
                Ok((cut, Some((path, per_shard))))
            }
            _ => Ok((Work::open(&self.study)?.cut(), None)),
        }
    }
}

pub(super) fn run(args: &SubmitArgs, terminal: &Terminal) -> Result<Outcome> {
    let slurm = args.settings()?;
    let (cut, tolerance) = args.work()?;
    if args.print {
        let found = cut.status()?;
        found.check_usable()?;
        for shard in found.missing {
            print_line!("{}", slurm.command(&cut, shard)?);
        }
        return Ok(Outcome::Fine);
    }
    let _turn = terminal.turn_at(&args.study.join("slurm"), args.slurm.as_deref())?;
    // Asked before the shards are looked at: a task that ends in between has made its shard.
    let mut queue = Queue::of(args)?;
    let found = cut.status()?;
    found.check_usable()?;
    let queued = queue.shards(&cut)?;
    let missing: Vec<u64> = found.missing.into_iter().filter(|n| !queued.contains(n)).collect();
    if !queued.is_empty() {
        terminal.say(&queue.words(queued.len()));
    }
    if missing.is_empty() && queued.is_empty() && !args.merge {
        print_line!("nothing is missing");
        return Ok(Outcome::Fine);
    }
    let mut before = Vec::new();
    if let Some((path, per_shard)) = tolerance {
        let job = slurm.plan_job(path, &args.study, per_shard)?;
        before.push(queue.submit(&job, "plan", &[], args)?);
    }
    let mut after = queue.arrays.clone();
    for (k, job) in slurm.arrays(&cut, &missing)?.iter().enumerate() {
        after.push(queue.submit(job, &format!("array_{k}"), &before, args)?);
    }
    if args.merge {
        queue.submit(&slurm.merge_job(&args.study)?, "merge", &after, args)?;
    }
    Ok(Outcome::Fine)
}

/// Jobs that are queued, as far as it is known.
struct Queue {
    tasks: Queued,
    /// Numbers of jobs by their names.
    numbers: Vec<(String, String)>,
    /// Numbers of arrays of this work that are queued.
    arrays: Vec<String>,
    /// Whether squeue said so, and not the record of submissions.
    is_asked: bool,
}

impl Queue {
    /// Jobs that squeue has; if it cannot be asked, all that were ever submitted from the folder.
    fn of(args: &SubmitArgs) -> Result<Self> {
        let asked = Command::new("squeue")
            .args(["--noheader", "--array", "--format=%j %F %K"])
            .output()
            .ok()
            .filter(|answer| answer.status.success());
        let (mut tasks, mut numbers) = (Queued::new(), Vec::new());
        if let Some(answer) = &asked {
            for line in String::from_utf8_lossy(&answer.stdout).lines() {
                let mut words = line.split_whitespace();
                let (Some(name), Some(job), index) = (words.next(), words.next(), words.next()) else {
                    continue;
                };
                if name.starts_with(JOB_NAME) {
                    tasks.insert((name.into(), index.and_then(|k| k.parse().ok())));
                    numbers.push((name.into(), job.into()));
                }
            }
        } else if !args.again {
            numbers = submitted(&args.study)?;
            tasks.extend(numbers.iter().map(|(name, _)| (name.clone(), None)));
        }
        Ok(Self {
            tasks,
            numbers,
            arrays: Vec::new(),
            is_asked: asked.is_some(),
        })
    }

    /// Missing shards that queued tasks make; remembers their arrays.
    fn shards(&mut self, cut: &Sharding) -> Result<BTreeSet<u64>> {
        let mut all = BTreeSet::new();
        let numbers: BTreeSet<&(String, String)> = self.numbers.iter().collect();
        for (name, job) in numbers {
            let own = self.tasks.iter().filter(|(task, _)| task == name).cloned().collect();
            let shards = queued_shards(&cut.folder, &own)?;
            let before = all.len();
            for shard in shards {
                if shard < cut.shards() && !cut.finished(shard)? {
                    all.insert(shard);
                }
            }
            if all.len() > before {
                self.arrays.push(job.clone());
            }
        }
        Ok(all)
    }

    fn words(&self, shards: usize) -> String {
        if self.is_asked {
            format!("{shards} missing shards are queued already")
        } else {
            format!(
                "{shards} missing shards were submitted as job {}, and squeue cannot be asked whether these are queued: \
                 --again submits them once more",
                self.arrays.join(", ")
            )
        }
    }

    /// Submit one job, unless it is a plan that is queued: its number. In a dry run the line of shell is printed that gives
    /// `variable` this number.
    fn submit(&self, job: &Job, variable: &str, after: &[String], args: &SubmitArgs) -> Result<String> {
        // One plan is enough. A merge that is queued waits for the arrays before: another one follows those of now.
        let same = self.numbers.iter().find(|(name, _)| *name == job.name);
        if let Some((_, number)) = same.filter(|_| variable == "plan") {
            return Ok(number.clone());
        }
        let what = match job.shards.len() {
            0 => variable.to_owned(),
            shards => format!("{shards} shards"),
        };
        if args.dry_run {
            print_line!("{variable}=$({})  # {what}", job.line(after));
            return Ok(format!("${variable}"));
        }
        let number = sbatch(job, &job.arguments(after))?;
        job.record(&args.study, &number)?;
        print_line!("{what}: job {number}");
        Ok(number)
    }
}

/// Number of the job that Slurm made of a script.
fn sbatch(job: &Job, arguments: &[OsString]) -> Result<String> {
    let answer = Command::new("sbatch")
        .args(arguments)
        .output()
        .map_err(Error::io("start sbatch for", &job.script))?;
    let said = String::from_utf8_lossy(&answer.stdout);
    // Behind a semicolon stands the name of a cluster.
    let number = said.trim().split(';').next().unwrap_or_default();
    if answer.status.success() && !number.is_empty() {
        return Ok(number.to_owned());
    }
    Err(Error::refused(
        "study/sbatch-failed",
        format!(
            "sbatch refused {}: {}",
            job.script.display(),
            String::from_utf8_lossy(&answer.stderr).trim()
        ),
        "correct the file that --slurm names; --dry-run writes the scripts alone",
    ))
}
