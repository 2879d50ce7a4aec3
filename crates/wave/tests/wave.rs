//! The propagators against one another, against the sum over all pillars, and against reference fields.

mod adjoint;

use metalith_pillars::{Lattice, PillarMap};
use metalith_sensor::{Optic, PixelGrid};
use metalith_wave::propagation::Together;
use metalith_wave::{
    Accuracy, Aperture, Direct, FoldedPropagator, Hankel, IdealPsf, PhaseFunction, Pillars, PlaneWave, Propagator, Psf,
    Scratch, TransmissionMap, WaveError, Window,
};
use ndarray::Array2;
use num_complex::{Complex32, Complex64};
use std::f64::consts::TAU;

/// Places of the reference are given to so many samples.
const SAME_PLACE: f64 = 1e-6;
/// Tolerance of the accurate mode: a part in 1e5 of the largest field of the lens.
const ACCURATE: f64 = 1e-5;
/// Tolerance of the fast mode.
const FAST: f64 = 1e-3;
/// |U| at the focus of the steered lens in matched light at 550 nm, largest of its reference field.
const STEERED_PEAK: f64 = 554.1;

struct Reference {
    wavelength_um: f64,
    sin_x: f64,
    point_um: [f64; 3],
    field: Complex64,
}

fn reference(text: &str) -> Vec<Vec<Reference>> {
    let rows = text.lines().skip(1).map(|line| {
        let v: Vec<f64> = line.split(',').map(|v| v.parse().unwrap()).collect();
        Reference {
            wavelength_um: v[0],
            sin_x: v[1].to_radians().sin(),
            point_um: [v[2], v[3], v[4]],
            field: Complex64::new(v[5], v[6]),
        }
    });
    let mut cases: Vec<Vec<Reference>> = Vec::new();
    for row in rows {
        match cases.last_mut() {
            Some(case) if case[0].wavelength_um == row.wavelength_um && case[0].sin_x == row.sin_x => case.push(row),
            _ => cases.push(vec![row]),
        }
    }
    cases
}

/// Turns of a cell of this duty cycle, by the published polynomial.
fn published_turns(wavelength_um: f64, duty: f64) -> f64 {
    let l = wavelength_um * 1e3;
    6.051 - 0.02033 * l + 2.26 * duty + 1.371e-5 * l * l - 0.002947 * l * duty + 0.797 * duty * duty
}

/// The steered element of the reference: 1 mm, f = 2.4 mm, 15 degrees at 550 nm, mapped and rounded.
fn steered() -> PillarMap {
    let lattice = Lattice::new(350, 2858).unwrap();
    let mut map = PillarMap::empty(lattice);
    for ((iy, ix), w) in map.number.indexed_iter_mut() {
        let [x, y] = [ix, iy].map(|i| lattice.coordinate_um(i));
        let r2 = x * x + y * y;
        if r2 <= 250_000.0 {
            let f = 2400.0_f64;
            let turns = (-((r2 + f * f).sqrt() - f) + 15.0_f64.to_radians().sin() * x) / 0.55;
            let u = turns - turns.floor();
            let duty = 0.2923 + 0.6809 * u - 0.1484 * u * u;
            *w = 2 * (175.0 * duty).round() as u16;
        }
    }
    map
}

fn published_table(wavelength_um: f64) -> Vec<Complex64> {
    (0..=350)
        .map(|w| Complex64::from_polar(1.0, TAU * published_turns(wavelength_um, f64::from(w) / 350.0)))
        .collect()
}

fn field_of(fold: &impl Propagator, aperture: &dyn Aperture, wave: &PlaneWave) -> Array2<Complex32> {
    fold.field(aperture, wave, &mut Scratch::default()).unwrap().values
}

fn double(z: Complex32) -> Complex64 {
    Complex64::new(z.re.into(), z.im.into())
}

/// Largest error at the points of one case, in units of `peak`, from windows whose samples hit them.
fn worst(case: &[Reference], aperture: &dyn Aperture, accuracy: Accuracy, peak: f64) -> f64 {
    let wave = PlaneWave {
        wavelength_um: case[0].wavelength_um,
        sin_x: case[0].sin_x,
        sin_y: 0.0,
    };
    let [x, y, z] = case[0].point_um;
    let mut errors = vec![f64::NAN; case.len()];
    for step in [0.5, 0.35, 0.1] {
        let window = Window::about([x, y], step, 257, z);
        let radius = aperture.radius_um();
        let fold = FoldedPropagator::plan(aperture.lattice(), radius, wave.wavelength_um, window, accuracy).unwrap();
        let values = field_of(&fold, aperture, &wave);
        for (r, error) in case.iter().zip(&mut errors) {
            let place = [0, 1].map(|a| (r.point_um[a] - window.centre_um[a]) / step + 128.0);
            let index = place.map(f64::round);
            if (0..2).all(|a| (place[a] - index[a]).abs() < SAME_PLACE && (0.0..257.0).contains(&index[a])) {
                let got = double(values[[index[1] as usize, index[0] as usize]]);
                *error = error.max((got - r.field).norm() / peak);
            }
        }
    }
    // A point that no window hit is still not a number, and is larger than any limit.
    errors
        .iter()
        .map(|e| if e.is_nan() { f64::INFINITY } else { *e })
        .fold(0.0, f64::max)
}

