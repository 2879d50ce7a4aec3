//! Transform from the lattice to the window.

use std::ops::Range;

use ndarray::ArrayViewMut2;
use num_complex::Complex32;

use super::planes::Plane;
use super::{FoldedPropagator, LANES};
use crate::kernels::{accumulate, gather, multiply_to, process, product_sum};
use crate::propagation::{ApertureSet, PlaneWave, Scratch};

impl FoldedPropagator {
    /// Folds and transforms along x; leaves the kept columns of these blocks in tiles of `LANES` columns by all rows, the
    /// tiles of each aperture one after the other. Gives the power that each passes of a wave of unit amplitude (um^2).
    pub(super) fn rows_forward(
        &self,
        set: &dyn ApertureSet,
        wave: &PlaneWave,
        blocks: Range<usize>,
        scratch: &mut Scratch,
    ) -> Vec<f64> {
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
        row.resize(set.count() * n, Complex32::ZERO);
        columns.resize((set.count() * m).max(columns.len()), Complex32::ZERO);
        let first = blocks.start * LANES;
        let kept = (blocks.end * LANES).min(self.band.count[0]) - first;
        spectrum.clear();
        spectrum.resize(blocks.len() * LANES, Complex32::ZERO);
        let of_each = blocks.len() * residues * LANES;
        let held = set.count() * of_each;
        if tiles.capacity() < held {
            // What grows by itself may take twice the memory that was counted with.
            tiles.clear();
            tiles.reserve_exact(held);
        }
        tiles.resize(held, Complex32::ZERO);
        let folded = &mut columns[..set.count() * m];
        let mut powers = vec![0.0; set.count()];
        for r in 0..residues {
            folded.fill(Complex32::ZERO);
            for iy in self.rows_of(r) {
                set.fill_rows(iy, row);
                let each = row.chunks_exact(n).zip(folded.chunks_exact_mut(m)).zip(&mut powers);
                for ((row, folded), power) in each {
                    *power += product_sum(row, row).re;
                    for (part, wave) in row.chunks(m).zip(wave_x.chunks(m)) {
                        accumulate(&mut folded[..part.len()], part, wave, wave_y[iy]);
                    }
                }
            }
            for (folded, tiles) in folded.chunks_exact_mut(m).zip(tiles.chunks_exact_mut(of_each)) {
                process(&*self.forward[0], folded, fft);
                gather(&mut spectrum[..kept], folded, self.band.first[0] + first as i64);
                for (block, lanes) in spectrum.chunks_exact(LANES).enumerate() {
                    let at = (block * residues + r) * LANES;
                    tiles[at..at + LANES].copy_from_slice(lanes);
                }
            }
        }
        powers.iter().map(|power| power * self.lattice.cell_um2()).collect()
    }

    /// Transforms these blocks of so many apertures along y, sends each frequency to each plane, shows it to `observe`, and forms
    /// the rows of the planes' windows of each column. What sends a frequency to a plane is worked out once for all apertures.
    pub(super) fn columns_forward(
        &self,
        blocks: Range<usize>,
        (count, planes): (usize, &[Plane]),
        scratch: &mut Scratch,
        observe: &mut dyn FnMut(usize, &[Complex32]),
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
        columns.resize(count * LANES * m, Complex32::ZERO);
        spectrum.resize(count * ky, Complex32::ZERO);
        sent.resize(ky, Complex32::ZERO);
        transfer.resize(ky, Complex32::ZERO);
        let of_plane = samples * kx;
        middle.resize(count * planes.len() * of_plane, Complex32::ZERO);
        row.resize(samples.max(row.len()), Complex32::ZERO);
        let (of_each, of_tile) = (blocks.len() * residues * LANES, residues * LANES);
        let first = blocks.start;
        for block in blocks {
            let lanes = LANES.min(kx - block * LANES);
            for (columns, tiles) in columns.chunks_exact_mut(LANES * m).zip(tiles.chunks_exact(of_each)) {
                let tile = &tiles[(block - first) * of_tile..][..of_tile];
                for (lane, column) in columns.chunks_exact_mut(m).enumerate() {
                    for (value, line) in column.iter_mut().zip(tile.chunks_exact(LANES)) {
                        *value = line[lane];
                    }
                    column[residues..].fill(Complex32::ZERO);
                }
            }
            for lane in 0..lanes {
                let k = block * LANES + lane;
                let rows = self.band.rows[k].clone();
                for (spectrum, columns) in spectrum.chunks_exact_mut(ky).zip(columns.chunks_exact_mut(LANES * m)) {
                    let column = &mut columns[lane * m..][..m];
                    process(&*self.forward[1], column, fft);
                    gather(
                        &mut spectrum[rows.clone()],
                        column,
                        self.band.first[1] + rows.start as i64,
                    );
                }
                let transfer = &mut transfer[..rows.len()];
                for (number, plane) in planes.iter().enumerate() {
                    self.transfer(plane, k, faded, transfer);
                    for (aperture, spectrum) in spectrum.chunks_exact(ky).enumerate() {
                        sent.fill(Complex32::ZERO);
                        multiply_to(&mut sent[rows.clone()], &spectrum[rows.clone()], transfer);
                        observe(aperture, sent);
                        self.zoom[1].run(sent, &mut row[..samples], padded, fft);
                        let middle = &mut middle[(aperture * planes.len() + number) * of_plane..][..of_plane];
                        for (value, line) in row.iter().zip(middle.chunks_exact_mut(kx)) {
                            line[k] = *value;
                        }
                    }
                }
            }
        }
    }

    /// Forms the samples of each row of the window of a plane, by its number among those of all apertures.
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
