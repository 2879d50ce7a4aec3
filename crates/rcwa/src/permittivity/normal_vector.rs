//! Pillars with sides in any direction.
//!
//! Across a side the normal component of D and the tangential one of E are continuous. With the normal n at the sides and
//! P = n n^T, continued over the pillar (see `moments`), F = (1 - P) E + P D / e_out is continuous, so that products with it
//! follow the Laurent rule: E = C F and D = S F, with C = 1 - P + P e_out / e and S = e (1 - P) + P e_out (E. Popov and
//! M. Neviere, J. Opt. Soc. Am. A 18, 2886 (2001), who make D = [S] [C]^-1 E of them). As e_out is the permittivity
//! outside, where F is E itself whatever P is there, C = 1 + (e_out / e_in - 1) P and S = e_out + (e_in - e_out) (1 - P) in the
//! pillar, and P outside of it drops out.
//!
//! [S] [C]^-1 is not symmetric when the series end, and so keeps neither power nor reciprocity. Of circles F is what is given by a
//! series that ends, and fields are tested with fields: of E' = C F' and D = S F the integral of E' D is that of F' C S F, the
//! product of both functions with each other taken before the series end. That makes D = [C]^-1 [C S] [C]^-1 E, which is symmetric,
//! is the inverse rule where all sides face one way, and errs by about half as much as half the sum of [S] [C]^-1 and its
//! transpose. Of rectangles, where F is steep about the corners, the half sum is nearer and is what is taken.
//!
//! With P = (1 + f R) / 2, where R is the reflection at the tangent and f falls from 1 at the rim, P P = (1 + f f + 2 f R) / 4: C and
//! C S are sums of the pillar, of f R and of f f over it.

use std::ops::Range;

use faer::Mat;
use faer::linalg::solvers::Solve;
use num_complex::Complex64;

use super::moments::{Coefficients, Moments};
use super::{CrossSection, Permittivity};
use crate::basis::FieldBasis;
use crate::outline::SlantedForm;
use crate::scalar::Scalar;

/// A tensor over the cell: `uniform`, and in the pillar also `mean` + `part` f R + `square` f f.
#[derive(Clone, Copy)]
pub(crate) struct PillarTensor {
    pub uniform: Complex64,
    pub mean: Complex64,
    pub part: Complex64,
    pub square: Complex64,
}

impl PillarTensor {
    /// C, for permittivities in the pillar and outside of it.
    pub(crate) fn stretch(inside: Complex64, outside: Complex64) -> Self {
        let half = 0.5 * (outside / inside - 1.0);
        Self {
            uniform: Complex64::ONE,
            mean: half,
            part: half,
            square: Complex64::ZERO,
        }
    }

    /// C S.
    pub(crate) fn energy(inside: Complex64, outside: Complex64) -> Self {
        let contrast = inside - outside;
        let quarter = 0.25 * contrast * contrast / inside;
        Self {
            uniform: outside,
            mean: quarter,
            part: 2.0 * quarter - contrast,
            square: quarter,
        }
    }

    /// S.
    fn direct(inside: Complex64, outside: Complex64) -> Self {
        let half = 0.5 * (inside - outside);
        Self {
            uniform: outside,
            mean: half,
            part: -half,
            square: Complex64::ZERO,
        }
    }
}

