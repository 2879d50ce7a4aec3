//! `metalith compare`: cameras side by side on the same photographs.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use metalith::baselines::{
    Comparison, DiffuserSpec, ExposureTimes, Lensless, ListedDesign, MaskSpec, write_comparison,
};
use metalith::file::InputFiles;
use metalith::imaging::KernelCache;
use metalith::report::counted;
use metalith::study::plan_comparison;
use metalith::{Design, Error, Result};

use super::course::Course;
use super::exposure_args::{self, ExposureArgs};
use super::paths::paths;
use super::picture::Assume;
use super::{Outcome, Terminal, images, output, print_json, print_line};

/// Take the same photographs with several simulated cameras, restore them by several methods, and print one table of
/// scores.
///
/// Cameras are layouts of designs, and baseline cameras without a lens on the same sensor, with the same exposure and
/// noise. The table is Markdown; `compare.html` shows the first photograph through each camera.
#[derive(Args)]
#[command(
    after_help = "Example:\n  metalith compare photographs --camera cameras/gt1930.toml --field-deg 80 \\\n    --design log=designs/prototype_3x3.toml --design designs/robust_3x3.toml:robust.gds \\\n    --baselines flatcam,diffusercam --method tikhonov,tv --separate --assume paper --out out/compare\n\n\
    Without `:LAYOUT` the layout is the one that `metalith layout` and `metalith run` write by default. A design with its own \
    camera, such as one behind a relay, names camera and field after the layout:\n  \
    --design nano=designs/neural_nano_optics.toml::cameras/gt1930_relay.toml:28.9"
)]
pub(crate) struct CompareArgs {
    /// Photographs, or folders of them: PNG, JPEG, TIFF, EXR or NPY, all of one size.
    #[arg(required = true)]
    photographs: Vec<PathBuf>,

    /// A design to compare: [NAME=]DESIGN.toml[:LAYOUT[:CAMERA.toml[:FIELD_DEG]]].
    #[arg(long, value_name = "[NAME=]DESIGN[:LAYOUT]")]
    design: Vec<ComparedDesign>,

    /// Camera file: sensor, light, exposure and noise of every camera without a camera file.
    #[arg(long)]
    camera: PathBuf,

    /// Baseline cameras without a lens: flatcam, diffusercam, separated by commas.
    #[arg(long, value_enum, value_delimiter = ',')]
    baselines: Vec<BaselineKind>,

    /// Restorations for designs, separated by commas, as in `metalith picture`. Baseline cameras have their own.
    #[arg(long, value_delimiter = ',', default_value = "tikhonov")]
    method: Vec<String>,

    /// Also restore arrays from each element alone, and blend these pictures.
    #[arg(long)]
    separate: bool,

    /// Also compare each design with simplifications: `paper`, those of the paper that the prototype follows. Baseline cameras
    /// then also have one wavelength for each colour.
    #[arg(long, value_name = "WHOSE")]
    assume: Option<Assume>,

    /// Angle from the left to the right edge of a photograph (degrees).
    #[arg(long, default_value_t = 90.0)]
    field_deg: f64,

    /// Crop the central square of each photograph to this number of pixels.
    #[arg(long, value_name = "N", value_parser = images::scored_sides())]
    pixels: Option<u16>,

    /// Weights of last stages from `metalith train --stage`, separated by commas. Each adds a method to the camera that
    /// it was trained for.
    #[arg(long, value_delimiter = ',', value_name = "FILE,...")]
    learnt: Vec<PathBuf>,

    /// Weights of LPIPS (AlexNet): the `state_dict` of the authors' package as safetensors. The column `1 - LPIPS` is
    /// empty without them.
    #[arg(long, value_name = "FILE")]
    lpips: Option<PathBuf>,

    #[command(flatten)]
    exposure: ExposureArgs,

    /// Expose each camera until a white pixel is bright. Without it, cameras whose files say `time_ms = "auto"` are exposed for one
    /// time, the shortest of their own.
    #[arg(long)]
    own_times: bool,

    /// Also take the first photograph in light of these illuminances (lux), separated by commas, for a curve of PSNR over light.
    #[arg(long, value_parser = exposure_args::light_of, value_delimiter = ',', value_name = "LUX,...")]
    lux_curve: Vec<f64>,

    /// Seed of the noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,

