//! `metalith study`: a chip made many times, in shards for any number of machines.

use std::path::PathBuf;
use std::process::{Child, Command};

use clap::{Args, Subcommand};
use metalith::gds::LayerNumber;
use metalith::report::{counted, sig};
use metalith::study::{
    MANIFEST, PairsPlan, PillarPlace, Plan, PlanSettings, REPORT, Slurm, StartsPlan, TableFormat, Work, merge, plan,
    submissions, write_page,
};
use metalith::{Error, Progress, Result};

use super::paths::apart;
use super::{Outcome, Terminal, print_json, print_line};

/// Simulate many chips with the tolerances of a process and a bench: the yield, and the effects that limit it.
#[derive(Args)]
#[command(
    after_help = "Example:\n  metalith study plan tolerance.toml --out out/study\n  metalith study run out/study --missing\n  metalith study merge out/study --out out/study/result.csv"
)]
pub(crate) struct StudyArgs {
    #[command(subcommand)]
    step: Step,
}

#[derive(Subcommand)]
enum Step {
    /// Plan a study: write the layout, solve the tables of cells, time the first draw, and cut the work into shards.
    Plan(PlanArgs),
    /// Make one shard, or all missing ones. Existing shards are kept.
    Run(RunArgs),
    /// List existing and missing shards.
    Status(StatusArgs),
    /// Submit missing shards to Slurm as job arrays.
    Submit(SubmitArgs),
    /// Merge all shards into a table of the draws and a page.
    Merge(MergeArgs),
}

#[derive(Args)]
struct PlanArgs {
    /// Tolerance file: what varies, the limits, and the number of draws.
    tolerance: PathBuf,

    /// Folder of the study, created if it does not exist.
    #[arg(long, short, value_name = "FOLDER")]
    out: PathBuf,

    /// Draws in a shard; as many as take ten minutes if left out. Results do not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    draws_per_shard: Option<u64>,

    /// Layer and datatype of the pillars in the layout that the tolerance file names; that of the design if left out.
    #[arg(long, value_name = "LAYER/DATATYPE", value_parser = super::psf::layer)]
    layer: Option<LayerNumber>,

    /// Cell of this layout to start from; the top cell if there is only one.
    #[arg(long, value_name = "CELL")]
    top: Option<String>,
}

#[derive(Args)]
struct RunArgs {
    /// Folder of the study.
    study: PathBuf,

    /// Number of the shard.
    #[arg(long, value_name = "N", required_unless_present = "missing")]
    shard: Option<u64>,

    /// Make all missing shards.
    #[arg(long, conflicts_with = "shard")]
    missing: bool,

    /// Number of processes; if left out, one shard after the other with all threads.
    #[arg(long, value_name = "N", requires = "missing", value_parser = clap::value_parser!(u16).range(1..=512))]
    jobs: Option<u16>,
}

#[derive(Args)]
struct StatusArgs {
    /// Folder of the study.
    study: PathBuf,

    /// Print the list as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
struct SubmitArgs {
    /// Folder of the study.
    study: PathBuf,

    /// File with the settings of the jobs: partition, time, memory, size of arrays.
    #[arg(long, value_name = "FILE")]
    slurm: PathBuf,

    /// Write the job scripts and submit nothing.
    #[arg(long)]
    dry_run: bool,
}

#[derive(Args)]
struct MergeArgs {
    /// Folder of the study.
    study: PathBuf,

    /// File for the table of the draws: .csv, .json, .jsonl, or .parquet in a program with that feature; `result.csv`
    /// in the folder of the study if left out. The page is written to the same folder.
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,

