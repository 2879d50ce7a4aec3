//! `measurement.toml` and the files that it names, with every fault found in one go.

mod elements;
mod measurements;

use std::path::Path;

use super::{BenchLed, MeasuredSet, PerElement, PerLed, Stack};
use elements::{LayoutPillars, elements};
use measurements::{measurements, widths};
use metalith_cell::{CellStack, Material, UniformLayer};
use metalith_core::document::{Document, KeyTable, Limits, Section, explore, load};
use metalith_core::{LayerNumber, Progress, Result, Silent};
use metalith_pillars::{DatabaseUnit, LatticeKind, PillarReader, PillarShape};
use metalith_rcwa::CellLattice;
use metalith_sensor::frame::{self, Orientation, Recorded, SensorFrame, SensorFrames};
use metalith_sensor::{Colour, ColourFilter, RelayCamera};
use ndarray::Array2;

/// Version of the format that is read.
const SCHEMA: i64 = 1;

/// Facts that a set may state of its cells and lenses, and of the places of its measurements.
pub const PITCH_NM: Limits = Limits::new(50.0..=20_000.0, "nm");
pub const HEIGHT_NM: Limits = Limits::new(10.0..=TALLEST_NM, "nm");
pub const AMBIENT_INDEX: Limits = Limits::new(1.0..=3.0, "");
pub const LENS_DIAMETER_UM: Limits = Limits::new(5.0..=2000.0, "um");
pub const FOCAL_LENGTH_UM: Limits = Limits::new(1.0..=1_000_000.0, "um");
pub const APERTURE_DIAMETER_UM: Limits = Limits::new(1.0..=2000.0, "um");
pub const DISTANCE_UM: Limits = Limits::new(1.0..=100_000.0, "um");
pub const WINDOW_CENTRE_UM: Limits = Limits::new(-10_000.0..=10_000.0, "um");

/// Half-width of the spectrum that the film's table must cover, in standard deviations: what lies outside
/// is 1e-3 of the light.
pub const SPECTRUM_SIGMAS: f64 = 3.2;

impl MeasuredSet {
    /// Read the set in `folder`, or the `measurement.toml` given; `layouts` reads the layout that it names.
    ///
    /// # Errors
    /// [`metalith_core::Error::Text`] with every fault of the text, the measurements, the tables and the layout, each at
    /// the line that names it.
    pub fn read(folder: &Path, layouts: &dyn PillarReader, progress: &dyn Progress) -> Result<Self> {
        let path = if folder.is_dir() {
            folder.join("measurement.toml")
        } else {
            folder.to_owned()
        };
        let text = load(&path)?;
        Document::read(&path, &text, |root| sections(&path, root, layouts, progress))
    }

    /// The keys of the `measurement.toml` of such a set; `layouts` need read no layout.
    pub fn keys(layouts: &dyn PillarReader) -> KeyTable {
        explore(&[], |root, path| sections(path, root, layouts, &Silent))
    }
}

fn sections(path: &Path, root: &Section<'_, '_>, layouts: &dyn PillarReader, progress: &dyn Progress) -> MeasuredSet {
    root.integer("schema", SCHEMA..=SCHEMA, "");
    // Other kinds have other readers.
    let kinds = ["psf", "heights", "spectra", "widths", "psf_stack"].map(|kind| (kind, ()));
    root.choice("kind", &kinds, Some(()));
    let title = root.text("title");
    let layers = root.section("layout_layers");
    let layer = |key| {
        let [layer, datatype] = whole(&layers, key, Limits::new(0.0..=32767.0, ""));
        LayerNumber {
            layer: layer as u16,
            datatype: datatype as u16,
        }
    };
    let pillar_layer = layer("pillars");
    layer("apertures");
    layers.finish();

    let (stack, is_known) = stack(&root.section("stack"), path.parent().unwrap_or(Path::new("")));
    let divergence_rad = source(&root.section("source"));
    let bench = root.section("camera");
    let free_scale = bench.choice("scale", &SCALE, Some(false));
    let (camera, frames) = camera(&bench);
    let leds: PerLed<_> = leds(root, camera.filter, is_known.then_some(&stack.cell)).into();
    let layout = root.file("layout");
    let elements: PerElement<_> = {
        let pillars = LayoutPillars {
            reader: layouts,
            file: &layout,
            layer: pillar_layer,
            shape: stack.cell.shape,
            progress,
        };
        elements(root, &stack, &pillars).into()
    };
    let measurements = measurements(root, (&camera, free_scale), &frames, &leds, &elements);
    let (sem, sem_offset_sigma_nm) = widths(root, &elements);
    let field_boundary_um = field_boundary(root);
    MeasuredSet {
        path: path.to_owned(),
        title,
        layout,
        stack,
        divergence_rad,
        camera,
        leds,
        elements,
        measurements: measurements.into(),
        free_scale,
        field_boundary_um,
        sem,
        sem_offset_sigma_nm,
    }
}

