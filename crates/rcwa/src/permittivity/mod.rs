//! The permittivity of a layer between the fields of a basis.
//!
//! For Ez it is the Laurent rule. For Ex and Ey the rule follows from the sides: `upright` where they are along the axes,
//! `normal_vector` where they are not, which also couples Ex and Ey.

mod moments;
mod normal_vector;
mod upright;

pub(super) use moments::disc_moments;
pub(super) use normal_vector::PillarTensor;

use faer::linalg::matmul::matmul;
use faer::linalg::solvers::Solve;
use faer::{Accum, Mat, Par};
use num_complex::Complex64;

use super::basis::{Family, FieldBasis, Rows};
use super::outline::{Outline, Sides};
use super::scalar::Scalar;
use super::stack::CellLattice;

/// Relative excess of the permittivity for Ey where half a turn is the only symmetry that is used: modes that a quarter
/// of a turn exchanges would have one constant, and the vectors of such a pair lose their digits. The field changes by
/// about as much.
const SPLIT: f64 = 1e-9;

/// A layer as the operators see it: optical constants in place of materials.
pub(super) struct CrossSection<'a> {
    pub outline: &'a Outline,
    /// Permittivity of the pillar.
    pub inside: Complex64,
    /// Permittivity around it.
    pub outside: Complex64,
    pub pitch_nm: f64,
    pub lattice: CellLattice,
}

impl CrossSection<'_> {
    /// The permittivity of a layer without structure.
    pub(crate) fn uniform(&self) -> Option<Complex64> {
        if self.outline.is_empty() || self.inside == self.outside {
            Some(self.outside)
        } else {
            self.outline.fills(self.pitch_nm).then_some(self.inside)
        }
    }
}

/// The permittivity matrices of a layer.
pub(super) struct Permittivity<T> {
    /// Matrices for Ex from Ex and for Ey from Ey, each in its own rows.
    pub transverse: [Mat<T>; 2],
    /// Matrices for Ex from Ey and for Ey from Ex, where sides are not along the axes.
    pub cross: Option<[Mat<T>; 2]>,
    /// Matrix for Ez.
    pub z: Mat<T>,
}

impl<T: Scalar> Permittivity<T> {
    pub(crate) fn new(section: &CrossSection<'_>, basis: &FieldBasis) -> Self {
        let mut found = match section.outline.sides() {
            Sides::Upright(bands) => upright::permittivity(section, basis, &bands),
            Sides::Slanted(form) => normal_vector::permittivity(section, basis, &form),
        };
        if basis.families[0] == Family::Alike {
            found.transverse[1] *= faer::Scale(T::real(1.0 + SPLIT));
        }
        found
    }

    /// All blocks for Ex and Ey: component from which, and component for which.
    fn blocks(&self) -> impl Iterator<Item = (usize, usize, &Mat<T>)> {
        let [xx, yy] = &self.transverse;
        let cross = self.cross.iter().flat_map(|[xy, yx]| [(1, 0, xy), (0, 1, yx)]);
        [(0, 0, xx), (1, 1, yy)].into_iter().chain(cross)
    }

    /// A B, whose eigenvalues are the squares of the propagation constants.
    pub(crate) fn operator(&self, rows: &Rows) -> Mat<T> {
        let n = rows.len();
        let offset = [0, rows.of_x];
        // k^T e_t, then e^-1 times it.
        let mut divergence = Mat::<T>::zeros(rows.of_z, n);
        for (source, target, e) in self.blocks() {
            for j in 0..e.ncols() {
                let from = e.col_as_slice(j);
                let to = divergence.col_as_slice_mut(offset[source] + j);
                for (i, value) in from.iter().enumerate() {
                    let row = &rows.list[offset[target] + i];
                    if let Some(z) = row.z {
                        to[z] += *value * T::real(row.divergence());
                    }
                }
            }
        }
        self.z.partial_piv_lu().solve_in_place(&mut divergence);

        let mut operator = Mat::<T>::zeros(n, n);
        for (source, target, e) in self.blocks() {
            for j in 0..e.ncols() {
                let to = &mut operator.col_as_slice_mut(offset[source] + j)[offset[target]..];
                to[..e.nrows()].copy_from_slice(e.col_as_slice(j));
            }
        }
        for j in 0..n {
            let to = operator.col_as_slice_mut(j);
            let from = divergence.col_as_slice(j);
            for (row, value) in rows.list.iter().zip(to.iter_mut()) {
                if let Some(z) = row.z {
                    *value -= from[z] * T::real(row.divergence());
                }
            }
            let row = &rows.list[j];
            to[j] -= T::real(row.curl() * row.curl());
            if let Some(p) = row.partner {
                to[p] -= T::real(rows.list[p].curl() * row.curl());
            }
        }
        operator
    }

    /// B times the columns of `w`.
    pub(crate) fn curl_of(&self, rows: &Rows, w: &Mat<T>) -> Mat<T> {
        let (n, split) = (rows.len(), rows.of_x);
        let mut out = Mat::<T>::zeros(n, w.ncols());
        let range = [0..split, split..n];
        for (source, target, e) in self.blocks() {
            let into = if source == target { Accum::Replace } else { Accum::Add };
            matmul(
                out.get_mut(range[target].clone(), ..),
                into,
                e,
                w.get(range[source].clone(), ..),
                T::real(1.0),
                Par::Seq,
            );
        }
        for j in 0..w.ncols() {
            let from = w.col_as_slice(j);
            let to = out.col_as_slice_mut(j);
            for (i, row) in rows.list.iter().enumerate() {
                let mut curl = from[i] * T::real(row.curl());
                if let Some(p) = row.partner {
                    curl += from[p] * T::real(rows.list[p].curl());
                }
                to[i] -= curl * T::real(row.curl());
            }
        }
        out
    }
}

pub(super) fn invert<T: Scalar>(matrix: Mat<T>) -> Mat<T> {
    let n = matrix.nrows();
    let mut inverse = Mat::<T>::zeros(n, n);
    (0..n).for_each(|i| inverse[(i, i)] = T::real(1.0));
    matrix.partial_piv_lu().solve_in_place(&mut inverse);
    inverse
}
