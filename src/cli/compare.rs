//! `metalith compare`: cameras side by side on the same photographs.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use metalith::camera::Camera;
use metalith::picture::restore::RestorationMethod;
use metalith::picture::scene::{SceneFile, SceneImage, read_scene};
use metalith::picture::{Assumed, Studio};
use metalith::rivals::{
    ArrayCamera, ComparedCamera, Comparison, Contender, DiffuserCam, DiffuserSpec, FlatCam, MaskSpec, compare,
    write_comparison,
};
use metalith::{Design, Error, Result};

use super::paths::apart;
use super::{Outcome, Terminal, images, output, print_json};

/// Take the same photographs with several cameras, restore them in several ways, and print one table of scores.
///
/// Cameras are layouts of designs, and cameras without a lens that are simulated on the same sensor with the same exposure
/// and noise. The table is Markdown; `compare.html` shows the first photograph through each camera.
#[derive(Args)]
#[command(
    after_help = "Example:\n  metalith compare photographs --camera cameras/gt1930.toml --field-deg 80 \\\n    --design log=designs/prototype_3x3.toml --design designs/robust_3x3.toml:robust.gds \\\n    --rivals flatcam,diffusercam --method tikhonov,tv --separate --assume paper --out out/compare\n\n\
    Without `:LAYOUT` the layout of a design is looked for where `metalith layout` and `metalith run` write it. A design with a\n\
    camera of its own, such as one behind a relay, has it and its field behind the layout:\n\
    --design nano=designs/neural_nano_optics.toml::cameras/gt1930_relay.toml:28.9"
)]
pub struct CompareArgs {
    /// Photographs, or folders of them: PNG, JPEG or NPY, all of one size.
    #[arg(required = true)]
    photographs: Vec<PathBuf>,

    /// A design that is compared: [NAME=]DESIGN.toml[:LAYOUT[:CAMERA.toml[:FIELD_DEG]]].
    #[arg(long, value_name = "[NAME=]DESIGN[:LAYOUT]")]
    design: Vec<ComparedDesign>,

    /// The camera file: sensor, light, exposure, noise of all cameras that name no other.
    #[arg(long)]
    camera: PathBuf,

    /// Cameras without a lens: flatcam, diffusercam, separated by commas.
    #[arg(long, value_enum, value_delimiter = ',')]
    rivals: Vec<Rival>,

    /// Ways to restore the frames of designs, separated by commas: tikhonov, tv, richardson-lucy, hqs and what else
    /// `metalith picture` has. Cameras without a lens have their own.
    #[arg(long, value_delimiter = ',', default_value = "tikhonov")]
    method: Vec<String>,

    /// Restore by each element of an array alone too.
    #[arg(long)]
    separate: bool,

    /// Each design also as others assume such cameras to be: `paper`, those of the array that the prototype follows.
    #[arg(long, value_name = "WHOSE")]
    assume: Option<Assume>,

    /// Angle from the left to the right edge of a photograph (degrees).
    #[arg(long, default_value_t = 90.0)]
    field_deg: f64,

    /// Seed of the noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,

    /// Distance of the mask of `flatcam` from the sensor (um).
    #[arg(long, default_value_t = MaskSpec::standard().distance_um, value_name = "UM")]
    mask_distance_um: f64,

    /// Width of an opening of this mask (um).
    #[arg(long, default_value_t = MaskSpec::standard().feature_um, value_name = "UM")]
    mask_feature_um: f64,

    /// Distance of the rough surface of `diffusercam` from the sensor (um).
    #[arg(long, default_value_t = DiffuserSpec::standard().distance_um, value_name = "UM")]
    diffuser_distance_um: f64,

    /// Distance of the random numbers that this surface is made of (um): bumps are about twice as wide.
    #[arg(long, default_value_t = DiffuserSpec::standard().grain_um, value_name = "UM")]
    diffuser_grain_um: f64,

