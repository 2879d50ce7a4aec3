//! Stacks with known effects, made by direct sums over the opening, from files to the answer.

use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::Path;

use metalith_core::Silent;
use metalith_metrology::{Diagnosis, FoundEffect, SetKind, SetVerdict, calibrate, kind_of};
use npyz::WriterBuilder;
use num_complex::Complex64;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const WAVELENGTH_UM: f64 = 0.633;
const FOCAL_UM: f64 = 100_000.0;
const APERTURE_UM: f64 = 5000.0;
const PIXEL_UM: f64 = 4.0;
const SIDE: usize = 40;
const PLANES: usize = 7;
const STEP_UM: f64 = 300.0;

/// Samples of a mask file, and their edge.
const SAMPLES: usize = 130;
const SAMPLE_UM: f64 = 40.0;

fn write_array(path: &Path, shape: &[u64], values: &[f64]) {
    let file = std::fs::File::create(path).unwrap();
    let options = npyz::WriteOptions::new().default_dtype().shape(shape);
    let mut writer = options.writer(file).begin_nd().unwrap();
    writer.extend(values.iter().copied()).unwrap();
    writer.finish().unwrap();
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

type Phase = fn(f64, f64) -> f64;

/// Phases (rad) of the objects over places in units of the radius; the first is the open aperture.
const OBJECTS: [(&str, Phase); 3] = [
    ("open", |_, _| 0.0),
    ("cubic", |x, y| 7.0 * (x * x * x + y * y * y)),
    ("lobes", |x, y| {
        1.6 * (4.0 * x).sin() + 1.2 * (5.0 * y + 2.0 * x).cos() + x * y
    }),
];

/// What was done to the bench.
#[derive(Clone, Copy)]
struct Truth {
    /// Astigmatism of the lens (nm rms, Noll 6), and of the objects `cubic` and `lobes` alone.
    lens_nm: f64,
    cubic_nm: f64,
    lobes_nm: f64,
    /// Displacement of all masks along x (um).
    shift_um: f64,
    spacing: f64,
    turned: bool,
}

const NONE: Truth = Truth {
    lens_nm: 0.0,
    cubic_nm: 0.0,
    lobes_nm: 0.0,
    shift_um: 0.0,
    spacing: 1.0,
    turned: false,
};

/// Intensity of an object on pixels, by direct sums over points of the opening and over 3 x 3 points of each pixel.
fn plane(object: usize, z_um: f64, truth: &Truth, moved_px: [f64; 2]) -> Vec<f64> {
    const POINTS: usize = 150;
    const FINE: usize = 3;
    let radius = 0.5 * APERTURE_UM;
    let step = 1.04 * APERTURE_UM / POINTS as f64;
    let at = |k: usize| (k as f64 - 0.5 * (POINTS as f64 - 1.0)) * step;
    let fine_at = |k: usize, moved: f64| {
        let pixel = (k as f64 + 0.5) / FINE as f64 - 0.5 * SIDE as f64;
        (pixel - moved) * PIXEL_UM
    };
    let wave = |x: usize, y: usize| {
        let (x, y) = (at(x) / radius, at(y) / radius);
        if x.hypot(y) > 1.0 {
            return Complex64::ZERO;
        }
        let shift = truth.shift_um / radius;
        let phase = OBJECTS[object].1(x - shift, y);
        let own = [0.0, truth.cubic_nm, truth.lobes_nm][object];
        let astigmatism = 6f64.sqrt() * (x * x - y * y);
        let path = (truth.lens_nm + own) * 1e-3 * astigmatism;
        let defocus = 0.5 * (1.0 / z_um - 1.0 / FOCAL_UM) * (x * x + y * y) * radius * radius;
        Complex64::cis(phase + TAU * (path + defocus) / WAVELENGTH_UM)
    };
    let fine = SIDE * FINE;
    let [by_x, by_y] = moved_px.map(|moved| -> Vec<Vec<Complex64>> {
        let factor = |k, point| Complex64::cis(-TAU * fine_at(k, moved) * at(point) / (WAVELENGTH_UM * z_um));
        (0..fine)
            .map(|k| (0..POINTS).map(|point| factor(k, point)).collect())
            .collect()
    });
    let mut rows = vec![Complex64::ZERO; POINTS * fine];
    for y in 0..POINTS {
        let line: Vec<Complex64> = (0..POINTS).map(|x| wave(x, y)).collect();
        for k in 0..fine {
            rows[y * fine + k] = (0..POINTS).map(|x| line[x] * by_x[k][x]).sum();
        }
    }
    let mut out = vec![0.0; SIDE * SIDE];
    for j in 0..fine {
        for k in 0..fine {
            let sum: Complex64 = (0..POINTS).map(|y| rows[y * fine + k] * by_y[j][y]).sum();
            out[j / FINE * SIDE + k / FINE] += sum.norm_sqr();
        }
    }
    out
}

fn stacks(truth: Truth, seed: u64) -> Diagnosis {
    let folder = tempfile::tempdir().unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut objects = String::new();
    for (number, (name, phase)) in OBJECTS.iter().enumerate() {
        let mut all = Vec::new();
        for k in 0..PLANES {
            let position = (k as f64 - 0.5 * (PLANES as f64 - 1.0)) * STEP_UM * truth.spacing;
            let moved = [0, 1].map(|_| 4.0 * rng.random::<f64>() - 2.0);
            let light = plane(number, FOCAL_UM + position, &truth, moved);
            let peak = light.iter().copied().fold(0.0, f64::max);
            let gain = 3000.0 * (0.8 + 0.4 * rng.random::<f64>()) / peak;
            let frame: Vec<f64> = light
                .iter()
                .map(|v| 100.0 + gain * v + 5.0 * normal(&mut rng))
                .collect();
            let turned = |k: usize| frame[k % SIDE * SIDE + (SIDE - 1 - k / SIDE)];
            all.extend((0..SIDE * SIDE).map(|k| if truth.turned { turned(k) } else { frame[k] }));
        }
        let shape = [PLANES as u64, SIDE as u64, SIDE as u64];
        write_array(&folder.path().join(format!("stack_{name}.npy")), &shape, &all);
        let kind = if number == 0 { "none" } else { "phase" };
        write!(objects, "[[object]]\nname = \"{name}\"\nkind = \"{kind}\"\n").unwrap();
        if number > 0 {
            let at = |k: usize| (k as f64 - 0.5 * (SAMPLES as f64 - 1.0)) * SAMPLE_UM / (0.5 * APERTURE_UM);
            let map: Vec<f64> = (0..SAMPLES * SAMPLES)
                .map(|k| phase(at(k % SAMPLES), at(k / SAMPLES)))
                .collect();
            let size = [SAMPLES as u64; 2];
            write_array(&folder.path().join(format!("{name}.npy")), &size, &map);
            write!(objects, "file = \"{name}.npy\"\nsample_um = {SAMPLE_UM}\n").unwrap();
        }
    }
    let first = -0.5 * (PLANES as f64 - 1.0) * STEP_UM;
    let text = format!(
        r#"
schema = 1
kind = "psf_stack"
title = "synthetic"
[source]
wavelength_nm = 633.0
[aperture]
diameter_um = {APERTURE_UM}
[lens]
focal_length_mm = 100.0
[sensor]
distance_mm = 100.0
pixel_um = {PIXEL_UM}
files = "stack_{{object}}.npy"
[planes]
start_um = {first}
step_um = {STEP_UM}
not_fitted = [2]
{objects}"#
    );
    std::fs::write(folder.path().join("measurement.toml"), text).unwrap();
    let out = folder.path().join("out");
    assert_eq!(kind_of(folder.path()), Some(SetKind::PsfStack));
    let answer = calibrate(folder.path(), SetKind::PsfStack, &out, (&[], None), &Silent)
        .unwrap()
        .diagnosis;
    println!("{}", answer.sentence());
    answer
        .remarks
        .iter()
        .chain(&answer.ladder_lines())
        .for_each(|line| println!("{line}"));
    answer
}

fn names(answer: &Diagnosis) -> Vec<&str> {
    answer.effects.iter().map(|e| e.name.as_str()).collect()
}

fn effect<'a>(answer: &'a Diagnosis, name: &str) -> &'a FoundEffect {
    let found = answer.effects.iter().find(|e| e.name == name);
    found.unwrap_or_else(|| panic!("{name} is not among {:?}", names(answer)))
}

