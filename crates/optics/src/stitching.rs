//! Write fields that do not meet: a part of every lens is displaced.

use num_complex::Complex32;
use serde::{Deserialize, Serialize};

use metalith_pillars::Lattice;

/// A boundary of write fields through every lens, beyond which pillars stand off their places. Openings in the metal are
/// written in another step, and stay.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stitching {
    /// Axis that the boundary is across: 0 for x, 1 for y. What lies at larger values is displaced.
    pub axis: usize,
    /// Place of the boundary along this axis, from the middle of a lens (um).
    pub at_um: f64,
    /// Displacement along x and y (nm).
    pub by_nm: [f64; 2],
}

/// Neighbours that a displaced field is interpolated through along an axis. At the steepest light of a lens that steers by 15
/// degrees neighbours differ by 1.9 rad, and six of them give a displacement of a seventh of the pitch to 1 %.
const TAPS: usize = 6;

/// The first of them, from the site below the place.
const FIRST: isize = -2;

/// Most boundaries of a lens.
pub(super) const MOST: usize = 8;

/// Replace what the displaced sites of a row transmit by what stands there once they are displaced: their pattern,
/// interpolated at the place that it came from. `pattern` fills rows as drawn; sites that are dark stay so.
pub(super) fn displace(
    all: &[Stitching],
    lattice: Lattice,
    iy: usize,
    row: &mut [Complex32],
    pattern: impl Fn(usize, &mut [Complex32]),
) {
    let n = lattice.sites();
    // Which boundaries each site lies beyond.
    let beyond = |ix: usize| {
        let place = [lattice.place_um(0, ix), lattice.place_um(1, iy)];
        let bits = all.iter().enumerate().filter(|(_, s)| place[s.axis] >= s.at_um);
        bits.fold(0usize, |bits, (k, _)| bits | 1 << k)
    };
    let parts: Vec<usize> = (0..n).map(beyond).collect();
    let mut known: Vec<usize> = parts.iter().copied().filter(|p| *p > 0).collect();
    known.sort_unstable();
    known.dedup();
    for part in known {
        let own = all.iter().enumerate().filter(|(k, _)| part & (1 << k) > 0);
        let by = own.fold([0.0; 2], |sum, (_, s)| [sum[0] + s.by_nm[0], sum[1] + s.by_nm[1]]);
        let steps = lattice.steps_um();
        let places = [0, 1].map(|a| by[a] * 1e-3 / steps[a]);
        let moved = moved_row(lattice, iy, places, &pattern);
        for ((to, moved), own) in row.iter_mut().zip(&moved).zip(&parts) {
            if *own == part && *to != Complex32::ZERO {
                *to = *moved;
            }
        }
    }
}

/// A row of a pattern that is displaced by so many places of the lattice's grid along x and y.
///
/// Along a row of a hexagonal lattice every other place is a site. Rows whose sites stand over those of this one are
/// interpolated from them, the others from the sites between.
fn moved_row(lattice: Lattice, iy: usize, by: [f64; 2], pattern: impl Fn(usize, &mut [Complex32])) -> Vec<Complex32> {
    let n = lattice.sites();
    let apart: isize = if lattice.is_square() { 1 } else { 2 };
    let (along, weights_y) = taps(by[1]);
    let mut line = vec![Complex32::ZERO; n];
    let mut moved = vec![Complex32::ZERO; n];
    for shift in 0..apart {
        let mut sum = vec![Complex32::ZERO; n];
        for (k, w) in weights_y.iter().enumerate().filter(|(_, w)| **w != 0.0) {
            let rows = along + FIRST + k as isize;
            let from = iy as isize + rows;
            if !(0..n as isize).contains(&from) || rows.rem_euclid(apart) != shift {
                continue;
            }
            pattern(from as usize, &mut line);
            sum.iter_mut().zip(&line).for_each(|(to, v)| *to += v * *w);
        }
        let at = |i: isize| {
            usize::try_from(i)
                .ok()
                .and_then(|i| sum.get(i))
                .copied()
                .unwrap_or_default()
        };
        // Sites are counted from the one a shift before the place.
        let (across, weights_x) = taps((by[0] - shift as f64) / apart as f64);
        for (ix, to) in moved.iter_mut().enumerate() {
            let taps = weights_x.iter().enumerate();
            *to += taps
                .map(|(k, w)| at(ix as isize - shift + apart * (across + FIRST + k as isize)) * *w)
                .sum::<Complex32>();
        }
    }
    moved
}

