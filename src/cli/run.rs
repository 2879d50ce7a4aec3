//! `metalith run`: from a design file to a folder that a cleanroom can take.

use std::path::PathBuf;

use clap::Args;
use metalith::layout::write_pillars_as;
use metalith::{Error, PillarArray, Result};

use super::course::Course;
use super::layout::Target;
use super::paths::paths;
use super::verify::{Judging, REPORT_FILES};
use super::{Outcome, Terminal, standard_input};

/// Write the layouts of a design, read them back, simulate them, and write the report.
#[derive(Args)]
#[command(
    after_help = "Example:\n  metalith run designs/mini_3x3.toml --out out/mini\n\nExit code 1 if a limit of the design does not hold."
)]
pub(crate) struct RunArgs {
    /// The design file.
    design: PathBuf,

    #[command(flatten)]
    target: Target,

    #[command(flatten)]
    judging: Judging,
}

pub(crate) fn run(args: &RunArgs, terminal: &Terminal) -> Result<Outcome> {
    let design = standard_input::design(&args.design, terminal)?;
    terminal.warnings(&design.warnings()?);
    // What could not be read back is not written; `metalith layout` writes it.
    let out = args.target.folder(&design.name, &args.design)?;
    let folder = &out.path;
    let simulation = args.judging.simulation(&design, folder)?;
    Judging::announce(&simulation, terminal);
    terminal.follow(Course::of_verification(&design, true));
    terminal.stop_on_interrupt();
    let array = PillarArray::build(&design, terminal)?;
    args.judging.check_drawn(&design, &array)?;
    let turn = out.turn(paths(&args.judging.inputs(&design)), terminal)?;
    // A report speaks of the layout beside it: the old one must not stand beside a new layout, whatever happens.
    let written = args.target.publish(
        (&design, &array),
        &turn,
        &REPORT_FILES,
        &write_pillars_as,
        |_, _| Ok(()),
        terminal,
    )?;
    let judged = args
        .judging
        .judge(&design, &array, &written.pillars.path, &turn, terminal);
    if let Err(Error::Interrupted) = &judged {
        terminal.clear();
        terminal.say(&format!(
            "the layouts in {} are new and whole; there is no report on them yet",
            folder.display()
        ));
    }
    judged
}
