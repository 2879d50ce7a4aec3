//! Frames as cameras write them, from files to the answer: colour filters, joined exposures, a sensor that is no even one.

use std::fs;
use std::path::Path;

use metalith_calibrate::{Diagnosis, MeasuredSet, Session, SetVerdict, Synthesizer};
use metalith_core::Silent;
use metalith_gds::extract::PillarsAt;
use metalith_sensor::ColourFilter;
use metalith_testing::session::{PIXELS, small_set, write_npy};
use ndarray::Array2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::set::{LIKE, SIMULATIONS, SYNTHESIZER, diagnosis_of, names, settings};

/// Nanometres added to every width of the chips of these sets.
const BIAS_NM: f64 = -8.0;

/// Reduced chi-square per pixel that may be left: synthetic sets have another sampling and other orders than fits, which a coarse
/// spectrum does not average out.
const EXPLAINED: f64 = 1.3;

/// A camera that is written here and knows nothing of the one that is tested: electrons and noise of each frame.
struct SensorModel {
    rng: ChaCha8Rng,
}

impl SensorModel {
    fn new(seed: u64) -> Self {
        Self {
            rng: ChaCha8Rng::seed_from_u64(seed),
        }
    }

    fn normal(&mut self) -> f64 {
        // Twelve uniform numbers: their sum has a variance of one.
        (0..12).map(|_| self.rng.random::<f64>()).sum::<f64>() - 6.0
    }

    /// Mean of so many frames of so much light (DN above black), not above saturation.
    fn recorded(&mut self, light_dn: f64, frames: u32) -> f32 {
        let camera = &LIKE.camera;
        let electrons = light_dn.max(0.0) * camera.gain_e_per_dn;
        let shot_dn = electrons.sqrt() / camera.gain_e_per_dn;
        let sigma_dn = shot_dn.hypot(camera.read_noise_dn) / f64::from(frames).sqrt();
        let dn = camera.black_level_dn + light_dn + sigma_dn * self.normal();
        dn.min(camera.saturation_dn) as f32
    }
}

/// Light of every capture without noise (DN above black), each with its registration and flux.
fn light() -> Vec<(String, Array2<f64>)> {
    let mut quiet = LIKE.clone();
    // A billionth of a DN.
    (quiet.camera.gain_e_per_dn, quiet.camera.read_noise_dn) = (1e18, 1e-9);
    let images = SYNTHESIZER
        .with_effects(&[vec![("cd_bias", &[BIAS_NM])]], &Silent)
        .unwrap()
        .remove(0);
    let set = Synthesizer::new(&quiet, &settings()).unwrap().draw(&images, 41);
    let black = LIKE.camera.black_level_dn;
    let of = |c: &metalith_calibrate::Measurement| (c.name.clone(), c.dn.mapv(|v| f64::from(v) - black));
    set.measurements.iter().map(of).collect()
}

/// The answer for the set in a folder, and the set.
fn diagnosed(folder: &Path) -> (Diagnosis, MeasuredSet) {
    let set = MeasuredSet::read(folder, &PillarsAt::STATED, &Silent).unwrap();
    let session = Session::new(&set, settings()).unwrap();
    let diagnosis = session.diagnose(&SIMULATIONS, &Silent).unwrap().0;
    (diagnosis, set)
}

fn is_the_bias(d: &Diagnosis) {
    assert_eq!(names(d), ["cd_bias"], "{} {:?}", d.sentence(), d.error);
    assert_eq!(d.verdict, SetVerdict::Explained, "{} {:?}", d.sentence(), d.error);
    assert_eq!(d.effects[0].holds(BIAS_NM), Some(true), "{}", d.sentence());
    assert!(d.error.after.held_out < EXPLAINED, "{:?}", d.error);
    assert_eq!(d.left_out.len(), 0);
}

