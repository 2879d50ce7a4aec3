//! Ideal elements against closed forms: where a slow lens focuses, and what a hologram sends into its orders.

use std::f64::consts::{PI, TAU};

use metalith_pillars::Lattice;
use metalith_wave::{
    Accuracy, Aperture, Direct, FoldedPropagator, PhaseFunction, PhaseMap, PlaneWave, Propagator, Psf, Scratch, Window,
};
use num_complex::Complex64;

/// Tolerance asked of ideal lenses: of the field on the axis, of the place of its peak, and of the Strehl ratio.
const IDEAL: f64 = 1e-3;
/// Tolerance asked of the orders of a hologram, as a share of the light that an element passes. A square about an order
/// loses the tail of its spot and has those of its neighbours.
const ORDERS: f64 = 1e-2;
/// Tolerance between two ways to compute the same field, as a share of the light that an element passes.
const ACCURATE: f64 = 1e-4;

/// Tolerance of a width at half maximum: the finite window, and straight lines between points of a sixteenth of a sample.
const WIDTH: f64 = 5e-3;

const PITCH_NM: u32 = 350;

/// Intensity on the axis behind a slow lens: `2 pi U / (k a^2) = sinc(x) / z` with `x = a^2 (1 / z - 1 / f) / (2
/// lambda)`: Li and Wolf, Opt. Commun. 39, 211 (1981). With a Fresnel number of about one its peak is far in front of
/// the focus.
#[test]
fn a_slow_lens_has_its_peak_where_diffraction_puts_it() {
    let (um, radius_um, focus_um) = (0.55, 100.0, 20_000.0);
    let lens = PhaseFunction {
        lattice: Lattice::new(PITCH_NM, 574).unwrap(),
        radius_um,
        amplitude: 1.0,
        phase_rad: |x: f64, y: f64| -PI / um * (x * x + y * y) / focus_um,
    };
    let places: Vec<f64> = (0..=120).map(|k| 7_000.0 + 100.0 * f64::from(k)).collect();
    let points: Vec<[f64; 3]> = places.iter().map(|z| [0.0, 0.0, *z]).collect();
    let field = Direct::at(&lens, &PlaneWave::normal(um), &points);
    // The area of the sites, which is not quite that of the circle.
    let area = power_um2(&lens);
    let theory = |z: f64| {
        let x = area / TAU / um * (1.0 / z - 1.0 / focus_um);
        area / (um * z) * (PI * x).sin() / (PI * x)
    };
    let peak = places.iter().map(|z| theory(*z).abs()).fold(0.0, f64::max);
    for (z, u) in places.iter().zip(&field) {
        let off = (u.norm() - theory(*z).abs()).abs() / peak;
        assert!(off < IDEAL, "{z} um: {} for {}", u.norm(), theory(*z));
    }
    // Strehl ratio in focus: all sites in phase.
    let strehl = Direct::at(&lens, &PlaneWave::normal(um), &[[0.0, 0.0, focus_um]])[0].norm_sqr()
        / (area / (um * focus_um)).powi(2);
    assert!((strehl - 1.0).abs() < IDEAL, "{strehl}");
    let best = |value: &dyn Fn(usize) -> f64| top_of(&places, value);
    let (seen, expected) = (best(&|k| field[k].norm_sqr()), best(&|k| theory(places[k]).powi(2)));
    assert!((seen / expected - 1.0).abs() < IDEAL, "{seen} um for {expected}");
    assert!(seen < 0.8 * focus_um, "the focal shift is what is looked at: {seen} um");
}

/// The width at half maximum of a lens of NA 0.8 is that of a direct sum at points far finer than the samples of the window, which
/// are half a pitch apart: a pitch is wider than the intensity allows (13 % too wide here).
#[test]
fn a_lens_of_high_aperture_has_the_width_of_a_direct_sum() {
    let (um, radius_um, focus_um, pitch_um) = (0.405, 12.0, 9.0, 0.216);
    let lens = PhaseFunction {
        lattice: Lattice::new(216, 112).unwrap(),
        radius_um,
        amplitude: 1.0,
        phase_rad: |x: f64, y: f64| -TAU / um * (x.hypot(y).hypot(focus_um) - focus_um),
    };
    let window = Window::of_psf([0.0; 2], (pitch_um, 64), (radius_um, focus_um), um);
    assert_eq!(window.samples, 128, "two samples a pitch");
    let fold = FoldedPropagator::plan(lens.lattice, radius_um, um, window, Accuracy::Accurate).unwrap();
    let wave = PlaneWave::normal(um);
    let psf = Psf::formed(&fold, &lens, &wave, &[], &mut Scratch::default()).unwrap();
    let points: Vec<[f64; 3]> = (0..=300).map(|k| [1e-3 * f64::from(k), 0.0, focus_um]).collect();
    let line: Vec<f64> = Direct::at(&lens, &wave, &points)
        .iter()
        .map(Complex64::norm_sqr)
        .collect();
    let half = line.iter().position(|v| *v < 0.5 * line[0]).unwrap();
    let crossing = half as f64 - (0.5 * line[0] - line[half]) / (line[half - 1] - line[half]);
    let [fwhm_um, _] = psf.fwhm_um();
    let expected_um = 2e-3 * crossing;
    assert!(
        (fwhm_um.unwrap() / expected_um - 1.0).abs() < WIDTH,
        "{fwhm_um:?} um for {expected_um}"
    );
}

