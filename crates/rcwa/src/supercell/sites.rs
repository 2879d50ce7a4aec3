//! The sites of a supercell: a lattice of translations, oblique if need be, on the lattice of sites.

use crate::basis::RetainedOrders;
use crate::error::{Error, Result};

/// Translations that leave a supercell as it is, in steps: (`row`, 0) and (`shift`, `rows`). The first step is one pitch along x; the
/// second is one pitch along y, or of staggered rows from a site to the one of the next row that is half a pitch further along x.
///
/// A grating whose phase rises by p / n turns for each of the first steps and by q / n for each of the second has a cell of n sites,
/// whatever its direction, not of n x n.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SiteLattice {
    row: usize,
    shift: usize,
    rows: usize,
}

impl SiteLattice {
    /// Largest number of sites of a cell.
    pub const MOST: usize = 64;

    /// A row of cells along x, repeated along y at every pitch.
    ///
    /// # Errors
    /// If there are none, or more than [`SiteLattice::MOST`].
    pub fn row(sites: usize) -> Result<Self> {
        Self::of_grating([1, 0], sites)
    }

    /// The smallest cell of a grating that turns its phase by `turns / sites` at each of the two steps.
    ///
    /// # Errors
    /// If there are no sites, or more than [`SiteLattice::MOST`].
    pub fn of_grating(turns: [i32; 2], sites: usize) -> Result<Self> {
        if sites == 0 || sites > Self::MOST {
            return Err(Error::Sites { sites });
        }
        let n = sites as i64;
        let turns = turns.map(i64::from);
        let common = gcd(gcd(turns[0], turns[1]), n);
        let (n, [p, q]) = (n / common, turns.map(|t| (t / common).rem_euclid(n / common)));
        let rows = gcd(p, n);
        let row = n / rows;
        let shift = (0..row).find(|s| (p * s + q * rows) % n == 0);
        Ok(Self {
            row: row as usize,
            shift: shift.expect("q rows is a multiple of the common divisor of p and n") as usize,
            rows: rows as usize,
        })
    }

    /// Number of sites.
    pub fn len(&self) -> usize {
        self.row * self.rows
    }

    /// A cell has at least one site.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Place of a site (steps).
    pub fn site(&self, index: usize) -> [usize; 2] {
        [index % self.row, index / self.row]
    }

    /// The site of the cell that stands for a place (steps).
    pub fn index(&self, x: usize, y: usize) -> usize {
        // `rows` steps along y are `shift` steps along x, counted on the ring of `row` sites.
        let back = (y / self.rows % self.row) * self.shift % self.row;
        (y % self.rows) * self.row + (x % self.row + self.row - back) % self.row
    }

    /// True if it is one row along x, which the x axis mirrors.
    pub(super) fn is_row(&self) -> bool {
        self.rows == 1 && self.shift == 0
    }

    /// Lines of sites along an axis (0 for x, 1 for y).
    pub(super) fn lines(&self, axis: usize) -> Lines {
        let lines = match axis {
            0 => self.rows,
            _ => gcd(self.shift as i64, self.row as i64) as usize,
        };
        Lines {
            axis,
            lines,
            period: self.len() / lines,
        }
    }

    /// Waves of a square lattice: those of the square that holds the orders `-highest..=highest` of a single cell and half a step more,
    /// so that as many fall to each site; turns of both steps, in parts of `len`.
    pub(super) fn waves(&self, highest: usize) -> Vec<[i32; 2]> {
        let most = ((2 * highest as i32 + 1) * self.len() as i32 - 1) / 2;
        self.waves_within(most, |_| [-most, most])
    }

    /// Waves of staggered rows: those of the circle that holds the orders that a single cell keeps with `-highest..=highest` along an
    /// axis. Where all pillars are equal the orders of the single cell are coupled to no others, and are the same.
    pub(super) fn staggered_waves(&self, highest: usize) -> Vec<[i32; 2]> {
        let RetainedOrders::Circle(most) = RetainedOrders::circle(2 * highest + 1) else {
            unreachable!("orders of staggered rows are kept in a circle");
        };
        // Orders of a rectangle of one pitch by two rows are (x, 2 y - x) over the number of sites.
        let most = (most * self.len() * self.len()) as i32;
        let reach = |square: i32| f64::from(square).sqrt() as i32;
        self.waves_within(reach(most / 3), |x| {
            let reach = reach(most - 3 * x * x);
            [-(reach - x).div_euclid(2), (reach + x).div_euclid(2)]
        })
    }