/// The site below the place that a displaced site came from, relative to it, and the weights of its neighbours.
fn taps(by: f64) -> (isize, [f32; TAPS]) {
    let below = (-by).floor();
    let u = -by - below;
    let node = |k: usize| FIRST as f64 + k as f64;
    let weight = |k: usize| -> f64 {
        let others = (0..TAPS).filter(|j| *j != k);
        others.map(|j| (u - node(j)) / (node(k) - node(j))).product()
    };
    let mut weights = [0.0; TAPS];
    for (k, w) in weights.iter_mut().enumerate() {
        *w = weight(k) as f32;
    }
    (below as isize, weights)
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_pillars::LatticeKind;

    const SITES: usize = 64;

    fn lattice() -> Lattice {
        Lattice::new(350, SITES).unwrap()
    }

    fn displaced(stitching: Stitching, iy: usize, pattern: impl Fn(usize, usize) -> Complex32) -> Vec<Complex32> {
        displaced_on(lattice(), stitching, iy, pattern)
    }

    fn displaced_on(
        lattice: Lattice,
        stitching: Stitching,
        iy: usize,
        pattern: impl Fn(usize, usize) -> Complex32,
    ) -> Vec<Complex32> {
        let fill = |iy: usize, row: &mut [Complex32]| {
            let sites = row.iter_mut().enumerate().filter(|(ix, _)| lattice.has(*ix, iy));
            sites.for_each(|(ix, to)| *to = pattern(ix, iy));
        };
        let mut row = vec![Complex32::ZERO; lattice.sites()];
        fill(iy, &mut row);
        displace(&[stitching], lattice, iy, &mut row, fill);
        row
    }

    #[test]
    fn a_whole_pitch_moves_sites_beyond_the_boundary_by_one() {
        let pattern = |ix: usize, iy: usize| Complex32::new(1.0 + ix as f32, 2.0 * iy as f32);
        let stitching = Stitching {
            axis: 0,
            at_um: 3.0,
            by_nm: [350.0, -350.0],
        };
        let row = displaced(stitching, 20, pattern);
        for (ix, v) in row.iter().enumerate() {
            let is_beyond = lattice().coordinate_um(ix) >= 3.0;
            let want = if is_beyond {
                pattern(ix - 1, 21)
            } else {
                pattern(ix, 20)
            };
            assert_eq!(*v, want, "{ix}");
        }
    }

    /// Displaced waves on a hexagonal lattice as well, towards all sides; what is between sites stays dark.
    #[test]
    fn a_displaced_wave_on_a_hexagonal_lattice_has_another_phase() {
        /// Interpolated between sites, (0.5 * 1.5 * 2.5)^2 / 6! of the sixth derivative: at one radian from site to site
        /// along a row, 0.005, and at 0.4 from row to row next to nothing.
        const TOLERANCE: f32 = 5e-3;
        let lattice = Lattice::of_kind(LatticeKind::Hexagonal, 400, 65).unwrap();
        let turn_per_um: [f64; 2] = [1.0 / 0.4, 0.4 / 0.346];
        let wave = |ix: usize, iy: usize| {
            let turn = turn_per_um[0] * lattice.place_um(0, ix) + turn_per_um[1] * lattice.place_um(1, iy);
            Complex32::from_polar(1.0, turn as f32)
        };
        for by_nm in [[40.0, 25.0], [-170.0, 60.0], [90.0, -400.0], [0.0, 346.0], [400.0, 0.0]] {
            let stitching = Stitching {
                axis: 1,
                at_um: -100.0,
                by_nm,
            };
            let behind = -1e-3 * (turn_per_um[0] * by_nm[0] + turn_per_um[1] * by_nm[1]);
            for iy in [30, 31] {
                let row = displaced_on(lattice, stitching, iy, wave);
                for (ix, v) in row.iter().enumerate().skip(10).take(45) {
                    let want = if lattice.has(ix, iy) {
                        wave(ix, iy) * Complex32::from_polar(1.0, behind as f32)
                    } else {
                        Complex32::ZERO
                    };
                    assert!((v - want).norm() < TOLERANCE, "{by_nm:?}, {ix}, {iy}: {v} {want}");
                }
            }
        }
    }

    /// A displaced wave is behind by its wave vector times the displacement.
    #[test]
    fn a_displaced_wave_has_another_phase() {
        /// Tolerance at one radian from site to site: (1 / pi)^6 of the interpolation.
        const TOLERANCE: f32 = 2e-3;
        let wave = |ix: usize, iy: usize| Complex32::from_polar(1.0, ix as f32 - 0.5 * iy as f32);
        let stitching = Stitching {
            axis: 1,
            at_um: -100.0,
            by_nm: [40.0, 25.0],
        };
        let behind = -(40.0 - 0.5 * 25.0) / 350.0;
        let row = displaced(stitching, 30, wave);
        for (ix, v) in row.iter().enumerate().skip(4).take(SITES - 8) {
            let want = wave(ix, 30) * Complex32::from_polar(1.0, behind);
            assert!((v - want).norm() < TOLERANCE, "{ix}: {v} {want}");
        }
    }
}
