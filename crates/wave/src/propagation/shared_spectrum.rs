//! Fields behind one aperture in light from many directions, from one spectrum of it.
//!
//! A plane wave shifts the spectrum of an aperture. The frequencies of each direction are a whole number of steps of the
//! spectrum away from its shifted origin, so that all directions use the same samples of it and none is interpolated.
//! A period is a whole number of samples of the window: one transform an axis forms the window, where a period of whole
//! places of the lattice needs the two of a chirp. The chirps are those from the lattice to the spectrum, once for all
//! directions.

use std::ops::Range;
use std::sync::Arc;

use metalith_fourier::{Fft, inverse};
use metalith_pillars::Lattice;
use ndarray::Array2;
use num_complex::Complex32;
use rayon::prelude::*;

use super::band::{FadeSizes, RetainedBins, rim_sines};
use super::chirp_transform::Zoom;
use super::propagator::check_wave;
use super::transfer::{FrequencyColumn, Transfer};
use super::{Accuracy, Aperture, Fade, Field, LANES, PlaneWave, Scratch, Window};
use crate::error::{Result, WaveError};
use crate::kernels::{cis, cis_all, fft_size, multiply_by, multiply_to, process, scatter};

/// Places along the rim of a disc of rays that tell which bins it needs, and bins beyond: between two places the rim of a
/// disc of 10,000 bins is flat to 0.8 of one.
const RIM_PLACES: usize = 256;
const RIM_BINS: i64 = 2;

/// A wave that arrives at an aperture, and the window in which its field is wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction {
    /// Wave at the aperture.
    pub wave: PlaneWave,
    /// Window behind it.
    pub window: Window,
}

/// A plan for one lattice and wavelength, and for directions whose windows have one size; made once, used for any number of
/// apertures.
pub struct SharedSpectrumPlan {
    lattice: Lattice,
    radius_um: f64,
    wavelength_um: f64,
    accuracy: Accuracy,
    /// Samples an axis of a window, and of a period.
    samples: usize,
    period: usize,
    period_um: f64,
    /// Bins that the directions need: the first of each axis, and their number.
    first: [i64; 2],
    count: [usize; 2],
    inverse: Arc<dyn Fft<f32>>,
}

/// Spectrum of an aperture without the wave that arrives.
pub struct ApertureSpectrum {
    /// Bins of the plan, column by column.
    values: Vec<Complex32>,
}

impl SharedSpectrumPlan {
    /// Plan for apertures on `lattice` that pass nothing outside `radius_um` of their centre. Fade and shortest period are
    /// those of a [`FoldedPropagator`](super::FoldedPropagator).
    ///
    /// # Errors
    /// If there is no direction, a window is none or has another size than the others, or a wave is of another wavelength.
    pub fn new(
        lattice: Lattice,
        radius_um: f64,
        wavelength_um: f64,
        accuracy: Accuracy,
        directions: &[Direction],
    ) -> Result<Self> {
        let Some(Direction { window: model, .. }) = directions.first() else {
            return Err(WaveError::Count {
                what: "directions",
                given: 0,
                needed: 1,
            });
        };
        let sizes = |window: &Window| FadeSizes::new(radius_um, wavelength_um, window, accuracy);
        let mut least_um = 0.0f64;
        for Direction { wave, window } in directions {
            window.check(wavelength_um)?;
            check_wave(wave, wavelength_um)?;
            if (window.samples, window.step_um) != (model.samples, model.step_um) {
                return Err(WaveError::Window {
                    wavelength_um,
                    window: *window,
                });
            }
            least_um = least_um.max(sizes(window).period_um);
        }
        let period = fft_size(model.samples.max((least_um / model.step_um).ceil() as usize));
        let period_um = period as f64 * model.step_um;
        let (mut first, mut end) = ([i64::MAX; 2], [i64::MIN; 2]);
        for Direction { wave, window } in directions {
            let [_, zero_um] = sizes(window).ends_um(period_um);
            for place in 0..RIM_PLACES {
                let rim = rim_sines(window, zero_um, place as f64 / RIM_PLACES as f64);
                for (axis, sine) in [wave.sin_x, wave.sin_y].into_iter().enumerate() {
                    let bin = ((rim[axis] - sine) * period_um / wavelength_um).floor() as i64;
                    first[axis] = first[axis].min(bin - RIM_BINS);
                    end[axis] = end[axis].max(bin + 2 + RIM_BINS);
                }
            }
        }
        Ok(Self {
            lattice,
            radius_um,
            wavelength_um,
            accuracy,
            samples: model.samples,
            period,
            period_um,
            first,
            count: [0, 1].map(|a| (end[a] - first[a]) as usize),
            inverse: inverse(period),
        })
    }

