use std::f64::consts::TAU;

use num_complex::Complex64;

use super::*;
use crate::Rings;
use crate::image::views::window_offset_um;
use crate::merit::focus::Lens;
use metalith_pillars::{Lattice, LatticeKind};

const WINDOW: PixelWindow = PixelWindow {
    pixels: 24,
    pixel_um: 2.5,
};

impl Imaging<'_> {
    /// Intensity at each sample, `[x][y]` with y from 0 to half the size, x from the middle of the window on
    /// and around its end. Their sum over all y is the share of the incident power.
    fn intensity(&mut self, t_re: &[f32], t_im: &[f32]) -> Vec<f32> {
        self.propagate(t_re, t_im);
        let (n, half) = (self.pupil.size, self.pupil.size / 2 + 1);
        (0..n * half)
            .map(|at| self.buffers.field[at].norm_sqr() * self.weight_x(at / half) * self.pupil.weight[at % half])
            .collect()
    }
}

fn lens() -> Lens {
    lens_on(LatticeKind::Square)
}

fn lens_on(kind: LatticeKind) -> Lens {
    let lattice = Lattice::of_kind_covering(kind, 100_000, 350).unwrap();
    let rings = Rings::new(lattice, 100_000).unwrap();
    Lens {
        rings,
        distance_um: 240.0,
    }
}

fn phases(lens: &Lens) -> Vec<f64> {
    let path = |k: usize| lens.rings.middle_um(k).hypot(240.0) - 240.0;
    (0..lens.rings.len()).map(|k| -TAU / 0.55 * path(k)).collect()
}

fn planes(phases: &[f64]) -> (Vec<f32>, Vec<f32>) {
    phases.iter().map(|p| (p.cos() as f32, p.sin() as f32)).unzip()
}

/// Rayleigh-Sommerfeld over all sites, at places x along the plane of incidence.
fn brute_force(lens: &Lens, phases: &[f64], wavelength: f64, angle: f64, places: &[(f64, f64)]) -> Vec<f64> {
    let (lattice, k, z) = (lens.rings.lattice(), TAU / wavelength, lens.distance_um);
    let mut sums = vec![Complex64::ZERO; places.len()];
    for ix in 0..lattice.sites() {
        for iy in 0..lattice.sites() {
            let Some(ring) = lens.rings.ring_at(ix, iy) else {
                continue;
            };
            let (x, y) = (lattice.place_um(0, ix), lattice.place_um(1, iy));
            let incident = phases[ring] + k * x * angle.sin();
            for (sum, place) in sums.iter_mut().zip(places) {
                let r = ((x - place.0).powi(2) + (y - place.1).powi(2) + z * z).sqrt();
                *sum += z / (TAU * r * r) * Complex64::new(1.0 / r, -k) * Complex64::cis(k * r + incident);
            }
        }
    }
    sums.iter().map(|e| (e * lattice.cell_um2()).norm_sqr()).collect()
}

#[test]
fn intensities_are_those_of_all_sites() {
    /// Tolerance as a share of the peak: what the expansion of the path leaves out at 10 um from the chief ray, 30
    /// degrees.
    const TOLERANCE: f64 = 0.02;
    let wavelength = 0.5;
    let cases = [LatticeKind::Square, LatticeKind::Hexagonal].map(|kind| [0.0f64, 15.0, 30.0].map(|deg| (kind, deg)));
    for (kind, angle) in cases.into_iter().flatten() {
        let (lens, angle) = (lens_on(kind), angle.to_radians());
        let phases = phases(&lens);
        let t = planes(&phases);
        let offset = window_offset_um(&lens, angle, WINDOW.side_um());
        let pupil = Pupil::new(&lens, wavelength, angle, WINDOW, offset).unwrap();
        let n = pupil.size;
        let spacing = WINDOW.side_um() / n as f64;
        let found = Imaging::new(&pupil, WINDOW, Scratch::default()).intensity(&t.0, &t.1);
        let samples = [(0, 0), (1, 2), (5, 0), (n - 7, 1), (9, 8), (n - 16, 0)];
        let landing = 240.0 * angle.tan() + offset;
        let places = samples.map(|(x, y)| {
            let x = if x > n / 2 { x as f64 - n as f64 } else { x as f64 };
            (landing + x * spacing, y as f64 * spacing)
        });
        let exact = brute_force(&lens, &phases, wavelength, angle, &places);
        let area = lens.rings.sites() as f64 * lens.rings.lattice().cell_um2();
        let scale = spacing * spacing / area;
        let peak = found.iter().copied().fold(0.0f32, f32::max);
        for (&(x, y), exact) in samples.iter().zip(exact) {
            let quick = found[x * (n / 2 + 1) + y];
            let error = (f64::from(quick) - exact * scale).abs() / f64::from(peak);
            assert!(
                error < TOLERANCE,
                "{angle}, ({x}, {y}): {quick:e} {:e} {error}",
                exact * scale
            );
        }
    }
}

/// No more light arrives than was sent, and with a sharp focus nearly all of it.
#[test]
fn power_is_kept() {
    /// Sums of single precision.
    const SINGLE: f32 = 1e-6;
    /// The window cuts rings of the Airy pattern off, and spreading adds aliases of up to 4e-3 at its edge.
    const ARRIVES: std::ops::Range<f32> = 0.9..1.02;
    let lens = lens();
    let t = planes(&phases(&lens));
    let pupil = Pupil::new(&lens, 0.55, 0.0, WINDOW, 0.0).unwrap();
    let h0 = Imaging::new(&pupil, WINDOW, Scratch::default()).transfer(&t.0, &t.1)[0];
    assert!(h0.im.abs() < SINGLE && ARRIVES.contains(&h0.re), "{h0}");
}

/// The slope of a linear function of the transfer function by every ring, by differences.
#[test]
fn the_adjoint_is_that_of_differences() {
    /// Single precision throughout, over steps of 1e-2.
    const TOLERANCE: f64 = 5e-3;
    let lens = lens();
    let pupil = Pupil::new(&lens, 0.6, 0.3, WINDOW, 1.0).unwrap();
    let mut imaging = Imaging::new(&pupil, WINDOW, Scratch::default());
    let t = planes(&phases(&lens));
    let count = imaging.transfer(&t.0, &t.1).len();
    let slope = (0..count)
        .map(|i| Complex32::new((0.3 * i as f32).cos(), (0.7 * i as f32).sin()))
        .collect::<Vec<_>>();
    let mut g = (vec![0.0; t.0.len()], vec![0.0; t.0.len()]);
    imaging.adjoint(&slope, &mut g.0, &mut g.1);
    let largest = g.0.iter().zip(&g.1).map(|(a, b)| a.hypot(*b)).fold(0.0, f32::max);
    let mut value = |t: &(Vec<f32>, Vec<f32>)| {
        let h = imaging.transfer(&t.0, &t.1);
        2.0 * h.iter().zip(&slope).map(|(h, s)| f64::from((h * s).re)).sum::<f64>()
    };
    for ring in [0, 30, 77, 141] {
        for (direction, expected) in [((1.0, 0.0), g.0[ring]), ((0.0, 1.0), g.1[ring])] {
            let mut at = |h: f32| {
                let mut moved = t.clone();
                moved.0[ring] += h * direction.0;
                moved.1[ring] += h * direction.1;
                value(&moved)
            };
            let h = 0.05;
            let difference = (at(h) - at(-h)) / (2.0 * f64::from(h));
            let error = (difference - 2.0 * f64::from(expected)).abs() / (2.0 * f64::from(largest));
            assert!(error < TOLERANCE, "ring {ring}: {difference} {expected}");
        }
    }
}
