//! Coupled model: transmission of a pillar among dissimilar neighbours.
//!
//! A lattice of equal pillars is one place in the space of all neighbourhoods, and a special one: its guided modes
//! resonate. Here the transmission of a site is a sum over pairs,
//!
//! t = a(w) + sum over the neighbours d within two pitches of b_d(w, w_d),
//!
//! w the width of its own pillar, w_d that of the neighbour at the offset d. a is a polynomial in w, b_d one in both, with
//! Chebyshev's polynomials as terms. b_d is zero on the mean over the widths that are drawn: a neighbour that is not there
//! counts with that mean. Resonances that need many equal pillars in a row are not in it.

use metalith_pillars::LatticeKind;
use num_complex::Complex64;

/// Offsets of the neighbours that count on a square lattice (pitches along x and y).
pub const NEIGHBOURS: [[i32; 2]; 12] = [
    [1, 0],
    [-1, 0],
    [0, 1],
    [0, -1],
    [1, 1],
    [1, -1],
    [-1, 1],
    [-1, -1],
    [2, 0],
    [-2, 0],
    [0, 2],
    [0, -2],
];

/// Offsets of neighbours on a hexagonal lattice, in places of its grid: half pitches along x, rows along y. The six
/// nearest, then the six behind their gaps.
const NEIGHBOURS_OF_HEXAGONAL: [[i32; 2]; NEIGHBOURS.len()] = [
    [2, 0],
    [-2, 0],
    [1, 1],
    [1, -1],
    [-1, 1],
    [-1, -1],
    [3, 1],
    [3, -1],
    [-3, 1],
    [-3, -1],
    [0, 2],
    [0, -2],
];

/// Offsets of the neighbours that count, in places of the grid of a [`Lattice`](metalith_pillars::Lattice) of this kind.
pub fn neighbours(kind: LatticeKind) -> &'static [[i32; 2]; NEIGHBOURS.len()] {
    match kind {
        LatticeKind::Square => &NEIGHBOURS,
        LatticeKind::Hexagonal => &NEIGHBOURS_OF_HEXAGONAL,
    }
}

/// Highest polynomial in the own width, of a(w) and of b_d.
const OWN_DEGREE: usize = 12;
const PAIR_DEGREE: usize = 6;

/// Degree in the neighbour's width: what a pair adds is a sum of so many products of a function of each.
pub const NEIGHBOUR_DEGREE: usize = 4;

/// Number of terms of a(w), and of each b_d.
const OWN_TERMS: usize = OWN_DEGREE + 1;
const PAIR_TERMS: usize = (PAIR_DEGREE + 1) * NEIGHBOUR_DEGREE;

/// Number of terms of the whole sum.
pub const NEIGHBOUR_TERMS: usize = OWN_TERMS + NEIGHBOURS.len() * PAIR_TERMS;

/// The terms of the sum over pairs, without their weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NeighbourBasis {
    range_nm: (f64, f64),
    /// Means of the polynomials of a neighbour's width over the widths that are drawn.
    means: [f64; NEIGHBOUR_DEGREE],
}

impl NeighbourBasis {
    /// Basis for pillars of these widths (nm), each as often as it is drawn. Widths beyond their range count as its
    /// end.
    pub fn new(widths_nm: impl Iterator<Item = f64> + Clone) -> Self {
        let range_nm = widths_nm
            .clone()
            .fold((f64::INFINITY, 0.0), |(low, high), w| (w.min(low), w.max(high)));
        let mut basis = Self {
            range_nm,
            means: [0.0; NEIGHBOUR_DEGREE],
        };
        let count = widths_nm.clone().count().max(1) as f64;
        let mut means = [0.0; NEIGHBOUR_DEGREE];
        for width in widths_nm {
            let all: [f64; NEIGHBOUR_DEGREE + 1] = basis.chebyshev(width);
            for (mean, value) in means.iter_mut().zip(&all[1..]) {
                *mean += value / count;
            }
        }
        basis.means = means;
        basis
    }

    /// Narrowest and widest pillar (nm).
    pub fn range_nm(&self) -> (f64, f64) {
        self.range_nm
    }

