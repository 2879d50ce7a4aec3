//! The transforms: from the lattice to frequencies, and from there to the window at each distance.

use num_complex::Complex32;

use super::{DistancesPlan, DistancesScratch, RetainedFrequencies};
use crate::kernels::{gather, multiply_by, multiply_to, process};
use crate::propagation::chirp_transform::Zoom;
use crate::propagation::transfer::{FrequencyColumn, Transfer};
use crate::propagation::{Aperture, LANES};

/// Steps from one distance to the next that differ by less are equal (um): rounding.
const EQUAL_UM: f64 = 1e-9;

impl DistancesPlan {
    /// The transfer function to each distance at each kept frequency.
    pub(super) fn transfer(
        &self,
        wavelength_um: f64,
        distances_um: &[f64],
        kept: &RetainedFrequencies,
        scratch: &mut DistancesScratch,
    ) {
        let [kx, ky] = kept.count;
        let least = distances_um.iter().copied().fold(f64::MAX, f64::min);
        let middle = distances_um.iter().sum::<f64>() / distances_um.len() as f64;
        let lattice = self.wanted.lattice;
        // The window's first sample; its middle lies between two. Chirps count from the middle.
        let first_sample = -0.5 * (self.window as f64 - 1.0) * self.step_um();
        let origin = [first_sample, if lattice.is_square() { first_sample } else { 0.0 }];
        let first_place = lattice.reach().map(|reach| reach.start);
        let shift =
            |axis: usize| self.wanted.centre_um[axis] + origin[axis] - lattice.place_um(axis, first_place[axis]);
        let transfer = Transfer {
            wavelength_um,
            centre_um: self.wanted.centre_um,
            shift_um: [0, 1].map(shift),
            fade: &self.fade(middle, least),
            cell_um: lattice.cell_um(),
        };
        scratch.transfer.resize(distances_um.len() * kx * ky, Complex32::ZERO);
        scratch.step.resize(ky, Complex32::ZERO);
        let steps: Vec<f64> = distances_um.windows(2).map(|z| z[1] - z[0]).collect();
        for k in 0..kx {
            let column = FrequencyColumn {
                first: [(kept.first[0] + k as i64) as f64, kept.first[1] as f64],
                count: ky,
            };
            transfer.fade(middle, column, &mut scratch.column);
            transfer.to_distance(
                distances_um[0],
                column,
                &scratch.column,
                &mut scratch.transfer[k * ky..][..ky],
            );
            // From one distance to the next; equal steps, as those of a focus series are, are worked out once.
            for (d, step) in steps.iter().enumerate() {
                if d == 0 || (step - steps[d - 1]).abs() > EQUAL_UM {
                    Transfer::step(*step, &scratch.column, &mut scratch.step);
                }
                let (known, next) = scratch.transfer.split_at_mut((d + 1) * kx * ky);
                let known = &known[(d * kx + k) * ky..][..ky];
                multiply_to(&mut next[k * ky..][..ky], known, &scratch.step);
            }
        }
    }

    /// Forward transform of what leaves the element in a wave, cut to the kept frequencies: `spectrum[kx][ky]`.
    pub(super) fn transform(
        &self,
        kept: &RetainedFrequencies,
        element: &dyn Aperture,
        [along_x, along_y]: [&[Complex32]; 2],
        scratch: &mut DistancesScratch,
    ) {
        let (n, [m, _]) = (self.wanted.lattice.sites(), self.sites);
        let [_, rows] = self.wanted.lattice.reach();
        let [kx, ky] = kept.count;
        scratch.row.resize(m.max(scratch.row.len()), Complex32::ZERO);
        // Rows first; only the kept part of each goes on, as columns of a period with zeros behind the element.
        scratch.lines.resize(rows.len() * kx, Complex32::ZERO);
        for (iy, line) in rows.clone().zip(scratch.lines.chunks_exact_mut(kx)) {
            let row = &mut scratch.row[..m];
            row[n..].fill(Complex32::ZERO);
            element.fill_row(iy, &mut row[..n]);
            multiply_by(&mut row[..n], along_x, along_y[iy]);
            process(&*self.forward[0], row, &mut scratch.fft);
            gather(line, row, kept.first[0]);
        }
        let (n, [_, m]) = (rows.len(), self.sites);
        scratch.spectrum.resize(kx * ky, Complex32::ZERO);
        scratch.columns.resize(LANES * m, Complex32::ZERO);
        for from in (0..kx).step_by(LANES) {
            let lanes = LANES.min(kx - from);
            let columns = &mut scratch.columns[..lanes * m];
            columns.chunks_exact_mut(m).for_each(|c| c[n..].fill(Complex32::ZERO));
            for (iy, line) in scratch.lines.chunks_exact(kx).enumerate() {
                for (lane, value) in line[from..from + lanes].iter().enumerate() {
                    columns[lane * m + iy] = *value;
                }
            }
            process(&*self.forward[1], columns, &mut scratch.fft);
            let spectrum = scratch.spectrum[from * ky..].chunks_exact_mut(ky);
            for (column, spectrum) in columns.chunks_exact(m).zip(spectrum) {
                gather(spectrum, column, kept.first[1]);
            }
        }
    }

