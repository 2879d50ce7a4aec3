//! Light against closed forms.

use std::f64::consts::{PI, TAU};

use ndarray::Array2;

use super::bench::{ApertureShape, StackBench, ThinLens};
use super::light::{Light, Place};
use super::sampling::{Method, Sampling};
use super::set::{StackObject, StackPlane, StackSet, Transmission};
use super::setting::{Setting, slots};

const WAVELENGTH_UM: f64 = 0.633;

fn set(aperture_um: f64, lens: Option<f64>, sensor_um: f64, pixel_um: f64, side: usize) -> StackSet {
    let plane = StackPlane {
        name: "open".into(),
        object: 0,
        number: 0,
        position_um: 0.0,
        frame: Array2::zeros((side, side)),
        used: Array2::from_elem((side, side), true),
        fitted: true,
    };
    StackSet {
        path: "".into(),
        title: String::new(),
        bench: StackBench {
            wavelengths: vec![[WAVELENGTH_UM, 1.0]],
            source_um: None,
            shape: ApertureShape::Round,
            aperture_um,
            lens: lens.map(|focal_um| ThinLens {
                focal_um,
                distance_um: 0.0,
                diameter_um: aperture_um,
            }),
            sensor_um,
            pixel_um,
            shift: true,
            background: true,
        },
        objects: vec![StackObject {
            name: "open".into(),
            transmission: None,
        }],
        planes: vec![plane],
        remarks: Vec::new(),
    }
}

/// Intensities along the row through the middle, with their places (pixels).
fn middle_row(set: &StackSet, sampling: &Sampling) -> Vec<(f64, f64)> {
    let light = Light::new(set, sampling);
    let setting = Setting::of(&vec![0.0; slots(set)], 0);
    let place = Place {
        distance_um: set.bench.sensor_um,
        pixel_um: set.bench.pixel_um,
        mask_um: 0.0,
        origin_px: [0.0; 2],
    };
    let found = light.intensity(&light.pupil(0, &setting.pupil), place);
    let n = found.ncols();
    let at = |k: usize| (k as f64 - 0.5 * (n as f64 - 1.0)) / sampling.fine as f64;
    (0..n).map(|k| (at(k), f64::from(found[(n / 2, k)]))).collect()
}

fn bessel(order: f64, x: f64) -> f64 {
    const STEPS: usize = 2000;
    let value = |k: usize| {
        let t = PI * (k as f64 + 0.5) / STEPS as f64;
        (order * t - x * t.sin()).cos()
    };
    (0..STEPS).map(value).sum::<f64>() / STEPS as f64
}

#[test]
fn an_open_aperture_at_a_lens_has_the_airy_pattern() {
    /// Of the peak: the rim of the opening on samples.
    const RIM: f64 = 0.01;
    let set = set(5000.0, Some(100_000.0), 100_000.0, 2.0, 41);
    let sampling = Sampling::new(&set).unwrap();
    assert!(sampling.reason.contains("Fraunhofer"), "{}", sampling.reason);
    let row = middle_row(&set, &sampling);
    let peak = row.iter().map(|v| v.1).fold(0.0, f64::max);
    for (px, found) in row {
        let v = PI * 5000.0 * px * 2.0 / (WAVELENGTH_UM * 100_000.0);
        let want = if v == 0.0 {
            1.0
        } else {
            (2.0 * bessel(1.0, v) / v).powi(2)
        };
        assert!((found / peak - want).abs() < RIM, "{px}: {} for {want}", found / peak);
    }
}

#[test]
fn a_phase_grating_has_the_orders_of_its_bessel_functions() {
    const AMPLITUDE: f64 = 0.9;
    const PERIOD_UM: f64 = 500.0;
    /// Means over samples of the light, and the tails of other orders.
    const SAMPLES: f64 = 0.03;
    let pixel = WAVELENGTH_UM * 100_000.0 / PERIOD_UM / 24.0;
    let mut set = set(5000.0, Some(100_000.0), 100_000.0, pixel, 81);
    set.bench.shape = ApertureShape::Square;
    let phase = |x: usize| AMPLITUDE * (TAU * (x as f64 + 0.5) * 20.0 / PERIOD_UM).sin();
    set.objects[0].transmission = Some(Transmission {
        phase: Array2::from_shape_fn((300, 300), |(_, x)| phase(x) as f32),
        amplitude: None,
        factors: vec![1.0],
        sample_um: 20.0,
        has_depth: true,
    });
    let sampling = Sampling::new(&set).unwrap();
    let row = middle_row(&set, &sampling);
    let at = |px: f64| row.iter().find(|(x, _)| (x - px).abs() < 1e-9).unwrap().1;
    let want = (bessel(1.0, AMPLITUDE) / bessel(0.0, AMPLITUDE)).powi(2);
    for order in [-24.0, 24.0] {
        let found = at(order) / at(0.0);
        assert!(
            (found / want - 1.0).abs() < 2.0 * SAMPLES,
            "{order}: {found} for {want}"
        );
    }
}

/// On the axis behind a round opening of an odd number of Fresnel zones light is four times as bright as without it, behind an even
/// number dark.
#[test]
fn zones_of_an_opening_are_bright_and_dark_by_both_ways() {
    const RIM: f64 = 0.12;
    for (zones, want) in [(1.0, 4.0), (2.0, 0.0), (5.0, 4.0)] {
        let z = 500.0 * 500.0 / (WAVELENGTH_UM * zones);
        let set = set(1000.0, None, z, 5.0, 41);
        let one_sum = Sampling::new(&set).unwrap();
        assert!(one_sum.reason.contains("Fresnel by one"), "{}", one_sum.reason);
        let dx_um = 8.0;
        let spectrum = Sampling {
            method: Method::AngularSpectrum,
            dx_um,
            n: (((1100.0 + WAVELENGTH_UM * z / dx_um) / dx_um) as usize).next_multiple_of(64),
            ..one_sum.clone()
        };
        let ways = if zones > 4.0 {
            vec![&one_sum, &spectrum]
        } else {
            vec![&one_sum]
        };
        for sampling in ways {
            let row = middle_row(&set, sampling);
            let found = row.iter().find(|(x, _)| *x == 0.0).unwrap().1;
            assert!((found - want).abs() < RIM, "{zones}: {found} for {want}");
        }
    }
}

#[test]
fn what_no_way_samples_is_refused_with_numbers() {
    // A pixel of the size of a hundred spots, and light from the side.
    let coarse = Sampling::new(&set(20_000.0, Some(50_000.0), 50_000.0, 100.0, 32));
    let steep = Sampling::new(&set(20_000.0, None, 5_000.0, 1.0, 32));
    for outcome in [coarse, steep] {
        assert_eq!(outcome.unwrap_err().id(), "stacks/not-sampled");
    }
}
