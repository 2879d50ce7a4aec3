//! `metalith train`: teach the prior of restorations, or the last stage of a camera, from photographs.

use std::path::{Path, PathBuf};

use clap::Args;
use metalith::baselines::{Comparison, StageKind};
use metalith::file::InputFiles;
use metalith::imaging::KernelCache;
use metalith::imaging::scene::images_in;
use metalith::imaging::scene::read_picture;
use metalith::training::{Photographs, Stacks, TrainingReport, TrainingSpec, train, train_post_processor};
use metalith::{Error, Result};

use super::compare::{BaselineKind, ComparedDesign, LenslessArgs};
use super::paths::{paths, writable};
use super::{Outcome, Terminal, print_json, print_line};

/// Train a network on the photographs of a folder: the denoiser of the learnt prior, or the last stage of a camera.
///
/// The weights depend on the photographs, the seed and the numbers below, not on the number of threads. Interrupted
/// training continues from a file next to the weights that ends in `.state`. One photograph in twelve is held out and
/// measures the quality of the network.
///
/// With `--stage` a simulated camera first takes the photographs, and they are restored by the methods that the stage
/// begins with. These pictures are cached in a folder next to the weights that ends in `.pictures`.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  metalith train photographs --out denoiser.safetensors --steps 9000\n  \
    metalith train photographs --stage flatnet --camera cameras/gt1930.toml --field-deg 80 \\\n    \
    --pixels 512 --steps 1200 --out flatnet.safetensors"
)]
pub(crate) struct TrainArgs {
    /// Folder of PNG, JPEG, TIFF, EXR or NPY photographs.
    folder: PathBuf,

    /// File for the weights [default: out/denoiser.safetensors, or out/KIND.safetensors for a last stage].
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,

    /// Number of gradient steps.
    #[arg(long, default_value_t = TrainingSpec::default().steps)]
    steps: u64,

    /// Pieces of photographs in a step.
    #[arg(long, default_value_t = TrainingSpec::default().batch)]
    batch: usize,

    /// Pixels along a side of a piece.
    #[arg(long, default_value_t = TrainingSpec::default().piece)]
    piece: usize,

    /// Seed of the first weights, the pieces and the noise.
    #[arg(long, default_value_t = TrainingSpec::default().seed)]
    seed: u64,

    /// Train the last stage of a camera instead: `flatnet` for the mask of flatcam, `unrolled-diffuser` for the surface
    /// of diffusercam, `multi-wiener` for the array of --design, or `blending` for the same array from the pictures of
    /// its single elements.
    #[arg(long, value_name = "KIND", requires = "camera")]
    stage: Option<StageKind>,

    /// Camera file of this camera: sensor, light, exposure and noise.
    #[arg(long, requires = "stage")]
    camera: Option<PathBuf>,

    /// Design of this camera, if it has one: DESIGN.toml[:LAYOUT].
    #[arg(long, value_name = "DESIGN[:LAYOUT]", requires = "stage")]
    design: Option<ComparedDesign>,

    /// Angle from the left to the right edge of a photograph (degrees).
    #[arg(long, default_value_t = 90.0, requires = "stage")]
    field_deg: f64,

    /// Crop the central square of each photograph to this number of pixels: a last stage is for pictures of one size.
    #[arg(long, value_name = "N", requires = "stage", value_parser = clap::value_parser!(u16).range(32..=4096))]
    pixels: Option<u16>,

    #[command(flatten)]
    bare: LenslessArgs,

    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

impl TrainArgs {
    /// The file for the weights.
    fn out(&self) -> PathBuf {
        let named = || self.stage.map_or("denoiser", StageKind::name);
        let default = || Path::new("out").join(named()).with_extension("safetensors");
        self.out.clone().unwrap_or_else(default)
    }

    /// The camera that a last stage is for.
    fn comparison(&self, kind: StageKind, photographs: Vec<PathBuf>, terminal: &Terminal) -> Result<Comparison> {
        let wrong = |what: &str, hint: &str| Err(Error::refused("train/stage-not-for-camera", what, hint));
        let lensless = match (kind, &self.design) {
            (StageKind::FlatNet, None) => vec![self.bare.camera(BaselineKind::Flatcam)?],
            (StageKind::UnrolledDiffuser, None) => vec![self.bare.camera(BaselineKind::Diffusercam)?],
            (_, Some(_)) if kind.is_of_design() => Vec::new(),
            (_, Some(_)) => return wrong("a camera without a lens has no design", "leave --design out"),
            (_, None) => return wrong("this last stage is of the array of a design", "name it by --design"),
        };
        Ok(Comparison {
            camera: self.camera.clone().unwrap_or_default(),
            designs: self.design.iter().map(|d| d.listed(terminal)).collect::<Result<_>>()?,
            lensless,
            methods: Vec::new(),
            separate: false,
            paper: false,
            field_deg: self.field_deg,
            seed: self.seed,
            photographs,
            pixels: self.pixels.map(usize::from),
            learnt: Vec::new(),
            lpips: None,
            exposure: metalith::sensor::StatedExposure::default(),
            curve_lux: Vec::new(),
        })
    }

    /// Teach a last stage.
    fn stage(
        &self,
        kind: StageKind,
        photographs: Vec<PathBuf>,
        spec: &TrainingSpec,
        [out, state]: [&Path; 2],
        terminal: &Terminal,
    ) -> Result<TrainingReport> {
        let comparison = self.comparison(kind, photographs, terminal)?;
        let open = comparison.open(terminal)?;
        Stacks::check(comparison.photographs.len(), open.size(), spec.piece)?;
        let cache = KernelCache::of_user();
        let (stacks, trained) = open.training_stacks(0, kind, &beside(out, ".pictures"), &cache, terminal)?;
        let stacks = Stacks::new(stacks, trained, spec.piece)?;
        train_post_processor(&stacks, spec, out, state, terminal)
    }
}

/// A file beside another.
fn beside(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.to_owned().into_os_string();
    name.push(ending);
    name.into()
}

pub(crate) fn run(args: &TrainArgs, terminal: &Terminal) -> Result<Outcome> {
    terminal.stop_on_interrupt();
    let spec = TrainingSpec {
        steps: args.steps,
        batch: args.batch,
        piece: args.piece,
        seed: args.seed,
    };
    spec.check()?;
    let files = images_in(&args.folder)?;
    let out = args.out();
    let state = beside(&out, ".state");
    InputFiles::of(paths(&files).chain(args.camera.as_deref())).check_outputs(&[&out, &state])?;
    writable(&[&out, &state])?;
    let report = match args.stage {
        Some(kind) => args.stage(kind, files, &spec, [&out, &state], terminal)?,
        None if !args.bare.is_standard() => {
            return Err(Error::refused(
                "train/option-without-stage",
                "options of a mask or of a rough surface are given, and no last stage",
                "give --stage flatnet or --stage unrolled-diffuser, or leave them out",
            ));
        }
        None => {
            let mut pictures = Vec::new();
            for file in &files {
                let name = file.display().to_string();
                pictures.push((name, read_picture(file)?.mapv(|v| v as f32)));
            }
            let photographs = Photographs::new(pictures, spec.piece)?;
            train(&photographs, &spec, &out, &state, terminal)?
        }
    };
    terminal.clear();
    if args.json {
        print_json(&report);
    } else {
        print_line!(
            "{}: {} weights, {:.2} dB for photographs that were held out{}",
            out.display(),
            report.weights,
            report.held_out_psnr_db,
            if args.stage.is_some() {
                ""
            } else {
                ", with noise of 25 / 255"
            }
        );
    }
    Ok(Outcome::Fine)
}