    /// Spectrum of an aperture in the bins of all directions, on all threads.
    ///
    /// # Errors
    /// If the aperture's lattice is not the planned one.
    pub fn spectrum(&self, aperture: &dyn Aperture) -> Result<ApertureSpectrum> {
        if aperture.lattice() != self.lattice {
            return Err(WaveError::Lattice {
                given: aperture.lattice(),
                planned: self.lattice,
            });
        }
        let [kx, ky] = self.count;
        let [_, rows] = self.lattice.reach();
        let columns = 0..self.lattice.sites();
        let [along_x, along_y] = [(0, &columns), (1, &rows)].map(|(axis, places)| {
            let step_um = self.lattice.steps_um()[axis];
            let first = self.lattice.place_um(axis, places.start) / step_um;
            let cycles = -step_um / self.period_um;
            Zoom::new(places.len(), first, self.count[axis], cycles)
        });
        let [carrier_x, carrier_y] = [(0, columns), (1, rows.clone())].map(|(axis, places)| self.carrier(axis, places));
        let mut lines = vec![Complex32::ZERO; rows.len() * kx];
        lines
            .par_chunks_exact_mut(kx)
            .zip(rows.clone())
            .for_each_init(Scratch::default, |scratch, (line, iy)| {
                let Scratch { row, padded, fft, .. } = scratch;
                row.resize(carrier_x.len(), Complex32::ZERO);
                aperture.fill_row(iy, row);
                multiply_by(row, &carrier_x, carrier_y[iy - rows.start]);
                along_x.run(row, line, padded, fft);
            });
        let mut values = vec![Complex32::ZERO; kx * ky];
        values
            .par_chunks_mut(LANES * ky)
            .enumerate()
            .for_each_init(Scratch::default, |scratch, (block, columns)| {
                let Scratch {
                    columns: lanes,
                    padded,
                    fft,
                    ..
                } = scratch;
                let (from, wide) = (block * LANES, columns.len() / ky);
                lanes.resize(LANES * rows.len(), Complex32::ZERO);
                for (iy, line) in lines.chunks_exact(kx).enumerate() {
                    for (lane, value) in line[from..from + wide].iter().enumerate() {
                        lanes[lane * rows.len() + iy] = *value;
                    }
                }
                for (lane, column) in lanes.chunks_exact(rows.len()).zip(columns.chunks_exact_mut(ky)) {
                    along_y.run(lane, column, padded, fft);
                }
            });
        Ok(ApertureSpectrum { values })
    }

    /// Factors that move the middle of the bins of an axis to where a chirp has it.
    fn carrier(&self, axis: usize, places: Range<usize>) -> Vec<Complex32> {
        let middle = self.first[axis] as f64 + 0.5 * (self.count[axis] as f64 - 1.0);
        let turns = |i: usize| -middle * self.lattice.place_um(axis, i) / self.period_um;
        places.map(|i| cis(turns(i))).collect()
    }

