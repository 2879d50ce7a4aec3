//! `metalith picture`: the picture that a layout will take.

use std::path::{Path, PathBuf};

use clap::Args;
use metalith::file::InputFiles;
use metalith::imaging::scene::{BuiltIn, SceneFile, SceneImage, chart, read_depth, read_scene};
use metalith::imaging::{
    ForecastScene, Frame, FrameFile, FrameStatement, ImagingSystem, KernelCache, PicturePages, PictureReport,
    RestorationReport, ScenePower, Uncertainty, ZoneScore, check_scored, contrast_curves, no_gain, picture_file,
    psnr_words, scores, worth_of_assumptions, write_pages,
};
use metalith::optics::CalibratedModel;
use metalith::restoration::{LearnedDenoiser, RestorationMethod};
use metalith::{Error, Progress, Result};

use super::camera_args::{CameraArgs, CameraFiles, distance_um};
use super::course::{Course, FRAME, OPERATOR};
use super::paths::{name_of, paths};
use super::reading::ReadingArgs;
use super::standard_input::InputFile;
use super::{Outcome, Terminal, print_json, print_line};

/// Simulate the frame that a camera with the chip records of a scene, and restore the picture from it.
#[derive(Args)]
#[command(
    after_help = "Example:\n  metalith picture out/prototype_3x3/prototype_3x3_pillars.gds --camera cameras/gt1930.toml \\\n    --design designs/prototype_3x3.toml scene.png --out out/picture\n\n\
    The scene is a PNG, JPEG or TIFF in sRGB or with a colour profile, an EXR or NPY of linear light, an NPY cube with --wavelengths-nm, or one of the built-in \
    scenes chart, star and edge. Pixels of the scene that are finer than half a sensor pixel are averaged. Kernels are cached."
)]
pub(crate) struct PictureArgs {
    /// The pillar layout; `-` for standard input.
    layout: PathBuf,

    #[command(flatten)]
    reading: ReadingArgs,

    /// The scene: an image file, `-` for standard input, or `chart`, `star`, `edge`.
    scene: String,

    #[command(flatten)]
    with: CameraArgs,

    /// Seed of the noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,

    /// Distance of the scene (mm); infinite if left out.
    #[arg(long)]
    distance_mm: Option<f64>,

    /// Distance of each pixel of the scene: an NPY in millimetres (`inf` is far), or a grey PNG of 16 bits in whole
    /// millimetres.
    #[arg(long, value_name = "FILE")]
    depth: Option<PathBuf>,

    /// Wavelengths of the bands of a spectral cube (nm), separated by commas. They must contain 95 % of the light that
    /// each channel of the camera counts.
    #[arg(long, value_delimiter = ',', value_name = "NM,NM,...")]
    wavelengths_nm: Option<Vec<f64>>,

    /// Pixels along an axis of a built-in scene; 800 if left out.
    #[arg(long, value_parser = super::images::scored_sides())]
    pixels: Option<u16>,

    /// Restorations: tikhonov, tv, richardson-lucy, hqs, prior (learnt from photographs), separated by commas. The page
    /// shows the first.
    #[arg(long, value_delimiter = ',', default_value = "tikhonov")]
    method: Vec<String>,

    /// Leave out the forecast, which costs as much as two restorations by Tikhonov.
    #[arg(long)]
    no_forecast: bool,

    /// Also restore from each element alone, and blend these pictures.
    #[arg(long)]
    separate: bool,

    /// Weights of the learnt prior from `metalith train`, or another denoiser as `.onnx`; the shipped weights if left
    /// out.
    #[arg(long, value_name = "FILE")]
    prior: Option<PathBuf>,

    /// With the learnt prior, draw this number of pictures that agree with the frame, and write their mean and an uncertainty
    /// map.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(2..=64))]
    samples: Option<u8>,

    /// Also compute the effect of simplifications: `paper`, those of the paper that the prototype follows.
    #[arg(long, value_name = "WHOSE")]
    assume: Option<Assume>,

    /// Folder for `picture.html`, `picture.json`, `frame.png` and a `restored_METHOD.png` for each method, images of 16
    /// bits.
    #[arg(long, short, default_value = "out/picture", value_name = "FOLDER")]
    out: PathBuf,

    /// Print `picture.json` to standard output, without its first two fields, `report` and `metalith`.
    #[arg(long)]
    json: bool,
}

/// Pixels an axis of a built-in scene, if nothing else is said.
const PIXELS: u16 = 800;

/// Source of the assumptions that are compared with the physics.
#[derive(Clone, Copy, clap::ValueEnum)]
pub(crate) enum Assume {
    Paper,
}

impl PictureArgs {
    /// All files that are written, the page first.
    fn outputs(&self, methods: &[RestorationMethod]) -> Vec<PathBuf> {
        let ways: &[bool] = if self.separate { &[true, false] } else { &[true] };
        let pictures = methods
            .iter()
            .flat_map(|method| ways.iter().map(move |joint| picture_file(*method, *joint)));
        let plain = ["picture.html", "picture.json", FrameFile::NAME].map(str::to_owned);
        let all = plain.into_iter().chain(pictures);
        all.map(|name| self.out.join(name)).collect()
    }

