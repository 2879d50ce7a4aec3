//! `metalith train`: teach the prior of restorations, or the last stage of a camera, from photographs.

use std::path::{Path, PathBuf};

use clap::Args;
use metalith::baselines::{Comparison, StageKind, TrainedStage, TrainingStacks};
use metalith::file::{InputFiles, file_digest};
use metalith::imaging::KernelCache;
use metalith::imaging::scene::images_in;
use metalith::imaging::scene::read_picture;
use metalith::prior::parts::read_stage;
use metalith::prior::{MOST_REFITS, Provenance};
use metalith::text::hex;
use metalith::training::{
    FittedStacks, Photographs, Stacks, TrainingReport, TrainingSpec, train, train_post_processor, train_through_fits,
};
use metalith::{Error, Result};

use super::compare::{BaselineKind, ComparedDesign, LenslessArgs};
use super::paths::{paths, writable};
use super::picture::Assume;
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
    /// of diffusercam, `multi-wiener` for the array of --design, `blending` for the same array from the pictures of
    /// its single elements, or `refined-prior` for the same array from the pictures of the learnt prior.
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

    /// Train for the array as the paper assumes it (needs --design), as `compare --assume paper` simulates it.
    #[arg(long, value_enum, requires = "design")]
    assume: Option<Assume>,

    /// Fits of the picture to its frame between passes of the network, for `refined-prior`: the gradient goes through
    /// them. Then a step takes --batch whole photographs in place of pieces.
    #[arg(long, value_name = "N", default_value_t = 0, requires = "stage")]
    refits: usize,

    /// Begin with the weights of this file instead of random ones: a last stage with as many pictures of a frame.
    #[arg(long, value_name = "WEIGHTS", requires = "stage")]
    begin: Option<PathBuf>,

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
            paper: self.assume.is_some(),
            field_deg: self.field_deg,
            seed: self.seed,
            photographs,
            pixels: self.pixels.map(usize::from),
            learnt: Vec::new(),
            lpips: None,
            exposure: metalith::sensor::StatedExposure::default(),
            curve_lux: Vec::new(),
            times: metalith::baselines::ExposureTimes::Own,
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
        let begun = self.begin.as_deref().map(read_stage).transpose()?;
        let spec = TrainingSpec {
            begun_with: self.begin.as_deref().map(file_digest).transpose()?.map(|d| hex(&d)),
            ..spec.clone()
        };
        let stage = TrainedStage {
            kind,
            assumed: self.assume.is_some(),
            refits: self.refits,
        };
        let mut report = None;
        let mut learn = |made: TrainingStacks<'_>| {
            let TrainingStacks {
                stacks,
                fits,
                provenance,
            } = made;
            let first = begun
                .clone()
                .map(|(of, weights)| self.continued(&of, &provenance, weights))
                .transpose()?;
            let stacks = Stacks::new(stacks, provenance, spec.piece)?;
            report = Some(if fits.is_empty() {
                train_post_processor(&stacks, &spec, first, [out, state], terminal)?
            } else {
                train_through_fits(&FittedStacks::new(stacks, fits), &spec, first, [out, state], terminal)?
            });
            Ok(())
        };
        open.with_training_stacks(0, stage, &beside(out, ".pictures"), &cache, terminal, &mut learn)?;
        Ok(report.expect("a camera that is ready is used"))
    }

    /// Weights to begin with, if they are of a network of this size.
    fn continued(&self, of: &Provenance, trained: &Provenance, weights: Vec<f32>) -> Result<Vec<f32>> {
        if of.kind == trained.kind && of.pictures == trained.pictures {
            return Ok(weights);
        }
        Err(Error::refused(
            "train/begin-of-other-stage",
            format!(
                "{}: weights of a last stage `{}` of {} pictures, not `{}` of {}",
                self.begin.as_deref().unwrap_or(Path::new("")).display(),
                of.kind,
                of.pictures,
                trained.kind,
                trained.pictures
            ),
            "give weights of the stage that is trained",
        ))
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
        begun_with: None,
    };
    spec.check()?;
    let files = images_in(&args.folder)?;
    let out = args.out();
    let state = beside(&out, ".state");
    let named = args.camera.iter().chain(&args.begin).map(PathBuf::as_path);
    InputFiles::of(paths(&files).chain(named)).check_outputs(&[&out, &state])?;
    let through = args.stage == Some(StageKind::RefinedPrior);
    if args.refits > if through { MOST_REFITS } else { 0 } {
        return Err(Error::refused(
            "train/refits-out-of-range",
            format!("{} fits to the frame are not possible for this last stage", args.refits),
            format!("give at most {MOST_REFITS}, and `--stage refined-prior`; other stages have none"),
        ));
    }
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
            "{}: {} weights, {:.2} dB for photographs that were held out ({:.2} dB before the network){}",
            out.display(),
            report.weights,
            report.held_out_psnr_db,
            report.held_out_uncorrected_psnr_db,
            if args.stage.is_some() {
                ""
            } else {
                ", with noise of 25 / 255"
            }
        );
    }
    Ok(Outcome::Fine)
}
