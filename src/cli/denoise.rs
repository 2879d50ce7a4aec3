//! `metalith denoise`: the learnt prior by itself.

use std::path::PathBuf;

use clap::Args;
use metalith::file::InputFiles;
use metalith::imaging::scene::read_picture;
use metalith::imaging::write_picture;
use metalith::prior::{NetworkDenoiser, with_noise};
use metalith::restoration::{psnr_db, ssim_colour};
use metalith::{Error, Result};
use ndarray::Array3;
use serde::Serialize;

use super::{Outcome, Terminal, print_json, print_line};

/// Remove noise from a picture with the network of the learnt prior.
///
/// With `--add` the noise is added first, and the result is compared with the picture.
#[derive(Args)]
#[command(after_help = "Example:\n  metalith denoise photograph.png --noise 25 --add --out clean.png")]
pub(crate) struct DenoiseArgs {
    /// The picture: PNG, JPEG, TIFF, EXR or NPY.
    picture: PathBuf,

    /// Standard deviation of the noise, in levels of a scale from 0 to 255.
    #[arg(long, value_name = "LEVELS", value_parser = noise)]
    noise: f32,

    /// Add normal noise of this standard deviation first, from `--seed`.
    #[arg(long)]
    add: bool,

    /// Seed of the added noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,

    /// Weights from `metalith train`, or another network as `.onnx`; the shipped weights if left out.
    #[arg(long, value_name = "FILE")]
    weights: Option<PathBuf>,

    /// File for the picture without noise: a PNG of 16 bits.
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,

    /// Print the scores as JSON.
    #[arg(long)]
    json: bool,
}

/// Similarity of the pictures to the one without noise.
#[derive(Serialize)]
struct Scores {
    noisy_psnr_db: f64,
    psnr_db: f64,
    ssim: f64,
}

fn noise(text: &str) -> std::result::Result<f32, String> {
    match text.parse() {
        Ok(value) if (0.0..=255.0).contains(&value) => Ok(value),
        _ => Err("give a number from 0 to 255".into()),
    }
}

pub(crate) fn run(args: &DenoiseArgs, terminal: &Terminal) -> Result<Outcome> {
    if args.out.is_none() && !args.add {
        return Err(Error::refused(
            "denoise/no-output",
            "there is no output",
            "name a file with --out, or compare the result with the picture by --add",
        ));
    }
    if let Some(out) = &args.out {
        if out.extension().is_none_or(|e| !e.eq_ignore_ascii_case("png")) {
            return Err(Error::refused(
                "denoise/unknown-ending",
                format!("{}: pictures are written as PNG", out.display()),
                "name a file that ends in .png",
            ));
        }
        let inputs = [Some(args.picture.as_path()), args.weights.as_deref()];
        InputFiles::of(inputs.into_iter().flatten()).check_output(out)?;
    }
    let given = read_picture(&args.picture)?;
    let denoiser = match &args.weights {
        Some(path) => NetworkDenoiser::read(path)?,
        None => NetworkDenoiser::shipped()?,
    };
    let deviation = args.noise / 255.0;
    let single = given.mapv(|v| v as f32);
    let noisy = if args.add {
        with_noise(&single, deviation, args.seed)
    } else {
        single
    };
    let clean = denoiser.denoise_even(&noisy, deviation)?;
    let values = |p: &Array3<f32>| p.mapv(|v| f64::from(v.clamp(0.0, 1.0)));
    if let Some(out) = &args.out {
        write_picture(out, &values(&clean))?;
    }
    terminal.clear();
    if args.add {
        // Noisy pictures are scored as they are; what a picture can hold is between black and white.
        let noisy = noisy.mapv(f64::from);
        let found = Scores {
            noisy_psnr_db: psnr_db(noisy.view(), given.view())?,
            psnr_db: psnr_db(values(&clean).view(), given.view())?,
            ssim: ssim_colour(values(&clean).view(), given.view())?,
        };
        if args.json {
            print_json(&found);
        } else {
            print_line!(
                "PSNR {:.2} dB (noisy {:.2}), SSIM {:.4}",
                found.psnr_db,
                found.noisy_psnr_db,
                found.ssim
            );
        }
    }
    Ok(Outcome::Fine)
}