    fn scene(&self) -> Result<SceneImage> {
        let distance_um = distance_um(self.distance_mm)?;
        let built_in = self.scene.parse::<BuiltIn>().ok();
        let idle = |option: &str, what: &str| {
            Err(Error::refused(
                "option/not-for-scene",
                format!("{option} does not apply to `{}`: it is for {what}", self.scene),
                format!("leave {option} out, or give another scene"),
            ))
        };
        let scene = match built_in {
            Some(_) if self.wavelengths_nm.is_some() => return idle("--wavelengths-nm", "spectral cubes"),
            None if self.pixels.is_some() => return idle("--pixels", "the built-in scenes chart, star and edge"),
            Some(kind) => {
                let pixels = self.pixels.unwrap_or(PIXELS);
                chart(kind, pixels.into(), self.with.field_deg, distance_um)
            }
            None => {
                let file = InputFile::of(self.scene.as_ref())?;
                read_scene(&SceneFile {
                    path: file.to_owned(),
                    wavelengths_nm: self.wavelengths_nm.clone(),
                    field_deg: self.with.field_deg,
                    distance_um,
                })?
            }
        };
        check_scored(&scene.view)?;
        match &self.depth {
            Some(path) => scene.with_depth(read_depth(path)?),
            None => Ok(scene),
        }
    }
}

/// Pictures that are restored for a forecast of scenes of some hundred pixels.
const OF_FORECAST: usize = 2;

pub(crate) fn run(args: &PictureArgs, terminal: &Terminal) -> Result<Outcome> {
    terminal.stop_on_interrupt();
    let methods = RestorationMethod::of_names(&args.method)?;
    let files = args.with.read(terminal)?;
    let others = [&args.depth, &args.prior].into_iter().filter_map(Option::as_deref);
    let ways = if args.separate { 2 } else { 1 };
    let is_forecast = !args.no_forecast && methods.contains(&RestorationMethod::Tikhonov);
    let of_forecast = if is_forecast { OF_FORECAST } else { 0 };
    terminal.follow(Course::of_pictures(1, methods.len() * ways + of_forecast));
    let inputs = files.inputs(&args.with, others.chain([args.layout.as_path(), args.scene.as_ref()]));
    let CameraFiles {
        mut design,
        camera,
        model,
    } = files;
    args.reading.aim(&mut design);
    let scene = args.scene()?;
    let outputs = args.outputs(&methods);
    let written: Vec<&Path> = paths(&outputs).collect();
    InputFiles::of(paths(&inputs)).check_outputs(&written)?;
    let layout = InputFile::of(&args.layout)?.below(&args.reading.file, terminal)?;
    let prior = args.prior.as_deref().map(LearnedDenoiser::read).transpose()?;
    let mut system = ImagingSystem::open(&design, &layout, &camera, model.as_ref(), &scene, terminal)?;
    if let Some(prior) = prior {
        system.prior = prior;
    }
    terminal.begin(FRAME, 1);
    // Once: it is asked for again and again.
    let scene = system.simulated(&scene).into_owned();
    let simulation = system.simulation_of(&scene);
    let frame = system.record(&simulation, &scene, args.seed)?;
    let truth = system.truth(&scene);
    drop(simulation);
    let notes = system.notes(&frame, &truth);
    notes.iter().for_each(|note| terminal.warn(note));
    terminal.begin(OPERATOR, 1);
    let operator = system.restoration();
    let forecast_scene = ForecastScene::new(&system, &operator);
    let error = &forecast_scene.operator_error;
    let limited = error.note(&camera.channel_names());
    if let Some(note) = &limited {
        terminal.say(note);
    }
    let mut pictures = Vec::new();
    let mut found = Vec::new();
    for method in methods {
        for joint in [true, false] {
            if joint || args.separate {
                let picture = system.restore(&operator, error, &frame, method, joint, terminal)?;
                let mut restoration = RestorationReport::new(method, joint, scores(&picture, &truth)?);
                // What is lost by other methods depends on more than the spectrum of a scene.
                if method == RestorationMethod::Tikhonov && joint && !args.no_forecast {
                    let forecast = forecast_scene.forecast(&system, &operator, terminal)?;
                    restoration.forecast_of_scene_db = forecast.psnr_linear_db(&ScenePower::of(&truth));
                    let natural = system.natural_scenes().into_iter();
                    restoration.forecast_natural = natural.map(|scenes| forecast.natural(scenes)).collect();
                }
                found.push(restoration);
                pictures.push(picture);
            }
        }
    }
    let no_gain = if frame.is_lost() { Vec::new() } else { no_gain(&found) };
    no_gain.iter().for_each(|note| terminal.say(note));
    let mut report = report(args, &system, &scene, &frame, found, model.as_ref());
    report.of_frame.operator_error.clone_from(&error.overall);
    if let Ok(kind) = args.scene.parse::<BuiltIn>() {
        report.contrast = contrast_curves(&system, kind, &truth, &frame, &pictures[0]);
    }
    let uncertainty = match args.samples {
        Some(n) => Some(Uncertainty::of(&system.samples(
            &operator,
            error,
            &frame,
            0..n.into(),
            terminal,
        )?)),
        None => None,
    };
    report.uncertainty = uncertainty.as_ref().map(|d| d.report(&truth)).transpose()?;
    if let Some(Assume::Paper) = args.assume {
        drop(operator);
        let narrow = system.open_without_dispersion(
            &design,
            &layout,
            model.as_ref(),
            &scene,
            &KernelCache::of_user(),
            terminal,
        )?;
        report.worth = worth_of_assumptions(&system, &narrow, &scene, args.seed, terminal)?;
    }
    report.of_frame.notes = notes;
    report.of_frame.notes.extend(limited.into_iter().chain(no_gain));
    let pages = PicturePages {
        report: &report,
        scene: &truth,
        frame: &frame,
        restored: &pictures,
        camera: &camera,
        uncertainty: uncertainty.as_ref(),
    };
    write_pages(&pages, &terminal.turn_at(&args.out, paths(&inputs))?)?;
    terminal.clear();
    if args.json {
        print_json(&report);
        return Ok(Outcome::Fine);
    }
    let score = |whole: &ZoneScore| {
        if frame.is_lost() {
            "no score, most pixels are at full scale".to_owned()
        } else {
            format!("PSNR {}, SSIM {:.3}", psnr_words(whole.psnr_db), whole.ssim)
        }
    };
    for restoration in &report.restorations {
        let way = if restoration.joint {
            "joint"
        } else {
            "each element alone"
        };
        print_line!("{}, {way}: {}", restoration.method, score(&restoration.scores[0]));
        if let Some(forecast) = restoration.forecast_words().filter(|_| !frame.is_lost()) {
            print_line!("{}, {way}: {forecast}", restoration.method);
        }
    }
    if let Some(uncertainty) = &report.uncertainty {
        print_line!(
            "mean of {} samples: {}; rank correlation of uncertainty and error {:.2}",
            uncertainty.samples,
            score(&uncertainty.scores[0]),
            uncertainty.rank_correlation
        );
    }
    let light = &report.of_frame.light;
    print_line!(
        "{}; electrons of a white pixel: {}; its SNR: {}",
        light.words(),
        light.each(|w| Some(w.electrons), 0),
        light.each(|w| w.snr, 1)
    );
    print_line!("page: {}", outputs[0].display());
    print_line!("frame: {}", args.out.join(FrameFile::NAME).display());
    for restoration in &report.restorations {
        print_line!("picture: {}", args.out.join(&restoration.picture).display());
    }
    Ok(Outcome::Fine)
}