    /// Its opening over the sensor, along each axis.
    #[arg(long, default_value_t = DiffuserSpec::standard().opening, value_name = "SHARE")]
    diffuser_opening: f64,

    /// Folder for `compare.html` and `compare.json`.
    #[arg(long, short, default_value = "out/compare", value_name = "FOLDER")]
    out: PathBuf,

    /// Print `compare.json` instead of the table.
    #[arg(long)]
    json: bool,
}

/// Whose assumptions are compared with the physics.
#[derive(Clone, Copy, clap::ValueEnum)]
enum Assume {
    Paper,
}

/// A camera without a lens.
#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum Rival {
    /// A mask that is a product of two sequences.
    Flatcam,
    /// A rough surface.
    Diffusercam,
}

/// A design, as it is asked for.
#[derive(Clone)]
struct ComparedDesign {
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
    /// The layout that is named, or the one that the program writes by default.
    fn layout(&self, design: &Design) -> Result<PathBuf> {
        if let Some(layout) = &self.layout {
            return Ok(layout.clone());
        }
        let folder = Path::new("out").join(&design.name);
        let there = ["gds", "oas"].map(|e| folder.join(format!("{}_pillars.{e}", design.name)));
        there.iter().find(|p| p.is_file()).cloned().ok_or_else(|| {
            Error::invalid(
                format!("no layout of `{}` at {}", design.name, there[0].display()),
                format!(
                    "write it by `metalith layout {}`, or name it behind a colon",
                    self.design.display()
                ),
            )
        })
    }
}

/// What all cameras are given.
struct Given<'a> {
    args: &'a CompareArgs,
    photographs: Vec<SceneImage>,
    methods: Vec<RestorationMethod>,
    terminal: &'a Terminal,
}

pub fn run(args: &CompareArgs, terminal: &Terminal) -> Result<Outcome> {
    terminal.stop_on_interrupt();
    if args.design.is_empty() && args.rivals.is_empty() {
        return Err(Error::invalid(
            "no camera to compare",
            "give --design, --rivals or both",
        ));
    }
    let methods: Vec<RestorationMethod> = args.method.iter().map(|m| m.parse()).collect::<Result<_>>()?;
    let camera = Camera::read(&args.camera)?;
    let files = images::of_all(&args.photographs)?;
    let [page, numbers] = ["compare.html", "compare.json"].map(|n| args.out.join(n));
    apart(files.iter().map(PathBuf::as_path), &[&page, &numbers])?;
    let given = Given {
        args,
        photographs: files.iter().map(|f| read(f, args.field_deg)).collect::<Result<_>>()?,
        methods,
        terminal,
    };
    let first = &given.photographs[0].view;
    if let Some(other) = given.photographs.iter().find(|p| p.view != *first) {
        return Err(Error::invalid(
            format!(
                "`{}` has {} x {} pixels, the first photograph {} x {}",
                other.name, other.view.columns, other.view.rows, first.columns, first.rows
            ),
            "give photographs of one size",
        ));
    }
    // Mistakes before any work.
    let opened = args
        .design
        .iter()
        .map(|asked| {
            let design = Design::read(&asked.design)?;
            let layout = asked.layout(&design)?;
            let own = asked.camera.as_deref().map(Camera::read).transpose()?;
            Ok((asked, design, layout, own.unwrap_or_else(|| camera.clone())))
        })
        .collect::<Result<Vec<_>>>()?;
    let mut cameras = Vec::new();
    for (asked, design, layout, camera) in &opened {
        given.take_by_design(asked, design, layout, camera, &mut cameras)?;
    }
    for rival in &args.rivals {
        cameras.push(given.take_by_rival(*rival, &camera)?);
    }
    let comparison = Comparison {
        photographs: given.photographs.iter().map(|p| p.name.clone()).collect(),
        size: [first.rows, first.columns],
        camera: camera.name.clone(),
        seed: args.seed,
        cameras,
    };
    write_comparison(&comparison, &args.out)?;
    terminal.clear();
    match args.json {
        true => print_json(&comparison),
        false => {
            output::line(format_args!("{}", comparison.markdown()));
            output::line(format_args!("page: {}", page.display()));
        }
    }
    Ok(Outcome::Fine)
}