/// True if a value lies in the 95 % interval of a parameter, or by a share beside it: masks have steps of 40 um in their files, and
/// the direct sums take them smooth.
fn holds(effect: &FoundEffect, parameter: usize, value: f64) -> bool {
    const STEPS: f64 = 0.005;
    let ends = match &effect.interval[parameter] {
        own if own.is_array() => own,
        _ => &effect.interval,
    };
    let [low, high]: [f64; 2] = serde_json::from_value(ends.clone()).unwrap();
    let more = STEPS * value.abs();
    (low - more..=high + more).contains(&value)
}

#[test]
fn stacks_as_stated_have_no_effect() {
    let answer = stacks(NONE, 1);
    assert!(answer.effects.is_empty(), "{:?}", names(&answer));
    assert_eq!(answer.verdict, SetVerdict::NoResidual);
}

#[test]
fn astigmatism_of_the_lens_a_shifted_mask_and_spacing_are_named() {
    let truth = Truth {
        lens_nm: 60.0,
        shift_um: 250.0,
        spacing: 1.15,
        turned: true,
        ..NONE
    };
    let answer = stacks(truth, 2);
    assert!(
        answer.remarks.iter().any(|r| r.contains("turned by 90 degrees")),
        "{:?}",
        answer.remarks
    );
    let lens = effect(&answer, "lens_astigmatism");
    assert!(holds(lens, 1, truth.lens_nm), "{lens:?}");
    let shift = effect(&answer, "mask_shift");
    assert!(holds(shift, 0, truth.shift_um), "{shift:?}");
    let spacing = effect(&answer, "plane_spacing");
    assert!(holds(spacing, 0, truth.spacing - 1.0), "{spacing:?}");
    assert!(answer.error.after.held_out < 0.05, "{:?}", answer.error);
}

