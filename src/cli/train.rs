//! `metalith train`: teach the prior of restorations from photographs.

use std::path::PathBuf;

use clap::Args;
use metalith::Result;
use metalith::picture::scene::read_picture;
use metalith::prior::{Photographs, TrainingSpec, train};

use super::paths::apart;
use super::{Outcome, Terminal, images, print_json, print_line};

/// Teach the network that takes noise out of pictures from the photographs of a folder.
///
/// The weights depend on the photographs, the seed and the numbers below, not on the number of threads. Training that was
/// stopped goes on: where it stands is kept beside the weights, in a file that ends in `.state`. One photograph of twelve is
/// held out, and the network judged by it.
#[derive(Args)]
#[command(after_help = "Example:\n  metalith train photographs --out denoiser.safetensors --steps 9000")]
pub struct TrainArgs {
    /// Folder of PNG, JPEG or NPY photographs.
    folder: PathBuf,

    /// File for the weights.
    #[arg(long, short, default_value = "out/denoiser.safetensors", value_name = "FILE")]
    out: PathBuf,

    /// Steps down the gradient.
    #[arg(long, default_value_t = TrainingSpec::default().steps)]
    steps: u64,

    /// Pieces of photographs a step.
    #[arg(long, default_value_t = TrainingSpec::default().batch)]
    batch: usize,

    /// Pixels a side of a piece.
    #[arg(long, default_value_t = TrainingSpec::default().piece)]
    piece: usize,

    /// Of first weights, pieces and noise.
    #[arg(long, default_value_t = TrainingSpec::default().seed)]
    seed: u64,

    /// Print what came out as JSON.
    #[arg(long)]
    json: bool,
}

pub fn run(args: &TrainArgs, terminal: &Terminal) -> Result<Outcome> {
    terminal.stop_on_interrupt();
    let spec = TrainingSpec {
        steps: args.steps,
        batch: args.batch,
        piece: args.piece,
        seed: args.seed,
    };
    let files = images::of_folder(&args.folder)?;
    let mut state = args.out.clone().into_os_string();
    state.push(".state");
    let state = PathBuf::from(state);
    apart(files.iter().map(PathBuf::as_path), &[&args.out, &state])?;
    let mut pictures = Vec::new();
    for file in &files {
        let name = file.display().to_string();
        pictures.push((name, read_picture(file)?.mapv(|v| v as f32)));
    }
    let photographs = Photographs::new(pictures, spec.piece)?;
    let report = train(&photographs, &spec, &args.out, &state, terminal)?;
    terminal.clear();
    if args.json {
        print_json(&report);
    } else {
        print_line!(
            "{}: {} weights, {:.2} dB for photographs that were held out, with noise of 25 / 255",
            args.out.display(),
            report.weights,
            report.held_out_psnr_db
        );
    }
    Ok(Outcome::Fine)
}