fn report(
    args: &PictureArgs,
    system: &ImagingSystem,
    scene: &SceneImage,
    frame: &Frame,
    restorations: Vec<RestorationReport>,
    model: Option<&CalibratedModel>,
) -> PictureReport {
    PictureReport {
        scene: scene.name.clone(),
        of_frame: FrameStatement::new(system, name_of(&args.layout), scene, frame, model),
        frame: FrameFile::of(&system.camera, frame),
        restorations,
        budget: system.budget(),
        points: system.point_images(),
        elements: system.element_images(),
        homographies: system.homographies(),
        contrast: Vec::new(),
        uncertainty: None,
        worth: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Alone {
        #[command(flatten)]
        picture: PictureArgs,
    }

    #[test]
    fn scenes_and_their_options_fit_or_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let small = folder.path().join("small.png").display().to_string();
        metalith::imaging::write_picture(small.as_ref(), &ndarray::Array3::from_elem((32, 40, 3), 0.5)).unwrap();
        let tiny = folder.path().join("tiny.png").display().to_string();
        metalith::imaging::write_picture(tiny.as_ref(), &ndarray::Array3::from_elem((8, 8, 3), 0.5)).unwrap();
        let scene = |of: &[&str]| {
            let files = [
                "picture",
                "layout.gds",
                "--camera",
                "camera.toml",
                "--design",
                "design.toml",
            ];
            let alone = Alone::try_parse_from(files.iter().chain(of)).unwrap();
            alone.picture.scene().map(|scene| scene.view.rows)
        };
        assert_eq!(scene(&["star"]).unwrap(), 800);
        assert_eq!(scene(&["edge", "--pixels", "33"]).unwrap(), 33);
        for (of, id) in [
            (&["star", "--wavelengths-nm", "400,500"][..], "option/not-for-scene"),
            (&["scene.png", "--pixels", "64"], "option/not-for-scene"),
            (&[&small], "score/too-small"),
            (&[&tiny], "table/malformed"),
        ] {
            let error = scene(of).unwrap_err();
            assert_eq!(error.id(), id, "{error}");
        }
    }
}