/// Green and red pixels of a mosaic record one LED each; what stands under other filters is another light.
#[test]
fn a_bias_is_found_in_a_mosaic() {
    let folder = tempfile::tempdir().unwrap();
    let path = small_set(folder.path());
    let text = fs::read_to_string(&path).unwrap();
    let text = text
        .replace("flux_sigma = 0.01", "flux_sigma = 0.01\nbayer = \"grbg\"")
        .replace("centre_nm = 500", "centre_nm = 500\nchannel = \"green\"")
        .replace("centre_nm = 560", "centre_nm = 560\nchannel = \"red\"");
    fs::write(&path, text).unwrap();
    let filter = ColourFilter::Grbg;
    let mut camera = SensorModel::new(1);
    let set = MeasuredSet::read(folder.path(), &PillarsAt::STATED, &Silent).unwrap();
    for ((name, light), measurement) in light().iter().zip(&set.measurements) {
        let pixels = filter.pixels_of(set.leds[measurement.led].channel).unwrap();
        let frame = Array2::from_shape_fn(light.dim(), |at| {
            // Through another filter comes a tenth.
            let share = if pixels.has(at) { 1.0 } else { 0.1 };
            camera.recorded(share * light[at], measurement.frames)
        });
        write_npy(&folder.path().join(format!("{name}.npy")), &frame);
    }
    let (d, set) = diagnosed(folder.path());
    is_the_bias(&d);
    // Half of the pixels are green, a quarter is red.
    let seen: Vec<usize> = set
        .measurements
        .iter_enumerated()
        .map(|(c, _)| set.seeing_pixels(c))
        .collect();
    let all = PIXELS * PIXELS;
    assert!(seen.contains(&(all / 2)) && seen.contains(&(all / 4)));
}

/// The long exposure of half of the measurements is saturated at its peak, which the short one tells of; the rest is known by the long one.
#[test]
fn a_bias_is_found_in_joined_exposures() {
    const LONG: f64 = 8.0;
    const SHORT: f64 = 0.5;
    const FRAMES: u32 = 16;
    let folder = tempfile::tempdir().unwrap();
    let path = small_set(folder.path());
    let mut text = fs::read_to_string(&path).unwrap();
    let mut camera = SensorModel::new(2);
    let full = LIKE.camera.saturation_dn as f32;
    let (mut saturated, mut measurements) = (0, 0);
    for (name, light) in light() {
        let mut exposures = String::new();
        for (kind, scale) in [("long", LONG), ("short", SHORT)] {
            let frame = light.mapv(|v| camera.recorded(scale * v, FRAMES));
            let lost = frame.iter().filter(|v| **v >= full).count();
            if kind == "long" {
                saturated += usize::from(lost > 0);
            } else {
                assert_eq!(lost, 0, "{name}");
            }
            write_npy(&folder.path().join(format!("{name}_{kind}.npy")), &frame);
            exposures.push_str(&format!(
                "[[capture.exposure]]\nfile = \"{name}_{kind}.npy\"\nscale_dn = {scale:?}\nframes = {FRAMES}\n"
            ));
        }
        // The keys of a measurement come before its exposures.
        let own = text.find(&format!("file = \"{name}.npy\"\n")).unwrap();
        let end = text[own..].find("scale_dn = 1.0\nframes = 64\n").unwrap() + own;
        text.replace_range(end..end + "scale_dn = 1.0\nframes = 64\n".len(), &exposures);
        text = text.replace(&format!("file = \"{name}.npy\"\n"), "");
        measurements += 1;
    }
    fs::write(&path, text).unwrap();
    assert!(
        2 * saturated >= measurements,
        "{saturated} of {measurements} are saturated"
    );
    let (d, set) = diagnosed(folder.path());
    is_the_bias(&d);
    assert!(set.measurements.iter().all(|c| c.noise.is_some() && c.scale_dn == LONG));
}

