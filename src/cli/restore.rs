//! `metalith restore`: the picture that a recorded frame is of.

use std::path::{Path, PathBuf};

use clap::Args;
use metalith::file::InputFiles;
use metalith::imaging::scene::SceneImage;
use metalith::imaging::{
    ForecastScene, FrameNumbers, FrameStatement, ImagingSystem, RestoredPicture, RestoredReport, check_scored,
    is_simulated, read_signals,
};
use metalith::restoration::{LearnedDenoiser, RestorationMethod};
use metalith::{Progress, Result};
use ndarray::Array3;

use super::camera_args::{CameraArgs, CameraFiles, distance_um};
use super::course::{Course, OPERATOR};
use super::paths::{name_of, paths};
use super::reading::ReadingArgs;
use super::standard_input::InputFile;
use super::{Outcome, Terminal, print_json, print_line};

/// Restore the picture from a frame that a real camera with the chip recorded.
#[derive(Args)]
#[command(
    after_help = "Example:\n  metalith restore out/prototype_3x3/prototype_3x3_pillars.gds out/picture/frame.png \\\n    --design designs/prototype_3x3.toml --camera cameras/gt1930.toml --out out/restored\n\n\
    The frame is a grey PNG of 8 or 16 bits with all pixels of the sensor: the mosaic of its colour filter array, else one \
    channel below the other. `white` in [exposure] of the camera sets the brightness of the picture. Kernels are cached."
)]
pub(crate) struct RestoreArgs {
    /// The pillar layout; `-` for standard input.
    layout: PathBuf,

    #[command(flatten)]
    reading: ReadingArgs,

    /// The frame: a grey PNG of 8 or 16 bits.
    frame: PathBuf,

    #[command(flatten)]
    with: CameraArgs,

    /// Pixel value of no signal; 0 if left out. Frames of `metalith picture` do not need it.
    #[arg(long, value_name = "N")]
    black_level: Option<u16>,

    /// Pixel value of full scale, such as 4095; for 8 bits 255 if left out. Frames of `metalith picture` do not need
    /// it.
    #[arg(long, value_name = "N")]
    white: Option<u16>,

    /// Distance of the scene (mm); infinite if left out.
    #[arg(long)]
    distance_mm: Option<f64>,

    /// Pixels of the picture along each axis.
    #[arg(long, default_value_t = 800, value_parser = clap::value_parser!(u16).range(64..=4096))]
    pixels: u16,

    /// Restorations: tikhonov, tv, richardson-lucy, hqs, prior (learnt from photographs), separated by commas.
    #[arg(long, value_delimiter = ',', default_value = "tikhonov")]
    method: Vec<String>,

    /// Also restore from each element alone, and blend these pictures.
    #[arg(long)]
    separate: bool,

    /// Weights of the learnt prior from `metalith train`, or another denoiser as `.onnx`; the shipped weights if left
    /// out.
    #[arg(long, value_name = "FILE")]
    prior: Option<PathBuf>,

    /// Folder for `restored.html`, `restored.json` and a `restored_METHOD.png` of 16 bits for each method.
    #[arg(long, short, default_value = "out/restored", value_name = "FOLDER")]
    out: PathBuf,

    /// Print `restored.json` to standard output, without its first two fields, `report` and `metalith`.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &RestoreArgs, terminal: &Terminal) -> Result<Outcome> {
    terminal.stop_on_interrupt();
    let wanted = pictures(&args.method, args.separate)?;
    let files = args.with.read(terminal)?;
    let others = [&args.layout, &args.frame].into_iter().chain(&args.prior);
    let inputs = files.inputs(&args.with, others.map(PathBuf::as_path));
    let CameraFiles {
        mut design,
        camera,
        model,
    } = files;
    args.reading.aim(&mut design);
    let distance_um = distance_um(args.distance_mm)?;
    let side = usize::from(args.pixels);
    // Nothing is known of it but its size and its field.
    let scene = SceneImage::of_rgb(
        "unknown",
        &Array3::zeros((side, side, 3)),
        args.with.field_deg,
        distance_um,
    );
    check_scored(&scene.view)?;
    let outputs: Vec<PathBuf> = [RestoredReport::PAGE, "restored.json"]
        .into_iter()
        .chain(wanted.iter().map(|(restored, _)| restored.picture.as_str()))
        .map(|name| args.out.join(name))
        .collect();
    let written: Vec<&Path> = paths(&outputs).collect();
    InputFiles::of(paths(&inputs)).check_outputs(&written)?;
    let numbers = FrameNumbers {
        black_level: args.black_level,
        white: args.white,
    };
    let signals = read_signals(&args.frame, &camera, numbers)?;
    terminal.follow(Course::of_pictures(1, wanted.len()));
    let layout = InputFile::of(&args.layout)?.below(&args.reading.file, terminal)?;
    let prior = args.prior.as_deref().map(LearnedDenoiser::read).transpose()?;
    let mut system = ImagingSystem::open(&design, &layout, &camera, model.as_ref(), &scene, terminal)?;
    if let Some(prior) = prior {
        system.prior = prior;
    }
    if !is_simulated(&args.frame)? {
        // Nothing is known of the light before a bench.
        system.exposure = system.exposure.by_white(&camera);
    }
    let frame = system.frame_of(signals)?;
    terminal.begin(OPERATOR, 1);
    let operator = system.restoration();
    let forecast_scene = ForecastScene::new(&system, &operator);
    let error = &forecast_scene.operator_error;
    let mut notes = system.notes(&frame, &Array3::zeros((1, 1, 3)));
    notes.extend(error.note(&camera.channel_names()));
    for note in &notes {
        terminal.warn(note);
    }
    let mut restored = Vec::new();
    for (picture, method) in &wanted {
        restored.push(system.restore(&operator, error, &frame, *method, picture.joint, terminal)?);
    }
    let of_frame = FrameStatement {
        notes,
        operator_error: error.overall.clone(),
        ..FrameStatement::new(&system, name_of(&args.layout), &scene, &frame, model.as_ref())
    };
    let report = RestoredReport {
        frame: name_of(&args.frame),
        of_frame,
        pictures: wanted.into_iter().map(|(picture, _)| picture).collect(),
    };
    report.write(
        &frame,
        &restored,
        &camera,
        &terminal.turn_at(&args.out, paths(&inputs))?,
    )?;
    terminal.clear();
    if args.json {
        print_json(&report);
        return Ok(Outcome::Fine);
    }
    print_line!("page: {}", args.out.join(RestoredReport::PAGE).display());
    for picture in &report.pictures {
        print_line!("picture: {}", args.out.join(&picture.picture).display());
    }
    Ok(Outcome::Fine)
}

/// The pictures that are asked for, each once.
fn pictures(names: &[String], separate: bool) -> Result<Vec<(RestoredPicture, RestorationMethod)>> {
    let ways: &[bool] = if separate { &[true, false] } else { &[true] };
    let all = RestorationMethod::of_names(names)?.into_iter().flat_map(|method| {
        ways.iter()
            .map(move |joint| (RestoredPicture::new(method, *joint), method))
    });
    Ok(all.collect())
}