    /// Multiply the spectrum with the transfer function and transform its columns back, by `along_y` where there is one:
    /// `lines[distance][row][kx]`.
    pub(super) fn propagate(
        &self,
        distances: usize,
        kept: &RetainedFrequencies,
        along_y: Option<&Zoom>,
        scratch: &mut DistancesScratch,
    ) {
        if let Some(zoom) = along_y {
            return self.propagate_by(zoom, distances, kept, scratch);
        }
        let [kx, ky] = kept.count;
        let (samples, window) = (self.samples, self.window);
        let start = kept.first[1].rem_euclid(samples as i64) as usize;
        let head = ky.min(samples - start);
        let DistancesScratch {
            lines,
            spectrum,
            columns,
            fft,
            transfer,
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
                    let transfer = &transfer[(d * kx + from + lane) * ky..][..ky];
                    let column = &mut columns[lane * samples..][..samples];
                    column[ky - head..start].fill(Complex32::ZERO);
                    column[start + head..].fill(Complex32::ZERO);
                    multiply_to(&mut column[start..start + head], &source[..head], &transfer[..head]);
                    multiply_to(&mut column[..ky - head], &source[head..], &transfer[head..]);
                }
                process(&*self.inverse, &mut columns[..lanes * samples], fft);
                for (iy, line) in lines.chunks_exact_mut(kx).enumerate() {
                    for (lane, to) in line[from..from + lanes].iter_mut().enumerate() {
                        *to = columns[lane * samples + iy];
                    }
                }
            }
        }
    }

    /// Variant of the propagation by chirps.
    fn propagate_by(&self, zoom: &Zoom, distances: usize, kept: &RetainedFrequencies, scratch: &mut DistancesScratch) {
        let [kx, ky] = kept.count;
        let DistancesScratch {
            row,
            lines,
            spectrum,
            columns,
            fft,
            padded,
            transfer,
            ..
        } = scratch;
        lines.resize(distances * self.window * kx, Complex32::ZERO);
        columns.resize(ky.max(columns.len()), Complex32::ZERO);
        row.resize(self.window.max(row.len()), Complex32::ZERO);
        let (column, row) = (&mut columns[..ky], &mut row[..self.window]);
        for (lines, transfer) in lines
            .chunks_exact_mut(self.window * kx)
            .zip(transfer.chunks_exact(kx * ky))
        {
            let known = spectrum.chunks_exact(ky).zip(transfer.chunks_exact(ky));
            for (k, (spectrum, transfer)) in known.enumerate() {
                multiply_to(column, spectrum, transfer);
                zoom.run(column, row, padded, fft);
                for (line, value) in lines.chunks_exact_mut(kx).zip(row.iter()) {
                    line[k] = *value;
                }
            }
        }
    }

    /// Transform the rows of one distance back and square them.
    pub(super) fn square(
        &self,
        kept: &RetainedFrequencies,
        distance: usize,
        scratch: &mut DistancesScratch,
        out: &mut Vec<f32>,
    ) {
        let kx = kept.count[0];
        let (samples, window) = (self.samples, self.window);
        out.resize(window * window, 0.0);
        scratch.row.resize(samples.max(scratch.row.len()), Complex32::ZERO);
        let start = kept.first[0].rem_euclid(samples as i64) as usize;
        let head = kx.min(samples - start);
        let lines = &scratch.lines[distance * window * kx..][..window * kx];
        for (line, out) in lines.chunks_exact(kx).zip(out.chunks_exact_mut(window)) {
            let row = &mut scratch.row[..samples];
            row[kx - head..start].fill(Complex32::ZERO);
            row[start + head..].fill(Complex32::ZERO);
            row[start..start + head].copy_from_slice(&line[..head]);
            row[..kx - head].copy_from_slice(&line[head..]);
            process(&*self.inverse, row, &mut scratch.fft);
            for (to, field) in out.iter_mut().zip(row.iter()) {
                *to = field.norm_sqr();
            }
        }
    }
}
