//! `measurement.toml` and the files that it names, with every fault found in one go.

use std::path::Path;

use super::{Capture, Led, MeasuredElement, MeasuredSet, RelayCamera, Stack, frame, sem};
use super::{ElementIndex, LedIndex, PerElement, PerLed};
use metalith_cell::Material;
use metalith_core::document::{Document, Limits, Section, load};
use metalith_core::{ElementSite, Lattice, LayerNumber, PillarReader, Progress, Result, WidthMap};

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
    let camera = camera(&root.section("camera"));
    let leds: PerLed<_> = leds(root, film_is_known.then_some(&stack.film)).into();
    let layout = root.file("layout");
    let elements: PerElement<_> = {
        let read = |sites: &[ElementSite]| layouts.pillars(&layout, pillar_layer, sites, progress);
        elements(root, &stack, &layout, &read).into()
    };
    let captures = captures(root, &camera, &leds, &elements);
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

fn camera(s: &Section<'_, '_>) -> RelayCamera {
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
    s.finish();
    camera
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

fn elements(
    root: &Section<'_, '_>,
    stack: &Stack,
    layout: &Path,
    read: &dyn Fn(&[ElementSite]) -> Result<Vec<WidthMap>>,
) -> Vec<MeasuredElement> {
    let sections = root.sections("element");
    if sections.is_empty() {
        root.fault(
            "element",
            "no element",
            "add one [[element]] for each lens that was measured",
        );
    }
    let mut elements: Vec<MeasuredElement> = Vec::new();
    for s in &sections {
        let index = s
            .array::<2>("index", Limits::new(-1000.0..=1000.0, ""))
            .map(|v| v as i64);
        let centre_um = s.array("centre_um", Limits::new(-1e6..=1e6, "um"));
        let aperture_diameter_um = s.float("aperture_diameter_um", Limits::new(1.0..=2000.0, "um"));
        s.finish();
        if elements.iter().any(|e| e.index == index) {
            s.fault("index", format!("element {index:?} is there twice"), "leave one out");
        }
        let diameter_nm = (stack.lens_diameter_um * 1e3).round() as u32;
        let lattice = Lattice::covering(diameter_nm, stack.pitch_nm).expect("an even pitch and a positive diameter");
        elements.push(MeasuredElement {
            index,
            centre_um,
            aperture_diameter_um,
            pillars: WidthMap::empty(lattice),
        });
    }
    if !layout.is_file() {
        return elements;
    }
    let sites: Vec<_> = elements
        .iter()
        .map(|e| ElementSite {
            name: format!("({}, {})", e.index[0], e.index[1]),
            centre_nm: e.centre_um.map(|c| (c * 1e3).round() as i64),
            lattice: e.pillars.lattice,
        })
        .collect();
    match read(&sites) {
        Err(e) => root.fault("layout", e.to_string(), "give the layout that was written"),
        Ok(found) => {
            for ((element, found), s) in elements.iter_mut().zip(found).zip(&sections) {
                element.pillars = found;
                if element.pillars.pillars() == 0 {
                    s.fault(
                        "centre_um",
                        format!("the layout has no pillars of element {:?} here", element.index),
                        "correct its centre or its layer, or give the layout that was written",
                    );
                }
            }
        }
    }
    elements
}

fn captures(
    root: &Section<'_, '_>,
    camera: &RelayCamera,
    leds: &PerLed<Led>,
    elements: &PerElement<MeasuredElement>,
) -> Vec<Capture> {
    let mut captures = Vec::new();
    for s in root.sections("capture") {
        let path = s.file("file");
        let index = s
            .array::<2>("element", Limits::new(-1000.0..=1000.0, ""))
            .map(|v| v as i64);
        let known = elements.iter_enumerated().find(|(_, e)| e.index == index);
        let element = known.map(|(e, _)| e).unwrap_or_else(|| {
            s.fault(
                "element",
                format!("no [[element]] has the index {index:?}"),
                "add it, or correct the index",
            );
            ElementIndex::from(0)
        });
        let led_nm = s.float("led_nm", Limits::new(200.0..=3000.0, "nm"));
        let known = leds.iter_enumerated().find(|(_, l)| l.centre_nm == led_nm);
        let led = known.map(|(l, _)| l).unwrap_or_else(|| {
            s.fault(
                "led_nm",
                format!("no [[led]] has its centre at {led_nm} nm"),
                "add it, or correct the wavelength",
            );
            LedIndex::from(0)
        });
        let aoi_deg: [f64; 2] = s.array("aoi_deg", Limits::new(-80.0..=80.0, "degrees"));
        let distance_um = s.float("distance_um", Limits::new(1.0..=100_000.0, "um"));
        let window_centre_um = s.array("window_centre_um", Limits::new(-10_000.0..=10_000.0, "um"));
        let scale_dn = s.float("scale_dn", Limits::new(f64::MIN_POSITIVE..=1e12, "DN"));
        let frames = s.integer("frames", 1..=1_000_000, "frames") as u32;
        s.finish();
        let dn = match frame::read(&path, camera.rows, camera.cols) {
            Ok(dn) => dn,
            Err(what) => {
                // A file that is not there has been named as such already.
                if path.is_file() {
                    s.fault(
                        "file",
                        what,
                        "save it as float32 [rows, cols] without gaps, or leave the capture out",
                    );
                }
                ndarray::Array2::zeros((camera.rows, camera.cols))
            }
        };
        captures.push(Capture {
            name: path
                .file_stem()
                .map_or_else(String::new, |n| n.to_string_lossy().into_owned()),
            element,
            led,
            aoi_rad: aoi_deg.map(f64::to_radians),
            distance_um,
            window_centre_um,
            scale_dn,
            frames,
            dn,
        });
    }
    if captures.is_empty() {
        root.fault("capture", "no capture", "add one [[capture]] for each frame");
    }
    captures
}

fn widths(root: &Section<'_, '_>, elements: &PerElement<MeasuredElement>) -> (Vec<super::SemSite>, f64) {
    let Some(s) = root.optional_section("cd_sem") else {
        return (Vec::new(), 1.0);
    };
    let path = s.file("file");
    let offset = s.float("edge_offset_nm", Limits::new(f64::MIN_POSITIVE..=100.0, "nm"));
    s.finish();
    if !path.is_file() {
        return (Vec::new(), offset);
    }
    match sem::read(&path) {
        Err(e) => {
            s.fault("file", e.to_string(), "mend the table of widths");
            (Vec::new(), offset)
        }
        Ok(sites) => {
            for site in &sites {
                if !elements.iter().any(|e| e.index == site.element) {
                    s.fault(
                        "file",
                        format!("it names element {:?}, which is not described", site.element),
                        "add an [[element]] for it",
                    );
                    break;
                }
            }
            (sites, offset)
        }
    }
}