/// A pattern of four phases that repeats after eight sites along both axes sends `|c_mn|^2` of the light into order
/// (m, n), c being the Fourier coefficients of a period.
#[test]
fn a_hologram_sends_its_light_into_orders_by_its_fourier_coefficients() {
    const PERIOD: usize = 8;
    const SITES: usize = 200;
    let (um, focus_um) = (0.55, 200.0);
    let lattice = Lattice::new(PITCH_NM, SITES).unwrap();
    let radius_um = 0.5 * SITES as f64 * lattice.pitch_um();
    // Stripes of half a turn along x, of a quarter along y: most light goes to a few orders.
    let pattern = |ix: usize, iy: usize| if ix < 3 { 0.5 } else { 0.0 } + if iy < 3 { 0.25 } else { 0.0 };
    let element = PhaseMap::new(lattice, radius_um, |ix, iy| {
        let [x, y] = [ix, iy].map(|i| lattice.coordinate_um(i));
        let r2 = x * x + y * y;
        let lens = -((r2 + focus_um * focus_um).sqrt() - focus_um) / um;
        (r2 <= radius_um * radius_um).then(|| lens + pattern(ix % PERIOD, iy % PERIOD))
    });
    let passed = power_um2(&element);
    let wave = PlaneWave::normal(um);
    let mut together = 0.0;
    for order in [[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [-1, 1]] {
        let sines = order.map(|m| f64::from(m) * um / (PERIOD as f64 * lattice.pitch_um()));
        let cosine = (1.0 - sines[0] * sines[0] - sines[1] * sines[1]).sqrt();
        // As far as half-way to the neighbours, in steps below lambda / (2 NA).
        let window = Window::about(sines.map(|s| focus_um * s / cosine), 1.25, 32, focus_um);
        let fold = FoldedPropagator::plan(lattice, radius_um, um, window, Accuracy::Accurate).unwrap();
        let direct = Direct::plan(lattice, um, window).unwrap();
        let [by_fold, by_sums] = [&fold as &dyn Propagator, &direct].map(|way| {
            let field = way.field(&element, &wave, &mut Scratch::default()).unwrap();
            // Flux through the plane of what arrives at an angle.
            Psf::of(&field).energy_um2() * cosine / passed
        });
        let theory = coefficient(PERIOD, order, pattern).norm_sqr();
        println!("order {order:?}: {by_fold:.4}, direct sums {by_sums:.4}, Fourier {theory:.4}");
        assert!((by_fold - by_sums).abs() < ACCURATE);
        assert!((by_fold - theory).abs() < ORDERS);
        together += theory;
    }
    assert!(together > 0.5, "orders without light show nothing: {together}");
}

/// Power behind an element that passes all light at its sites (um^2).
fn power_um2(element: &dyn Aperture) -> f64 {
    let lattice = element.lattice();
    let mut row = vec![Default::default(); lattice.sites()];
    let sites: f64 = (0..lattice.sites())
        .map(|iy| {
            element.fill_row(iy, &mut row);
            row.iter().map(|t| f64::from(t.norm_sqr())).sum::<f64>()
        })
        .sum();
    sites * lattice.pitch_um().powi(2)
}

/// Fourier coefficient of a period of phases (turns).
fn coefficient(period: usize, order: [i32; 2], turns: impl Fn(usize, usize) -> f64) -> Complex64 {
    let mut sum = Complex64::ZERO;
    for (iy, ix) in (0..period * period).map(|k| (k / period, k % period)) {
        let carrier = (f64::from(order[0]) * ix as f64 + f64::from(order[1]) * iy as f64) / period as f64;
        sum += Complex64::cis(TAU * (turns(ix, iy) - carrier));
    }
    sum / (period * period) as f64
}

/// Place of the largest value of a sampled function, by the parabola through the largest sample and its neighbours.
fn top_of(places: &[f64], value: &dyn Fn(usize) -> f64) -> f64 {
    let k = (1..places.len() - 1)
        .max_by(|a, b| value(*a).total_cmp(&value(*b)))
        .unwrap();
    let [a, b, c] = [k - 1, k, k + 1].map(value);
    places[k] + (places[k + 1] - places[k]) * 0.5 * (a - c) / (a - 2.0 * b + c)
}
