//! Places of the sites of supercells in the plane, and on the grid of an element.

use metalith_pillars::LatticeKind;
use metalith_rcwa::CellLattice;

use super::{NEIGHBOURS, neighbours};
use crate::CellStack;

/// A square lattice of sites, or staggered rows of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SiteGrid {
    /// Distance of staggered rows (pitches).
    row: Option<f64>,
}

impl SiteGrid {
    /// A square lattice.
    pub const SQUARE: Self = Self { row: None };

    /// The one that the pillars of a cell stand on.
    pub fn of(stack: &CellStack) -> Self {
        let row = match stack.lattice {
            CellLattice::Square => None,
            CellLattice::Staggered { row_nm } => Some(row_nm / stack.pitch_nm),
        };
        Self { row }
    }

    /// True if it is square.
    pub fn is_square(self) -> bool {
        self.row.is_none()
    }

    /// Offsets of the neighbours that count, in places of the grid of an element.
    pub(crate) fn neighbours(self) -> &'static [[i32; 2]; NEIGHBOURS.len()] {
        neighbours(match self.row {
            None => LatticeKind::Square,
            Some(_) => LatticeKind::Hexagonal,
        })
    }

    /// An offset in places of the grid, in the steps of a [`SiteLattice`](metalith_rcwa::SiteLattice).
    pub(crate) fn steps(self, [x, y]: [i32; 2]) -> [i32; 2] {
        match self.row {
            None => [x, y],
            Some(_) => [(x - y) / 2, y],
        }
    }

    /// Turns over both steps of a phase that turns by one for each place of the grid in this direction.
    pub(crate) fn turns_of_places(self, [x, y]: [i32; 2]) -> [i32; 2] {
        match self.row {
            None => [x, y],
            Some(_) => [2 * x, x + y],
        }
    }

    /// The grating vector (turns a pitch along x and y) of turns over both steps.
    pub(crate) fn vector(self, [x, y]: [f64; 2]) -> [f64; 2] {
        match self.row {
            None => [x, y],
            Some(row) => [x, (y - 0.5 * x) / row],
        }
    }

    /// True if samples on the sites distinguish a wave of this vector (waves a pitch along x and y) from all shorter
    /// ones.
    pub(crate) fn tells(self, vector: [f64; 2]) -> bool {
        let within = |share: f64| (-0.5..0.5).contains(&share);
        let Some(row) = self.row else {
            return vector.into_iter().all(within);
        };
        // The nearest orders of one pillar: across rows, and on both sides of them.
        let across = 0.5 / row;
        [[0.0, 2.0 * across], [1.0, across], [1.0, -across]]
            .into_iter()
            .all(|[x, y]: [f64; 2]| within((x * vector[0] + y * vector[1]) / (x * x + y * y)))
    }

    /// The images of a vector by mirrors that leave the lattice and light from a direction (sines) as they are, and whether s and p
    /// change places.
    pub(crate) fn images(self, sines: [f64; 2], k: [f64; 2]) -> Vec<([f64; 2], bool)> {
        match self.row {
            None => images(sines, k),
            // No mirror exchanges x and y.
            Some(_) => images(sines, k).into_iter().take(mirrors(sines)).collect(),
        }
    }
}

/// A vector and its mirror images that are the same to light of this direction (sines) on a square lattice; whether s and p
/// change places.
pub(crate) fn images(sines: [f64; 2], k: [f64; 2]) -> Vec<([f64; 2], bool)> {
    let mut all = vec![(k, false)];
    for axis in [0, 1] {
        if sines[axis] == 0.0 {
            for (mut image, swapped) in all.clone() {
                image[axis] = -image[axis];
                all.push((image, swapped));
            }
        }
    }
    if sines[0] == sines[1] {
        // Along the normal p is x and s is y; else s and p go with the plane of incidence, which is its own image.
        let normal = sines[0] == 0.0;
        for ([x, y], swapped) in all.clone() {
            all.push(([y, x], swapped ^ normal));
        }
    }
    all
}

/// Number of images of a vector by mirrors of the axes alone: the first of [`images`].
fn mirrors(sines: [f64; 2]) -> usize {
    sines.iter().map(|sine| if *sine == 0.0 { 2 } else { 1 }).product()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums of a few numbers of size one.
    const ROUNDING: f64 = 1e-12;

    fn hexagonal() -> SiteGrid {
        SiteGrid {
            row: Some(0.75_f64.sqrt()),
        }
    }

    #[test]
    fn turns_are_those_at_the_sites() {
        let grid = hexagonal();
        let turns = [0.3, -0.2];
        let vector = grid.vector(turns);
        for place in grid.neighbours() {
            let [i, j] = grid.steps(*place).map(f64::from);
            let [x, y] = [0.5 * f64::from(place[0]), grid.row.unwrap() * f64::from(place[1])];
            assert!((turns[0] * i + turns[1] * j - vector[0] * x - vector[1] * y).abs() < ROUNDING);
            // One turn for each place along an axis.
            for direction in [[1, 0], [0, -1]] {
                let [p, q] = grid.turns_of_places(direction);
                let along = direction[0] * place[0] + direction[1] * place[1];
                assert_eq!(p * grid.steps(*place)[0] + q * grid.steps(*place)[1], along);
            }
        }
    }

    #[test]
    fn neighbours_are_mirrored_into_neighbours() {
        let grid = hexagonal();
        for (sines, count) in [([0.0, 0.0], 4), ([0.2, 0.0], 2), ([0.2, 0.2], 1)] {
            for place in grid.neighbours() {
                let images = grid.images(sines, place.map(f64::from));
                assert_eq!(images.len(), count);
                assert!(
                    images
                        .iter()
                        .all(|(k, _)| grid.neighbours().contains(&k.map(|v| v as i32)))
                );
            }
        }
    }

    /// Waves that are equal at all sites form a class, and one of each class is distinguished.
    #[test]
    fn one_wave_of_a_class_is_told() {
        let grid = hexagonal();
        let across = 0.5 / grid.row.unwrap();
        for k in 0..50 {
            let [x, y] = [0.0137, 0.0291].map(|step| f64::from(k) * step);
            let class = (-4..=4).flat_map(|m| (-4..=4).map(move |n| [f64::from(m), f64::from(2 * n + m)]));
            let told = class.filter(|[m, n]| grid.tells([x + m, y + n * across])).count();
            assert_eq!(told, 1, "{x} {y}");
        }
    }
}