/// Pixels of unlike response and dark current, and dark and flat frames of few frames, whose noise is larger than that of the
/// measurements: it is counted.
#[test]
fn a_bias_is_found_behind_noisy_dark_and_flat_frames() {
    const FLAT_DN: f64 = 3000.0;
    const FLAT_FRAMES: u32 = 4;
    const DARK_FRAMES: u32 = 16;
    /// Reduced chi-square per pixel if the noise of dark and flat frames is left out.
    const SEEN: f64 = 1.5;
    let folder = tempfile::tempdir().unwrap();
    let path = small_set(folder.path());
    let mut camera = SensorModel::new(3);
    let shape = (PIXELS, PIXELS);
    let response = Array2::from_shape_fn(shape, |_| 1.0 + 0.02 * camera.normal());
    let dark = Array2::from_shape_fn(shape, |_| 4.0 + camera.normal());
    let mut frame = |light: &dyn Fn((usize, usize)) -> f64, frames: u32| {
        Array2::from_shape_fn(shape, |at| camera.recorded(response[at] * light(at) + dark[at], frames))
    };
    write_npy(&folder.path().join("dark.npy"), &frame(&|_| 0.0, DARK_FRAMES));
    write_npy(&folder.path().join("flat.npy"), &frame(&|_| FLAT_DN, FLAT_FRAMES));
    for (name, light) in light() {
        write_npy(&folder.path().join(format!("{name}.npy")), &frame(&|at| light[at], 64));
    }
    let text = fs::read_to_string(&path).unwrap();
    let with = |dark: u32, flat: u32| {
        let keys = format!(
            "flux_sigma = 0.01\ndark_frame = \"dark.npy\"\ndark_frames = {dark}\nflat_frame = \"flat.npy\"\nflat_frames = {flat}"
        );
        fs::write(&path, text.replace("flux_sigma = 0.01", &keys)).unwrap();
        diagnosed(folder.path()).0
    };
    is_the_bias(&with(DARK_FRAMES, FLAT_FRAMES));
    // As if both were the mean of so many frames that they have no noise.
    let d = with(1_000_000, 1_000_000);
    assert!(d.error.after.held_out > SEEN, "{:?}", d.error);
    // How many frames it is the mean of must be said.
    fs::write(
        &path,
        text.replace("flux_sigma = 0.01", "flux_sigma = 0.01\ndark_frame = \"dark.npy\""),
    )
    .unwrap();
    let error = MeasuredSet::read(folder.path(), &PillarsAt::STATED, &Silent)
        .unwrap_err()
        .to_string();
    assert!(error.contains("dark_frames"), "{error}");
}

/// The sensor stands behind the chip itself, without a relay: the light of a lens falls on a few of its pixels.
#[test]
fn a_gap_is_found_on_a_bare_sensor() {
    const EDGE: usize = 16;
    const DEFOCUS_UM: f64 = 15.0;
    let folder = tempfile::tempdir().unwrap();
    let path = small_set(folder.path());
    let text = fs::read_to_string(&path).unwrap();
    let text = text
        .replace("pixel_um = 0.5", "pixel_um = 5.86")
        .replace(&format!("rows = {PIXELS}"), &format!("rows = {EDGE}"))
        .replace(&format!("cols = {PIXELS}"), &format!("cols = {EDGE}"))
        .replace("scale_dn = 1.0", "scale_dn = 12.0");
    fs::write(&path, text).unwrap();
    for measurement in &LIKE.measurements {
        let dark = Array2::from_elem((EDGE, EDGE), LIKE.camera.black_level_dn as f32);
        write_npy(&folder.path().join(format!("{}.npy", measurement.name)), &dark);
    }
    let like = MeasuredSet::read(folder.path(), &PillarsAt::STATED, &Silent).unwrap();
    let synthesizer = Synthesizer::new(&like, &settings()).unwrap();
    let images = synthesizer.with_effect("defocus", &[DEFOCUS_UM], &Silent).unwrap();
    let set = synthesizer.draw(&images, 43);
    let session = Session::new(&set, settings()).unwrap();
    let d = diagnosis_of(&session);
    assert_eq!(
        names(&d),
        ["defocus"],
        "{} {:?} {:?}",
        d.sentence(),
        d.error,
        d.left_out
    );
    assert_eq!(d.effects[0].holds(DEFOCUS_UM), Some(true), "{}", d.sentence());
    assert!(d.error.after.held_out < EXPLAINED, "{:?}", d.error);
}