/// Exactly `N` whole numbers that must be there, each within the limits.
fn whole<const N: usize>(s: &Section<'_, '_>, key: &str, limits: Limits) -> [i64; N] {
    let numbers: [f64; N] = s.array(key, limits);
    if numbers.iter().any(|v| v.fract() != 0.0) {
        s.fault(key, format!("`{key}` has a fraction"), "give whole numbers");
    }
    numbers.map(|v| v as i64)
}

/// Edge of a pixel in the plane of the chip's image (um): as given, or that of the sensor over the magnification of the
/// relay.
fn pixel_um(s: &Section<'_, '_>) -> f64 {
    let positive = |key, high, unit| s.float(key, Limits::new(f64::MIN_POSITIVE..=high, unit));
    if !s.has("magnification") {
        return positive("pixel_um", 100.0, "um");
    }
    if s.has("pixel_um") {
        s.fault(
            "pixel_um",
            "a pixel size beside a magnification",
            "give `sensor_pixel_um` and `magnification`, or `pixel_um` alone",
        );
    }
    positive("sensor_pixel_um", 1000.0, "um") / positive("magnification", 1000.0, "")
}

/// Limits as those of a whole number.
fn whole_range(limits: &Limits) -> std::ops::RangeInclusive<i64> {
    *limits.range.start() as i64..=*limits.range.end() as i64
}

/// Tallest pillar and thickest layer (nm).
const TALLEST_NM: f64 = 50_000.0;

/// The cell as stated, and whether its materials are known; a vacuum takes their place else.
fn stack(s: &Section<'_, '_>, folder: &Path) -> (Stack, bool) {
    let pitch_nm = s.integer("pitch_nm", whole_range(&PITCH_NM), "nm") as u32;
    if !pitch_nm.is_multiple_of(2) {
        s.fault(
            "pitch_nm",
            "an odd pitch puts pillars off the 1 nm grid",
            "use an even number",
        );
    }
    let height_nm = s.float("pillar_height_nm", HEIGHT_NM);
    s.choice("incidence", &[("substrate", ())], None);
    let vacuum = || Material::constant(1.0, 0.0).expect("index one is physical");
    let found = |key: &str, material: metalith_core::Result<Material>| {
        let fault = |e: metalith_core::Error| s.fault(key, e.to_string(), "name a known material, or mend its table");
        material.map_err(fault).ok()
    };
    let film_path = s.file("pillar_index");
    let film = if film_path.is_file() {
        found("pillar_index", Material::read_csv(&film_path).map_err(Into::into))
    } else {
        None
    };
    let substrate = found("substrate", resolved(&s.text("substrate"), folder));
    let ambient_index = s.float("ambient_index", AMBIENT_INDEX);
    let spacer = s.optional_text("spacer_material");
    let spacer = spacer.map(|name| found("spacer_material", resolved(&name, folder)).unwrap_or_else(vacuum));
    let layer = |key: &str, material: Option<Material>| {
        let height = s.float_or(key, Limits::new(0.0..=TALLEST_NM, "nm"), 0.0);
        if height > 0.0 && material.is_none() {
            s.fault(key, "a layer of no known material", "say its material");
        }
        let layer = material.map(|material| UniformLayer {
            material,
            height_nm: height,
        });
        layer.filter(|_| height > 0.0)
    };
    let under = [layer("spacer_nm", spacer), layer("residual_nm", film.clone())];
    let shape = s.choice("shape", &PillarShape::CHOICES, Some(PillarShape::default()));
    let lattice = s.choice("lattice", &LatticeKind::CHOICES, Some(LatticeKind::Square));
    if let Some(what) = lattice.refusal(shape) {
        s.fault_given(
            &["stack.shape"],
            "lattice",
            what,
            "add `shape = \"circle\"`, or use the square lattice",
        );
    }
    let lens_diameter_um = s.float("lens_diameter_um", LENS_DIAMETER_UM);
    let focal_length_um = s.float("focal_length_um", FOCAL_LENGTH_UM);
    s.finish();
    let is_known = film.is_some() && substrate.is_some();
    let even_nm = pitch_nm + pitch_nm % 2;
    let cell = CellStack {
        lattice: CellLattice::drawn(lattice, even_nm.into(), DatabaseUnit::Nanometre),
        shape,
        film: film.unwrap_or_else(vacuum),
        substrate: substrate.unwrap_or_else(vacuum),
        under: under.into_iter().flatten().collect(),
        ambient: Material::constant(ambient_index, 0.0).unwrap_or_else(|_| vacuum()),
        ..CellStack::paper(f64::from(even_nm), height_nm).expect("the program knows its own materials")
    };
    let stack = Stack {
        cell,
        lens_diameter_um,
        focal_length_um,
    };
    (stack, is_known)
}

