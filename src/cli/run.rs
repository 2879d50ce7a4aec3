//! `metalith run`: from a design file to a folder that a cleanroom can take.

use std::path::PathBuf;

use clap::Args;
use metalith::{Design, PillarArray, Result};

use super::layout::Target;
use super::verify::Judging;
use super::{Outcome, Terminal};

/// Write the layouts of a design, read them back, simulate what was written, and report.
#[derive(Args)]
#[command(
    after_help = "Example:\n  metalith run designs/mini_3x3.toml --out out/mini\n\nExit code 1 if a limit of the design does not hold."
)]
pub struct RunArgs {
    /// The design file.
    design: PathBuf,

    #[command(flatten)]
    target: Target,

    #[command(flatten)]
    judging: Judging,
}

pub fn run(args: &RunArgs, terminal: &Terminal) -> Result<Outcome> {
    let design = Design::read(&args.design)?;
    // What could not be read back is not written; `metalith layout` writes it.
    metalith::verify::fits(&design, &args.target.folder(&design))?;
    terminal.stop_on_interrupt();
    let array = PillarArray::build(&design, terminal)?;
    let written = args.target.write(&design, &array, terminal)?;
    args.judging.judge(
        &design,
        &array,
        &written.pillars.path,
        &args.target.folder(&design),
        terminal,
    )
}
