//! `metalith psf`: what a layout from anywhere does to light.

mod light;
mod optics;

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use metalith::cell::{Analyser, Fidelity, Handedness, Polarisation};
use metalith::design::CellFile;
use metalith::extract::LeftOut;
use metalith::gds::LayerNumber;
use metalith::report::{count, counted, exact, sig};
use metalith::verify::{
    STREHL_AGAINST, SimulationCase, SinglePsf, SinglePsfReport, focal_length_words, focus_words, outline_warnings,
    plane_words, single_psfs, single_white, write_single_psf_report,
};
use metalith::wave::psf::FOCUS_PLANES;
use metalith::{
    AsBuiltChip, CalibratedModel, Error, Extraction, ExtractionPlan, PillarShape, PolarisationBasis, Result, extract,
};

use self::light::{PsfLight, USUAL_DISTANCE_UM};
use super::accuracy_args::AccuracyArgs;
use super::reading::ReadingArgs;
use super::standard_input::InputFile;
use super::verify::FidelityArg;
use super::{Outcome, Terminal, print_json, print_line};

/// Find the elements of any layout in GDSII or OASIS, read their pillars, and simulate their PSFs.
#[derive(Args, Clone)]
#[command(
    after_help = "Exit codes: 0 fine, 1 if 0.1 % of the shapes or more were not understood, 2 bad input.\n\
    Example:\n  metalith psf lens.gds --layer 1/0 --distance-um 2400 --wavelength-nm 530 --out out/lens\n\n\
    Without --angle-x-deg and --angle-y-deg, incidence is normal. Without --at-x-um and --at-y-um, the axis of the element \
    is in the middle of the window. A steered element sends light of normal incidence far from its axis."
)]
pub(crate) struct PsfArgs {
    /// The layout, of any program; `-` for standard input.
    layout: PathBuf,

    #[command(flatten)]
    reading: ReadingArgs,

    /// Distance from the pillar tops to the sensor (um). If left out, the focal length of the design that --cell names, else 2400.
    #[arg(long = "distance-um", value_name = "DISTANCE_UM", value_parser = between(0.1, 1e6))]
    asked_distance_um: Option<f64>,

    #[arg(skip = USUAL_DISTANCE_UM)]
    distance_um: f64,

    /// Wavelength (nm); may be given several times. If left out, those of the design that --cell names, else 455, 530 and 660 nm;
    /// with a --camera that does not count light from 455 to 660 nm, the middle of each of its channels.
    #[arg(long = "wavelength-nm", value_parser = between(150.0, 20_000.0))]
    wavelengths_nm: Vec<f64>,