    /// Number of worst draws that are simulated again to show their PSFs.
    #[arg(long, value_name = "N", default_value_t = 3)]
    psfs: usize,
}

pub(crate) fn run(args: &StudyArgs, terminal: &Terminal) -> Result<Outcome> {
    terminal.stop_on_interrupt();
    match &args.step {
        Step::Plan(args) => plan_study(args, terminal),
        Step::Run(args) => run_shards(args, terminal),
        Step::Status(args) => tell_status(args),
        Step::Submit(args) => submit(args),
        Step::Merge(args) => merge_shards(args, terminal),
    }
}

fn plan_study(args: &PlanArgs, terminal: &Terminal) -> Result<Outcome> {
    let settings = PlanSettings {
        draws_per_shard: args.draws_per_shard,
        place: PillarPlace {
            layer: args.layer,
            top: args.top.clone(),
        },
    };
    let plan = plan(&args.tolerance, &args.out, settings, terminal)?;
    terminal.clear();
    print_line!(
        "{} of {:.2} s in {} of {}: {}",
        counted(plan.draws as usize, "draw"),
        plan.seconds_per_draw,
        counted(plan.cut().shards() as usize, "shard"),
        plan.draws_per_shard,
        args.out.display()
    );
    Ok(Outcome::Fine)
}

fn run_shards(args: &RunArgs, terminal: &Terminal) -> Result<Outcome> {
    let work = Work::open(&args.study)?;
    if let Some(number) = args.shard {
        work.run(&[number], terminal)?;
        terminal.clear();
        return Ok(Outcome::Fine);
    }
    let found = work.cut().status()?;
    if let Some((path, why)) = found.unusable.first() {
        return Err(Error::refused(
            "study/shard-unusable",
            format!("{} cannot be used: {why}", path.display()),
            "remove it, then run again",
        ));
    }
    match args.jobs {
        Some(jobs) if jobs > 1 => by_processes(args, &found.missing, jobs.into(), terminal)?,
        _ => work.run(&found.missing, terminal)?,
    }
    terminal.clear();
    tell(&work)
}

/// Each shard by a separate process, so many at a time.
fn by_processes(args: &RunArgs, missing: &[u64], jobs: usize, terminal: &Terminal) -> Result<()> {
    let program = super::program()?;
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    let threads = (cores / jobs).max(1).to_string();
    terminal.begin("running shards", missing.len() as u64);
    let mut running: Vec<(u64, Child)> = Vec::new();
    let mut failed = Vec::new();
    let mut waiting = missing.iter();
    loop {
        while running.len() < jobs && !terminal.stopped() {
            let Some(number) = waiting.next() else { break };
            let child = Command::new(&program)
                .args(["study", "run"])
                .arg(&args.study)
                .args(["--shard", &number.to_string(), "--threads", &threads, "--quiet"])
                .spawn()
                .map_err(Error::io("start", &program))?;
            running.push((*number, child));
        }
        if running.is_empty() {
            break;
        }
        let (number, mut child) = running.remove(0);
        let done = child.wait().map_err(Error::io("wait for", &program))?;
        terminal.advance(1);
        if !done.success() {
            failed.push(number);
        }
    }
    terminal.check_stopped()?;
    if failed.is_empty() {
        return Ok(());
    }
    Err(Error::refused(
        "study/shards-not-made",
        format!("{} failed, the first is {}", counted(failed.len(), "shard"), failed[0]),
        "their messages are above; run again with --missing",
    ))
}

/// One line on how far the work is.
fn tell(work: &Work) -> Result<Outcome> {
    let found = work.cut().status()?;
    print_line!("{} of {} shards are there", found.finished, found.shards);
    Ok(Outcome::Fine)
}

fn tell_status(args: &StatusArgs) -> Result<Outcome> {
    let found = Work::open(&args.study)?.cut().status()?;
    if args.json {
        print_json(&found);
    } else {
        print_line!("{} of {} shards are there", found.finished, found.shards);
        for (path, why) in &found.unusable {
            print_line!("{}: {why}", path.display());
        }
    }
    Ok(Outcome::Fine)
}

fn submit(args: &SubmitArgs) -> Result<Outcome> {
    let cut = Work::open(&args.study)?.cut();
    let slurm = Slurm::read(&args.slurm)?;
    let missing = cut.status()?.missing;
    if missing.is_empty() {
        print_line!("nothing is missing");
        return Ok(Outcome::Fine);
    }
    for submission in submissions(&cut, &slurm, &missing)? {
        let shards = submission.shards.len();
        if args.dry_run {
            print_line!("{}: sbatch {}", counted(shards, "shard"), submission.script.display());
            continue;
        }
        let answer = Command::new("sbatch")
            .arg(&submission.script)
            .output()
            .map_err(Error::io("start sbatch for", &submission.script))?;
        if !answer.status.success() {
            return Err(Error::refused(
                "study/sbatch-failed",
                format!(
                    "sbatch refused {}: {}",
                    submission.script.display(),
                    String::from_utf8_lossy(&answer.stderr).trim()
                ),
                "correct the file that --slurm names; --dry-run writes the scripts alone",
            ));
        }
        print_line!(
            "{}: {}",
            counted(shards, "shard"),
            String::from_utf8_lossy(&answer.stdout).trim()
        );
    }
    Ok(Outcome::Fine)
}

fn merge_shards(args: &MergeArgs, terminal: &Terminal) -> Result<Outcome> {
    match Work::open(&args.study)? {
        Work::Study(plan) => merge_study(&plan, args, terminal),
        Work::Pairs(plan) => merge_pairs(&plan, args, terminal),
        #[cfg(feature = "baselines")]
        Work::Comparison(plan) => merge_comparison(&plan, args, terminal),
        Work::Starts(plan) => merge_starts(&plan, args),
    }
}

/// Work that is no study has no table of draws.
fn without_table(args: &MergeArgs) -> Result<()> {
    match &args.out {
        None => Ok(()),
        Some(_) => Err(Error::refused(
            "study/no-table",
            "--out is for a table of draws, and this work has none",
            "leave out --out: the files are written into the folder of the plan",
        )),
    }
}

fn merge_pairs(plan: &PairsPlan, args: &MergeArgs, terminal: &Terminal) -> Result<Outcome> {
    without_table(args)?;
    let manifest = plan.merge(terminal)?;
    terminal.clear();
    print_line!("{} in {}", counted(manifest.pairs.len(), "pair"), args.study.display());
    Ok(Outcome::Fine)
}

#[cfg(feature = "baselines")]
fn merge_comparison(plan: &metalith::study::ComparisonPlan, args: &MergeArgs, terminal: &Terminal) -> Result<Outcome> {
    without_table(args)?;
    let comparison = plan.merge(terminal)?;
    terminal.clear();
    super::compare::tell(&comparison, &args.study)
}

fn merge_starts(plan: &StartsPlan, args: &MergeArgs) -> Result<Outcome> {
    without_table(args)?;
    let result = plan.merge()?;
    let best = &result.starts[result.best];
    print_line!(
        "best of {} starts: number {}, merit {}",
        result.starts.len(),
        best.start,
        sig(best.merit, 4)
    );
    print_line!("phase: {}", result.phase.display());
    Ok(Outcome::Fine)
}

fn merge_study(plan: &Plan, args: &MergeArgs, terminal: &Terminal) -> Result<Outcome> {
    let out = args.out.clone().unwrap_or_else(|| args.study.join("result.csv"));
    let folder = out.parent().map_or_else(PathBuf::new, std::path::Path::to_owned);
    let [page, numbers] = REPORT.map(|name| folder.join(name));
    apart([args.study.join(MANIFEST).as_path()], &[&out, &page, &numbers])?;
    TableFormat::of(&out)?;
    let result = merge(plan, args.psfs, terminal)?;
    result.write(&out)?;
    write_page(&result, &folder)?;
    terminal.clear();
    for y in &result.yields {
        print_line!(
            "{}: {} of {} draws, {:.1} % ({:.1} to {:.1} %)",
            y.key,
            y.held,
            y.of,
            100.0 * y.share,
            100.0 * y.interval[0],
            100.0 * y.interval[1]
        );
    }
    print_line!("{}", out.display());
    print_line!("{}", page.display());
    Ok(Outcome::Fine)
}