fn read(path: &Path, field_deg: f64) -> Result<SceneImage> {
    read_scene(&SceneFile {
        path: path.to_owned(),
        wavelengths_nm: None,
        field_deg,
        distance_um: f64::INFINITY,
    })
}

impl Given<'_> {
    fn take(
        &self,
        contender: &dyn Contender,
        names: (&str, &str),
        photographs: &[SceneImage],
    ) -> Result<ComparedCamera> {
        compare(contender, names, photographs, self.args.seed, self.terminal)
    }

    fn take_by_design(
        &self,
        asked: &ComparedDesign,
        design: &Design,
        layout: &Path,
        camera: &Camera,
        cameras: &mut Vec<ComparedCamera>,
    ) -> Result<()> {
        let name = asked.name.as_deref().unwrap_or(&design.name);
        let mut photographs = self.photographs.clone();
        if let Some(field_deg) = asked.field_deg {
            photographs.iter_mut().for_each(|p| p.view.field_deg = field_deg);
        }
        let studio = Studio::open(design, layout, camera, None, &photographs[0], self.terminal)?;
        let words = format!(
            "the layout of `{}` behind `{}`, {} elements, pillars solved rigorously, veil and dispersion included.",
            design.name,
            camera.name,
            design.elements().len()
        );
        {
            let ready = ArrayCamera::new(&studio, &self.methods, self.args.separate);
            cameras.push(self.take(&ready, (name, &words), &photographs)?);
        }
        if let Some(Assume::Paper) = self.args.assume {
            let narrow = studio.open_without_dispersion(design, layout, None, &photographs[0], self.terminal)?;
            drop(studio);
            let studio = narrow.assuming(Assumed::paper())?;
            let words = format!(
                "`{}` as the paper assumes such cameras to be: one kernel for each element and colour, brightness by a Butterworth filter, one wavelength a colour, no veil, patches of 420 x 420 pixels.",
                design.name
            );
            let ready = ArrayCamera::new(&studio, &self.methods, self.args.separate);
            let name = format!("{name}, paper's assumptions");
            cameras.push(self.take(&ready, (&name, &words), &photographs)?);
        }
        Ok(())
    }

    fn take_by_rival(&self, rival: Rival, camera: &Camera) -> Result<ComparedCamera> {
        let (args, view, terminal) = (self.args, self.photographs[0].view, self.terminal);
        match rival {
            Rival::Flatcam => {
                let mask = MaskSpec::new(args.mask_feature_um, args.mask_distance_um)?;
                let words = format!(
                    "a mask in place of a lens, the product of two sequences of maximum length (511 members of {} um), {} um before the sensor; Tikhonov in closed form by singular values.",
                    mask.feature_um, mask.distance_um
                );
                let ready = FlatCam::new(&mask, camera, view, terminal)?;
                self.take(&ready, ("FlatCam, ours", &words), &self.photographs)
            }
            Rival::Diffusercam => {
                let spec = DiffuserSpec::new(args.diffuser_distance_um, args.diffuser_grain_um, args.diffuser_opening)?;
                let words = format!(
                    "a random smooth surface in place of a lens, numbers {} um apart, {} um before the sensor, its opening {} of the sensor along each axis; caustic by rays; total variation with the crop (ADMM).",
                    spec.grain_um, spec.distance_um, spec.opening
                );
                let ready = DiffuserCam::new(&spec, camera, view, terminal)?;
                self.take(&ready, ("DiffuserCam, ours", &words), &self.photographs)
            }
        }
    }
}
