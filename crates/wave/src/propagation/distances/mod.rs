//! Intensity in a window, at several distances and one wavelength.
//!
//! The element is transformed once, zeros around it up to a period; for each distance the frequencies whose
//! rays land near the window are multiplied with the transfer function and transformed back onto samples of
//! about a pixel. A ray is weighed by where it lands, falling smoothly to zero, so that what belongs elsewhere
//! does not come back into the window as an alias. Intensity has twice the band of the field: the step is
//! chosen to hold it.
//!
//! Rows of a hexagonal lattice are no whole number of samples apart: its samples along y are formed by chirps, so that
//! they are as far apart as those along x.

mod propagate;

use std::sync::Arc;

use metalith_fourier::{Fft, forward, inverse};
use metalith_pillars::Lattice;
use num_complex::Complex32;

use super::chirp_transform::Zoom;
use super::transfer::FadedColumn;
use super::{Aperture, Fade};
use crate::kernels::fft_size;

/// Beyond what geometry needs, a period holds this for the fade (um): with it, intensities agree with the
/// direct sum to 2e-4 of the peak; see the tests.
const FADE_ROOM_UM: f64 = 70.0;

/// The fade begins within this share of where it ends, however far the distances are apart.
const LATEST_FADE: f64 = 0.9;

/// Request for intensity at several distances, for one element and one direction of light.
#[derive(Clone, Copy, Debug)]
pub struct Distances {
    /// Lattice of the samples of the element.
    pub lattice: Lattice,
    /// Radius outside of which the element is opaque (um).
    pub radius_um: f64,
    /// Middle of the window from the element's axis (um).
    pub centre_um: [f64; 2],
    /// Half of the window's edge that must be right (um).
    pub half_width_um: f64,
    /// Largest step of the samples (um); the step taken divides the period.
    pub step_um: f64,
}

/// The transforms for [`Distances`], shared by all wavelengths and distances.
pub struct DistancesPlan {
    wanted: Distances,
    /// Places of the lattice's grid in a period along x and along y.
    sites: [usize; 2],
    /// Samples in a period along x.
    samples: usize,
    /// Samples of the window along an axis.
    window: usize,
    /// Along x and along y; that along y is not the shorter.
    period_um: [f64; 2],
    forward: [Arc<dyn Fft<f32>>; 2],
    inverse: Arc<dyn Fft<f32>>,
}

/// Working memory of a [`DistancesPlan`]: one a thread.
#[derive(Default)]
pub struct DistancesScratch {
    row: Vec<Complex32>,
    lines: Vec<Complex32>,
    spectrum: Vec<Complex32>,
    columns: Vec<Complex32>,
    fft: Vec<Complex32>,
    padded: Vec<Complex32>,
    column: FadedColumn,
    /// Transfer function to each distance, `[distance][kx][ky]`.
    transfer: Vec<Complex32>,
    /// Factors from one distance to the next, `[ky]`.
    step: Vec<Complex32>,
}

/// Frequencies that are kept, in whole cycles a period.
#[derive(Clone, Copy)]
struct RetainedFrequencies {
    first: [i64; 2],
    count: [usize; 2],
}

impl DistancesPlan {
    /// Plan for a window; as far as `margin` largest steps more is kept on each side of it.
    pub fn new(wanted: Distances, margin: usize) -> Self {
        // A period of whole steps must not gain one by rounding.
        const ROUNDING: f64 = 1e-9;
        let lattice = wanted.lattice;
        let (steps, reach) = (lattice.steps_um(), lattice.reach());
        let least = 2.0 * (wanted.radius_um + wanted.half_width_um) + FADE_ROOM_UM;
        let period = |axis: usize, least: f64| {
            let least = least.max(steps[axis] * reach[axis].len() as f64);
            let sites = fft_size((least / steps[axis]).ceil() as usize);
            (sites, steps[axis] * sites as f64)
        };
        let (columns, period_x) = period(0, least);
        let (rows, period_y) = period(1, period_x * (1.0 - ROUNDING));
        let samples = fft_size((period_x / wanted.step_um - ROUNDING).ceil() as usize);
        let step = period_x / samples as f64;
        let margin = (margin as f64 * wanted.step_um / step - ROUNDING).ceil() as usize;
        let inner = (2.0 * wanted.half_width_um / step).ceil() as usize + 2 * margin;
        Self {
            wanted,
            sites: [columns, rows],
            samples,
            window: (inner + inner % 2).min(samples),
            period_um: [period_x, period_y],
            forward: [columns, rows].map(forward),
            inverse: inverse(samples),
        }
    }

