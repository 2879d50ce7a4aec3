//! `metalith plan`: from a design and a bench to the measurements that distinguish effects.

use std::path::{Path, PathBuf};

use clap::Args;
use metalith::bench_plan::{BenchFile, MeasurementPlan};
use metalith::{Result, plan_session};

use super::out_folder::OutFolder;
use super::reading::ReadingArgs;
use super::standard_input::InputFile;
use super::{Outcome, Terminal, print_json, print_line, standard_input};

/// Plan a bench session: the fewest measurements that find every effect at a wanted size and distinguish it from the
/// others.
#[derive(Args)]
#[command(
    after_help = "Example:\n  metalith plan designs/mini_3x3.toml --bench bench.toml --out out/session-1\n\nWrites measurement.toml, plan.html (a check list to print) and plan.json; frames go to captures/. Exit code 1 if an effect is not found at its wanted size."
)]
pub(crate) struct PlanArgs {
    /// The design file.
    design: PathBuf,

    /// Bench file: what the bench can do, and which effects it must find.
    #[arg(long, short, value_name = "BENCH")]
    bench: PathBuf,

    /// The layout that was fabricated; without it, the design's pillars are written into the folder.
    #[arg(long, value_name = "FILE")]
    layout: Option<PathBuf>,

    #[command(flatten)]
    reading: ReadingArgs,

    /// Folder of the session, created if it does not exist; `out/NAME_session` of the design if left out.
    #[arg(long, short, value_name = "FOLDER")]
    out: Option<PathBuf>,

    /// Plan for these effects only, separated by commas; for all if left out.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    effects: Vec<String>,

    /// Print the plan as JSON.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &PlanArgs, terminal: &Terminal) -> Result<Outcome> {
    terminal.stop_on_interrupt();
    let mut design = standard_input::design(&args.design, terminal)?;
    args.reading.aim(&mut design);
    let bench = BenchFile::read(&args.bench)?;
    let default = Path::new("out").join(format!("{}_session", design.name));
    let out = OutFolder::of(args.out.as_deref(), default, &args.design)?;
    let layout = args
        .layout
        .as_deref()
        .map(|path| InputFile::of(path)?.below(&args.reading.file, terminal));
    let layout = layout.transpose()?;
    let planned = plan_session(
        &design,
        &bench,
        layout.as_deref(),
        &out.path,
        args.effects.clone(),
        terminal,
    )?;
    out.note()?;
    terminal.clear();
    if args.json {
        print_json(&planned);
    } else {
        describe(&planned);
    }
    Ok(Outcome::of(planned.finds_all()))
}

fn describe(planned: &MeasurementPlan) {
    print_line!("{}", planned.sentence());
    for c in &planned.confusions {
        print_line!("not distinguished: {} and {}; {}", c.effect, c.looks_like, c.remedy());
    }
    print_line!("{}", planned.folder.join("measurement.toml").display());
    print_line!("{}", planned.page.display());
}
