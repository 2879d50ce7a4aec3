//! `metalith diff`: what is different between two layouts.

use std::path::{Path, PathBuf};

use clap::Args;
use metalith::Result;
use metalith::diff::{self, DiffPlan};
use metalith::file::InputFiles;
use metalith::gds::USUAL_LAYER;

use super::course::Course;
use super::reading::ReadingArgs;
use super::standard_input::InputFile;
use super::{Outcome, Terminal, output, print_json, print_text};

/// Compare the geometry of two layouts, whatever their hierarchy.
#[derive(Args)]
#[command(after_help = "Exit codes: 0 same geometry, 1 different, 2 bad input.\n\
    Example:\n  metalith diff golden/lens.gds out/lens_pillars.gds --report diff.html")]
pub(crate) struct DiffArgs {
    /// The first layout, `-` for standard input.
    a: PathBuf,

    /// The second layout, `-` for standard input.
    b: PathBuf,

    #[command(flatten)]
    reading: ReadingArgs,

    /// Largest number of changes in the list; all are counted.
    #[arg(long, value_name = "N", default_value_t = 1000)]
    listed: usize,

    /// Write a page that shows where the changes are.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,

    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &DiffArgs, terminal: &Terminal) -> Result<Outcome> {
    let report: Vec<_> = args.report.as_deref().into_iter().collect();
    InputFiles::of([args.a.as_path(), &args.b]).check_outputs(&report)?;
    terminal.stop_on_interrupt();
    let files = [InputFile::of(&args.a)?, InputFile::of(&args.b)?];
    terminal.follow(Course::of_comparison([&files[0], &files[1]]));
    let open = |path: &Path| args.reading.open(path, terminal);
    let (a, b) = (open(&files[0])?, open(&files[1])?);
    // Where no layer is the one of the pillars, all shapes are compared as outlines.
    let layer = args.reading.pillar_layer(&a, terminal).unwrap_or(USUAL_LAYER);
    let plan = DiffPlan {
        pillar_layer: layer,
        listed: args.listed,
    };
    let mut found = diff::diff(&a, &b, &plan, terminal)?;
    terminal.clear();
    (found.a, found.b) = (output::shown(found.a), output::shown(found.b));
    if let Some(path) = &args.report {
        diff::page(&found).write(path)?;
    }
    if args.json {
        print_json(&serde_json::to_value(&found).expect("a comparison is plain data"));
    } else {
        print_text(diff::text(&found).trim_end());
    }
    Ok(Outcome::of(found.same_geometry))
}
