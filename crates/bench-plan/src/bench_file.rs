//! Bench file `BENCH.toml`: what a bench can do and what is asked of it, with every fault found in one go.

use std::collections::BTreeMap;
use std::path::Path;

use metalith_core::Result;
use metalith_core::document::{Document, KeyTable, Limits, Section, explore, load};

use metalith_calibrate::set_format as read;
use metalith_calibrate::{BenchLed, PerLed};
use metalith_sensor::RelayCamera;

/// Version of the format that is read.
const SCHEMA: i64 = 1;

/// Abilities of a bench.
#[derive(Clone, Debug)]
pub struct BenchFile {
    /// Full angle of the uniform disc that the source is (rad).
    pub divergence_rad: f64,
    pub camera: RelayCamera,
    pub leds: PerLed<BenchLed>,
    /// Ending of the frames that the camera saves, without the dot.
    pub ending: String,
    /// Elements that may be looked at, by their place in the array; those of the design that differ most if empty.
    pub elements: Vec<[i64; 2]>,
    /// Angles of incidence in air along x and y (deg), from where an element looks.
    pub fields_deg: Vec<[f64; 2]>,
    /// Distances from the pillar tops (um); three about the focus if empty.
    pub distances_um: Vec<f64>,
    /// Frames that a measurement may be the mean of, fewest first.
    pub frames: Vec<u32>,
    /// The brightest pixel of a measurement is exposed to this share of saturation.
    pub peak: f64,
    /// Measurements that a session may have.
    pub most_measurements: usize,
    /// Place where a boundary of write fields runs through every lens (um), if it is known.
    pub field_boundary_um: Option<[f64; 2]>,
    /// Widths by SEM that could be taken.
    pub sem: Option<SemOffer>,
    /// Spectra of the film and of pads that could be measured.
    pub spectrometer: Option<Spectrometer>,
    /// Sizes that are to be found, by the name of the effect, in its unit.
    pub wanted: BTreeMap<String, f64>,
}

/// Measurements that a scanning electron microscope could add.
#[derive(Clone, Copy, Debug)]
pub struct SemOffer {
    /// Pillars that are measured.
    pub sites: usize,
    /// Standard deviation of one width (nm).
    pub sigma_nm: f64,
    /// Standard deviation of the offset that all widths share (nm).
    pub offset_sigma_nm: f64,
}

/// A spectrometer, along the normal.
#[derive(Clone, Copy, Debug)]
pub struct Spectrometer {
    pub from_nm: f64,
    pub to_nm: f64,
    pub step_nm: f64,
    /// Standard deviation of a reflectance.
    pub sigma: f64,
}

impl Spectrometer {
    pub(crate) fn wavelengths_nm(&self) -> Vec<f64> {
        let steps = ((self.to_nm - self.from_nm) / self.step_nm).floor().max(0.0) as usize;
        (0..=steps).map(|k| self.from_nm + k as f64 * self.step_nm).collect()
    }
}

/// Part of saturation that measurements are exposed to where the bench says nothing: 30 % of room for what is brighter than
/// planned.
const PEAK: f64 = 0.7;

/// Frames of a measurement where the bench says nothing.
const FRAMES: [u32; 2] = [16, 64];

/// Measurements of a session where the bench says nothing.
const MOST_CAPTURES: i64 = 48;

impl BenchFile {
    /// Read the file.
    ///
    /// # Errors
    /// Every fault at once, each at the line that has it.
    pub fn read(path: &Path) -> Result<Self> {
        let text = load(path)?;
        Document::read(path, &text, sections)
    }

    /// The keys of a bench file.
    pub fn keys() -> KeyTable {
        explore(&[], |root, _| sections(root))
    }
}