#[test]
fn steered_lens_with_all_its_orders() {
    let map = steered();
    assert_eq!(map.pillars(), 6_411_448);
    for case in reference(include_str!("../../../golden/truth/diffraction_steered.csv")) {
        let pillars = Pillars::new(&map, &published_table(case[0].wavelength_um)).unwrap();
        let accurate = worst(&case, &pillars, Accuracy::Accurate, STEERED_PEAK);
        let fast = worst(&case, &pillars, Accuracy::Fast, STEERED_PEAK);
        println!(
            "{} um, sin {:.3}: accurate {accurate:.1e}, fast {fast:.1e}",
            case[0].wavelength_um, case[0].sin_x
        );
        assert!(accurate < ACCURATE);
        assert!(fast < FAST);
    }
}

#[test]
fn round_lens_on_an_odd_lattice_on_and_off_axis() {
    let cases = reference(include_str!("../../../golden/truth/diffraction_rs.csv"));
    let mut peak = 0.0;
    for case in cases {
        let l = case[0].wavelength_um;
        let lens = PhaseFunction {
            lattice: Lattice::new(350, 2857).unwrap(),
            radius_um: 500.0,
            amplitude: 1.0,
            phase_rad: |x: f64, y: f64| -TAU / l * ((x * x + y * y + 4e6).sqrt() - 2000.0),
        };
        if case[0].sin_x == 0.0 {
            peak = case.iter().map(|r| r.field.norm()).fold(0.0, f64::max);
        }
        let accurate = worst(&case, &lens, Accuracy::Accurate, peak);
        println!("{l} um, sin {:.3}: accurate {accurate:.1e}", case[0].sin_x);
        assert!(accurate < ACCURATE);
    }
}

/// A lens of 40 um on the lattice, f = 50 um at 550 nm, steered by `sin_x`, with a phase too steep to be smooth.
fn small(sin_x: f64) -> PhaseFunction<impl Fn(f64, f64) -> f64 + Sync> {
    PhaseFunction {
        lattice: Lattice::new(350, 116).unwrap(),
        radius_um: 20.0,
        amplitude: 1.2,
        phase_rad: move |x: f64, y: f64| TAU / 0.55 * (50.0 - (x * x + y * y + 2500.0).sqrt() + sin_x * x),
    }
}

fn largest_difference(a: &Array2<Complex32>, b: &Array2<Complex32>) -> f64 {
    f64::from(a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f32::max))
}

#[test]
fn fold_agrees_with_the_direct_sum_for_small_lenses_wherever_they_look() {
    // Twice the accuracy asked for, in units of the peak in matched light: these lenses are faster, smaller and
    // steered further than any design here.
    const SMALL: f64 = 2.0 * ACCURATE;
    for (steer, sin, wavelength) in [
        (0.0, 0.0, 0.55),
        (0.2, -0.1, 0.45),
        (-0.45, 0.0, 0.63),
        (0.5, 0.1, 0.45),
        // At 41, 50 and 58 degrees, as lenses that do not steer see the edge of a wide scene.
        (0.0, 0.66, 0.55),
        (0.0, 0.77, 0.45),
        (0.0, 0.85, 0.65),
    ] {
        let lens = small(steer);
        let wave = PlaneWave {
            wavelength_um: wavelength,
            sin_x: sin,
            sin_y: 0.07,
        };
        let out: f64 = sin + steer * wavelength / 0.55;
        let z: f64 = 50.0;
        let centre = [out, 0.07].map(|s| z * s / (1.0 - out * out - 0.0049).sqrt());
        let window = Window {
            centre_um: centre.map(|c| c + 1.3),
            step_um: 0.6,
            samples: 21,
            distance_um: z,
        };
        let fold = FoldedPropagator::plan(lens.lattice, 20.0, wavelength, window, Accuracy::Accurate).unwrap();
        let direct = Direct::plan(lens.lattice, wavelength, window).unwrap();
        let matched = 1.2 * TAU / 2.0 * 400.0 / (wavelength * z);
        let error = largest_difference(&field_of(&fold, &lens, &wave), &field_of(&direct, &lens, &wave)) / matched;
        println!(
            "steered {steer}, sin {sin}, {wavelength} um: {error:.1e}, {:?}",
            fold.fade()
        );
        assert!(error < SMALL);
    }
}