    #[command(flatten)]
    bare: LenslessArgs,

    /// Folder for `compare.html` and `compare.json`.
    #[arg(long, short, default_value = "out/compare", value_name = "FOLDER")]
    out: PathBuf,

    /// Also state CPU seconds in `compare.html` and `compare.json`. Without it, two runs write the same bytes.
    #[arg(long, conflicts_with = "plan")]
    timings: bool,

    /// Print `compare.json` instead of the table, without its first two fields, `report` and `metalith`.
    #[arg(long)]
    json: bool,

    /// Only plan the comparison into --out, as shards of one camera each that any number of machines can run. `metalith study
    /// run`, `submit`, `status` and `merge` work on the folder.
    #[arg(long, conflicts_with = "json")]
    plan: bool,
}

/// Optical element in front of the sensor of a camera without a lens.
#[derive(Args)]
pub(crate) struct LenslessArgs {
    /// Distance of the mask of `flatcam` from the sensor (um).
    #[arg(long, default_value_t = MaskSpec::standard().distance_um, value_name = "UM")]
    mask_distance_um: f64,

    /// Width of an opening of the mask of `flatcam` (um).
    #[arg(long, default_value_t = MaskSpec::standard().feature_um, value_name = "UM")]
    mask_feature_um: f64,

    /// Distance of the rough surface of `diffusercam` from the sensor (um).
    #[arg(long, default_value_t = DiffuserSpec::standard().distance_um, value_name = "UM")]
    diffuser_distance_um: f64,

    /// Spacing of the random numbers that define this surface (um); its bumps are about twice as wide.
    #[arg(long, default_value_t = DiffuserSpec::standard().grain_um, value_name = "UM")]
    diffuser_grain_um: f64,

    /// Opening of `diffusercam` over the size of the sensor, along each axis.
    #[arg(long, default_value_t = DiffuserSpec::standard().opening, value_name = "SHARE")]
    diffuser_opening: f64,
}

impl LenslessArgs {
    /// True if nobody asked for another mask or surface.
    pub(crate) fn is_standard(&self) -> bool {
        let (mask, surface) = (MaskSpec::standard(), DiffuserSpec::standard());
        let own = [self.mask_distance_um, self.mask_feature_um];
        let rough = [self.diffuser_distance_um, self.diffuser_grain_um, self.diffuser_opening];
        own == [mask.distance_um, mask.feature_um] && rough == [surface.distance_um, surface.grain_um, surface.opening]
    }

    /// A camera of this kind.
    ///
    /// # Errors
    /// If a length is out of its range.
    pub(crate) fn camera(&self, kind: BaselineKind) -> Result<Lensless> {
        Ok(match kind {
            BaselineKind::Flatcam => Lensless::FlatCam(MaskSpec::new(self.mask_feature_um, self.mask_distance_um)?),
            BaselineKind::Diffusercam => Lensless::DiffuserCam(DiffuserSpec::new(
                self.diffuser_distance_um,
                self.diffuser_grain_um,
                self.diffuser_opening,
            )?),
        })
    }
}

/// A camera without a lens.
#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
pub(crate) enum BaselineKind {
    /// A mask that is a product of two sequences.
    Flatcam,
    /// A rough surface.
    Diffusercam,
}

/// A design, as it is asked for.
#[derive(Clone)]
pub(crate) struct ComparedDesign {
    name: Option<String>,
    design: PathBuf,
    layout: Option<PathBuf>,
    camera: Option<PathBuf>,
    field_deg: Option<f64>,
}

impl FromStr for ComparedDesign {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let (name, files) = match text.split_once('=') {
            Some((name, files)) => (Some(name.to_owned()), files),
            None => (None, text),
        };
        let mut parts = files.split(':');
        let mut next = || parts.next().filter(|p| !p.is_empty());
        let design = next().ok_or("name a design file: [NAME=]DESIGN.toml[:LAYOUT[:CAMERA.toml[:FIELD_DEG]]]")?;
        let (layout, camera, field) = (next(), next(), next());
        let field_deg = match field {
            Some(text) => Some(text.parse().map_err(|_| format!("`{text}` is no field in degrees"))?),
            None => None,
        };
        match parts.next() {
            Some(more) => Err(format!("`{more}` is one part too many")),
            None => Ok(Self {
                name,
                design: design.into(),
                layout: layout.map(Into::into),
                camera: camera.map(Into::into),
                field_deg,
            }),
        }
    }
}

