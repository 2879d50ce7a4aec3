//! `metalith convert`: a layout in the other format.

use std::path::PathBuf;

use clap::Args;
use metalith::Result;
use metalith::file::InputFiles;
use metalith::layout::{LayoutFormat, convert};

use super::layout::FormatArg;
use super::reading::FileArgs;
use super::standard_input::InputFile;
use super::{Outcome, Terminal, print_line};

/// Write a layout in GDSII or OASIS: the same cells, streamed from one file into the other. Drawings in DXF are read too.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  metalith convert out/lens_pillars.gds out/lens_pillars.oas\n  \
    metalith convert from_elsewhere.oas lens.gds\n  \
    metalith convert drawing.dxf lens.gds"
)]
pub(crate) struct ConvertArgs {
    /// The layout to read, `-` for standard input; its first bytes show its format.
    from: PathBuf,

    /// The layout to write, in OASIS if its name ends in .oas; compressed if it ends in .gz.
    to: PathBuf,

    /// Format to write; if left out, the ending of the name decides.
    #[arg(long, value_enum)]
    format: Option<FormatArg>,

    #[command(flatten)]
    reading: FileArgs,
}

pub(crate) fn run(args: &ConvertArgs, terminal: &Terminal) -> Result<Outcome> {
    InputFiles::of([args.from.as_path()]).check_output(&args.to)?;
    let format = args.format.map_or_else(|| LayoutFormat::of_name(&args.to), Into::into);
    terminal.stop_on_interrupt();
    let from = InputFile::of(&args.from)?;
    let layout = args.reading.open(&from, terminal)?;
    let written = convert(&layout, format, &args.to, terminal)?;
    terminal.clear();
    for remark in &written.remarks {
        terminal.say(&format!("note: {remark}"));
    }
    print_line!("{}  {:.3} MB", written.path.display(), written.bytes as f64 * 1e-6);
    Ok(Outcome::Fine)
}
