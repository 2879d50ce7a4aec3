//! Plane waves of a supercell, and the combinations of them that are even or odd about its mirror plane.

use std::collections::HashMap;

use faer::Mat;
use num_complex::Complex64;

use super::placed::Placed;
use crate::basis::{FieldRow, Rows, Space};

/// The transverse field of a supercell: all plane waves, or for a row along x the combinations that are
/// even or odd in y. Ex and Ez are in the space `y`, Ey in its derived space.
pub(super) struct Waves {
    pub rows: Rows,
    /// Wave of each row, as turns of both steps in parts of the number of sites; of Ex, Ey and Ez.
    pub of: [Vec<[i32; 2]>; 3],
    /// Their functions of y.
    pub spaces: [Space; 3],
    place: [HashMap<[i32; 2], usize>; 3],
}

impl Waves {
    /// Number of components of the field. Of a row, the rows of Ex and Ey in one symmetry about the x axis are together
    /// as many as there are plane waves.
    pub(crate) fn unknowns(placed: &Placed, highest: usize, y: Space) -> usize {
        let waves = placed.waves(highest).len();
        if y == Space::Full { 2 * waves } else { waves }
    }

    /// `k` is the wave vector of the zero order over k0, `step` the wavelength over the pitch.
    pub(crate) fn new(placed: &Placed, highest: usize, y: Space, k: [f64; 2], step: f64) -> Self {
        let spaces = [y, y.derived(), y];
        let all = placed.waves(highest);
        let of = spaces.map(|space| -> Vec<[i32; 2]> {
            let first = match space {
                Space::Full => i32::MIN,
                Space::Even => 0,
                Space::Odd => 1,
            };
            all.iter().copied().filter(|wave| wave[1] >= first).collect()
        });
        let place = [0, 1, 2].map(|c: usize| of[c].iter().enumerate().map(|(i, &wave)| (wave, i)).collect());
        let of_x = of[0].len();
        let mut list = Vec::with_capacity(of_x + of[1].len());
        for component in [0, 1] {
            for wave in &of[component] {
                let find = |c: usize| -> Option<usize> {
                    let place: &HashMap<[i32; 2], usize> = &place[c];
                    place.get(wave).copied()
                };
                list.push(FieldRow {
                    component,
                    k: placed.sines(*wave, k, step),
                    partner: find(1 - component).map(|p| if component == 0 { of_x + p } else { p }),
                    z: find(2),
                });
            }
        }
        Self {
            rows: Rows {
                list,
                of_x,
                of_z: of[2].len(),
            },
            of,
            spaces,
            place,
        }
    }

    /// Row and factor of a plane wave in a component (0 for Ex, 1 for Ey).
    pub(crate) fn plane_wave(&self, component: usize, wave: [i32; 2]) -> Option<(usize, f64)> {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let factor = match self.spaces[component] {
            Space::Full => 1.0,
            Space::Even if wave[1] == 0 => 1.0,
            Space::Odd if wave[1] < 0 => -half,
            Space::Even | Space::Odd => half,
        };
        let stands_for = match self.spaces[component] {
            Space::Full => wave,
            Space::Even | Space::Odd => [wave[0], wave[1].abs()],
        };
        let place = *self.place[component].get(&stands_for)?;
        Some((component * self.rows.of_x + place, factor))
    }

    /// Amplitudes of Ex and Ey of a plane wave of the field in column `column` of `field`.
    pub(crate) fn amplitude(&self, field: &Mat<Complex64>, column: usize, wave: [i32; 2]) -> [Complex64; 2] {
        [0, 1].map(|component| {
            self.plane_wave(component, wave)
                .map_or(Complex64::ZERO, |(row, factor)| field[(row, column)] * factor)
        })
    }
}

/// Entry of multiplication by a function of y, between two waves of one space: `f` of the difference of
/// their orders, which is even where the space is.
pub(super) fn entry(space: Space, to: i32, from: i32, f: impl Fn(i32) -> Complex64) -> Complex64 {
    match space {
        Space::Full => f(to - from),
        Space::Even if to == 0 && from == 0 => f(0),
        Space::Even if to == 0 || from == 0 => f(to - from) * std::f64::consts::SQRT_2,
        Space::Even => f(to - from) + f(to + from),
        Space::Odd => f(to - from) - f(to + from),
    }
}