    /// Waves with turns of the first step up to `most`, and of the second within what `within` gives for these.
    fn waves_within(&self, most: i32, within: impl Fn(i32) -> [i32; 2]) -> Vec<[i32; 2]> {
        let (row, rows, shift) = (self.row as i32, self.rows as i32, self.shift as i32);
        let mut waves = Vec::new();
        for m in -most / rows..=most / rows {
            // y = row n - shift m.
            let [low, high] = within(rows * m).map(|y| y + shift * m);
            for n in -(-low).div_euclid(row)..=high.div_euclid(row) {
                waves.push([rows * m, row * n - shift * m]);
            }
        }
        waves
    }
}

/// Lines of sites along an axis: so many next to one another, each with its period.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lines {
    pub axis: usize,
    /// Number of lines that differ; the pattern across them repeats, shifted, at this many pitches.
    pub lines: usize,
    /// Period along a line (pitches).
    pub period: usize,
}

impl Lines {
    /// Place of a site (pitches).
    pub(crate) fn site(&self, line: usize, step: usize) -> [usize; 2] {
        if self.axis == 0 { [step, line] } else { [line, step] }
    }
}

fn gcd(a: i64, b: i64) -> i64 {
    if b == 0 { a.abs() } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grating_has_as_many_sites_as_its_fraction_says() {
        for (turns, n) in [
            ([1, 0], 5),
            ([0, 1], 5),
            ([1, 1], 6),
            ([2, 1], 7),
            ([2, 3], 12),
            ([4, -6], 16),
            ([3, 9], 12),
            ([0, 0], 4),
        ] {
            let lattice = SiteLattice::of_grating(turns, n).unwrap();
            let n = n as i32;
            let phase = |x: i32, y: i32| (turns[0] * x + turns[1] * y).rem_euclid(n);
            let (row, shift, rows) = (lattice.row as i32, lattice.shift as i32, lattice.rows as i32);
            assert_eq!(phase(row, 0), 0);
            assert_eq!(phase(shift, rows), 0);
            let mut seen: Vec<_> = (0..lattice.len())
                .map(|i| lattice.site(i))
                .map(|[x, y]| phase(x as i32, y as i32))
                .collect();
            seen.sort_unstable();
            seen.dedup();
            assert_eq!(
                seen.len(),
                lattice.len(),
                "{turns:?} / {n}: every site has its own phase"
            );
            for (x, y) in [(17, 0), (3, 8), (0, 11)] {
                let [a, b] = lattice.site(lattice.index(x, y));
                assert_eq!(phase(x as i32, y as i32), phase(a as i32, b as i32));
            }
        }
        assert!(SiteLattice::row(0).is_err());
        assert!(SiteLattice::row(SiteLattice::MOST + 1).is_err());
        let most = SiteLattice::of_grating([i32::MIN, i32::MAX], SiteLattice::MOST).unwrap();
        assert!(most.index(usize::MAX, usize::MAX) < most.len());
    }

    #[test]
    fn waves_are_as_dense_in_all_lattices() {
        // Share of the waves that may be on the rim of the square.
        const RIM: f64 = 0.2;
        for (turns, n) in [([1, 0], 5), ([2, 1], 5), ([3, 1], 10)] {
            let lattice = SiteLattice::of_grating(turns, n).unwrap();
            let waves = lattice.waves(2);
            let most = 5 * n as i32 / 2;
            assert!(waves.iter().flatten().all(|k| k.abs() <= most));
            assert!(waves.contains(&[0, 0]));
            // Waves in a square of sides 5 / pitch, n to each 1 / pitch^2, but for those on its rim.
            let whole = 25.0 * n as f64;
            assert!((waves.len() as f64 - whole).abs() < RIM * whole, "{}", waves.len());
            for [x, y] in waves {
                let invariant = |a: usize, b: usize| (x * a as i32 + y * b as i32) % n as i32 == 0;
                assert!(invariant(lattice.row, 0) && invariant(lattice.shift, lattice.rows));
            }
        }
    }
}