    /// Samples of the window along an axis; sample `i` is at the middle plus (i - (n - 1) / 2) steps.
    pub fn window(&self) -> usize {
        self.window
    }

    /// Distance of the samples (um).
    pub fn step_um(&self) -> f64 {
        self.period_um[0] / self.samples as f64
    }

    /// |field|^2 behind some elements at each of `distances_um`, for a wavelength (um): the transfer function is
    /// worked out once for all of them. `wave`: what arrives along x and along y, site by site; that of a site is the
    /// product of both. Output, `[element][distance]`: one square of `window` x `window`.
    pub fn intensities(
        &self,
        wavelength_um: f64,
        distances_um: &[f64],
        wave: [&[Complex32]; 2],
        elements: &[&dyn Aperture],
        scratch: &mut DistancesScratch,
        out: &mut [Vec<Vec<f32>>],
    ) {
        let kept = self.kept(wavelength_um, distances_um);
        let along_y = self.along_y(&kept);
        self.transfer(wavelength_um, distances_um, &kept, scratch);
        for (element, out) in elements.iter().zip(out) {
            self.transform(&kept, *element, wave, scratch);
            self.propagate(distances_um.len(), &kept, along_y.as_ref(), scratch);
            for (d, out) in out.iter_mut().enumerate() {
                self.square(&kept, d, scratch, out);
            }
        }
    }

    /// Chirp transform that forms the samples along y where a period holds no whole number of them.
    fn along_y(&self, kept: &RetainedFrequencies) -> Option<Zoom> {
        let cycles = self.step_um() / self.period_um[1];
        let zoom = || Zoom::new(kept.count[1], kept.first[1] as f64, self.window, cycles);
        (!self.wanted.lattice.is_square()).then(zoom)
    }

    /// Frequencies whose rays land within the end of the fade at any of the distances.
    fn kept(&self, wavelength_um: f64, distances_um: &[f64]) -> RetainedFrequencies {
        let end = self.fade_end_um();
        let z = distances_um.iter().copied().fold(f64::MAX, f64::min);
        let mut kept = RetainedFrequencies {
            first: [0; 2],
            count: [0; 2],
        };
        for axis in [0, 1] {
            let [c, o] = [self.wanted.centre_um[axis], self.wanted.centre_um[1 - axis]];
            // The sine along this axis is largest for rays that stay closest to its plane.
            let across = (o.abs() - end).max(0.0);
            let sine = |x: f64| x / (x * x + across * across + z * z).sqrt();
            let period_um = self.period_um[axis];
            let cycles = |x: f64| sine(x) / wavelength_um * period_um;
            let first = cycles(c - end).floor() as i64;
            let last = cycles(c + end).ceil() as i64;
            let samples = (period_um / self.period_um[0] * self.samples as f64) as usize;
            let most = samples.min(self.sites[axis]) as i64;
            let middle = (first + last) / 2;
            let first = first.max(middle - most / 2);
            kept.first[axis] = first;
            kept.count[axis] = ((last - first + 1).min(most)) as usize;
        }
        kept
    }

    /// Distance from the window's middle to the outermost rays that it needs (um).
    fn reach_um(&self) -> f64 {
        self.wanted.radius_um + self.wanted.half_width_um
    }