#[test]
fn adjoints_are_adjoint() {
    let lens = small(0.3);
    let wave = PlaneWave {
        wavelength_um: 0.5,
        sin_x: -0.2,
        sin_y: 0.1,
    };
    let window = Window {
        centre_um: [6.0, 4.0],
        step_um: 0.7,
        samples: 12,
        distance_um: 50.0,
    };
    let fold = |accuracy| FoldedPropagator::plan(lens.lattice, 20.0, 0.5, window, accuracy).unwrap();
    // A period shorter than the lattice, so that sites are folded onto one another.
    let folded = FoldedPropagator::with_fade(lens.lattice, 0.5, window, [96, 96], [12.0, 15.0]).unwrap();
    let direct = Direct::plan(lens.lattice, 0.5, window).unwrap();
    let (accurate, fast) = (fold(Accuracy::Accurate), fold(Accuracy::Fast));
    let all: [&dyn Propagator; 4] = [&accurate, &fast, &folded, &direct];
    for propagator in all {
        adjoint::checked(propagator, &lens, &wave);
    }
}

#[test]
fn apertures_that_are_formed_once_are_those_that_are_formed_row_by_row() {
    let (lens, other) = (small(0.3), small(-0.1));
    let wave = PlaneWave::normal(0.5);
    let window = Window::about([6.0, 4.0], 0.7, 12, 50.0);
    let fold = FoldedPropagator::plan(lens.lattice, 20.0, 0.5, window, Accuracy::Accurate).unwrap();
    let psf = |aperture: &dyn Aperture| Psf::formed(&fold, aperture, &wave, &[40.0], &mut Scratch::default()).unwrap();
    let alone = [psf(&lens), psf(&other)];
    let maps = TransmissionMap::of_set(&Together(vec![&lens, &other]), 20.0);
    assert_eq!([psf(&maps[0]), psf(&maps[1])], alone);
    let set = Together(vec![&maps[0], &maps[1]]);
    let both = Psf::formed_of_set(&fold, &set, &wave, &[40.0], &mut Scratch::default()).unwrap();
    assert_eq!(both, alone);
}

#[test]
fn rings_agree_with_the_lattice_on_the_axis_and_near_it() {
    // On the axis the lattice's own rings are the same sum.
    const SAME_SUM: f64 = 1e-6;
    // Off it they are its azimuthal mean, and a lattice of 57 rings is nearly round.
    const NEARLY_ROUND: f64 = 5e-3;
    let lens = small(0.0);
    let wave = PlaneWave::normal(0.55);
    let rings = Hankel::of_lattice(0.55, 50.0, &lens.lattice, 20.0).unwrap();
    let transmission: Vec<Complex64> = rings
        .radii_um()
        .iter()
        .map(|&r| Complex64::from_polar(1.2, (lens.phase_rad)(r, 0.0)))
        .collect();
    let rho = [0.0, 0.2, 0.9, 2.5];
    let field = rings.field(&transmission, &rho).unwrap();
    let points = rho.map(|r| [r * 0.8, r * 0.6, 50.0]);
    let direct = Direct::at(&lens, &wave, &points);
    let peak = direct[0].norm();
    assert!((field[0] - direct[0]).norm() < SAME_SUM * peak);
    for (a, b) in field.iter().zip(&direct) {
        assert!((a - b).norm() < NEARLY_ROUND * peak, "{a} is not {b}");
    }
    let values = [
        Complex64::new(1.0, 0.5),
        Complex64::I,
        Complex64::new(-0.3, 2.0),
        Complex64::ONE,
    ];
    let back = rings.adjoint(&values, &rho).unwrap();
    let left: Complex64 = values.iter().zip(&field).map(|(v, f)| v.conj() * f).sum();
    let right: Complex64 = back.iter().zip(&transmission).map(|(b, t)| b.conj() * t).sum();
    // Sums over a few hundred products in double precision.
    const DOUBLE: f64 = 1e-12;
    assert!((left - right).norm() < DOUBLE * left.norm());
}

#[test]
fn what_does_not_fit_together_is_refused() {
    let lens = small(0.0);
    let window = Window::about([0.0, 0.0], 0.5, 8, 50.0);
    let fold = FoldedPropagator::plan(lens.lattice, 20.0, 0.55, window, Accuracy::Fast).unwrap();
    let scratch = &mut Scratch::default();
    let wave = PlaneWave::normal(0.55);
    let blue = fold.field(&lens, &PlaneWave::normal(0.56), scratch);
    assert!(matches!(blue, Err(WaveError::Wave { planned_um: 0.55, .. })));
    let other = PhaseFunction {
        lattice: Lattice::new(350, 114).unwrap(),
        radius_um: 20.0,
        amplitude: 1.0,
        phase_rad: |_: f64, _: f64| 0.0,
    };
    let elsewhere = fold.field(&other, &wave, scratch);
    assert!(matches!(elsewhere, Err(WaveError::Lattice { .. })));
    let back = fold.adjoint(&Array2::zeros((8, 7)), &wave, scratch);
    assert!(matches!(
        back,
        Err(WaveError::Shape {
            given: [8, 7],
            wanted: [8, 8],
            ..
        })
    ));
    let far = Window {
        distance_um: f64::NAN,
        ..window
    };
    let plan = |window| FoldedPropagator::plan(lens.lattice, 20.0, 0.55, window, Accuracy::Fast).err();
    assert!(matches!(plan(far), Some(WaveError::Window { .. })));
    let wide = Window { step_um: 1e6, ..window };
    assert!(matches!(plan(wide), Some(WaveError::Fade { .. })));
}

