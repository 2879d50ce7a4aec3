//! `metalith study`: a chip made many times, in shards for any number of machines.

mod run;
mod submit;

use std::path::PathBuf;

use clap::{Args, Subcommand};
use metalith::file::InputFiles;
use metalith::gds::LayerNumber;
use metalith::report::{counted, sig};
use metalith::study::{
    PairsPlan, PillarPlace, Plan, PlanSettings, StartsPlan, TableFormat, Work, merge, plan, report_files, write_page,
};
use metalith::{Error, Result};

use super::paths::{name_of, paths};
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
    Run(run::RunArgs),
    /// List existing and missing shards.
    Status(StatusArgs),
    /// Submit missing shards to Slurm as job arrays, or print a command for each.
    Submit(submit::SubmitArgs),
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
struct StatusArgs {
    /// Folder of the study.
    study: PathBuf,

    /// Print the list as JSON.
    #[arg(long)]
    json: bool,
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
        Step::Run(args) => run::run(args, terminal),
        Step::Status(args) => tell_status(args),
        Step::Submit(args) => submit::run(args, terminal),
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

fn tell_status(args: &StatusArgs) -> Result<Outcome> {
    let found = Work::open(&args.study)?.cut().status()?;
    if args.json {
        print_json(&found);
    } else {
        print_line!("{} of {} shards are there", found.finished, found.shards);
        for (path, why) in found.damaged.iter().chain(&found.unusable) {
            print_line!("{} {why}", path.display());
        }
        if let Some(words) = found.of_several_processors() {
            print_line!("{words}");
        }
    }
    Ok(Outcome::Fine)
}

fn merge_shards(args: &MergeArgs, terminal: &Terminal) -> Result<Outcome> {
    match Work::open(&args.study)? {
        Work::Study(plan) => merge_study(&plan, args, terminal),
        Work::Pairs(plan) => merge_pairs(&plan, args, terminal),
        #[cfg(feature = "baselines")]
        Work::Comparison(plan) => merge_comparison(&plan, args, terminal),
        Work::Starts(plan) => merge_starts(&plan, args, terminal),
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
    let table = comparison.markdown();
    metalith::baselines::write_comparison(
        &comparison.untimed(),
        &terminal.turn_at(&args.study, paths(&plan.comparison.inputs()))?,
    )?;
    terminal.clear();
    super::compare::tell(&table, &args.study);
    Ok(Outcome::Fine)
}

fn merge_starts(plan: &StartsPlan, args: &MergeArgs, terminal: &Terminal) -> Result<Outcome> {
    without_table(args)?;
    let result = plan.merge(terminal)?;
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
    let files = report_files(&name_of(&out));
    let [page, numbers] = files.each_ref().map(|name| folder.join(name));
    let inputs = plan.inputs()?;
    let outputs = [out.as_path(), &page, &numbers];
    InputFiles::of(paths(&inputs)).check_outputs(&outputs)?;
    InputFiles::of(outputs).check_outside(&plan.cut().shards_folder())?;
    TableFormat::of(&out)?;
    let result = merge(plan, args.psfs, terminal)?;
    terminal
        .turn_at(&folder, paths(&inputs))?
        .publish(&name_of(&out), &[], |folder| {
            result.write(&folder.join(name_of(&out)))?;
            write_page(&result, &files, folder)
        })?;
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