    /// Distance from the window's middle to the nearest rays that would come back into it as aliases (um).
    fn fade_end_um(&self) -> f64 {
        self.period_um[0] - self.reach_um()
    }

    /// Distances differ by little, and one fade serves all: it begins where the least of them needs it to.
    fn fade(&self, middle_um: f64, least_um: f64) -> Fade {
        let [cx, cy] = self.wanted.centre_um;
        let (reach, end) = (self.reach_um(), self.fade_end_um());
        Fade {
            period_um: self.period_um,
            full_um: (reach + (middle_um / least_um - 1.0) * (reach + cx.hypot(cy))).min(LATEST_FADE * end),
            zero_um: end,
            relabelled: 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::cis;
    use crate::propagation::{Direct, PhaseFunction, PlaneWave};
    use metalith_pillars::LatticeKind;

    /// Share of the peak intensity by which samples may differ from the direct sum: what the fade lets
    /// through, in single precision.
    const OF_THE_PEAK: f64 = 1e-3;

    #[test]
    fn intensity_is_that_of_the_direct_sum() {
        for lattice in [
            Lattice::new(350, 116).unwrap(),
            // Rows are 303 and 606 nm apart, which divide no step of samples.
            Lattice::of_kind_covering(LatticeKind::Hexagonal, 40_600, 350).unwrap(),
            Lattice::of_kind_covering(LatticeKind::Hexagonal, 40_600, 700).unwrap(),
        ] {
            let worst = worst_of_the_peak(lattice);
            println!("{lattice:?}: {worst:.1e} of the peak");
            assert!(worst < OF_THE_PEAK, "{lattice:?}: {worst}");
        }
    }

    /// Largest difference to the direct sum, of the peak.
    fn worst_of_the_peak(lattice: Lattice) -> f64 {
        let (um, focal) = (0.53, 60.0);
        let lens = PhaseFunction {
            lattice,
            radius_um: 20.0,
            amplitude: 1.1,
            phase_rad: |x: f64, y: f64| {
                let k = std::f64::consts::TAU / 0.53;
                -k * ((x * x + y * y + focal * focal).sqrt() - focal) + k * 0.26 * x
            },
        };
        // Light that the wedge brings 6 um off the axis.
        let wave = PlaneWave {
            wavelength_um: um,
            sin_x: -0.16,
            sin_y: 0.02,
        };
        let wanted = Distances {
            lattice,
            radius_um: 20.0,
            centre_um: [6.0, 1.0],
            half_width_um: 8.0,
            step_um: 0.5,
        };
        let planned = DistancesPlan::new(wanted, 4);
        let distances = [56.0, 60.0];
        let mut out = vec![vec![Vec::new(); 2]];
        let places = |axis: usize| (0..lattice.sites()).map(move |i| lattice.place_um(axis, i));
        let along_x: Vec<Complex32> = places(0).map(|x| cis(wave.turns(x, 0.0))).collect();
        let along_y: Vec<Complex32> = places(1).map(|y| cis(wave.turns(0.0, y))).collect();
        let scratch = &mut DistancesScratch::default();
        planned.intensities(um, &distances, [&along_x, &along_y], &[&lens], scratch, &mut out);
        let n = planned.window();
        let at = |i: usize| (i as f64 - 0.5 * (n as f64 - 1.0)) * planned.step_um();
        let mut worst = 0.0f64;
        for (plane, z) in out[0].iter().zip(distances) {
            let peak = f64::from(plane.iter().copied().fold(0.0, f32::max));
            let places: Vec<usize> = (0..40).map(|k| (k * 7919) % (n * n)).collect();
            let points: Vec<[f64; 3]> = places.iter().map(|&i| [6.0 + at(i % n), 1.0 + at(i / n), z]).collect();
            for (i, field) in places.iter().zip(Direct::at(&lens, &wave, &points)) {
                worst = worst.max((f64::from(plane[*i]) - field.norm_sqr()).abs() / peak);
            }
        }
        worst
    }
}