/// The permittivity matrices of the pillar of a section.
pub(super) fn permittivity<T: Scalar>(
    section: &CrossSection<'_>,
    basis: &FieldBasis,
    form: &SlantedForm,
) -> Permittivity<T> {
    let reach = basis.kept.reach().map(|order| 2 * order);
    let moments = Moments::of(form, section.pitch_nm, section.lattice, reach);
    let (inside, outside) = (section.inside, section.outside);
    let split = basis.rows.of_x;
    let size = basis.rows.len();
    let matrix_of = |tensor: PillarTensor| -> Mat<T> {
        let PillarTensor {
            uniform,
            mean,
            part,
            square,
        } = tensor;
        let mut matrix = Mat::<T>::zeros(size, size);
        let mut fill = |target: usize, source: usize, sum: &[(Complex64, &Coefficients)], uniform: Complex64| {
            let block = multiplication::<T>(basis, [target, source], sum, uniform);
            matrix
                .submatrix_mut(target * split, source * split, block.nrows(), block.ncols())
                .copy_from(&block);
        };
        let own = |sign: f64| {
            let alike = [(mean, &moments.pillar), (square, &moments.square)];
            [alike[0], alike[1], (sign * part, &moments.cosine)]
        };
        fill(0, 0, &own(1.0), uniform);
        fill(1, 1, &own(-1.0), uniform);
        fill(0, 1, &[(part, &moments.sine)], Complex64::ZERO);
        fill(1, 0, &[(part, &moments.sine)], Complex64::ZERO);
        matrix
    };
    let stretched = matrix_of(PillarTensor::stretch(inside, outside)).partial_piv_lu();
    let transverse = match form {
        SlantedForm::Circle { .. } => {
            let mut half = matrix_of(PillarTensor::energy(inside, outside));
            stretched.solve_in_place(&mut half);
            let mut transverse = half.transpose().to_owned();
            stretched.solve_in_place(&mut transverse);
            transverse
        }
        // Both are symmetric: C^-1 S is the transpose of S C^-1.
        SlantedForm::Rectangle { .. } => {
            let mut transverse = matrix_of(PillarTensor::direct(inside, outside));
            stretched.solve_in_place(&mut transverse);
            transverse
        }
    };
    let block = |rows: Range<usize>, columns: Range<usize>| -> Mat<T> {
        Mat::from_fn(rows.len(), columns.len(), |i, j| {
            let (i, j) = (rows.start + i, columns.start + j);
            (transverse[(i, j)] + transverse[(j, i)]) * T::real(0.5)
        })
    };
    let (x, y) = (0..split, split..size);
    Permittivity {
        transverse: [block(x.clone(), x.clone()), block(y.clone(), y.clone())],
        cross: Some([block(x.clone(), y.clone()), block(y, x)]),
        z: multiplication(basis, [2, 2], &[(inside - outside, &moments.pillar)], outside),
    }
}

/// Multiplication of component `source` by a sum of functions of the cell and a constant, as component `target`.
fn multiplication<T: Scalar>(
    basis: &FieldBasis,
    [target, source]: [usize; 2],
    sum: &[(Complex64, &Coefficients)],
    constant: Complex64,
) -> Mat<T> {
    // Coefficients of the sum by the difference of two orders.
    let reach = basis.kept.reach().map(|order| 2 * order as i32);
    let sides = reach.map(|reach| 2 * reach + 1);
    let place = |[m, n]: [i32; 2]| m * sides[1] + n;
    let middle = place(reach);
    let mut table: Vec<T> = Vec::with_capacity((sides[0] * sides[1]) as usize);
    for m in -reach[0]..=reach[0] {
        for n in -reach[1]..=reach[1] {
            table.push(T::of(
                sum.iter().map(|(factor, function)| factor * function.at(m, n)).sum(),
            ));
        }
    }
    table[middle as usize] += T::of(constant);

    let families = [target, source].map(|c| basis.families[c]);
    let [to, from] = [target, source].map(|c| &basis.orders[c]);
    let [scale_to, scale_from] = [0, 1].map(|end| -> Vec<f64> {
        let images = families[end].images();
        let same = |[m, n]: [i32; 2]| images.iter().filter(|([p, q], _)| [p * m, q * n] == [m, n]).count();
        [to, from][end]
            .iter()
            .map(|&order| (same(order) as f64).sqrt().recip())
            .collect()
    });
    let images = families[1].images();
    let mut matrix = Mat::<T>::zeros(to.len(), from.len());
    for (j, [m, n]) in from.iter().enumerate() {
        let column = matrix.col_as_slice_mut(j);
        for ([p, q], sign) in &images {
            let start = middle - place([p * m, q * n]);
            for ((entry, order), scale) in column.iter_mut().zip(to).zip(&scale_to) {
                *entry += table[(start + place(*order)) as usize] * T::real(sign * scale * scale_from[j]);
            }
        }
    }
    matrix
}
