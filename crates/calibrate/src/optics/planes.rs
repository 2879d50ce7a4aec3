//! Intensity in a window, at several distances and one wavelength.
//!
//! The element is transformed once, zeros around it up to a period; for each distance the frequencies whose
//! rays land near the window are carried there and transformed back onto samples of about a pixel. A ray is
//! weighed by where it lands, falling smoothly to zero, so that what belongs elsewhere does not come back into
//! the window as an alias. Intensity has twice the band of the field: the step is chosen to hold it.

use std::sync::Arc;

use num_complex::Complex32;
use rustfft::{Fft, FftPlanner};

use super::cis::cis;
use metalith_core::Lattice;

/// Beyond what geometry needs, a period holds this for the fade [um]: with it, fields agree with the
/// direct sum to 1e-4 of the peak; see the tests.
const FADE_ROOM_UM: f64 = 70.0;

/// Where intensity is wanted, for one element and one direction of light.
#[derive(Clone, Copy, Debug)]
pub struct Planes {
    pub lattice: Lattice,
    /// Radius outside of which the element is opaque [um].
    pub radius_um: f64,
    /// Middle of the window from the element's axis [um].
    pub centre_um: [f64; 2],
    /// Half of the window's edge that must be right [um].
    pub half_width_um: f64,
    /// Largest step of the samples [um]; the step taken divides the period.
    pub step_um: f64,
}

/// The transforms for [`Planes`], shared by all wavelengths and distances.
pub struct Planned {
    planes: Planes,
    /// Sites in a period.
    sites: usize,
    /// Samples in a period.
    samples: usize,
    /// Samples of the window along an axis.
    window: usize,
    period_um: f64,
    forward: Arc<dyn Fft<f32>>,
    inverse: Arc<dyn Fft<f32>>,
}

/// Working memory: one a thread.
#[derive(Default)]
pub struct Scratch {
    row: Vec<Complex32>,
    lines: Vec<Complex32>,
    spectrum: Vec<Complex32>,
    columns: Vec<Complex32>,
    fft: Vec<Complex32>,
    fz: Vec<f64>,
    faded: Vec<f32>,
    /// What the way to each distance makes of each frequency.
    way: Vec<Complex32>,
}

/// Fills a row of the lattice with what an element passes; rows are asked for in order.
pub type Passed<'a> = dyn Fn(usize, &mut [Complex32]) + 'a;

/// Frequencies that are kept, in whole cycles a period.
#[derive(Clone, Copy)]
struct Band {
    first: [i64; 2],
    count: [usize; 2],
}

impl Planned {
    /// Plan for a window; `margin` more samples are kept on each side of it.
    pub fn new(planes: Planes, margin: usize) -> Self {
        let pitch = planes.lattice.pitch_um();
        let aperture_um = pitch * planes.lattice.sites() as f64;
        let least = (2.0 * (planes.radius_um + planes.half_width_um) + FADE_ROOM_UM).max(aperture_um);
        let sites = smooth((least / pitch).ceil() as usize);
        let period_um = pitch * sites as f64;
        let samples = smooth((period_um / planes.step_um - 1e-9).ceil() as usize);
        let step = period_um / samples as f64;
        let inner = (2.0 * planes.half_width_um / step).ceil() as usize + 2 * margin;
        let mut planner = FftPlanner::new();
        Self {
            planes,
            sites,
            samples,
            window: (inner + inner % 2).min(samples),
            period_um,
            forward: planner.plan_fft_forward(sites),
            inverse: planner.plan_fft_inverse(samples),
        }
    }

    /// Samples of the window along an axis; sample `i` is at the middle plus (i - (n - 1) / 2) steps.
    pub fn window(&self) -> usize {
        self.window
    }

    /// Distance of the samples [um].
    pub fn step_um(&self) -> f64 {
        self.period_um / self.samples as f64
    }