    /// Field in the window of one of the planned directions behind the aperture of a spectrum.
    ///
    /// # Errors
    /// If the window is not of the planned size, or the wave of another wavelength.
    pub fn field(&self, spectrum: &ApertureSpectrum, direction: &Direction, scratch: &mut Scratch) -> Result<Field> {
        let Direction { wave, window } = direction;
        check_wave(wave, self.wavelength_um)?;
        let (samples, period, period_um) = (self.samples, self.period, [self.period_um; 2]);
        if (window.samples, window.step_um * period as f64) != (samples, self.period_um) {
            return Err(WaveError::Window {
                wavelength_um: self.wavelength_um,
                window: *window,
            });
        }
        let [full_um, zero_um] =
            FadeSizes::new(self.radius_um, self.wavelength_um, window, self.accuracy).ends_um(self.period_um);
        let fade = Fade {
            period_um,
            full_um,
            zero_um,
            relabelled: 0,
        };
        // Shift of the spectrum by the wave: whole bins, and the rest.
        let shift = [wave.sin_x, wave.sin_y].map(|sine| sine / self.wavelength_um * self.period_um);
        let whole = shift.map(|bins| bins.round() as i64);
        let offset = [0, 1].map(|a| shift[a] - whole[a] as f64);
        let bins = RetainedBins::within(window, zero_um, self.wavelength_um, period_um, offset);
        let transfer = Transfer {
            wavelength_um: self.wavelength_um,
            centre_um: window.centre_um,
            shift_um: [0, 1].map(|a| window.coordinate_um(a, 0)),
            fade: &fade,
            cell_um: self.lattice.cell_um(),
        };
        let place = |axis: usize| bins.first[axis] - whole[axis] - self.first[axis];
        let kx = bins.count[0];
        let Scratch {
            columns,
            middle,
            fft,
            transfer: factors,
            column: faded,
            sent,
            turns,
            wave: [along_x, along_y],
            ..
        } = scratch;
        columns.resize(LANES * period, Complex32::ZERO);
        middle.resize(samples * kx, Complex32::ZERO);
        for from in (0..kx).step_by(LANES) {
            let lanes = LANES.min(kx - from);
            let block = &mut columns[..lanes * period];
            block.fill(Complex32::ZERO);
            for (k, column) in (from..).zip(block.chunks_exact_mut(period)) {
                let Some((known, rows)) = self.column(spectrum, place(0) + k as i64, place(1), &bins.rows[k]) else {
                    continue;
                };
                let first = bins.first[1] + rows.start as i64;
                let frequencies = FrequencyColumn {
                    first: [(bins.first[0] + k as i64) as f64 + offset[0], first as f64 + offset[1]],
                    count: rows.len(),
                };
                factors.resize(rows.len(), Complex32::ZERO);
                sent.resize(rows.len(), Complex32::ZERO);
                transfer.fade(window.distance_um, frequencies, faded);
                transfer.to_distance(window.distance_um, frequencies, faded, factors);
                multiply_to(sent, known, factors);
                scatter(column, sent, first);
            }
            process(&*self.inverse, block, fft);
            for (iy, line) in middle.chunks_exact_mut(kx).enumerate() {
                for (lane, value) in line[from..from + lanes].iter_mut().enumerate() {
                    *value = block[lane * period + iy];
                }
            }
        }
        // What is left of the shift turns from sample to sample.
        for (along, offset) in [(&mut *along_x, offset[0]), (&mut *along_y, offset[1])] {
            turns.clear();
            turns.extend((0..samples).map(|m| offset * m as f64 / period as f64));
            along.resize(samples, Complex32::ZERO);
            cis_all(turns, along);
        }
        let mut values = Array2::zeros([samples; 2]);
        let line = &mut columns[..period];
        for (iy, mut out) in values.rows_mut().into_iter().enumerate() {
            line.fill(Complex32::ZERO);
            scatter(line, &middle[iy * kx..][..kx], bins.first[0]);
            process(&*self.inverse, line, fft);
            let out = out.as_slice_mut().expect("rows are contiguous");
            out.copy_from_slice(&line[..samples]);
            multiply_by(out, along_x, along_y[iy]);
        }
        Ok(Field {
            window: *window,
            wave: *wave,
            values,
            fade: Some(fade),
            accuracy: Some(self.accuracy),
        })
    }

