//! The derivatives of a PSF against difference quotients, and its values against the sum over all sites.

use std::f64::consts::TAU;

use metalith_pillars::Lattice;
use metalith_wave::psf::phase_cotangent;
use metalith_wave::{
    Accuracy, Aperture, DifferentiablePsf, Direct, PlaneWave, Propagator, PsfPullback, Scratch, TransmissionMap, Window,
};
use ndarray::Array2;
use num_complex::Complex32;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Agreement of derivatives with difference quotients, over the size of the derivative.
const QUOTIENT: f64 = 1e-4;
/// Error of the accurate propagation, over the peak of a lens of the same size that focuses.
const ACCURATE: f64 = 1e-5;
const UM: f64 = 0.55;
/// In the middle of the distances that have one plan.
const DISTANCE_UM: f64 = 30.08;

/// What a PSF is a function of.
#[derive(Clone)]
struct Point {
    turns: Array2<f64>,
    sin: [f64; 2],
    distance_um: f64,
}

struct Case {
    psf: DifferentiablePsf,
    point: Point,
    weights: Array2<f64>,
    random: ChaCha8Rng,
}

impl Case {
    /// A lens of random phases and random weights of its PSF on a window off its axis.
    fn new(lattice: Lattice) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(60);
        let n = lattice.sites();
        let window = Window {
            centre_um: [1.5, -2.0],
            step_um: 0.3,
            samples: 24,
            distance_um: DISTANCE_UM,
        };
        let outermost = lattice.place_um(0, n - 1);
        let psf = DifferentiablePsf::new(lattice, outermost * 2.0_f64.sqrt(), UM, window, Accuracy::Accurate).unwrap();
        Self {
            psf,
            point: Point {
                turns: Array2::from_shape_fn([n; 2], |_| random.random()),
                sin: [0.05, -0.02],
                distance_um: DISTANCE_UM,
            },
            weights: Array2::from_shape_fn([24; 2], |_| random.random()),
            random,
        }
    }

    fn lens(&self, turns: &Array2<f64>) -> TransmissionMap {
        let lattice = self.psf.lattice();
        let at = |((iy, ix), turns): ((usize, usize), &f64)| {
            let passes = if lattice.has(ix, iy) { 1.0 } else { 0.0 };
            Complex32::cis((TAU * turns) as f32) * passes
        };
        let values: Vec<Complex32> = turns.indexed_iter().map(at).collect();
        TransmissionMap::new(lattice, Array2::from_shape_vec(turns.dim(), values).unwrap()).unwrap()
    }

    fn at(&self, point: &Point) -> PsfPullback {
        let lens = self.lens(&point.turns);
        self.psf
            .at(&lens, point.sin, point.distance_um, true, &mut Scratch::default())
            .unwrap()
    }

    fn merit(&self, point: &Point) -> f64 {
        (&self.at(point).psf * &self.weights).sum()
    }

    /// Derivative along a line of points, by the quotient whose error falls with the fourth power of the step.
    fn quotient(&self, step: f64, along: impl Fn(f64) -> Point) -> f64 {
        let difference = |h: f64| (self.merit(&along(h)) - self.merit(&along(-h))) / (2.0 * h);
        (4.0 * difference(step) - difference(2.0 * step)) / 3.0
    }
}

fn assert_near(found: f64, wanted: f64, what: &str) {
    assert!(
        (found - wanted).abs() < QUOTIENT * wanted.abs(),
        "{what}: {found} is not {wanted}"
    );
}

#[test]
fn derivatives_are_difference_quotients() {
    for lattice in [
        Lattice::new(350, 24).unwrap(),
        Lattice::of_kind(metalith_pillars::LatticeKind::Hexagonal, 400, 25).unwrap(),
    ] {
        let mut case = Case::new(lattice);
        let point = case.point.clone();
        let lens = case.lens(&point.turns);
        let pullback = case.at(&point);
        let found = pullback.pull(&lens, &case.weights, &mut Scratch::default()).unwrap();

        // By the phases: along their own gradient, and along a random direction that is not across it.
        let pairs = found.transmission.iter().zip(lens.values());
        let by_phase: Vec<f64> = pairs.map(|(g, t)| phase_cotangent(*g, *t)).collect();
        let by_phase = Array2::from_shape_vec(point.turns.dim(), by_phase).unwrap();
        let norm = by_phase.mapv(|g| g * g).sum().sqrt();
        let gradient = &by_phase / norm;
        let noise = Array2::from_shape_fn(gradient.dim(), |_| case.random.random_range(-0.2..0.2));
        for direction in [gradient.clone(), &gradient + &noise] {
            let quotient = case.quotient(0.02, |h| Point {
                turns: &point.turns + &(&direction * (h / TAU)),
                ..point.clone()
            });
            assert_near((&by_phase * &direction).sum(), quotient, "phase");
        }

        for axis in [0, 1] {
            let quotient = case.quotient(2e-4, |h| {
                let mut moved = point.clone();
                moved.sin[axis] += h;
                moved
            });
            assert_near(found.wedge_sin[axis], quotient, "wedge");
        }

        // Less than the distances of one plan.
        let quotient = case.quotient(0.03, |h| Point {
            distance_um: point.distance_um + h,
            ..point.clone()
        });
        assert_near(found.distance_um.unwrap(), quotient, "distance");
    }
}

#[test]
fn values_are_the_sum_over_all_sites_at_any_distance() {
    let case = Case::new(Lattice::new(350, 24).unwrap());
    let lens = case.lens(&case.point.turns);
    // Within the distances of a plan, and far from them.
    for distance_um in [DISTANCE_UM, 30.1, 25.0, 41.0] {
        let point = Point {
            distance_um,
            ..case.point.clone()
        };
        let [sin_x, sin_y] = point.sin;
        let wave = PlaneWave {
            wavelength_um: UM,
            sin_x,
            sin_y,
        };
        let window = case.psf.window().at_distance(distance_um);
        let direct = Direct::plan(lens.lattice(), UM, window).unwrap();
        let field = direct.field(&lens, &wave, &mut Scratch::default()).unwrap();
        let wanted = field.values.mapv(|e| f64::from(e.norm_sqr()));
        let radius_um = lens.lattice().place_um(0, 23);
        let peak = (std::f64::consts::PI * radius_um.powi(2) / (UM * distance_um)).powi(2);
        let found = case.at(&point).psf;
        let worst = (&found - &wanted).iter().fold(0.0, |worst: f64, d| worst.max(d.abs()));
        assert!(worst < ACCURATE * peak, "{distance_um} um: {worst} of {peak}");
    }
}