/// A material by its name or the path of its table.
fn resolved(text: &str, folder: &Path) -> Result<Material> {
    Ok(Material::resolve(text, folder)?)
}

/// Place where write fields meet in every lens, if it is stated.
pub fn field_boundary(root: &Section<'_, '_>) -> Option<[f64; 2]> {
    let s = root.optional_section("writer")?;
    let place = s.array("field_boundary_um", Limits::new(-1000.0..=1000.0, "um"));
    s.finish();
    Some(place)
}

pub fn source(s: &Section<'_, '_>) -> f64 {
    s.choice("kind", &[("collimated", ())], None);
    s.choice("divergence_axes", &[("uniform disc", ())], None);
    let mrad = s.float("divergence_mrad", Limits::new(0.0..=50.0, "mrad"));
    s.finish();
    mrad * 1e-3
}

/// Share of the pixels of a flat frame that may be saturated: hot ones.
const MOST_FULL: f64 = 0.01;

/// Fault a number of frames that is less than the file holds.
fn holds_its_pages(s: &Section<'_, '_>, key: &str, recorded: &Recorded, frames: u32) {
    if frames < recorded.pages {
        s.fault(
            key,
            format!("{frames} frames, and the file holds {}", recorded.pages),
            "say of how many frames the mean of the file is",
        );
    }
}

/// Fault a flat frame that tells nothing of the pixels: one without light, or with too much.
fn check_flat(s: &Section<'_, '_>, camera: &RelayCamera, frames: &SensorFrames) {
    let Some(flat) = &frames.flat else { return };
    let mean = |dn: &Array2<f32>| f64::from(dn.mean().unwrap_or(0.0));
    let dark = frames.dark.as_ref().map_or(camera.black_level_dn, |d| mean(&d.dn));
    if mean(&flat.dn) <= dark {
        s.fault(
            "flat_frame",
            format!("its mean is {:.1} DN, and {dark:.1} DN without light", mean(&flat.dn)),
            "give a frame in even light",
        );
    }
    let full = flat.dn.iter().filter(|v| f64::from(**v) >= camera.full_dn()).count();
    if full as f64 > MOST_FULL * flat.dn.len() as f64 {
        s.fault(
            "flat_frame",
            format!("{full} of its {} pixels are saturated", flat.dn.len()),
            "take it in less light",
        );
    }
}

/// True if the scale of each measurement is fitted.
const SCALE: [(&str, bool); 2] = [("stated", false), ("free", true)];

/// True if the dark frame of a camera is that of any exposure, by what it is said to hold for.
const DARK_HOLDS_FOR: [(&str, bool); 2] = [("its_exposure", false), ("any_exposure", true)];

/// Frames may be a power of two too bright by their bits alone if every value is a multiple of this, or more.
const SHIFTED: u32 = 4;

/// A file whose darkest pixel is this many times the black level has its bits at the left.
const TOO_BRIGHT: f64 = 4.0;

/// A frame of a camera, upright.
///
/// # Errors
/// What is wrong with the file, in words.
fn recorded(path: &Path, camera: &RelayCamera, orientation: Orientation) -> std::result::Result<Recorded, String> {
    let (rows, cols) = if orientation.is_transposed() {
        (camera.cols, camera.rows)
    } else {
        (camera.rows, camera.cols)
    };
    let mut recorded = frame::read(path, rows, cols, camera.saturation_dn)?;
    let ends = recorded
        .dn
        .iter()
        .fold((f32::MAX, 0f32), |(a, b), v| (a.min(*v), b.max(*v)));
    let (least, most) = (f64::from(ends.0), f64::from(ends.1));
    let black = camera.black_level_dn;
    let is_shifted = recorded.step_dn >= SHIFTED && is_varied(&recorded.dn);
    if is_shifted && (most > camera.saturation_dn || (black > 0.0 && least > TOO_BRIGHT * black)) {
        return Err(format!(
            "all its values are multiples of {step}, up to {most}, and `saturation_dn` is {}: its bits are at the left of 16; \
             divide the values by {step}, or give black level, saturation and read noise times {step}, and `gain_e_per_dn` over \
             {step}",
            camera.saturation_dn,
            step = recorded.step_dn
        ));
    }
    recorded.dn = orientation.upright(&recorded.dn);
    Ok(recorded)
}

/// True if a frame has several values: those of a uniform one may be multiples of anything.
fn is_varied(dn: &Array2<f32>) -> bool {
    /// Values that are multiples of four by chance once in a hundred thousand frames.
    const SEVERAL: usize = 8;
    let mut seen: Vec<f32> = Vec::new();
    for value in dn {
        if !seen.contains(value) {
            seen.push(*value);
        }
        if seen.len() >= SEVERAL {
            return true;
        }
    }
    false
}

