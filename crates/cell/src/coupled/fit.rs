//! A response of pairs fitted to the sites of supercells, by least squares.

use nalgebra::DMatrix;
use num_complex::Complex64;

use metalith_core::{Error, Result};
use metalith_rcwa::SiteLattice;

use super::training::TrainingCell;
use super::{NEIGHBOUR_TERMS, NEIGHBOURS, NeighbourBasis, NeighbourResponse, SiteGrid, linear};

/// Added to the mean square of each term, as a part of it: sites are a few for each weight, and widths of neighbours
/// are often nearly those of a grating. Terms of high degree are held back more, by the fourth power of their degree in
/// parts of [`PLAIN_DEGREE`]: that takes a twentieth off what is left of rows of real pillars. Without the power, 1e-4
/// and 1e-3 cannot be distinguished.
const RIDGE: f64 = 1e-4;
const RIDGE_OF_DEGREE: f64 = 1e-2;
const PLAIN_DEGREE: f64 = 4.0;

/// Every sixth supercell is left out in turn to see the error.
const PARTS: usize = 6;

/// A site of a supercell with what it transmits.
#[derive(Clone, Debug)]
pub(crate) struct SiteSample {
    /// Number of its supercell.
    pub supercell: usize,
    /// Weight, as so many sites.
    pub weight: f64,
    pub own_nm: f64,
    /// Widths in the order of [`SiteGrid::neighbours`].
    pub neighbours_nm: [f64; NEIGHBOURS.len()],
    /// Transmission for s and p.
    pub transmitted: [Complex64; 2],
}

/// The sites of a supercell with their neighbours.
pub(crate) fn samples(
    grid: SiteGrid,
    supercell: usize,
    cell: &TrainingCell,
    transmitted: &[Vec<Complex64>; 2],
) -> Vec<SiteSample> {
    let (lattice, widths_nm) = (&cell.lattice, &cell.widths_nm);
    (0..lattice.len())
        .map(|i| SiteSample {
            supercell,
            weight: cell.weight,
            own_nm: widths_nm[i],
            neighbours_nm: neighbours_nm(grid, lattice, widths_nm, i),
            transmitted: [transmitted[0][i], transmitted[1][i]],
        })
        .collect()
}

/// Widths of the neighbours of a site of a supercell (nm), in the order of [`SiteGrid::neighbours`].
pub(crate) fn neighbours_nm(
    grid: SiteGrid,
    lattice: &SiteLattice,
    widths_nm: &[f64],
    site: usize,
) -> [f64; NEIGHBOURS.len()] {
    let here = lattice.site(site);
    grid.neighbours().map(|offset| {
        let offset = grid.steps(offset);
        // All lattices repeat after as many steps as they have sites.
        let period = 2 * lattice.len() as i32;
        let [x, y] = [0, 1].map(|axis| (here[axis] as i32 + offset[axis] + period) as usize);
        widths_nm[lattice.index(x, y)]
    })
}

/// Sums over samples: upper triangle of the products of terms, and those with what is transmitted.
#[derive(Clone)]
struct Sums {
    matrix: Vec<Vec<f64>>,
    right: Vec<[Complex64; 2]>,
    count: f64,
}

impl Sums {
    fn zero() -> Self {
        Self {
            matrix: vec![vec![0.0; NEIGHBOUR_TERMS]; NEIGHBOUR_TERMS],
            right: vec![[Complex64::ZERO; 2]; NEIGHBOUR_TERMS],
            count: 0.0,
        }
    }

    fn add(&mut self, terms: &[f64; NEIGHBOUR_TERMS], transmitted: [Complex64; 2], weight: f64) {
        for (i, own) in terms.iter().enumerate() {
            let own = weight * own;
            for (value, other) in self.matrix[i][i..].iter_mut().zip(&terms[i..]) {
                *value += own * other;
            }
            for (value, t) in self.right[i].iter_mut().zip(transmitted) {
                *value += t * own;
            }
        }
        self.count += weight;
    }

