//! Elements given by their phase alone.

use std::f64::consts::TAU;

use metalith_core::Lattice;
use num_complex::Complex32;

use super::Aperture;
use super::aperture::sites_inside;
use crate::kernels::cis_all;

/// A phase as a function of place, such as the design before mapping and rounding, with the same
/// amplitude everywhere inside a circle.
#[derive(Clone, Copy, Debug)]
pub struct PhaseFunction<F> {
    /// Where the samples are.
    pub lattice: Lattice,
    /// Radius of the circle (um); sites on it belong to it.
    pub radius_um: f64,
    /// |t| inside the circle.
    pub amplitude: f64,
    /// Phase (rad) at x, y (um) from the element's centre; reduced modulo 2 pi here.
    pub phase_rad: F,
}

impl<F: Fn(f64, f64) -> f64 + Sync> Aperture for PhaseFunction<F> {
    fn lattice(&self) -> Lattice {
        self.lattice
    }

    fn radius_um(&self) -> f64 {
        self.radius_um
    }

    fn fill_row(&self, iy: usize, row: &mut [Complex32]) {
        // Phases are reduced in double precision, chunk by chunk, before they become single.
        const CHUNK: usize = 256;
        let y = self.lattice.coordinate_um(iy);
        let inside = sites_inside(&self.lattice, self.radius_um, iy);
        let (first, amplitude) = (inside.start, self.amplitude as f32);
        let mut turns = [0.0; CHUNK];
        row.fill(Complex32::ZERO);
        for (chunk, out) in row[inside].chunks_mut(CHUNK).enumerate() {
            let turns = &mut turns[..out.len()];
            for (i, turns) in turns.iter_mut().enumerate() {
                let x = self.lattice.coordinate_um(first + chunk * CHUNK + i);
                *turns = (self.phase_rad)(x, y) / TAU;
            }
            cis_all(turns, out);
            for t in out {
                *t = Complex32::new(t.re * amplitude, t.im * amplitude);
            }
        }
    }
}