    /// |field|^2 behind some elements at each of `distances_um`, for a wavelength [um]: the way of the light is
    /// worked out once for all of them. Output, `[element][distance]`: one square of `window` x `window`.
    pub fn intensities(
        &self,
        wavelength_um: f64,
        distances_um: &[f64],
        elements: &[&Passed<'_>],
        scratch: &mut Scratch,
        out: &mut [Vec<Vec<f32>>],
    ) {
        let band = self.band(wavelength_um, distances_um);
        self.pave(wavelength_um, distances_um, &band, scratch);
        for (passed, out) in elements.iter().zip(out) {
            self.transform(&band, passed, scratch);
            self.carry(distances_um.len(), &band, scratch);
            for (d, out) in out.iter_mut().enumerate() {
                self.gather(&band, d, scratch, out);
            }
        }
    }

    /// Frequencies whose rays land within the end of the fade at any of the distances.
    fn band(&self, wavelength_um: f64, distances_um: &[f64]) -> Band {
        let (_, end) = self.fade_um();
        let z = distances_um.iter().copied().fold(f64::MAX, f64::min);
        let mut band = Band {
            first: [0; 2],
            count: [0; 2],
        };
        for axis in [0, 1] {
            let [c, o] = [self.planes.centre_um[axis], self.planes.centre_um[1 - axis]];
            // The sine along this axis is largest for rays that stay closest to its plane.
            let across = (o.abs() - end).max(0.0);
            let sine = |x: f64| x / (x * x + across * across + z * z).sqrt();
            let cycles = |x: f64| sine(x) / wavelength_um * self.period_um;
            let first = cycles(c - end).floor() as i64;
            let last = cycles(c + end).ceil() as i64;
            let most = self.samples.min(self.sites) as i64;
            let middle = (first + last) / 2;
            let first = first.max(middle - most / 2);
            band.first[axis] = first;
            band.count[axis] = ((last - first + 1).min(most)) as usize;
        }
        band
    }

    /// Where the fade begins and ends, from the window's middle [um].
    fn fade_um(&self) -> (f64, f64) {
        let reach = self.planes.radius_um + self.planes.half_width_um;
        (reach, self.period_um - reach)
    }

    /// Forward transform of the element, cut to the band: `spectrum[ky][kx]`.
    fn transform(&self, band: &Band, passed: &Passed<'_>, scratch: &mut Scratch) {
        let (n, m) = (self.planes.lattice.sites(), self.sites);
        let [kx, ky] = band.count;
        scratch.row.resize(m, Complex32::ZERO);
        // Rows first; only the band of each is kept, as columns of length m with zeros behind the element.
        scratch.lines.resize(n * kx, Complex32::ZERO);
        for iy in 0..n {
            scratch.row.fill(Complex32::ZERO);
            passed(iy, &mut scratch.row[..n]);
            run(&*self.forward, &mut scratch.row, &mut scratch.fft);
            let line = &mut scratch.lines[iy * kx..(iy + 1) * kx];
            let start = band.first[0].rem_euclid(m as i64) as usize;
            let head = kx.min(m - start);
            line[..head].copy_from_slice(&scratch.row[start..start + head]);
            line[head..].copy_from_slice(&scratch.row[..kx - head]);
        }
        scratch.spectrum.resize(kx * ky, Complex32::ZERO);
        scratch.columns.resize(LANES * m, Complex32::ZERO);
        let start = band.first[1].rem_euclid(m as i64) as usize;
        let head = ky.min(m - start);
        for from in (0..kx).step_by(LANES) {
            let lanes = LANES.min(kx - from);
            scratch.columns[..lanes * m].fill(Complex32::ZERO);
            for (iy, line) in scratch.lines.chunks_exact(kx).enumerate().take(n) {
                for (lane, value) in line[from..from + lanes].iter().enumerate() {
                    scratch.columns[lane * m + iy] = *value;
                }
            }
            run(&*self.forward, &mut scratch.columns[..lanes * m], &mut scratch.fft);
            for lane in 0..lanes {
                let column = &scratch.columns[lane * m..(lane + 1) * m];
                let target = &mut scratch.spectrum[(from + lane) * ky..(from + lane + 1) * ky];
                target[..head].copy_from_slice(&column[start..start + head]);
                target[head..].copy_from_slice(&column[..ky - head]);
            }
        }
    }

    /// What the way to each distance makes of each frequency of the band: `way[distance][kx][ky]`.
    fn pave(&self, wavelength_um: f64, distances_um: &[f64], band: &Band, scratch: &mut Scratch) {
        let [kx, ky] = band.count;
        let df = 1.0 / self.period_um;
        let [cx, cy] = self.planes.centre_um;
        let x0 = self.planes.lattice.coordinate_um(0);
        let (reach, end) = self.fade_um();
        // Distances differ by little, and one fade serves all: it begins where the least of them needs it to.
        let least = distances_um.iter().copied().fold(f64::MAX, f64::min);
        let middle = distances_um.iter().sum::<f64>() / distances_um.len() as f64;
        let full = (reach + (middle / least - 1.0) * (reach + cx.hypot(cy))).min(0.9 * end);
        let slope = 1.0 / (end - full);
        let weight = (self.planes.lattice.pitch_um() * df).powi(2) as f32;
        // The window's first sample; its middle lies between two.
        let edge = -0.5 * (self.window as f64 - 1.0) * self.step_um();
        let (along_x, along_y) = (cx + edge - x0, cy + edge - x0);
        let Scratch { fz, faded, way, .. } = scratch;
        fz.resize(ky, 0.0);
        faded.resize(ky, 0.0);
        way.resize(distances_um.len() * kx * ky, Complex32::ZERO);
        let arch = pulp::Arch::new();
        for k in 0..kx {
            let fx = (band.first[0] + k as i64) as f64 * df;
            let rest = wavelength_um.powi(-2) - fx * fx;
            arch.dispatch(|| {
                for (i, (fz, faded)) in fz.iter_mut().zip(faded.iter_mut()).enumerate() {
                    let fy = (band.first[1] + i as i64) as f64 * df;
                    *fz = (rest - fy * fy).max(1e-12).sqrt();
                    let reach = middle / *fz;
                    let (sx, sy) = (reach * fx - cx, reach * fy - cy);
                    let s = ((sx * sx + sy * sy).sqrt() - full) * slope;
                    *faded = fade(s) * weight;
                }
            });
            for (d, &z) in distances_um.iter().enumerate() {
                let way = &mut way[(d * kx + k) * ky..][..ky];
                arch.dispatch(|| {
                    for (i, (way, (fz, faded))) in way.iter_mut().zip(fz.iter().zip(faded.iter())).enumerate() {
                        let fy = (band.first[1] + i as i64) as f64 * df;
                        *way = cis(z * fz + fx * along_x + fy * along_y) * *faded;
                    }
                });
            }
        }
    }

    /// Send the spectrum on its way and transform its columns back: `lines[distance][row][kx]`.
    fn carry(&self, distances: usize, band: &Band, scratch: &mut Scratch) {
        let [kx, ky] = band.count;
        let (samples, window) = (self.samples, self.window);
        let start = band.first[1].rem_euclid(samples as i64) as usize;
        let head = ky.min(samples - start);
        let Scratch {
            lines,
            spectrum,
            columns,
            fft,
            way,
            ..
        } = scratch;
        lines.resize(distances * window * kx, Complex32::ZERO);
        columns.resize(LANES * samples, Complex32::ZERO);
        for d in 0..distances {
            let lines = &mut lines[d * window * kx..][..window * kx];
            for from in (0..kx).step_by(LANES) {
                let lanes = LANES.min(kx - from);
                for lane in 0..lanes {
                    let source = &spectrum[(from + lane) * ky..][..ky];
                    let way = &way[(d * kx + from + lane) * ky..][..ky];
                    let column = &mut columns[lane * samples..][..samples];
                    column.fill(Complex32::ZERO);
                    product(&mut column[start..start + head], &source[..head], &way[..head]);
                    product(&mut column[..ky - head], &source[head..], &way[head..]);
                }
                run(&*self.inverse, &mut columns[..lanes * samples], fft);
                for (iy, line) in lines.chunks_exact_mut(kx).enumerate() {
                    for (lane, to) in line[from..from + lanes].iter_mut().enumerate() {
                        *to = columns[lane * samples + iy];
                    }
                }
            }
        }
    }

    /// Transform the rows of one distance back and square them.
    fn gather(&self, band: &Band, distance: usize, scratch: &mut Scratch, out: &mut Vec<f32>) {
        let kx = band.count[0];
        let (samples, window) = (self.samples, self.window);
        out.resize(window * window, 0.0);
        scratch.row.resize(samples.max(self.sites), Complex32::ZERO);
        let start = band.first[0].rem_euclid(samples as i64) as usize;
        let head = kx.min(samples - start);
        let lines = &scratch.lines[distance * window * kx..][..window * kx];
        for (line, out) in lines.chunks_exact(kx).zip(out.chunks_exact_mut(window)) {
            let row = &mut scratch.row[..samples];
            row.fill(Complex32::ZERO);
            row[start..start + head].copy_from_slice(&line[..head]);
            row[..kx - head].copy_from_slice(&line[head..]);
            run(&*self.inverse, row, &mut scratch.fft);
            for (to, field) in out.iter_mut().zip(row.iter()) {
                *to = field.norm_sqr();
            }
        }
    }
}

/// From one at s <= 0 to zero at s >= 1, three times smooth.
#[inline(always)]
fn fade(s: f64) -> f32 {
    let s = s.clamp(0.0, 1.0) as f32;
    let s4 = s * s * s * s;
    1.0 - s4 * (35.0 + s * (-84.0 + s * (70.0 - 20.0 * s)))
}

fn product(to: &mut [Complex32], a: &[Complex32], b: &[Complex32]) {
    pulp::Arch::new().dispatch(|| {
        for (to, (a, b)) in to.iter_mut().zip(a.iter().zip(b)) {
            *to = Complex32::new(a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re);
        }
    });
}

/// Columns that go through one call of a transform: enough to fill cache lines.
const LANES: usize = 8;

fn run(fft: &dyn Fft<f32>, buffer: &mut [Complex32], scratch: &mut Vec<Complex32>) {
    let need = fft.get_inplace_scratch_len();
    if scratch.len() < need {
        scratch.resize(need, Complex32::ZERO);
    }
    fft.process_with_scratch(buffer, &mut scratch[..need]);
}

/// The smallest number not below `n` without prime factors above seven.
pub fn smooth(n: usize) -> usize {
    (n.max(8)..)
        .find(|&m| {
            let mut rest = m;
            for p in [2, 3, 5, 7] {
                while rest % p == 0 {
                    rest /= p;
                }
            }
            rest == 1 && m % 2 == 0
        })
        .expect("powers of two are smooth")
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_wave::{Aperture, Direct, PhaseFunction, PlaneWave};

    /// Share of the peak intensity by which samples may differ from the direct sum: what the fade lets
    /// through, in single precision.
    const OF_THE_PEAK: f64 = 1e-3;

    #[test]
    fn intensity_is_that_of_the_direct_sum() {
        let lattice = Lattice::new(350, 116).unwrap();
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
        let planes = Planes {
            lattice,
            radius_um: 20.0,
            centre_um: [6.0, 1.0],
            half_width_um: 8.0,
            step_um: 0.5,
        };
        let planned = Planned::new(planes, 4);
        let distances = [56.0, 60.0];
        let mut out = vec![vec![Vec::new(); 2]];
        let fill = |iy: usize, row: &mut [Complex32]| {
            lens.fill_row(iy, row);
            for (ix, t) in row.iter_mut().enumerate() {
                *t *= cis(wave.turns(lattice.coordinate_um(ix), lattice.coordinate_um(iy)));
            }
        };
        planned.intensities(um, &distances, &[&fill], &mut Scratch::default(), &mut out);
        let n = planned.window();
        let at = |i: usize| (i as f64 - 0.5 * (n as f64 - 1.0)) * planned.step_um();
        for (plane, z) in out[0].iter().zip(distances) {
            let peak = f64::from(plane.iter().copied().fold(0.0, f32::max));
            let places: Vec<usize> = (0..40).map(|k| (k * 7919) % (n * n)).collect();
            let points: Vec<[f64; 3]> = places.iter().map(|&i| [6.0 + at(i % n), 1.0 + at(i / n), z]).collect();
            for (i, field) in places.iter().zip(Direct::at(&lens, &wave, &points)) {
                let miss = f64::from(plane[*i]) - field.norm_sqr();
                assert!(
                    miss.abs() < OF_THE_PEAK * peak,
                    "{} is not {}, peak {peak}",
                    plane[*i],
                    field.norm_sqr()
                );
            }
        }
    }
}
