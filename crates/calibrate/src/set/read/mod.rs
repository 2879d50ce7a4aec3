//! `measurement.toml` and the files that it names, with every fault found in one go.

mod captures;
mod elements;

use std::path::Path;

use super::frame::{self, SensorFrames};
use super::{Led, MeasuredSet, PerElement, PerLed, RelayCamera, Stack};
use captures::{captures, widths};
use elements::elements;
use metalith_cell::Material;
use metalith_core::document::{Document, Limits, Section, load};
use metalith_core::{ElementSite, LayerNumber, PillarReader, Progress, Result};

/// Version of the format that is read.
const SCHEMA: i64 = 1;

/// Half-width of the spectrum that the film's table must cover, in standard deviations: what lies outside
/// is 1e-3 of the light.
pub(super) const SPECTRUM_SIGMAS: f64 = 3.2;

impl MeasuredSet {
    /// Read the set in `folder`, or the `measurement.toml` given; `layouts` reads the layout that it names.
    ///
    /// # Errors
    /// [`metalith_core::Error::Text`] with every fault of the text, the captures, the tables and the layout, each at
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
}

fn sections(path: &Path, root: &Section<'_, '_>, layouts: &dyn PillarReader, progress: &dyn Progress) -> MeasuredSet {
    root.integer("schema", SCHEMA..=SCHEMA, "");
    let title = root.text("title");
    let layers = root.section("layout_layers");
    let layer = |key| {
        let [layer, datatype] = layers.array(key, Limits::new(0.0..=32767.0, ""));
        LayerNumber {
            layer: layer as u16,
            datatype: datatype as u16,
        }
    };
    let pillar_layer = layer("pillars");
    layer("apertures");
    layers.finish();

    let (stack, film_is_known) = stack(&root.section("stack"));
    let divergence_rad = source(&root.section("source"));
    let (camera, frames) = camera(&root.section("camera"));
    let leds: PerLed<_> = leds(root, film_is_known.then_some(&stack.film)).into();
    let layout = root.file("layout");
    let elements: PerElement<_> = {
        let read = |sites: &[ElementSite]| layouts.pillars(&layout, pillar_layer, sites, progress);
        elements(root, &stack, &layout, &read).into()
    };
    let captures = captures(root, &camera, &frames, &leds, &elements);
    let (sem, sem_offset_sigma_nm) = widths(root, &elements);
    MeasuredSet {
        path: path.to_owned(),
        title,
        layout,
        stack,
        divergence_rad,
        camera,
        leds,
        elements,
        captures: captures.into(),
        sem,
        sem_offset_sigma_nm,
    }
}

/// The cell as stated, and whether the film's table could be read; a vacuum takes its place else.
fn stack(s: &Section<'_, '_>) -> (Stack, bool) {
    let pitch_nm = s.integer("pitch_nm", 50..=5000, "nm") as u32;
    if !pitch_nm.is_multiple_of(2) {
        s.fault(
            "pitch_nm",
            "an odd pitch puts pillars off the 1 nm grid",
            "use an even number",
        );
    }
    let pillar_height_nm = s.float("pillar_height_nm", Limits::new(10.0..=10_000.0, "nm"));
    s.choice("substrate", &[("fused_silica_malitson_1965", ())], None);
    s.choice("incidence", &[("substrate", ())], None);
    let ambient_index = s.float("ambient_index", Limits::new(1.0..=1.0, ""));
    let lens_diameter_um = s.float("lens_diameter_um", Limits::new(5.0..=2000.0, "um"));
    let focal_length_um = s.float("focal_length_um", Limits::new(1.0..=100_000.0, "um"));
    let film_path = s.file("pillar_index");
    let film = film_path
        .is_file()
        .then(|| Material::read_csv(&film_path))
        .and_then(|film| match film {
            Ok(film) => Some(film),
            Err(e) => {
                s.fault("pillar_index", e.to_string(), "mend the table of the film");
                None
            }
        });
    s.finish();
    let film_is_known = film.is_some();
    let vacuum = || Material::constant(1.0, 0.0).expect("index one is physical");
    let stack = Stack {
        pitch_nm: pitch_nm + pitch_nm % 2,
        pillar_height_nm,
        film: film.unwrap_or_else(vacuum),
        ambient_index,
        lens_diameter_um,
        focal_length_um,
    };
    (stack, film_is_known)
}

fn source(s: &Section<'_, '_>) -> f64 {
    s.choice("kind", &[("collimated", ())], None);
    s.choice("divergence_axes", &[("uniform disc", ())], None);
    let mrad = s.float("divergence_mrad", Limits::new(0.0..=50.0, "mrad"));
    s.finish();
    mrad * 1e-3
}

fn camera(s: &Section<'_, '_>) -> (RelayCamera, SensorFrames) {
    let positive = |key, high, unit| s.float(key, Limits::new(f64::MIN_POSITIVE..=high, unit));
    let camera = RelayCamera {
        pixel_um: positive("pixel_um", 100.0, "um"),
        rows: s.integer("rows", 16..=1024, "pixels") as usize,
        cols: s.integer("cols", 16..=1024, "pixels") as usize,
        black_level_dn: s.float("black_level_dn", Limits::new(0.0..=1e6, "DN")),
        gain_e_per_dn: positive("gain_e_per_dn", 1e6, "e/DN"),
        read_noise_dn: positive("read_noise_dn", 1e6, "DN"),
        saturation_dn: positive("saturation_dn", 1e9, "DN"),
        registration_sigma_px: positive("registration_sigma_px", 8.0, "pixels"),
        flux_sigma: positive("flux_sigma", 1.0, ""),
    };
    let sensor_frame = |key| {
        s.has(key)
            .then(|| s.file(key))
            .filter(|path| path.is_file())
            .and_then(|path| {
                let read = frame::read(&path, camera.rows, camera.cols);
                read.map_err(|what| s.fault(key, what, "give a frame as large as the captures"))
                    .ok()
            })
    };
    let frames = SensorFrames {
        dark: sensor_frame("dark_frame"),
        flat: sensor_frame("flat_frame"),
    };
    s.finish();
    (camera, frames)
}

fn leds(root: &Section<'_, '_>, film: Option<&Material>) -> Vec<Led> {
    let mut leds: Vec<Led> = Vec::new();
    for s in root.sections("led") {
        let led = Led {
            centre_nm: s.float("centre_nm", Limits::new(200.0..=3000.0, "nm")),
            fwhm_nm: s.float("fwhm_nm", Limits::new(0.5..=200.0, "nm")),
        };
        s.finish();
        if leds.iter().any(|l| l.centre_nm == led.centre_nm) {
            s.fault(
                "centre_nm",
                "two LEDs of one wavelength",
                "leave one out; captures name their LED by it",
            );
        }
        if let Some(film) = film {
            let (low, high) = film.range_um();
            let (low, high) = (low * 1e3, high * 1e3);
            let half = SPECTRUM_SIGMAS * led.sigma_nm();
            if led.centre_nm - half < low || led.centre_nm + half > high {
                s.fault(
                    "centre_nm",
                    format!(
                        "its spectrum from {:.0} to {:.0} nm is outside the film's table, {low:.0} to {high:.0} nm",
                        led.centre_nm - half,
                        led.centre_nm + half
                    ),
                    "measure the film over the whole spectrum, or correct centre and width of the LED",
                );
            }
        }
        leds.push(led);
    }
    if leds.is_empty() {
        root.fault("led", "no light source", "add one [[led]] for each colour");
    }
    leds
}