    fn plus(mut self, other: &Self) -> Self {
        for (own, other) in self.matrix.iter_mut().flatten().zip(other.matrix.iter().flatten()) {
            *own += other;
        }
        for (own, other) in self.right.iter_mut().flatten().zip(other.right.iter().flatten()) {
            *own += other;
        }
        self.count += other.count;
        self
    }

    /// Weights for s and p.
    fn solve(mut self) -> Result<[Vec<Complex64>; 2]> {
        let size = NEIGHBOUR_TERMS;
        let mut matrix = DMatrix::from_fn(size, size, |i, j| self.matrix[i.min(j)][i.max(j)]);
        for (i, degree) in NeighbourBasis::degrees().into_iter().enumerate() {
            let ridge = RIDGE + RIDGE_OF_DEGREE * (degree as f64 / PLAIN_DEGREE).powi(4);
            // A term that never occurs has no weight.
            matrix[(i, i)] += ridge * matrix[(i, i)].max(self.count * f64::EPSILON);
        }
        linear::solve(matrix, &mut self.right, f64::MIN_POSITIVE).ok_or_else(|| {
            Error::refused(
                "neighbours/singular",
                "the supercells do not distinguish their pillars",
                "give a mapping that draws several widths",
            )
        })?;
        Ok([0, 1].map(|pol| self.right.iter().map(|w| w[pol]).collect()))
    }
}

/// A fitted response, and what it leaves.
#[derive(Clone, Debug)]
pub(crate) struct Fitted {
    pub responses: [NeighbourResponse; 2],
    /// Mean of |t - t'|^2 over sites of supercells that were left out.
    pub left_out: f64,
}

/// The responses for light whose direction has these sines; its symmetry makes several samples of each.
pub(crate) fn fit(grid: SiteGrid, basis: NeighbourBasis, sines: [f64; 2], samples: &[SiteSample]) -> Result<Fitted> {
    let symmetries = symmetries(grid, sines);
    let mut parts = vec![Sums::zero(); PARTS];
    for sample in samples {
        for symmetry in &symmetries {
            let (neighbours_nm, transmitted) = symmetry.of(sample);
            let terms = basis.terms(sample.own_nm, &neighbours_nm);
            parts[sample.supercell % PARTS].add(&terms, transmitted, sample.weight);
        }
    }
    let mut square = 0.0;
    for left in 0..PARTS {
        let others = parts.iter().enumerate().filter(|(part, _)| *part != left);
        let weights = others.fold(Sums::zero(), |sum, (_, part)| sum.plus(part)).solve()?;
        for sample in samples.iter().filter(|s| s.supercell % PARTS == left) {
            let terms = basis.terms(sample.own_nm, &sample.neighbours_nm);
            for (weights, wanted) in weights.iter().zip(sample.transmitted) {
                let found: Complex64 = weights.iter().zip(terms).map(|(w, t)| w * t).sum();
                square += (found - wanted).norm_sqr();
            }
        }
    }
    let whole = parts.iter().fold(Sums::zero(), Sums::plus);
    Ok(Fitted {
        responses: whole.solve()?.map(|weights| NeighbourResponse { basis, weights }),
        left_out: square / (2.0 * samples.len().max(1) as f64),
    })
}

/// A mirror of the lattice that leaves the direction of the light.
struct Symmetry {
    /// Number to which the neighbour of each number goes.
    to: [usize; NEIGHBOURS.len()],
    /// True if s and p change places.
    swapped: bool,
}

impl Symmetry {
    fn of(&self, sample: &SiteSample) -> ([f64; NEIGHBOURS.len()], [Complex64; 2]) {
        let mut neighbours_nm = sample.neighbours_nm;
        for (width, to) in sample.neighbours_nm.iter().zip(self.to) {
            neighbours_nm[to] = *width;
        }
        let [s, p] = sample.transmitted;
        (neighbours_nm, if self.swapped { [p, s] } else { [s, p] })
    }
}

