//! The adjoint: from the window to the lattice.

use ndarray::Array2;
use num_complex::Complex32;

use super::planes::Plane;
use super::{FoldedPropagator, LANES};
use crate::kernels::{multiply_conj, multiply_conj_to, process, scatter};
use crate::propagation::{PlaneWave, Scratch};

impl FoldedPropagator {
    /// The adjoint of `window_rows`.
    pub(super) fn window_rows_adjoint(&self, values: &Array2<Complex32>, scratch: &mut Scratch) {
        let (kx, samples) = (self.band.count[0], self.window.samples);
        let Scratch {
            middle,
            fft,
            padded,
            row,
            ..
        } = scratch;
        middle.resize(samples * kx, Complex32::ZERO);
        row.resize(samples.max(row.len()), Complex32::ZERO);
        for (line, given) in middle.chunks_exact_mut(kx).zip(values.rows()) {
            for (a, b) in row.iter_mut().zip(given) {
                *a = *b;
            }
            self.zoom[0].adjoint(&row[..samples], line, padded, fft);
        }
    }

    /// The adjoint of `columns_forward` to one plane.
    pub(super) fn columns_adjoint(&self, plane: &Plane, scratch: &mut Scratch) {
        let (m, residues, samples) = (self.band.bins[1], self.residues(), self.window.samples);
        let [kx, ky] = self.band.count;
        let Scratch {
            tiles,
            columns,
            spectrum,
            middle,
            fft,
            padded,
            transfer,
            column: faded,
            row,
            ..
        } = scratch;
        columns.resize(m.max(columns.len()), Complex32::ZERO);
        spectrum.resize(ky, Complex32::ZERO);
        transfer.resize(ky, Complex32::ZERO);
        row.resize(samples.max(row.len()), Complex32::ZERO);
        tiles.clear();
        tiles.resize(self.blocks() * residues * LANES, Complex32::ZERO);
        let column = &mut columns[..m];
        for k in 0..kx {
            for (value, line) in row.iter_mut().zip(middle.chunks_exact(kx)) {
                *value = line[k];
            }
            self.zoom[1].adjoint(&row[..samples], spectrum, padded, fft);
            let rows = self.band.rows[k].clone();
            let kept = &mut spectrum[rows.clone()];
            let transfer = &mut transfer[..rows.len()];
            self.transfer(plane, k, faded, transfer);
            multiply_conj(kept, transfer);
            column.fill(Complex32::ZERO);
            scatter(column, kept, self.band.first[1] + rows.start as i64);
            process(&*self.inverse[1], column, fft);
            let tile = &mut tiles[k / LANES * residues * LANES..];
            for (line, value) in tile.chunks_exact_mut(LANES).zip(&column[..residues]) {
                line[k % LANES] = *value;
            }
        }
    }

    /// The adjoint of `rows_forward`, into one value a site.
    pub(super) fn rows_adjoint(&self, wave: &PlaneWave, scratch: &mut Scratch, sites: &mut Array2<Complex32>) {
        let (m, residues) = (self.band.bins[0], self.residues());
        self.fill_wave(wave, scratch);
        let Scratch {
            wave: [wave_x, wave_y],
            tiles,
            columns,
            spectrum,
            fft,
            ..
        } = scratch;
        spectrum.resize(self.blocks() * LANES, Complex32::ZERO);
        columns.resize(m.max(columns.len()), Complex32::ZERO);
        let folded = &mut columns[..m];
        for r in 0..residues {
            for (block, lanes) in spectrum.chunks_exact_mut(LANES).enumerate() {
                let at = (block * residues + r) * LANES;
                lanes.copy_from_slice(&tiles[at..at + LANES]);
            }
            folded.fill(Complex32::ZERO);
            scatter(folded, &spectrum[..self.band.count[0]], self.band.first[0]);
            process(&*self.inverse[0], folded, fft);
            for iy in self.rows_of(r) {
                let wy = wave_y[iy].conj();
                let mut line = sites.row_mut(iy);
                let line = line.as_slice_mut().expect("rows are contiguous");
                for (part, wave) in line.chunks_mut(m).zip(wave_x.chunks(m)) {
                    multiply_conj_to(part, &folded[..part.len()], wave, wy);
                }
                if !self.lattice.is_square() {
                    let between = line.iter_mut().enumerate().filter(|(ix, _)| !self.lattice.has(*ix, iy));
                    between.for_each(|(_, site)| *site = Complex32::ZERO);
                }
            }
        }
    }
}