    /// All terms for a pillar and its neighbours (nm), the latter in the order of [`NEIGHBOURS`].
    pub fn terms(&self, own_nm: f64, neighbours_nm: &[f64; NEIGHBOURS.len()]) -> [f64; NEIGHBOUR_TERMS] {
        let mut terms = [0.0; NEIGHBOUR_TERMS];
        let (own, pairs) = terms.split_at_mut(OWN_TERMS);
        own.copy_from_slice(&self.own(own_nm));
        for (to, width) in pairs.chunks_exact_mut(PAIR_TERMS).zip(neighbours_nm) {
            to.copy_from_slice(&self.pair(own_nm, *width));
        }
        terms
    }

    /// Degree of each term: that in its own width, and of pairs that in the neighbour's added.
    pub fn degrees() -> [usize; NEIGHBOUR_TERMS] {
        std::array::from_fn(|i| match i.checked_sub(OWN_TERMS) {
            None => i,
            Some(pair) => {
                let within = pair % PAIR_TERMS;
                within / NEIGHBOUR_DEGREE + within % NEIGHBOUR_DEGREE + 1
            }
        })
    }

    fn own(&self, width_nm: f64) -> [f64; OWN_TERMS] {
        self.chebyshev(width_nm)
    }

    fn pair(&self, own_nm: f64, neighbour_nm: f64) -> [f64; PAIR_TERMS] {
        let own: [f64; PAIR_DEGREE + 1] = self.chebyshev(own_nm);
        let other = self.neighbour(neighbour_nm);
        std::array::from_fn(|i| own[i / NEIGHBOUR_DEGREE] * other[i % NEIGHBOUR_DEGREE])
    }

    /// Functions of the width of a neighbour.
    fn neighbour(&self, width_nm: f64) -> [f64; NEIGHBOUR_DEGREE] {
        let all: [f64; NEIGHBOUR_DEGREE + 1] = self.chebyshev(width_nm);
        std::array::from_fn(|b| all[b + 1] - self.means[b])
    }

    /// T_0 to T_(N-1) of a width over the range.
    fn chebyshev<const N: usize>(&self, width_nm: f64) -> [f64; N] {
        let (low, high) = self.range_nm;
        let x = if high > low {
            ((2.0 * width_nm - low - high) / (high - low)).clamp(-1.0, 1.0)
        } else {
            0.0
        };
        let mut all = [1.0; N];
        if N > 1 {
            all[1] = x;
        }
        for k in 2..N {
            all[k] = 2.0 * x * all[k - 1] - all[k - 2];
        }
        all
    }
}

/// The sum over pairs, at one wavelength, direction and polarisation.
#[derive(Clone, Debug, PartialEq)]
pub struct NeighbourResponse {
    pub basis: NeighbourBasis,
    /// Weight of each term, in the order of [`NeighbourBasis::terms`]. The sum has the scale of
    /// [`CellResponse`](crate::CellResponse).
    pub weights: Vec<Complex64>,
}

/// The sums over pairs in one light, fitted to supercells, and how far they are from others.
#[derive(Clone, Debug)]
pub struct FittedNeighbours {
    /// Responses for s and p.
    pub responses: [NeighbourResponse; 2],
    /// Share of the arriving light that the sums put elsewhere than supercells do that were left out of the fit: mean over their
    /// sites, s and p.
    pub left_out: f64,
}

/// A sum over pairs in one light.
pub trait SiteResponse: Sync {
    /// Mean transmission of a pillar (nm) over its neighbours.
    fn own(&self, width_nm: f64) -> Complex64;

    /// Term that the neighbour at the offset of this number in [`NEIGHBOURS`] adds; widths in nm.
    fn pair(&self, number: usize, own_nm: f64, neighbour_nm: f64) -> Complex64;

    /// Factors of the term of a pair that depend on the own width: [`SiteResponse::pair`] is the sum of the products of
    /// these, of the own width, with [`SiteResponse::neighbour_factors`].
    fn pair_factors(&self, number: usize, own_nm: f64) -> [Complex64; NEIGHBOUR_DEGREE];

