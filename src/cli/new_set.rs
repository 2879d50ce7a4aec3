//! `metalith new-set`: a measured set begun from a layout and frames.

use std::path::PathBuf;

use clap::Args;
use metalith::{NewSet, Result, new_set};

use super::reading::ReadingArgs;
use super::{Outcome, Terminal, print_line, standard_input};

/// Begin a measured set: write measurement.toml from a layout and a folder of frames.
///
/// Elements, pitch and lattice are taken from the layout; colour, distance, element, angle and exposure from the names of the frames,
/// such as `e10_530nm_z336um_20ms.tif`. Keys that neither states are commented and marked `state this`.
#[derive(Args)]
#[command(
    after_help = "Example:\n  metalith new-set layout.gds captures/ --out session/measurement.toml\n\nWrites the file, and beside it a page of the frames with what was recognised."
)]
pub(crate) struct NewSetArgs {
    /// The layout that was fabricated.
    layout: PathBuf,

    /// Frames (NPY, PNG, TIFF, FITS), or their folders.
    #[arg(required = true)]
    frames: Vec<PathBuf>,

    /// The file to write. An existing file is never replaced.
    #[arg(long, short, value_name = "FILE", default_value = "measurement.toml")]
    out: PathBuf,

    #[command(flatten)]
    reading: ReadingArgs,
}

pub(crate) fn run(args: &NewSetArgs, terminal: &Terminal) -> Result<Outcome> {
    terminal.stop_on_interrupt();
    standard_input::named(["a measured set", "the set refers to it"], [args.layout.as_path()])?;
    let layout = args.reading.open(&args.layout, terminal)?;
    let begun = new_set(&layout, args.reading.layer, &args.frames, &args.out, terminal)?;
    terminal.clear();
    describe(&begun);
    Ok(Outcome::Fine)
}

fn describe(begun: &NewSet) {
    let head = ["frame"].into_iter().chain(NewSet::COLUMNS).map(String::from).collect();
    let rows: Vec<Vec<String>> = std::iter::once(head)
        .chain(begun.frames.iter().map(|f| {
            let words = f.words().into_iter().map(|w| if w.is_empty() { "-".into() } else { w });
            std::iter::once(f.name()).chain(words).collect()
        }))
        .collect();
    let columns = rows[0].len();
    let width = |k: usize| rows.iter().map(|row| row[k].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    for row in &rows {
        let cells = row.iter().zip(&widths).map(|(cell, width)| format!("{cell:width$}"));
        print_line!("{}", cells.collect::<Vec<_>>().join("  ").trim_end());
    }
    print_line!("state these in {}:", begun.file.display());
    for key in &begun.open {
        print_line!("  {key}");
    }
    print_line!("correct these where they are assumed:");
    for key in NewSet::ASSUMED {
        print_line!("  {key}");
    }
    print_line!("{}", begun.page.display());
}
