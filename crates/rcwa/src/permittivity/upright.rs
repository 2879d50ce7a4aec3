//! Pillars whose sides are along the axes: the inverse rule along a component, the Laurent rule across (L. Li,
//! J. Opt. Soc. Am. A 14, 2758 (1997), Eqs. 8-10), band by band of constant width.

use faer::Mat;

use super::{CrossSection, Permittivity, invert};
use crate::basis::{Family, FieldBasis, Space};
use crate::outline::{Band, slab_coefficients};
use crate::scalar::Scalar;

/// The permittivity matrices of the pillar of a section.
pub(super) fn permittivity<T: Scalar>(
    section: &CrossSection<'_>,
    basis: &FieldBasis,
    [along_x, along_y]: &[Vec<Band>; 2],
) -> Permittivity<T> {
    let Family::Product(x, y) = basis.families[0] else {
        unreachable!("pillars with upright sides are solved in products")
    };
    // All orders up to one along either axis: staggered rows have no pillars with upright sides.
    let [highest, _] = basis.kept.reach();
    let laurent = |space: Space, half_width: f64| -> Mat<T> {
        let f: Vec<T> = slab_coefficients(half_width, section.pitch_nm, 2 * highest)
            .into_iter()
            .map(T::real)
            .collect();
        space.toeplitz(&f, highest)
    };
    // 1 / (Toeplitz matrix of 1 / permittivity), less the permittivity outside.
    let inverse_rule = |space: Space, half_width: f64| -> Mat<T> {
        let mut f: Vec<T> = slab_coefficients(half_width, section.pitch_nm, 2 * highest)
            .into_iter()
            .map(|c| T::of((section.inside.inv() - section.outside.inv()) * c))
            .collect();
        f[0] += T::of(section.outside.inv());
        let mut inverse = invert(space.toeplitz(&f, highest));
        for i in 0..inverse.nrows() {
            inverse[(i, i)] -= T::of(section.outside);
        }
        inverse
    };
    let band_of = |space: Space, from: f64, to: f64| -> Mat<T> {
        let mut band = laurent(space, to);
        if from > 0.0 {
            band -= laurent(space, from);
        }
        band
    };
    let outside = |n: usize| -> Mat<T> {
        let mut m = Mat::zeros(n, n);
        (0..n).for_each(|i| m[(i, i)] = T::of(section.outside));
        m
    };

    let mut ex = outside(basis.rows.of_x);
    let mut ez = outside(basis.rows.of_z);
    let contrast = T::of(section.inside - section.outside);
    for band in along_x {
        let across = band_of(y, band.from, band.to);
        add_kronecker(&mut ex, T::real(1.0), &inverse_rule(x, band.half_width), &across);
        add_kronecker(&mut ez, contrast, &laurent(x.derived(), band.half_width), &across);
    }
    let mut ey = outside(basis.rows.len() - basis.rows.of_x);
    for band in along_y {
        let across = band_of(x.derived(), band.from, band.to);
        add_kronecker(
            &mut ey,
            T::real(1.0),
            &across,
            &inverse_rule(y.derived(), band.half_width),
        );
    }
    Permittivity {
        transverse: [ex, ey],
        cross: None,
        z: ez,
    }
}

/// sum += factor (a x b), row (i, k) at i times the size of b plus k.
fn add_kronecker<T: Scalar>(sum: &mut Mat<T>, factor: T, a: &Mat<T>, b: &Mat<T>) {
    let n = b.nrows();
    for j in 0..a.ncols() {
        for l in 0..n {
            let column = sum.col_as_slice_mut(j * n + l);
            for i in 0..a.nrows() {
                let scale = factor * a[(i, j)];
                let part = &mut column[i * n..(i + 1) * n];
                for (to, from) in part.iter_mut().zip(b.col_as_slice(l)) {
                    *to += scale * *from;
                }
            }
        }
    }
}
