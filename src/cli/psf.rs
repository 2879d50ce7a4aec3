//! `metalith psf`: what a layout from anywhere does to light.

mod light;
mod optics;

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use metalith::cell::{Analyser, Fidelity, Handedness, Polarisation};
use metalith::design::TALLEST_NM;
use metalith::gds::{LayerNumber, ReadLimits};
use metalith::report::{count, exact, sig};
use metalith::verify::{
    STREHL_AGAINST, SimulationCase, SinglePsfReport, single_psfs, single_white, write_single_psf_report,
};
use metalith::{
    AsBuiltChip, CalibratedModel, Error, Extraction, ExtractionPlan, Layout, PolarisationBasis, Result, extract,
};

use self::light::PsfLight;
use super::standard_input::InputFile;
use super::verify::FidelityArg;
use super::{Outcome, Terminal, print_line};

/// Find the elements of any layout in GDSII or OASIS, read their pillars, and simulate their PSFs.
#[derive(Args)]
#[command(
    after_help = "Example:\n  metalith psf lens.gds --layer 1/0 --distance-um 2400 --wavelength-nm 530 --out out/lens\n\n\
    Light comes along the chip's normal unless --angle-x-deg, --angle-y-deg say otherwise; the window is about the \
    element's axis unless --at-x-um, --at-y-um do. A steered element sends light along the normal far off its axis."
)]
pub struct PsfArgs {
    /// The layout, by whatever program it was written; `-` for standard input.
    layout: PathBuf,

    /// Layer and datatype of the pillars.
    #[arg(long, default_value = "1/0", value_parser = layer)]
    layer: LayerNumber,

    /// Cell to start from; the top cell if there is one only.
    #[arg(long)]
    top: Option<String>,

    /// From the pillar tops to the sensor (um).
    #[arg(long, default_value_t = 2400.0, value_parser = between(0.1, 1e6))]
    distance_um: f64,

    /// Wavelength (nm); may be given several times. 455, 530 and 660 nm if left out; with a --camera that does not count light
    /// from 455 to 660 nm the middle of each of its channels.
    #[arg(long = "wavelength-nm", value_parser = between(150.0, 20_000.0))]
    wavelengths_nm: Vec<f64>,

