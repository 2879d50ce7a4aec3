//! Elements given by their phase alone.

use std::f64::consts::TAU;

use metalith_pillars::Lattice;
use ndarray::Array2;
use num_complex::Complex32;

use super::Aperture;
use super::aperture::sites_inside;
use crate::kernels::{cis_all, cis_where};

/// A phase as a function of place, such as the design before mapping and rounding, with the same
/// amplitude everywhere inside a circle.
#[derive(Clone, Copy, Debug)]
pub struct PhaseFunction<F> {
    /// Lattice of the samples.
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
        let y = self.lattice.place_um(1, iy);
        let inside = sites_inside(&self.lattice, self.radius_um, iy);
        let (first, amplitude) = (inside.start, self.amplitude as f32);
        let mut turns = [0.0; CHUNK];
        row.fill(Complex32::ZERO);
        for (chunk, out) in row[inside].chunks_mut(CHUNK).enumerate() {
            let turns = &mut turns[..out.len()];
            for (i, turns) in turns.iter_mut().enumerate() {
                let x = self.lattice.place_um(0, first + chunk * CHUNK + i);
                *turns = (self.phase_rad)(x, y) / TAU;
            }
            cis_all(turns, out);
            for t in out {
                *t = Complex32::new(t.re * amplitude, t.im * amplitude);
            }
        }
        if !self.lattice.is_square() {
            let between = row.iter_mut().enumerate().filter(|(ix, _)| !self.lattice.has(*ix, iy));
            between.for_each(|(_, t)| *t = Complex32::ZERO);
        }
    }
}

/// A phase that is known at each site, with modulus one where there is one.
#[derive(Clone, Debug)]
pub struct PhaseMap {
    lattice: Lattice,
    radius_um: f64,
    /// Turns, within half a turn of zero, so that single precision keeps 4e-7 rad; NaN where nothing passes.
    turns: Array2<f32>,
}

impl PhaseMap {
    /// `turns` is the phase at column `ix` and row `iy`, not reduced; nothing passes where there is none, and none is asked
    /// for where the lattice has no site. No site that passes light may be farther from the centre than `radius_um`.
    pub fn new(lattice: Lattice, radius_um: f64, turns: impl Fn(usize, usize) -> Option<f64>) -> Self {
        let n = lattice.sites();
        Self {
            lattice,
            radius_um,
            turns: Array2::from_shape_fn([n; 2], |(iy, ix)| at_site(&lattice, &turns, ix, iy)),
        }
    }
}

/// The phase of a place within half a turn of zero; NaN where there is none.
fn at_site(lattice: &Lattice, turns: &impl Fn(usize, usize) -> Option<f64>, ix: usize, iy: usize) -> f32 {
    let turns = lattice.has(ix, iy).then(|| turns(ix, iy)).flatten();
    turns.map_or(f32::NAN, |turns| (turns - turns.round()) as f32)
}

/// Variant of [`PhaseMap`], equal to the last bit, that computes the phase each time that a row is asked for: nothing
/// of the size of the element is held.
#[derive(Clone, Copy, Debug)]
pub struct PhaseSites<F> {
    /// Lattice of the samples.
    pub lattice: Lattice,
    /// No site that passes light is farther from the centre (um).
    pub radius_um: f64,
    /// The phase at column `ix` and row `iy` (turns), not reduced; nothing passes where there is none, and none is asked
    /// for where the lattice has no site.
    pub turns: F,
}

impl<F: Fn(usize, usize) -> Option<f64> + Sync> Aperture for PhaseSites<F> {
    fn lattice(&self) -> Lattice {
        self.lattice
    }

    fn radius_um(&self) -> f64 {
        self.radius_um
    }

    fn fill_row(&self, iy: usize, row: &mut [Complex32]) {
        let turns: Vec<f32> = (0..row.len())
            .map(|ix| at_site(&self.lattice, &self.turns, ix, iy))
            .collect();
        cis_where(&turns, row);
    }
}

impl Aperture for PhaseMap {
    fn lattice(&self) -> Lattice {
        self.lattice
    }

    fn radius_um(&self) -> f64 {
        self.radius_um
    }

    fn fill_row(&self, iy: usize, row: &mut [Complex32]) {
        let turns = self.turns.row(iy);
        let turns = turns.to_slice().expect("rows are contiguous");
        cis_where(turns, row);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_phase_that_is_computed_is_the_one_that_is_held() {
        let lattice = Lattice::new(350, 41).unwrap();
        let turns = |ix: usize, iy: usize| (ix + iy > 9).then(|| 0.37 * (ix * ix) as f64 - 1.9 * iy as f64);
        let held = PhaseMap::new(lattice, 11.0, turns);
        let computed = PhaseSites {
            lattice,
            radius_um: 11.0,
            turns,
        };
        let (mut a, mut b) = ([Complex32::ONE; 41], [Complex32::ONE; 41]);
        for iy in 0..41 {
            held.fill_row(iy, &mut a);
            computed.fill_row(iy, &mut b);
            assert_eq!(a, b);
        }
        assert_eq!(a[0].norm_sqr() > 0.5, turns(0, 40).is_some());
    }
}