    /// Angle of incidence in the x-z plane, in air (degrees).
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, value_parser = between(-STEEPEST_DEG, STEEPEST_DEG))]
    angle_x_deg: f64,

    /// Angle of incidence in the y-z plane, in air (degrees).
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, value_parser = between(-STEEPEST_DEG, STEEPEST_DEG))]
    angle_y_deg: f64,

    /// Distance along x from the axis of the element to the middle of the PSF window (um).
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, value_parser = between(-1e6, 1e6))]
    at_x_um: f64,

    /// Distance along y from the axis of the element to the middle of the PSF window (um).
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, value_parser = between(-1e6, 1e6))]
    at_y_um: f64,

    /// Width of the window in pitches. Samples are a pitch apart, or an equal part of one that is at most lambda / (4 NA).
    #[arg(long, default_value_t = 256, value_parser = samples)]
    samples: usize,

    /// The pillar and the materials around it, for every model except `published`: a file with a section [cell] as in a design,
    /// or a whole design. Pitch and lattice must be the same as in the layout. Silicon nitride 700 nm high on fused silica in
    /// air if left out.
    #[arg(long, value_name = "FILE")]
    cell: Option<PathBuf>,

    #[arg(skip)]
    stated: Option<CellFile>,

    /// Edge of a sensor pixel (um); if left out, the one of --camera, else 5.86.
    #[arg(long, value_parser = between(0.1, 100.0))]
    pixel_um: Option<f64>,

    /// Simulation model of the pillars.
    #[arg(long, value_enum, default_value = "rigorous")]
    fidelity: FidelityArg,

    /// Simulate the chip as fabricated, by the `model.toml` of `metalith calibrate`. The changes of the model are added
    /// to the stated distance and angles.
    #[arg(long, value_name = "MODEL", conflicts_with = "fidelity")]
    model: Option<PathBuf>,

    /// Diameter of the openings in the metal (um), for a model with an aperture offset; the circle around the pillars
    /// if left out.
    #[arg(long, value_parser = between(0.1, 1e5))]
    aperture_um: Option<f64>,

    /// Solve the unit cell for the angle at which light arrives (oblique incidence) and for both polarisations. If left out,
    /// the cell is solved for normal incidence.
    #[arg(long)]
    oblique: bool,

    #[command(flatten)]
    accuracy: AccuracyArgs,

    /// Simulate planes along z too, up to this distance from the sensor on each side (um): for each plane Strehl ratio, FWHM and
    /// focusing efficiency, and the focal length found through focus. Without a value two depths of focus, 2 lambda / NA^2.
    #[arg(long, value_name = "RANGE_UM", num_args = 0..=1, require_equals = true, value_parser = between(1e-3, 1e6))]
    #[expect(
        clippy::option_option,
        reason = "absent, without a value, with a value: as clap tells them"
    )]
    through_focus: Option<Option<f64>>,

    /// Number of planes of --through-focus.
    #[arg(long, value_name = "N", default_value_t = FOCUS_PLANES, requires = "through_focus")]
    planes: usize,

    /// Add polychromatic figures for the camera of this file; all wavelengths arrive at the same angle.
    #[arg(long, value_name = "CAMERA")]
    camera: Option<PathBuf>,

    /// Angle in the x-z plane by which the elements steer at --wedge-wavelength-nm (degrees). With --camera it decides where
    /// each wavelength lands. A layout does not contain this angle.
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, requires = "camera")]
    wedge_x_deg: f64,

    /// Angle in the y-z plane by which the elements steer at --wedge-wavelength-nm (degrees).
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, requires = "camera")]
    wedge_y_deg: f64,

    /// Wavelength at which the elements steer by --wedge-x-deg and --wedge-y-deg (nm).
    #[arg(long, default_value_t = 550.0, requires = "camera")]
    wedge_wavelength_nm: f64,

    /// Polarisation of the arriving light, for pillars that are rectangles: `left` or `right` (circular; left is (x + i
    /// y) / sqrt 2 for a wave along +z), `x`, `y` or an angle from x towards y in degrees (linear), or `unpolarised`.
    /// If left out, `left` for rotated and `x` for upright ones.
    #[arg(long, value_name = "POLARISATION", allow_negative_numbers = true, value_parser = polarisation)]
    arriving: Option<Polarisation>,

    /// Analyser before the sensor, for pillars that are rectangles: `circular` (rotated ones only) passes the
    /// handedness that focused light is converted to; `x`, `y` or an angle from x towards y in degrees passes linear
    /// polarisation.
    #[arg(long, value_name = "ANALYSER", allow_negative_numbers = true, value_parser = analyser)]
    analyser: Option<Analyser>,

    /// Circular polarisation that the layout focuses; it decides what a circular --analyser passes. If left out: `arriving` of
    /// --cell if its pillars are rotated rectangles, else --arriving.
    #[arg(long, value_enum, requires = "analyser")]
    focused: Option<CircularArg>,

    /// Read the pillars and simulate nothing.
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
pub(crate) fn layer(text: &str) -> std::result::Result<LayerNumber, String> {
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
fn mostly_pillars(args: &PsfArgs, layer: LayerNumber, found: &Extraction, left_out: Option<&LeftOut>) -> Result<()> {
    let others = found.oddities.total();
    if args.extract_only || others <= found.pillars {
        return Ok(());
    }
    let reasons = left_out.map_or_else(String::new, |left_out| format!("; {}", left_out.words));
    Err(Error::refused(
        "psf/mostly-other-shapes",
        format!(
            "{}: only {} of {} shapes on layer {} are {} on a lattice{reasons}",
            args.layout.display(),
            count(found.pillars),
            count(found.pillars + others),
            layer,
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
    if let (Some(stated), Some(element)) = (&args.stated, found.elements.first()) {
        let (own, lattice) = (&stated.cell, element.site.lattice);
        if own.lattice != lattice.kind() || !own.pitch_nm.is_near(lattice.pitch_nm()) {
            return Err(Error::refused(
                "psf/lattices-differ",
                format!(
                    "{}: pillars on a {} lattice of {} nm, and {} is of a {} lattice of {} nm",
                    args.layout.display(),
                    lattice.kind(),
                    lattice.pitch_nm(),
                    stated.path.display(),
                    own.lattice,
                    own.pitch_nm
                ),
                "give by --cell the cell of the design that the layout is of",
            ));
        }
    }
    let fidelity = match args.model {
        Some(_) => Fidelity::Calibrated,
        None => args.fidelity.into(),
    };
    let is_judged = args.model.is_none() || found.shape == PillarShape::Mixed;
    if is_judged
        && !args.extract_only
        && let Some((what, hint)) = fidelity.refusal(found.shape, PsfArgs::lattice_kind(found))
    {
        return Err(Error::refused(
            "cell/fidelity-not-for-pillars",
            format!("{}: {what}", args.layout.display()),
            hint,
        ));
    }
    Ok(())
}

/// Light of a polarisation is simulated where pillars distinguish polarisations, and a circular analyser for light of both hands must be
/// told which it passes.
fn known_light(args: &PsfArgs, found: &Extraction) -> Result<()> {
    if found.shape.basis().is_none() && (args.arriving.is_some() || args.analyser.is_some()) {
        return Err(Error::refused(
            "light/polarisation-without-rectangles",
            format!(
                "{}: a polarisation is given, and the pillars are {}",
                args.layout.display(),
                found.shape.plural()
            ),
            "leave out --arriving and --analyser: they are for rectangles only. Other pillars are simulated in unpolarised light",
        ));
    }
    if found.shape.basis() == Some(PolarisationBasis::Linear)
        && (args.analyser == Some(Analyser::Circular) || args.focused.is_some())
    {
        return Err(Error::refused(
            "light/not-focused",
            format!(
                "{}: its pillars are upright rectangles, which focus linear light, and {} was asked for",
                args.layout.display(),
                match args.focused {
                    Some(_) => "a handedness by --focused",
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
        return Err(Error::refused(
            "light/handedness-missing",
            format!(
                "a circular analyser needs the focused handedness, and light arrives {}",
                args.arriving(found.shape)
            ),
            "name the handedness that the layout focuses by --focused left or right: the analyser passes what it is converted to",
        ));
    }
    Ok(())
}

/// Print the figures of each point spread function of a layout with so many elements, with its focal length where planes through
/// focus were simulated.
fn print_psfs(psfs: &[SinglePsf], elements: usize, pixel_um: &str) {
    if psfs.is_empty() {
        return;
    }
    for psf in psfs {
        print_line!(
            "{}, {} nm: Strehl {}{}, {} % in a pixel of {pixel_um} um, peak at ({}, {}) um",
            psf.element,
            sig(psf.wavelength_um * 1e3, 4),
            sig(psf.metrics.strehl, 3),
            focus_words(&psf.metrics).map_or_else(String::new, |words| format!(", {words}")),
            sig(psf.metrics.energy_1_pixel * 100.0, 3),
            sig(psf.metrics.peak_um[0], 5),
            sig(psf.metrics.peak_um[1], 5),
        );
        if let Some(series) = &psf.through_focus {
            print_line!(
                "{}, {} nm, through focus: {}; the sensor is at {} um",
                psf.element,
                sig(psf.wavelength_um * 1e3, 4),
                focal_length_words(series),
                exact(series.sensor_um)
            );
            for plane in &series.planes {
                print_line!("  z {} um: {}", sig(plane.distance_um, 6), plane_words(&plane.focus));
            }
        }
    }
    let simulated: BTreeSet<&str> = psfs.iter().map(|psf| psf.element.as_str()).collect();
    let copies = elements - simulated.len();
    if copies > 0 {
        print_line!(
            "{} not simulated: their pillars are those of an element above, whose figures hold for them",
            counted(copies, "element")
        );
    }
    print_line!("{STREHL_AGAINST}");
}

pub(crate) fn run(args: &PsfArgs, terminal: &Terminal) -> Result<Outcome> {
    let stated = args.cell.as_deref().map(CellFile::read).transpose()?;
    let mut args = args.clone().with_design(stated);
    args.say_guesses(terminal);
    terminal.stop_on_interrupt();
    let file = InputFile::of(&args.layout)?;
    // Messages name what is read.
    args.layout = file.to_path_buf();
    let args = &args;
    let layout = args.reading.open(&file, terminal)?;
    let layer = args.reading.pillar_layer(&layout, terminal)?;
    let found = extract(&layout, &ExtractionPlan::discover(layer), terminal)?;
    let left_out = LeftOut::of(&found, layer);
    mostly_pillars(args, layer, &found, left_out.as_ref())?;
    if !args.extract_only {
        one_kind(args, &found)?;
    }
    known_light(args, &found)?;
    let light = if args.extract_only {
        None
    } else {
        Some(args.light(&found)?)
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
        (Some(light), Some(chip)) => simulate(SimulationCase::from(chip), light)?,
        (Some(light), None) => simulate(SimulationCase::from(args.cell(&found, light)?.as_ref()), light)?,
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
            left_out: left_out.as_ref(),
            model: model.as_ref(),
            white: white.as_ref(),
        };
        let named = [&args.cell, &args.model, &args.camera];
        let inputs = named.into_iter().flatten().chain([&args.layout]).map(PathBuf::as_path);
        terminal
            .turn_at(folder, inputs)?
            .publish("report", &[], |folder| write_single_psf_report(&report, folder))?;
    }
    terminal.clear();
    let warnings = outline_warnings(&found);
    let outcome = Outcome::of(left_out.as_ref().is_none_or(|left_out| !left_out.is_much));
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
            "not_understood": left_out.as_ref().map(|left_out| &left_out.words),
            "warnings": warnings,
            "turned_deg": found.turned_deg,
            "pillars": found.pillars,
            "elements": elements.collect::<Vec<_>>(),
            "other_shapes": found.oddities,
            "psfs": psfs,
            "assumptions": assumptions.iter().map(|(k, v)| (*k, v.as_str())).collect::<BTreeMap<_, _>>(),
            "model": model,
            "camera": white.as_ref().map(|w| &w.0),
            "white": white.as_ref().map(|w| &w.1),
        });
        print_json(&json);
        return Ok(outcome);
    }
    if let Some(left_out) = &left_out {
        print_line!("{}", left_out.words);
    }
    for warning in &warnings {
        print_line!("{warning}");
    }
    for element in &found.elements {
        let (site, lattice) = (&element.site, element.site.lattice);
        print_line!(
            "{} at ({}, {}) um: {} pillars on {}",
            site.name,
            sig(site.centre_nm[0] as f64 * 1e-3, 8),
            sig(site.centre_nm[1] as f64 * 1e-3, 8),
            count(element.widths.pillars()),
            if lattice.is_square() {
                format!("{0} x {0} sites of {1} nm", lattice.sites(), lattice.pitch_nm())
            } else {
                format!("a {} lattice of {} nm", lattice.kind(), lattice.pitch_nm())
            },
        );
    }
    let others = counted(found.oddities.total() as usize, "other shape");
    print_line!("{others} on layer {layer}");
    for (what, value) in &assumptions {
        print_line!("{what}: {value}");
    }
    for quantity in model.iter().flat_map(|m| &m.not_applied) {
        print_line!("{quantity}");
    }
    let pixel_um = light
        .as_ref()
        .map_or_else(String::new, |light| exact(args.pixel_um(light)));
    print_psfs(&psfs, found.elements.len(), &pixel_um);
    for element in white.iter().flat_map(|w| &w.1) {
        for channel in &element.channels {
            print_line!(
                "{}, polychromatic, channel {}: {} % in a square of two pixels, spread {} um",
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
    Ok(outcome)
}