    /// Angle of incidence in the x-z plane, in air (degrees).
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, value_parser = between(-STEEPEST_DEG, STEEPEST_DEG))]
    angle_x_deg: f64,

    /// Angle of incidence in the y-z plane, in air (degrees).
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, value_parser = between(-STEEPEST_DEG, STEEPEST_DEG))]
    angle_y_deg: f64,

    /// Middle of the window from the element's axis (um).
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, value_parser = between(-1e6, 1e6))]
    at_x_um: f64,

    /// Middle of the window from the element's axis (um).
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, value_parser = between(-1e6, 1e6))]
    at_y_um: f64,

    /// Samples an axis, one pitch apart.
    #[arg(long, default_value_t = 256, value_parser = samples)]
    samples: usize,

    /// Height of the pillars (nm), for all cells but the published one.
    #[arg(long, default_value_t = 700.0, value_parser = between(10.0, TALLEST_NM))]
    height_nm: f64,

    /// Material of the pillars: a name that a design file takes, or a CSV table of its index.
    #[arg(long, default_value = "sin_luke_2015")]
    pillar_material: String,

    /// Material of the substrate, likewise.
    #[arg(long, default_value = "fused_silica_malitson_1965")]
    substrate_material: String,

    /// Thickness of a layer between substrate and film (nm).
    #[arg(long, default_value_t = 0.0, value_parser = between(0.0, TALLEST_NM))]
    spacer_nm: f64,

    /// Its material.
    #[arg(long, value_name = "MATERIAL")]
    spacer_material: Option<String>,

    /// Thickness of the film that the etch left between the pillars (nm).
    #[arg(long, default_value_t = 0.0, value_parser = between(0.0, TALLEST_NM))]
    residual_nm: f64,

    /// Refractive index between the pillars and towards the sensor; that of air if left out.
    #[arg(long, value_parser = between(1.0, 3.0))]
    ambient_index: Option<f64>,

    /// Material there, in place of --ambient-index.
    #[arg(long, value_name = "MATERIAL", conflicts_with = "ambient_index")]
    ambient_material: Option<String>,

    /// Edge of a sensor pixel (um); that of the --camera if left out, without one 5.86.
    #[arg(long, value_parser = between(0.1, 100.0))]
    pixel_um: Option<f64>,

    /// The cell.
    #[arg(long, value_enum, default_value = "rigorous")]
    fidelity: FidelityArg,

    /// The chip as a measured line and bench make it: the `model.toml` that `metalith calibrate` wrote. Distance and
    /// angles are those stated; what the model adds to them is added.
    #[arg(long, value_name = "MODEL", conflicts_with = "fidelity")]
    model: Option<PathBuf>,

    /// Diameter of the openings in the metal (um), for a model whose aperture is off its place; that of the circle
    /// around the pillars if left out.
    #[arg(long, value_parser = between(0.1, 1e5))]
    aperture_um: Option<f64>,

    /// Solve the cell at the angle of incidence, for both polarisations, instead of along the normal.
    #[arg(long)]
    as_lit: bool,

    /// Simulate with errors of 1e-3 instead of 1e-5 of the amplitude of a perfect lens, several times faster.
    #[arg(long)]
    fast: bool,

    /// Simulate white light for the camera of this file too: all wavelengths from the angle of incidence.
    #[arg(long, value_name = "CAMERA")]
    camera: Option<PathBuf>,

    /// Angle in the x-z plane by which the elements steer at --wedge-wavelength-nm (degrees); with --camera it says
    /// where each wavelength lands, which a layout does not.
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, requires = "camera")]
    wedge_x_deg: f64,

    /// The same in the y-z plane.
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, requires = "camera")]
    wedge_y_deg: f64,

    /// Wavelength at which the elements steer by these angles (nm).
    #[arg(long, default_value_t = 550.0, requires = "camera")]
    wedge_wavelength_nm: f64,

    /// Polarisation of the light that arrives, where the pillars are rectangles (if left out, `left` at rotated ones and `x` at upright ones): `left` or `right` circular,
    /// with (x + i y) / sqrt 2 for left and a wave along +z, linear along `x` or `y` or at an angle from x towards y (degrees),
    /// or `unpolarised`.
    #[arg(long, value_name = "POLARISATION", allow_negative_numbers = true, value_parser = polarisation)]
    arriving: Option<Polarisation>,

    /// What is before the sensor, where the pillars are rectangles: `circular` (of rotated ones), which passes the hand that focused light is
    /// converted to, or linear along `x` or `y` or at an angle from x towards y (degrees).
    #[arg(long, value_name = "ANALYSER", allow_negative_numbers = true, value_parser = analyser)]
    analyser: Option<Analyser>,

    /// Circular polarisation of the light that the layout focuses, which decides what a circular --analyser passes; that of
    /// --arriving if left out.
    #[arg(long, value_enum, requires = "analyser")]
    focused: Option<CircularArg>,

    /// Only read the pillars; simulate nothing.
    #[arg(long)]
    extract_only: bool,

    /// Folder for a report and the PSFs as NPY.
    #[arg(long, short, value_name = "FOLDER")]
    out: Option<PathBuf>,

    /// Print all numbers as JSON.
    #[arg(long)]
    json: bool,
}

/// A word or an angle.
fn polarisation(text: &str) -> std::result::Result<Polarisation, String> {
    text.parse().map_err(|e: Error| e.to_string())
}

/// A word or an angle.
fn analyser(text: &str) -> std::result::Result<Analyser, String> {
    text.parse().map_err(|e: Error| e.to_string())
}

/// Circular polarisations.
#[derive(Clone, Copy, ValueEnum)]
enum CircularArg {
    /// (x + i y) / sqrt 2 for a wave along +z.
    Left,
    Right,
}

impl From<CircularArg> for Handedness {
    fn from(arg: CircularArg) -> Self {
        match arg {
            CircularArg::Left => Self::Left,
            CircularArg::Right => Self::Right,
        }
    }
}

/// `1/0`, or `1`, as layer 1, datatype 0.
pub fn layer(text: &str) -> std::result::Result<LayerNumber, String> {
    let (layer, datatype) = text.split_once('/').unwrap_or((text, "0"));
    match (layer.parse(), datatype.parse()) {
        (Ok(layer), Ok(datatype)) => Ok(LayerNumber::new(layer, datatype)),
        _ => Err("write layer and datatype as 1/0".into()),
    }
}