fn symmetries(grid: SiteGrid, sines: [f64; 2]) -> Vec<Symmetry> {
    let neighbours = grid.neighbours();
    let of = neighbours.map(|offset| grid.images(sines, offset.map(f64::from)));
    (0..of[0].len())
        .map(|number| Symmetry {
            to: std::array::from_fn(|k| {
                let image = of[k][number].0.map(|v| v as i32);
                let found = neighbours.iter().position(|offset| *offset == image);
                found.expect("the neighbours are symmetric")
            }),
            swapped: of[0][number].1,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coupled::training::random;
    use crate::{Mapping, SiteResponse};

    /// The ridge keeps back one part in 1e4 of each weight, and more of those of high degree, which are small here.
    const KEPT_BACK: f64 = 1e-3;

    fn basis(mapping: &Mapping) -> NeighbourBasis {
        NeighbourBasis::new(mapping.samples_nm().iter().map(|w| f64::from(*w)))
    }

    /// Sites that transmit as the sum over pairs says are met, also those of supercells that were left out.
    #[test]
    fn a_sum_over_pairs_is_found_again() {
        let mapping = Mapping::new(|u| 100 + 2 * (u * 100.0) as u16);
        let basis = basis(&mapping);
        let wanted = [0, 1].map(|pol| NeighbourResponse {
            basis,
            weights: (0..NEIGHBOUR_TERMS)
                .map(|i| Complex64::cis((i * (pol + 2)) as f64) / (1.0 + i as f64))
                .zip(NeighbourBasis::degrees())
                .map(|(weight, degree)| weight * 0.1_f64.powi(degree as i32))
                .collect(),
        });
        let all: Vec<SiteSample> = random(std::slice::from_ref(&mapping), 300, true)
            .unwrap()
            .iter()
            .enumerate()
            .flat_map(|(number, cell)| {
                let none = [0, 1].map(|_| vec![Complex64::ZERO; cell.lattice.len()]);
                let mut sites = samples(SiteGrid::SQUARE, number, cell, &none);
                for site in &mut sites {
                    let terms = basis.terms(site.own_nm, &site.neighbours_nm);
                    let sum = |r: &NeighbourResponse| r.weights.iter().zip(terms).map(|(w, t)| w * t).sum();
                    site.transmitted = [sum(&wanted[0]), sum(&wanted[1])];
                }
                sites
            })
            .collect();
        // No symmetry: the weights above have none.
        let fitted = fit(SiteGrid::SQUARE, basis, [0.3, 0.1], &all).unwrap();
        assert!(fitted.left_out < KEPT_BACK, "{}", fitted.left_out);
        for pol in [0, 1] {
            let (found, wanted) = (&fitted.responses[pol], &wanted[pol]);
            assert!((found.own(170.0) - wanted.own(170.0)).norm() < 30.0 * KEPT_BACK);
        }
    }

    #[test]
    fn along_the_normal_s_is_p_turned_by_a_right_angle() {
        let mapping = Mapping::new(|u| 100 + 2 * (u * 100.0) as u16);
        let mut all = Vec::new();
        for (number, cell) in random(std::slice::from_ref(&mapping), 60, true)
            .unwrap()
            .iter()
            .enumerate()
        {
            let t = [0, 1].map(|pol| {
                let each = cell.widths_nm.iter().enumerate();
                each.map(|(i, w)| Complex64::cis(w * (0.02 + 0.01 * f64::from(pol)) + i as f64))
                    .collect()
            });
            all.extend(samples(SiteGrid::SQUARE, number, cell, &t));
        }
        let found = fit(SiteGrid::SQUARE, basis(&mapping), [0.0; 2], &all)
            .unwrap()
            .responses;
        const ROUNDING: f64 = 1e-6;
        for (k, offset) in NEIGHBOURS.iter().enumerate() {
            let turned = [offset[1], offset[0]];
            let k2 = NEIGHBOURS.iter().position(|o| *o == turned).unwrap();
            let (s, p) = (found[0].pair(k, 150.0, 210.0), found[1].pair(k2, 150.0, 210.0));
            assert!((s - p).norm() < ROUNDING, "{offset:?}: {s} {p}");
        }
        assert_eq!(symmetries(SiteGrid::SQUARE, [0.2, 0.0]).len(), 2);
        assert_eq!(symmetries(SiteGrid::SQUARE, [0.2, 0.2]).len(), 2);
        assert_eq!(symmetries(SiteGrid::SQUARE, [0.2, 0.1]).len(), 1);
    }
}
