//! `metalith study run`: shards here, by one process or several.

use std::collections::VecDeque;
use std::io;
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::time::Duration;

use clap::Args;
use metalith::report::counted;
use metalith::study::Work;
use metalith::{Error, Progress, Result};

use crate::cli::{Outcome, Terminal, print_line, program};

/// Time after which a run looks again at its processes.
const PAUSE: Duration = Duration::from_millis(50);

/// Most damaged shards that are named before they are made again.
const MOST_NAMED: usize = 20;

#[derive(Args)]
pub(super) struct RunArgs {
    /// Folder of the study.
    study: PathBuf,

    /// Number of the shard.
    #[arg(long, value_name = "N", required_unless_present = "missing")]
    shard: Option<u64>,

    /// Make all missing shards. Shards that another run makes at the same time are passed over and waited for at the end.
    #[arg(long, conflicts_with = "shard")]
    missing: bool,

    /// Number of processes; if left out, one shard after the other with all threads.
    #[arg(long, value_name = "N", requires = "missing", value_parser = clap::value_parser!(u16).range(1..=512))]
    jobs: Option<u16>,

    /// End when standard input ends: it is a pipe from the process that started this one.
    #[arg(long, hide = true, requires = "shard")]
    with_parent: bool,
}

pub(super) fn run(args: &RunArgs, terminal: &Terminal) -> Result<Outcome> {
    if args.with_parent {
        end_with_parent();
    }
    let work = Work::open(&args.study)?;
    if let Some(number) = args.shard {
        work.run(&[number], terminal)?;
        terminal.clear();
        return Ok(Outcome::Fine);
    }
    let found = work.cut().status()?;
    found.check_usable()?;
    for (path, why) in found.damaged.iter().take(MOST_NAMED) {
        terminal.say(&format!("{} {why}: it is made again", path.display()));
    }
    match args.jobs {
        Some(jobs) if jobs > 1 => by_processes(args, &work, found.missing, jobs.into(), terminal)?,
        _ => work.run(&found.missing, terminal)?,
    }
    terminal.clear();
    let found = work.cut().status()?;
    print_line!("{} of {} shards are there", found.finished, found.shards);
    if found.finished == found.shards {
        return Ok(Outcome::Fine);
    }
    Err(Error::refused(
        "study/shards-not-made",
        format!("{} shards are not there whole", found.shards - found.finished),
        "somebody changed or removed them meanwhile; run again with --missing",
    ))
}

/// End this process with the one that started it, however that one ends: the system closes its end of the pipe.
fn end_with_parent() {
    std::thread::spawn(|| {
        let _ = io::copy(&mut io::stdin().lock(), &mut io::sink());
        // What is unfinished is taken over by the next run.
        std::process::exit(130);
    });
}

/// A shard that a process makes.
struct Running {
    shard: u64,
    process: Child,
    /// Dropped to end the process.
    _pipe: Option<ChildStdin>,
}

/// Each shard by a separate process, so many at a time. All end with this one.
fn by_processes(args: &RunArgs, work: &Work, missing: Vec<u64>, jobs: usize, terminal: &Terminal) -> Result<()> {
    let program = program()?;
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    let threads = (cores / jobs).max(1).to_string();
    let cut = work.cut();
    terminal.begin("running shards", missing.len() as u64);
    let mut waiting = VecDeque::from(missing);
    let (mut running, mut failed, mut held) = (Vec::new(), Vec::new(), Vec::new());
    let start = |shard: u64| -> Result<Running> {
        let mut process = Command::new(&program)
            .args(["study", "run", "--with-parent", "--quiet", "--shard"])
            .args([&shard.to_string(), "--threads", &threads])
            .arg("--")
            .arg(&args.study)
            .stdin(Stdio::piped())
            .spawn()
            .map_err(Error::io("start", &program))?;
        let pipe = process.stdin.take();
        Ok(Running {
            shard,
            process,
            _pipe: pipe,
        })
    };
    loop {
        while running.len() < jobs {
            let Some(shard) = waiting.pop_front() else { break };
            // Another run may have made it since.
            if cut.finished(shard)? {
                terminal.advance(1);
            } else if cut.is_held(shard)? {
                held.push(shard);
            } else {
                running.push(start(shard)?);
            }
        }
        if running.is_empty() {
            break;
        }
        let mut still = Vec::new();
        for mut child in running {
            match child.process.try_wait().map_err(Error::io("wait for", &program))? {
                None => still.push(child),
                Some(done) => {
                    terminal.advance(1);
                    if !done.success() {
                        failed.push(child.shard);
                    }
                }
            }
        }
        running = still;
        // Their pipes close as these values end.
        terminal.check_stopped()?;
        std::thread::sleep(PAUSE);
    }
    if failed.is_empty() {
        return work.run(&held, terminal);
    }
    Err(Error::refused(
        "study/shards-not-made",
        format!("{} failed, the first is {}", counted(failed.len(), "shard"), failed[0]),
        "their messages are above; run again with --missing",
    ))
}