/// Light that is steeper grazes the chip: no detector of an angle is that good, and cosines become zero.
const STEEPEST_DEG: f64 = 89.0;

/// Samples along an axis of a window.
fn samples(text: &str) -> std::result::Result<usize, String> {
    const SAMPLES: std::ops::RangeInclusive<usize> = 2..=8192;
    match text.parse() {
        Ok(value) if SAMPLES.contains(&value) => Ok(value),
        _ => Err(format!(
            "give a whole number from {} to {}",
            SAMPLES.start(),
            SAMPLES.end()
        )),
    }
}

/// A number from `low` to `high`.
fn between(low: f64, high: f64) -> impl Fn(&str) -> std::result::Result<f64, String> + Clone + Send + Sync + 'static {
    move |text| match text.parse::<f64>() {
        Ok(value) if (low..=high).contains(&value) => Ok(value),
        _ => Err(format!("give a number from {low} to {high}")),
    }
}

/// A figure of a layout of which most was left out would be a figure of something else.
fn mostly_pillars(args: &PsfArgs, found: &Extraction) -> Result<()> {
    let others = found.oddities.total();
    if args.extract_only || others <= found.pillars {
        return Ok(());
    }
    Err(Error::invalid(
        format!(
            "{}: only {} of {} shapes on layer {} are {} on a lattice",
            args.layout.display(),
            count(found.pillars),
            count(found.pillars + others),
            args.layer,
            found.shape.plural()
        ),
        "name the layer of the pillars with --layer, or look at what else is there with --extract-only --json",
    ))
}

/// One cell is solved for all elements: their pillars stand on lattices of one kind and pitch, which the cell must know.
fn one_kind(args: &PsfArgs, found: &Extraction) -> Result<()> {
    found.check_one_lattice(
        &args.layout,
        "name a cell with elements of one kind by --top, or look at what is there with --extract-only --json",
    )?;
    if args.model.is_none()
        && !args.extract_only
        && let Some((what, hint)) = Fidelity::from(args.fidelity).refusal(found.shape, PsfArgs::lattice_kind(found))
    {
        return Err(Error::invalid(format!("{}: {what}", args.layout.display()), hint));
    }
    Ok(())
}

/// Light of a polarisation is simulated where pillars tell polarisations apart, and a circular analyser for light of both hands must be
/// told which it passes.
fn known_light(args: &PsfArgs, found: &Extraction) -> Result<()> {
    if found.shape.basis().is_none() && (args.arriving.is_some() || args.analyser.is_some()) {
        return Err(Error::invalid(
            format!(
                "{}: light of a polarisation for {}",
                args.layout.display(),
                found.shape.plural()
            ),
            "leave out --arriving and --analyser: they count for rectangles alone, others are simulated in light that is not \
             polarised",
        ));
    }
    if found.shape.basis() == Some(PolarisationBasis::Linear)
        && (args.analyser == Some(Analyser::Circular) || args.focused.is_some())
    {
        return Err(Error::invalid(
            format!(
                "{}: its pillars are upright rectangles, which focus linear light, and {} was asked for",
                args.layout.display(),
                match args.focused {
                    Some(_) => "a hand by --focused",
                    None => "a circular analyser",
                }
            ),
            match args.focused {
                Some(_) => "leave out --focused",
                None => "give --analyser x, y or an angle",
            },
        ));
    }
    if args.analyser == Some(Analyser::Circular) && args.hand().is_none() {
        return Err(Error::invalid(
            format!(
                "a circular analyser in light that arrives {}",
                args.arriving(found.shape)
            ),
            "say which hand the layout focuses by --focused left or right: the analyser passes what that is converted to",
        ));
    }
    Ok(())
}