#[test]
fn a_perfect_lens_has_the_image_of_theory() {
    let lens = PhaseFunction {
        lattice: Lattice::new(350, 400).unwrap(),
        radius_um: 70.0,
        amplitude: 1.2,
        phase_rad: |x: f64, y: f64| -TAU / 0.53 * ((x * x + y * y + 336.0 * 336.0).sqrt() - 336.0),
    };
    let window = Window::about([0.0, 0.0], 0.35, 256, 336.0);
    let fold = FoldedPropagator::plan(lens.lattice, 70.0, 0.53, window, Accuracy::Accurate).unwrap();
    let field = fold
        .field(&lens, &PlaneWave::normal(0.53), &mut Scratch::default())
        .unwrap();
    let psf = Psf::of(&field);
    let matched = IdealPsf::of(&lens, [0.0, 0.0, 336.0], 0.53, 1.2);
    let metrics = psf.metrics(&matched, 5.86);
    // All sites in phase: the accuracy of the fold, twice for the square.
    assert!((metrics.strehl - 1.0).abs() < 2.0 * ACCURATE);
    const ROUNDING_UM: f64 = 1e-9;
    assert!(metrics.peak_um.iter().all(|p| p.abs() < ROUNDING_UM));
    // A rim of the circle on the lattice and rays at 12 degrees are what the paraxial closed form leaves out; light
    // outside the window, 1 / (pi^2 NA w / lambda), is what the window leaves out of its zero frequency.
    const PARAXIAL: f64 = 5e-3;
    let cutoff = 2.0 * 70.0 / (0.53 * 336.0_f64.hypot(70.0)) * 1e3;
    for f in [42.7, 85.3, 300.0] {
        let v: f64 = f / cutoff;
        let theory = (v.acos() - v * (1.0 - v * v).sqrt()) * 2.0 / std::f64::consts::PI;
        let got = psf.mtf([f, 0.0]);
        assert!((got - theory).abs() < PARAXIAL, "{got} is not {theory}");
    }
    // And of the energy: 1 / (pi^2 0.2 x 45 um / 0.53 um), and what a lattice keeps in other orders.
    const IN_WINDOW: std::ops::Range<f64> = 0.99..1.0;
    assert!(IN_WINDOW.contains(&metrics.energy_window));
    assert!(metrics.energy_1_pixel < metrics.energy_2_pixels && metrics.energy_2_pixels < metrics.energy_window);
}

/// A pixel is one thing: the PSF integrated over pixels, and its spectrum read behind their aperture.
#[test]
fn a_pixel_sees_the_same_by_both_ways() {
    // Single precision, and what the fade of the surroundings takes, of the brightest pixel.
    const SAME_PIXELS: f64 = 1e-5;
    let lens = small(0.0);
    let window = Window {
        centre_um: [0.0, 0.0],
        step_um: 0.25,
        samples: 96,
        distance_um: 50.0,
    };
    let fold = FoldedPropagator::plan(lens.lattice, 20.0, 0.55, window, Accuracy::Accurate).unwrap();
    let field = fold
        .field(&lens, &PlaneWave::normal(0.55), &mut Scratch::default())
        .unwrap();
    let psf = Psf::of(&field);
    let (pixel_um, pixels, off_um) = (1.3, 7, [0.4, -0.2]);
    let energy = psf.on_pixels(off_um, pixel_um, pixels).unwrap();
    let optic = Optic {
        pixel_um,
        disc_um: [[0.0; 2]; 2],
        blur_um: 0.0,
    };
    let samples: Vec<f32> = psf.values.iter().map(|v| *v as f32).collect();
    let mean = PixelGrid::new(&samples, window.step_um, &optic, pixels, pixels).pixels(off_um);
    let brightest = energy.iter().copied().fold(0.0, f64::max);
    for (e, m) in energy.iter().zip(&mean) {
        let error = (e - f64::from(*m) * pixel_um * pixel_um).abs() / brightest;
        assert!(error < SAME_PIXELS, "{error:.1e}");
    }
}