fn sections(root: &Section<'_, '_>) -> BenchFile {
    root.integer("schema", SCHEMA..=SCHEMA, "");
    let divergence_rad = read::source(&root.section("source"));
    let s = root.section("camera");
    for key in ["dark_frame", "flat_frame", "dark_holds_for"] {
        if s.has(key) {
            s.fault(
                key,
                "frames of the sensor are no part of a plan",
                "add them to measurement.toml once they have been taken",
            );
        }
    }
    let (camera, _) = read::camera(&s);
    let leds: PerLed<BenchLed> = read::leds(root, camera.filter, None).into();
    let s = root.section("captures");
    let ending = s.choice(
        "format",
        &[("npy", "npy"), ("png", "png"), ("tiff", "tiff")],
        Some("npy"),
    );
    let pairs = |key: &str, limits: fn() -> Limits| -> Vec<[f64; 2]> {
        if !s.has(key) {
            return Vec::new();
        }
        let all = s.floats(key, limits());
        if all.len() % 2 == 1 {
            s.fault(key, "an odd number of numbers", "give pairs, x and y: x1, y1, x2, y2");
        }
        all.chunks_exact(2).map(|p| [p[0], p[1]]).collect()
    };
    let elements = pairs("elements", || Limits::new(-1000.0..=1000.0, ""));
    let mut fields_deg = pairs("field_deg", || Limits::new(-80.0..=80.0, "degrees"));
    if fields_deg.is_empty() {
        fields_deg.push([0.0; 2]);
    }
    let floats = |key: &str, limits: Limits| if s.has(key) { s.floats(key, limits) } else { Vec::new() };
    let distances_um = floats("distance_um", Limits::new(1.0..=100_000.0, "um"));
    let whole = |v: &f64| v.fract() == 0.0;
    let numbers = floats("frames", Limits::new(1.0..=1e6, "frames"));
    if !numbers.iter().all(whole) {
        s.fault("frames", "a part of a frame", "give whole numbers");
    }
    let mut frames: Vec<u32> = numbers.iter().map(|f| *f as u32).collect();
    if frames.is_empty() {
        frames.extend(FRAMES);
    }
    frames.sort_unstable();
    frames.dedup();
    let peak = s.float_or("peak", Limits::new(0.05..=0.9, ""), PEAK);
    let most = s.integer_or("most", 1..=1000, "measurements", MOST_CAPTURES);
    s.finish();
    BenchFile {
        divergence_rad,
        camera,
        leds,
        ending: ending.to_owned(),
        elements: elements.into_iter().map(|e| e.map(|v| v as i64)).collect(),
        fields_deg,
        distances_um,
        frames,
        peak,
        most_measurements: most as usize,
        field_boundary_um: read::field_boundary(root),
        sem: root.optional_section("sem").map(|s| sem(&s)),
        spectrometer: root.optional_section("spectrometer").map(|s| spectrometer(&s)),
        wanted: root
            .optional_section("wanted")
            .map_or_else(BTreeMap::new, |s| wanted(&s)),
    }
}

fn sem(s: &Section<'_, '_>) -> SemOffer {
    let offer = SemOffer {
        sites: s.integer("sites", 2..=10_000, "pillars") as usize,
        sigma_nm: s.float("sigma_nm", Limits::new(0.01..=100.0, "nm")),
        offset_sigma_nm: s.float("edge_offset_nm", Limits::new(f64::MIN_POSITIVE..=100.0, "nm")),
    };
    s.finish();
    offer
}

fn spectrometer(s: &Section<'_, '_>) -> Spectrometer {
    let nm = || Limits::new(100.0..=20_000.0, "nm");
    let out = Spectrometer {
        from_nm: s.float("from_nm", nm()),
        to_nm: s.float("to_nm", nm()),
        step_nm: s.float("step_nm", Limits::new(0.5..=100.0, "nm")),
        sigma: s.float("sigma", Limits::new(1e-5..=0.5, "")),
    };
    if !(8..=500).contains(&(out.wavelengths_nm().len() - 1)) {
        s.fault(
            "to_nm",
            "the spectrum has fewer than 8 or more than 500 steps",
            "check `from_nm`, `to_nm` and `step_nm`",
        );
    }
    s.finish();
    out
}

fn wanted(s: &Section<'_, '_>) -> BTreeMap<String, f64> {
    let sizes = s.keys().into_iter().map(|name| {
        let size = s.float(&name, Limits::new(1e-9..=1e9, ""));
        (name, size)
    });
    let sizes = sizes.collect();
    s.finish();
    sizes
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// The bench of small sessions, with these sections beside `[captures]`.
    pub(crate) fn small_bench(more: &str) -> BenchFile {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bench.toml");
        let bench = metalith_testing::session::bench();
        std::fs::write(&path, format!("schema = 1\n{bench}\n[captures]\n{more}")).unwrap();
        BenchFile::read(&path).unwrap()
    }

    #[test]
    fn every_fault_of_a_bench_is_named_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bench.toml");
        std::fs::write(
            &path,
            "schema = 1\n[source]\nkind = \"collimated\"\ndivergence_mrad = 99.0\ndivergence_axes = \"uniform disc\"\n\
             [[led]]\ncentre_nm = 530\nfwhm_nm = 30\n[captures]\nfield_deg = [1.0, 2.0, 3.0]\nformat = \"bmp\"\n",
        )
        .unwrap();
        let error = BenchFile::read(&path).unwrap_err().to_string();
        for part in ["divergence_mrad", "odd number", "format", "camera"] {
            assert!(error.contains(part), "{part} is not in:\n{error}");
        }
    }
}