#[test]
fn a_wavefront_of_one_object_is_not_of_the_lens() {
    let truth = Truth { cubic_nm: 70.0, ..NONE };
    let answer = stacks(truth, 3);
    let own = effect(&answer, "astigmatism_of_cubic");
    assert_eq!(own.of, "cubic");
    assert!(holds(own, 1, truth.cubic_nm), "{own:?}");
    assert!(!names(&answer).contains(&"lens_astigmatism"), "{:?}", names(&answer));
}

#[test]
fn a_wavefront_of_all_masks_that_the_open_aperture_denies_is_refused_by_name() {
    let truth = Truth {
        cubic_nm: 70.0,
        lobes_nm: 70.0,
        ..NONE
    };
    let answer = stacks(truth, 4);
    assert!(!names(&answer).contains(&"lens_astigmatism"), "{:?}", names(&answer));
    let tried = answer.ranking.iter().find(|r| r.name == "lens_astigmatism").unwrap();
    let reason = tried.rejected.as_deref().unwrap();
    assert!(reason.contains("predicts worse") && reason.contains("open"), "{reason}");
    assert!(answer.error.after.held_out < 0.05, "{:?}", answer.error);
}

#[test]
fn effects_of_a_file_are_refused_for_stacks() {
    let nowhere = Path::new("no_set");
    let declared = (&[][..], Some(Path::new("effects.toml")));
    let outcome = calibrate(nowhere, SetKind::PsfStack, nowhere, declared, &Silent);
    assert_eq!(outcome.unwrap_err().id(), "calibrate/kind-has-none");
}

/// A mask of complex values before a lens that stands apart, in the light of a table, with a file for each plane.
#[test]
fn complex_masks_a_lens_at_a_distance_and_a_spectrum_are_read() {
    const EDGE: usize = 24;
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let values: Vec<npyz::num_complex::Complex<f64>> = (0..EDGE * EDGE)
        .map(|k| npyz::num_complex::Complex::from_polar(1.0, 0.1 * (k % EDGE) as f64))
        .collect();
    let file = std::fs::File::create(at("mask.npy")).unwrap();
    let options = npyz::WriteOptions::new().default_dtype().shape(&[EDGE as u64; 2]);
    let mut writer = options.writer(file).begin_nd().unwrap();
    writer.extend(values).unwrap();
    writer.finish().unwrap();
    for z in [-500, 0, 500] {
        let spot = |k: usize| {
            let [x, y] = [k % EDGE, k / EDGE].map(|v| v as f64 - 0.5 * EDGE as f64);
            100.0 + 1000.0 * (-(x * x + y * y) / 8.0).exp()
        };
        let frame: Vec<f64> = (0..EDGE * EDGE).map(spot).collect();
        write_array(&at(&format!("mask_{z}.npy")), &[EDGE as u64; 2], &frame);
    }
    std::fs::write(at("led.csv"), "wavelength_nm,weight\n620,1\n633,2\n646,1\n").unwrap();
    let text = r#"
schema = 1
kind = "psf_stack"
title = "read"
[source]
spectrum = "led.csv"
[aperture]
diameter_mm = 1.0
[lens]
focal_length_mm = 100.0
distance_mm = 50.0
diameter_mm = 2.0
[sensor]
distance_mm = 100.0
pixel_um = 20.0
files = "{object}_{z_um}.npy"
[[object]]
name = "mask"
kind = "complex"
file = "mask.npy"
sample_um = 40.0
"#;
    std::fs::write(at("measurement.toml"), text).unwrap();
    let only = ["focus_offset".to_owned()];
    let answer = calibrate(folder.path(), SetKind::PsfStack, &at("out"), (&only, None), &Silent);
    let answer = answer.unwrap().diagnosis;
    assert!(
        answer.remarks.iter().any(|r| r.starts_with("propagation")),
        "{:?}",
        answer.remarks
    );
    assert!(answer.ranking.iter().all(|r| r.name == "focus_offset"));
}
