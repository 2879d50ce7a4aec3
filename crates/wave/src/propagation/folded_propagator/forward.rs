//! Transform from the lattice to the window.

use std::ops::Range;

use ndarray::ArrayViewMut2;
use num_complex::Complex32;

use super::planes::Plane;
use super::{FoldedPropagator, LANES};
use crate::kernels::{accumulate, gather, multiply_to, process, product_sum};
use crate::propagation::{Aperture, PlaneWave, Scratch};

impl FoldedPropagator {
    /// Folds and transforms along x; leaves the kept columns of these blocks in tiles of `LANES` columns by all rows. Gives
    /// the power that the aperture passes of a wave of unit amplitude (um^2).
    pub(super) fn rows_forward(
        &self,
        aperture: &dyn Aperture,
        wave: &PlaneWave,
        blocks: Range<usize>,
        scratch: &mut Scratch,
    ) -> f64 {
        let (n, m, residues) = (self.lattice.sites(), self.band.bins[0], self.residues());
        self.fill_wave(wave, scratch);
        let Scratch {
            row,
            wave: [wave_x, wave_y],
            tiles,
            columns,
            spectrum,
            fft,
            ..
        } = scratch;
        row.resize(n, Complex32::ZERO);
        columns.resize(m.max(columns.len()), Complex32::ZERO);
        let first = blocks.start * LANES;
        let kept = (blocks.end * LANES).min(self.band.count[0]) - first;
        spectrum.clear();
        spectrum.resize(blocks.len() * LANES, Complex32::ZERO);
        let held = blocks.len() * residues * LANES;
        if tiles.capacity() < held {
            // What grows by itself may take twice the memory that was counted with.
            tiles.clear();
            tiles.reserve_exact(held);
        }
        tiles.resize(held, Complex32::ZERO);
        let folded = &mut columns[..m];
        let mut power = 0.0;
        for r in 0..residues {
            folded.fill(Complex32::ZERO);
            for iy in self.rows_of(r) {
                aperture.fill_row(iy, row);
                power += product_sum(row, row).re;
                for (part, wave) in row.chunks(m).zip(wave_x.chunks(m)) {
                    accumulate(&mut folded[..part.len()], part, wave, wave_y[iy]);
                }
            }
            process(&*self.forward[0], folded, fft);
            gather(&mut spectrum[..kept], folded, self.band.first[0] + first as i64);
            for (block, lanes) in spectrum.chunks_exact(LANES).enumerate() {
                let at = (block * residues + r) * LANES;
                tiles[at..at + LANES].copy_from_slice(lanes);
            }
        }
        power * self.lattice.cell_um2()
    }

    /// Transforms these blocks along y, sends each frequency to each plane, shows it to `observe`, and forms the rows of the
    /// planes' windows of each column.
    pub(super) fn columns_forward(
        &self,
        blocks: Range<usize>,
        planes: &[Plane],
        scratch: &mut Scratch,
        observe: &mut dyn FnMut(&[Complex32]),
    ) {
        let (m, residues, samples) = (self.band.bins[1], self.residues(), self.window.samples);
        let [kx, ky] = self.band.count;
        let Scratch {
            tiles,
            columns,
            spectrum,
            sent,
            middle,
            fft,
            padded,
            transfer,
            column: faded,
            row,
            ..
        } = scratch;
        columns.resize(LANES * m, Complex32::ZERO);
        spectrum.resize(ky, Complex32::ZERO);
        sent.resize(ky, Complex32::ZERO);
        transfer.resize(ky, Complex32::ZERO);
        middle.resize(planes.len() * samples * kx, Complex32::ZERO);
        row.resize(samples.max(row.len()), Complex32::ZERO);
        for (block, tile) in blocks.zip(tiles.chunks_exact(residues * LANES)) {
            let lanes = LANES.min(kx - block * LANES);
            for (lane, column) in columns.chunks_exact_mut(m).enumerate() {
                for (value, line) in column.iter_mut().zip(tile.chunks_exact(LANES)) {
                    *value = line[lane];
                }
                column[residues..].fill(Complex32::ZERO);
            }
            for (lane, column) in columns.chunks_exact_mut(m).enumerate().take(lanes) {
                let k = block * LANES + lane;
                let rows = self.band.rows[k].clone();
                process(&*self.forward[1], column, fft);
                let kept = &mut spectrum[rows.clone()];
                gather(kept, column, self.band.first[1] + rows.start as i64);
                let transfer = &mut transfer[..rows.len()];
                sent.fill(Complex32::ZERO);
                for (plane, middle) in planes.iter().zip(middle.chunks_exact_mut(samples * kx)) {
                    self.transfer(plane, k, faded, transfer);
                    multiply_to(&mut sent[rows.clone()], kept, transfer);
                    observe(sent);
                    self.zoom[1].run(sent, &mut row[..samples], padded, fft);
                    for (value, line) in row.iter().zip(middle.chunks_exact_mut(kx)) {
                        line[k] = *value;
                    }
                }
            }
        }
    }

    /// Forms the samples of each row of the window of a plane, by its number.
    pub(super) fn window_rows(&self, plane: usize, scratch: &mut Scratch, values: &mut ArrayViewMut2<Complex32>) {
        let (kx, samples) = (self.band.count[0], self.window.samples);
        let Scratch {
            middle, fft, padded, ..
        } = scratch;
        let middle = &middle[plane * samples * kx..][..samples * kx];
        for (line, mut out) in middle.chunks(kx).zip(values.rows_mut()) {
            let out = out.as_slice_mut().expect("rows are contiguous");
            self.zoom[0].run(line, out, padded, fft);
        }
    }
}