    /// Known values of a column of a spectrum in a range of rows that begins at `first`, and the rows that they are of.
    fn column<'s>(
        &self,
        spectrum: &'s ApertureSpectrum,
        column: i64,
        first: i64,
        rows: &Range<usize>,
    ) -> Option<(&'s [Complex32], Range<usize>)> {
        let [kx, ky] = self.count;
        let column = usize::try_from(column).ok().filter(|k| *k < kx)?;
        let within = |row: usize| (first + row as i64).clamp(0, ky as i64) as usize;
        let (start, end) = (within(rows.start), within(rows.end));
        let row = |at: usize| (at as i64 - first) as usize;
        (start < end).then(|| (&spectrum.values[column * ky..][start..end], row(start)..row(end)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::propagation::{FoldedPropagator, PhaseFunction, Propagator};

    const WAVELENGTH_UM: f64 = 0.53;
    const RADIUS_UM: f64 = 60.0;
    const FOCAL_UM: f64 = 300.0;

    fn lens(lattice: Lattice) -> PhaseFunction<impl Fn(f64, f64) -> f64 + Sync> {
        PhaseFunction {
            lattice,
            radius_um: RADIUS_UM,
            amplitude: 1.0,
            phase_rad: move |x: f64, y: f64| {
                let path = (x * x + y * y + FOCAL_UM * FOCAL_UM).sqrt() - FOCAL_UM - 0.25 * x;
                -std::f64::consts::TAU * path / WAVELENGTH_UM
            },
        }
    }

    /// Directions from and beside where a lens looks whose wedge has this sine along x.
    fn directions(samples: usize) -> Vec<Direction> {
        let direction = |(x, y): (f64, f64)| {
            let cosine = (1.0 - x * x - y * y).sqrt();
            Direction {
                wave: PlaneWave {
                    wavelength_um: WAVELENGTH_UM,
                    sin_x: x - 0.25,
                    sin_y: y,
                },
                window: Window {
                    centre_um: [x, y].map(|sine| FOCAL_UM * sine / cosine),
                    step_um: 0.31,
                    samples,
                    distance_um: FOCAL_UM,
                },
            }
        };
        [(0.0, 0.0), (0.11, -0.07), (-0.2, 0.313)].map(direction).to_vec()
    }

    /// Largest error of the fields of all directions as a share of the largest value, against accurate fields of one direction each.
    fn worst(lattice: Lattice, accuracy: Accuracy) -> f32 {
        let (lens, directions) = (lens(lattice), directions(90));
        let plan = SharedSpectrumPlan::new(lattice, RADIUS_UM, WAVELENGTH_UM, accuracy, &directions).unwrap();
        let spectrum = plan.spectrum(&lens).unwrap();
        let mut scratch = Scratch::default();
        let error = |direction: &Direction| {
            let Direction { wave, window } = direction;
            let alone = FoldedPropagator::plan(lattice, RADIUS_UM, WAVELENGTH_UM, *window, Accuracy::Accurate).unwrap();
            let want = alone.field(&lens, wave, &mut Scratch::default()).unwrap().values;
            let got = plan.field(&spectrum, direction, &mut scratch).unwrap().values;
            let peak = want.iter().map(|v| v.norm()).fold(0.0, f32::max);
            let errors = got.iter().zip(&want).map(|(a, b)| (a - b).norm() / peak);
            errors.fold(0.0, f32::max)
        };
        directions.iter().map(error).fold(0.0, f32::max)
    }

    #[test]
    fn fields_of_one_spectrum_are_those_of_each_direction() {
        /// Errors of both ways for lenses of this size: 1e-5 of the matched peak, see the width of the fade.
        const ACCURATE: f32 = 2e-5;
        /// As fast fields promise.
        const FAST: f32 = 1e-3;
        for lattice in [
            Lattice::covering(120_000, 350).unwrap(),
            Lattice::covering(120_000, 290).unwrap(),
        ] {
            let accurate = worst(lattice, Accuracy::Accurate);
            assert!(accurate < ACCURATE, "{accurate}");
            let fast = worst(lattice, Accuracy::Fast);
            assert!(fast < FAST, "{fast}");
        }
    }

    #[test]
    fn windows_of_another_size_are_refused() {
        let lattice = Lattice::covering(120_000, 350).unwrap();
        let mut directions = directions(32);
        let plan = |directions: &[Direction]| {
            SharedSpectrumPlan::new(lattice, RADIUS_UM, WAVELENGTH_UM, Accuracy::Fast, directions).map(|_| ())
        };
        assert!(plan(&directions).is_ok() && plan(&[]).is_err());
        directions[1].window.samples = 34;
        assert!(plan(&directions).is_err());
    }
}