    /// The factors of a neighbour's width (nm); the same at all wavelengths of one cell.
    fn neighbour_factors(&self, neighbour_nm: f64) -> [f64; NEIGHBOUR_DEGREE];

    /// Transmission of a pillar among neighbours of these widths (nm), in the order of [`NEIGHBOURS`].
    fn among(&self, own_nm: f64, neighbours_nm: &[f64; NEIGHBOURS.len()]) -> Complex64 {
        let pairs = neighbours_nm.iter().enumerate();
        let pairs: Complex64 = pairs.map(|(k, other)| self.pair(k, own_nm, *other)).sum();
        self.own(own_nm) + pairs
    }
}

impl SiteResponse for NeighbourResponse {
    fn own(&self, width_nm: f64) -> Complex64 {
        sum(&self.weights[..OWN_TERMS], &self.basis.own(width_nm))
    }

    fn pair(&self, number: usize, own_nm: f64, neighbour_nm: f64) -> Complex64 {
        let first = OWN_TERMS + number * PAIR_TERMS;
        sum(
            &self.weights[first..first + PAIR_TERMS],
            &self.basis.pair(own_nm, neighbour_nm),
        )
    }

    fn pair_factors(&self, number: usize, own_nm: f64) -> [Complex64; NEIGHBOUR_DEGREE] {
        let own: [f64; PAIR_DEGREE + 1] = self.basis.chebyshev(own_nm);
        let first = OWN_TERMS + number * PAIR_TERMS;
        let weight = |a: usize, b: usize| self.weights[first + a * NEIGHBOUR_DEGREE + b];
        std::array::from_fn(|b| own.iter().enumerate().map(|(a, t)| weight(a, b) * t).sum())
    }

    fn neighbour_factors(&self, neighbour_nm: f64) -> [f64; NEIGHBOUR_DEGREE] {
        self.basis.neighbour(neighbour_nm)
    }
}

fn sum(weights: &[Complex64], terms: &[f64]) -> Complex64 {
    weights.iter().zip(terms).map(|(w, t)| w * t).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums of two hundred terms in another order.
    const ROUNDING: f64 = 1e-12;

    #[test]
    fn the_sum_is_that_of_its_parts_and_means_vanish() {
        let widths = || (0..50).map(|i| 100.0 + f64::from(i * i) / 12.5);
        let basis = NeighbourBasis::new(widths());
        let weight = |i: usize| Complex64::new((i % 7) as f64 - 3.0, (i % 5) as f64);
        let response = NeighbourResponse {
            basis,
            weights: (0..NEIGHBOUR_TERMS).map(weight).collect(),
        };
        let neighbours = std::array::from_fn(|k| 110.0 + 13.0 * k as f64);
        let terms = basis.terms(170.0, &neighbours);
        let whole: Complex64 = terms.iter().zip(&response.weights).map(|(t, w)| w * t).sum();
        let pairs = neighbours.iter().enumerate();
        let parts: Complex64 = pairs.map(|(k, w)| response.pair(k, 170.0, *w)).sum();
        assert!((response.own(170.0) + parts - whole).norm() < ROUNDING);
        for number in 0..NEIGHBOURS.len() {
            let mean: Complex64 = widths().map(|w| response.pair(number, 230.0, w)).sum();
            assert!(mean.norm() / 50.0 < ROUNDING, "{number}: {mean}");
            let products = response.pair_factors(number, 170.0).into_iter();
            let products: Complex64 = products
                .zip(response.neighbour_factors(211.0))
                .map(|(a, b)| a * b)
                .sum();
            assert!((products - response.pair(number, 170.0, 211.0)).norm() < ROUNDING);
        }
        // Beyond the range nothing changes any more: polynomials would run away.
        assert_eq!(response.own(500.0), response.own(296.08));
    }

    #[test]
    fn one_width_alone_has_a_response() {
        let basis = NeighbourBasis::new(std::iter::once(150.0));
        assert!(basis.terms(150.0, &[150.0; 12]).iter().all(|t| t.is_finite()));
    }
}
