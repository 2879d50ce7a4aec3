//! `metalith dataset`: frames and scenes for those who train a restoration.

use std::path::{Path, PathBuf};

use clap::Args;
use metalith::Result;
use metalith::picture::scene::{SceneFile, read_scene};
use metalith::picture::{Studio, write_dataset};

use super::camera_args::{CameraArgs, CameraFiles};
use super::standard_input::InputFile;
use super::{Outcome, Terminal, images, print_line};

/// Record the frame of every image of a folder, for learning: frames, what an ideal camera gives, and a manifest.
///
/// Images are taken in the order of their names and must be of one size. The noise of each follows from its bytes and the
/// seed. Pairs that are there are kept: a set that was stopped goes on.
#[derive(Args)]
#[command(
    after_help = "Example:\n  metalith dataset photographs --layout out/prototype_3x3/prototype_3x3_pillars.gds \\\n    --camera cameras/gt1930.toml --design designs/prototype_3x3.toml --out out/pairs"
)]
pub struct DatasetArgs {
    /// Folder of PNG, JPEG or NPY images.
    images: PathBuf,

    /// The pillar layout; `-` for standard input.
    #[arg(long)]
    layout: PathBuf,

    #[command(flatten)]
    with: CameraArgs,

    /// Folder for the pairs.
    #[arg(long, short, value_name = "FOLDER")]
    out: PathBuf,
}

pub fn run(args: &DatasetArgs, terminal: &Terminal) -> Result<Outcome> {
    terminal.stop_on_interrupt();
    let CameraFiles { design, camera, model } = args.with.read()?;
    let images = images::of_folder(&args.images)?;
    let read = |path: &Path| {
        read_scene(&SceneFile {
            path: path.to_owned(),
            wavelengths_nm: None,
            field_deg: args.with.field_deg,
            distance_um: f64::INFINITY,
        })
    };
    let layout = InputFile::of(&args.layout)?;
    let studio = Studio::open(&design, &layout, &camera, model.as_ref(), &read(&images[0])?, terminal)?;
    let operator = studio.simulation();
    let manifest = write_dataset(&studio, &operator, &images, &read, args.with.seed, &args.out, terminal)?;
    terminal.clear();
    print_line!("{} pairs in {}", manifest.pairs.len(), args.out.display());
    Ok(Outcome::Fine)
}