/// A frame of the sensor by itself, and of how many it is the mean, by the keys of both; none where it is not named.
fn sensor_frame(
    s: &Section<'_, '_>,
    (camera, orientation): (&RelayCamera, Orientation),
    key: &str,
    count: &str,
) -> Option<SensorFrame> {
    if !s.has(key) {
        return None;
    }
    let (path, frames) = (s.file(key), s.integer(count, 1..=1_000_000, "frames") as u32);
    let recorded = path.is_file().then(|| recorded(&path, camera, orientation))?;
    let recorded = recorded.map_err(|what| s.fault(key, what, "give a frame as large as the captures"));
    let recorded = recorded.ok()?;
    holds_its_pages(s, count, &recorded, frames);
    Some(SensorFrame {
        rounding_dn2: recorded.rounding_dn2(frames),
        dn: recorded.dn,
        frames,
    })
}

pub fn camera(s: &Section<'_, '_>) -> (RelayCamera, SensorFrames) {
    let positive = |key, high, unit| s.float(key, Limits::new(f64::MIN_POSITIVE..=high, unit));
    let camera = RelayCamera {
        pixel_um: pixel_um(s),
        rows: s.integer("rows", 16..=1024, "pixels") as usize,
        cols: s.integer("cols", 16..=1024, "pixels") as usize,
        black_level_dn: s.float("black_level_dn", Limits::new(0.0..=1e6, "DN")),
        gain_e_per_dn: positive("gain_e_per_dn", 1e6, "e/DN"),
        read_noise_dn: positive("read_noise_dn", 1e6, "DN"),
        saturation_dn: positive("saturation_dn", 1e9, "DN"),
        registration_sigma_px: positive("registration_sigma_px", 8.0, "pixels"),
        flux_sigma: positive("flux_sigma", 1.0, ""),
        relay_blur_um: s.float_or("relay_blur_um", Limits::new(0.0..=100.0, "um"), 0.0),
        filter: s.choice("bayer", &ColourFilter::BAYER, Some(ColourFilter::None)),
    };
    let orientation = s.choice("orientation", &Orientation::ALL, Some(Orientation::Upright));
    let own = (&camera, orientation);
    let frames = SensorFrames {
        orientation,
        dark: sensor_frame(s, own, "dark_frame", "dark_frames"),
        flat: sensor_frame(s, own, "flat_frame", "flat_frames"),
        dark_of_any_exposure: s.choice("dark_holds_for", &DARK_HOLDS_FOR, Some(false)),
    };
    check_flat(s, &camera, &frames);
    s.finish();
    (camera, frames)
}

/// Fault of a lamp whose spectrum reaches beyond what is known of the materials of a cell, and what to do.
pub fn beyond_tables(led: &BenchLed, cell: &CellStack) -> Option<(String, &'static str)> {
    let (film, all) = (cell.film.range_um(), cell.range_um());
    let half = SPECTRUM_SIGMAS * led.sigma_nm();
    let (from, to) = (led.centre_nm - half, led.centre_nm + half);
    let tables = [
        (
            "the film's table",
            "measure the film over the whole spectrum, or correct centre and width of the LED",
            film,
        ),
        (
            "what is known of the other materials",
            "give a table of the material that reaches farther",
            all,
        ),
    ];
    tables.into_iter().find_map(|(what, hint, (low, high))| {
        let (low, high) = (low * 1e3, high * 1e3);
        let what = format!("its spectrum from {from:.0} to {to:.0} nm is outside {what}, {low:.0} to {high:.0} nm");
        (from < low || to > high).then_some((what, hint))
    })
}

pub fn leds(root: &Section<'_, '_>, filter: ColourFilter, cell: Option<&CellStack>) -> Vec<BenchLed> {
    let mut leds: Vec<BenchLed> = Vec::new();
    for s in root.sections("led") {
        let led = BenchLed {
            centre_nm: s.float("centre_nm", Limits::new(200.0..=20_000.0, "nm")),
            fwhm_nm: s.float("fwhm_nm", Limits::new(0.5..=200.0, "nm")),
            channel: (filter != ColourFilter::None).then(|| s.choice("channel", &Colour::CHOICES, None)),
        };
        s.finish();
        if leds.iter().any(|l| l.name() == led.name()) {
            s.fault(
                "centre_nm",
                format!("two LEDs of {} nm", led.name()),
                "leave one out; captures and effects name their LED by it, in whole nanometres",
            );
        }
        if let Some((what, hint)) = cell.and_then(|cell| beyond_tables(&led, cell)) {
            s.fault("centre_nm", what, hint);
        }
        leds.push(led);
    }
    if leds.is_empty() {
        root.fault("led", "no light source", "add one [[led]] for each colour");
    }
    leds
}