pub fn run(args: &PsfArgs, terminal: &Terminal) -> Result<Outcome> {
    terminal.stop_on_interrupt();
    let layout = Layout::open_with(&InputFile::of(&args.layout)?, ReadLimits::default(), terminal)?;
    let plan = ExtractionPlan {
        top: args.top.clone(),
        ..ExtractionPlan::discover(args.layer)
    };
    let found = extract(&layout, &plan, terminal)?;
    mostly_pillars(args, &found)?;
    one_kind(args, &found)?;
    known_light(args, &found)?;
    let light = match args.extract_only {
        true => None,
        false => Some(args.light(&found)?),
    };
    let assumptions = args.assumptions(&found, light.as_ref());
    let made = match &args.model {
        Some(path) => Some(args.made(&found, &CalibratedModel::read(path)?)?),
        None => None,
    };
    let simulate = |case: SimulationCase<'_>, light: &PsfLight| -> Result<_> {
        let lighting = args.lighting(light, found.shape);
        let psfs = single_psfs(&found, case, &lighting, terminal)?;
        let white = match &light.white {
            Some(white) => {
                let counted = (&white.camera, &white.sampling);
                Some(single_white(&found, case, &lighting, counted, args.wedge()?, terminal)?)
            }
            None => None,
        };
        Ok((psfs, white))
    };
    let (psfs, white) = match (&light, &made) {
        (None, _) => (Vec::new(), None),
        (Some(light), Some(chip)) => simulate(SimulationCase::Made(chip), light)?,
        (Some(light), None) => simulate(SimulationCase::Cell(args.cell(&found, light)?.as_ref()), light)?,
    };
    let model = made.as_ref().map(AsBuiltChip::statement);
    if let Some(folder) = &args.out {
        let name = args
            .layout
            .file_name()
            .map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        let report = SinglePsfReport {
            file: &name,
            found: &found,
            psfs: &psfs,
            assumptions: &assumptions,
            model: model.as_ref(),
            white: white.as_ref(),
        };
        write_single_psf_report(&report, folder)?;
    }
    terminal.clear();
    if args.json {
        let elements = found.elements.iter().map(|e| {
            serde_json::json!({
                "name": e.site.name,
                "centre_nm": e.site.centre_nm,
                "pitch_nm": e.site.lattice.pitch_nm(),
                "lattice": e.site.lattice.kind(),
                "sites": e.site.lattice.sites(),
                "pillars": e.widths.pillars(),
            })
        });
        let json = serde_json::json!({
            "pillars": found.pillars,
            "elements": elements.collect::<Vec<_>>(),
            "other_shapes": found.oddities,
            "psfs": psfs,
            "assumptions": assumptions.iter().map(|(k, v)| (*k, v.as_str())).collect::<BTreeMap<_, _>>(),
            "model": model,
            "camera": white.as_ref().map(|w| &w.0),
            "white": white.as_ref().map(|w| &w.1),
        });
        print_line!("{json:#}");
        return Ok(Outcome::Fine);
    }
    for element in &found.elements {
        let (site, lattice) = (&element.site, element.site.lattice);
        print_line!(
            "{} at ({}, {}) um: {} pillars on {}",
            site.name,
            sig(site.centre_nm[0] as f64 * 1e-3, 8),
            sig(site.centre_nm[1] as f64 * 1e-3, 8),
            count(element.widths.pillars()),
            match lattice.is_square() {
                true => format!("{0} x {0} sites of {1} nm", lattice.sites(), lattice.pitch_nm()),
                false => format!("a {} lattice of {} nm", lattice.kind(), lattice.pitch_nm()),
            },
        );
    }
    print_line!("{} other shapes on layer {}", count(found.oddities.total()), args.layer);
    for (what, value) in &assumptions {
        print_line!("{what}: {value}");
    }
    for quantity in model.iter().flat_map(|m| &m.not_applied) {
        print_line!("{quantity}");
    }
    let pixel_um = light
        .as_ref()
        .map_or_else(String::new, |light| exact(args.pixel_um(light)));
    for psf in &psfs {
        print_line!(
            "{}, {} nm: Strehl {}, {} % in a pixel of {pixel_um} um, peak at ({}, {}) um",
            psf.element,
            sig(psf.wavelength_um * 1e3, 4),
            sig(psf.metrics.strehl, 3),
            sig(psf.metrics.energy_1_pixel * 100.0, 3),
            sig(psf.metrics.peak_um[0], 5),
            sig(psf.metrics.peak_um[1], 5),
        );
    }
    if !psfs.is_empty() {
        print_line!("{STREHL_AGAINST}");
    }
    for element in white.iter().flat_map(|w| &w.1) {
        for channel in &element.channels {
            print_line!(
                "{}, white light, channel {}: {} % in a square of two pixels, spread {} um",
                element.element,
                channel.channel,
                sig(channel.energy_2_pixels * 100.0, 3),
                sig(channel.spread_um, 3),
            );
        }
    }
    if let Some(folder) = &args.out {
        print_line!("report: {}", folder.join("report.html").display());
    }
    Ok(Outcome::Fine)
}