impl ComparedDesign {
    /// Design as the library lists it.
    ///
    /// # Errors
    /// If the design cannot be read, or has no layout.
    pub(crate) fn listed(&self, terminal: &Terminal) -> Result<ListedDesign> {
        Ok(ListedDesign {
            name: self.name.clone(),
            layout: self.layout(&Design::read_with(&self.design, terminal)?)?,
            design: self.design.clone(),
            camera: self.camera.clone(),
            field_deg: self.field_deg,
        })
    }

    /// The layout that is named, or the one that the program writes by default.
    fn layout(&self, design: &Design) -> Result<PathBuf> {
        if let Some(layout) = &self.layout {
            return Ok(layout.clone());
        }
        let folder = Path::new("out").join(&design.name);
        let there = ["gds", "oas"].map(|e| folder.join(format!("{}_pillars.{e}", design.name)));
        there.iter().find(|p| p.is_file()).cloned().ok_or_else(|| {
            Error::refused(
                "compare/no-layout",
                format!("no layout of `{}` at {}", design.name, there[0].display()),
                format!(
                    "write it by `metalith layout {}`, or name it behind a colon",
                    self.design.display()
                ),
            )
        })
    }
}

impl CompareArgs {
    /// Comparison that is asked for, as the library has it.
    fn comparison(&self, terminal: &Terminal) -> Result<Comparison> {
        Ok(Comparison {
            camera: self.camera.clone(),
            designs: self.design.iter().map(|d| d.listed(terminal)).collect::<Result<_>>()?,
            lensless: self
                .baselines
                .iter()
                .map(|r| self.bare.camera(*r))
                .collect::<Result<_>>()?,
            methods: self.method.clone(),
            separate: self.separate,
            paper: matches!(self.assume, Some(Assume::Paper)),
            field_deg: self.field_deg,
            seed: self.seed,
            photographs: images::of_all(&self.photographs)?,
            pixels: self.pixels.map(usize::from),
            learnt: self.learnt.clone(),
            lpips: self.lpips.clone(),
            exposure: self.exposure.stated(),
            curve_lux: self.lux_curve.clone(),
            times: if self.own_times {
                ExposureTimes::Own
            } else {
                ExposureTimes::Equal
            },
        })
    }
}

pub(crate) fn run(args: &CompareArgs, terminal: &Terminal) -> Result<Outcome> {
    terminal.stop_on_interrupt();
    let comparison = args.comparison(terminal)?;
    let inputs = comparison.inputs();
    let outputs = ["compare.html", "compare.json"].map(|n| args.out.join(n));
    InputFiles::of(paths(&inputs)).check_outputs(&[&outputs[0], &outputs[1]])?;
    if args.plan {
        let plan = plan_comparison(&comparison, &args.out, terminal)?;
        terminal.clear();
        print_line!(
            "{} in as many shards: {}",
            counted(plan.cut().shards() as usize, "camera"),
            args.out.display()
        );
        return Ok(Outcome::Fine);
    }
    let cache = KernelCache::of_user();
    let ways = comparison.methods.len() * if comparison.separate { 2 } else { 1 };
    let cameras = comparison.designs.len() + comparison.lensless.len();
    terminal.follow(Course::of_pictures(cameras, comparison.photographs.len() * ways));
    let open = comparison.open(terminal)?;
    open.notes().iter().for_each(|note| terminal.say(note));
    let time_ms = open.equal_time_ms(&cache, terminal)?;
    let open = open.exposed_for(time_ms)?;
    let take = |k| open.take(k, &cache, terminal);
    let comparison = open.comparison((0..comparison.count()).map(take).collect::<Result<_>>()?);
    terminal.clear();
    let table = comparison.markdown();
    let stated = if args.timings { comparison } else { comparison.untimed() };
    write_comparison(&stated, &terminal.turn_at(&args.out, paths(&inputs))?)?;
    if args.json {
        print_json(&stated);
    } else {
        tell(&table, &args.out);
    }
    Ok(Outcome::Fine)
}

/// Print the table of a comparison and where its page is.
pub(crate) fn tell(table: &str, folder: &Path) {
    output::print_text(table);
    output::line(format_args!("page: {}", folder.join("compare.html").display()));
}
