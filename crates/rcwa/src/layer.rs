//! Modes of one layer.
//!
//! With lengths times k0, E = (Ex, Ey) and G = (Hy, -Hx) times the impedance of free space:
//! dE/dz = i A G, dG/dz = i B E, A = 1 - k e^-1 k^T, B = diag(ex, ey) - q q^T, where k = (kx, ky) leads
//! from Ez and q = (-ky, kx) from Hz. The permittivities are matrices: for Ez the Laurent rule, for Ex
//! and Ey the inverse rule along the component and the Laurent rule across (L. Li, J. Opt. Soc. Am. A
//! 14, 2758 (1997), Eqs. 8-10). As k^T q = 0, the square of the propagation constants are eigenvalues of
//! A B = diag(ex, ey) - q q^T - k e^-1 k^T diag(ex, ey).

use faer::linalg::matmul::matmul;
use faer::linalg::solvers::Solve;
use faer::{Accum, Mat, Par};
use num_complex::Complex64;

use super::Result;
use super::basis::{FieldBasis, FieldRow, Rows, Space};
use super::outline::{Outline, slab_coefficients};
use super::scalar::{Eigen, Scalar};

/// Below this the square of a propagation constant over k0 counts as zero, and is moved off it: the
/// wave grazes, and 1 / gamma would not be a number. The field changes by about its square root.
const GRAZING: f64 = 1e-18;

/// Two modes of equal constants may come out as a conjugate pair, apart by rounding. Both run forwards:
/// an imaginary part below this share of the real one does not say that a wave grows.
const ROUNDED: f64 = 1e-7;

/// A layer as the operators see it: optical constants in place of materials.
pub(super) struct CrossSection<'a> {
    pub outline: &'a Outline,
    /// Permittivity of the pillar.
    pub inside: Complex64,
    /// Permittivity around it.
    pub outside: Complex64,
    pub pitch_nm: f64,
}

impl CrossSection<'_> {
    /// The permittivity of a layer without structure.
    fn uniform(&self) -> Option<Complex64> {
        if self.outline.is_empty() || self.inside == self.outside {
            Some(self.outside)
        } else {
            self.outline.fills(self.pitch_nm).then_some(self.inside)
        }
    }
}

/// Modes of a layer: E = w (exp(i gamma z) a + exp(-i gamma z) b), G = v (exp(i gamma z) a - exp(-i gamma z) b).
pub(super) struct Modes {
    pub w: Mat<Complex64>,
    pub v: Mat<Complex64>,
    /// Propagation constants over k0, Im >= 0, and Re > 0 where real.
    pub gamma: Vec<Complex64>,
}

impl Modes {
    pub fn of(section: &CrossSection<'_>, basis: &FieldBasis) -> Result<Self> {
        if let Some(permittivity) = section.uniform() {
            return Ok(Self::uniform(permittivity, &basis.rows));
        }
        if section.inside.im == 0.0 && section.outside.im == 0.0 {
            Self::structured(&Permittivity::<f64>::new(section, basis), &basis.rows)
        } else {
            Self::structured(&Permittivity::<Complex64>::new(section, basis), &basis.rows)
        }
    }

    /// Modes of a layer without structure: the plane waves.
    pub fn uniform(permittivity: Complex64, rows: &Rows) -> Self {
        let medium = Medium::new(permittivity, rows);
        let identity = Mat::<Complex64>::identity(rows.len(), rows.len());
        Self {
            v: medium.admittance(rows, &identity),
            w: identity,
            gamma: medium.gamma,
        }
    }

    /// Modes of a layer with these permittivity matrices.
    pub fn structured<T: Scalar>(permittivity: &Permittivity<T>, rows: &Rows) -> Result<Self> {
        let Eigen { values, packed } = T::eigen(permittivity.operator(rows).as_ref())?;
        let bw = permittivity.curl_of(rows, &packed);
        let gamma: Vec<Complex64> = values.iter().map(|&g2| root(g2)).collect();
        let mut v = T::unpack(bw, &values);
        for (j, g) in gamma.iter().enumerate() {
            let scale = g.inv();
            v.col_as_slice_mut(j).iter_mut().for_each(|x| *x *= scale);
        }
        let w = T::unpack(packed, &values);
        Ok(Self { w, v, gamma })
    }
}

/// Square root on the branch that decays or runs forwards, never zero.
fn root(square: Complex64) -> Complex64 {
    if square.norm() < GRAZING {
        return Complex64::new(0.0, GRAZING.sqrt());
    }
    let g = square.sqrt();
    if g.im < -ROUNDED * g.re { -g } else { g }
}

/// The permittivity matrices of a layer.
pub(super) struct Permittivity<T> {
    /// For Ex and Ey, each in its own rows.
    pub transverse: [Mat<T>; 2],
    /// For Ez.
    pub z: Mat<T>,
}

impl<T: Scalar> Permittivity<T> {
    fn new(section: &CrossSection<'_>, basis: &FieldBasis) -> Self {
        let (x, y) = (basis.x, basis.y);
        let laurent = |space: Space, half_width: f64| -> Mat<T> {
            let f: Vec<T> = slab_coefficients(half_width, section.pitch_nm, 2 * basis.highest)
                .into_iter()
                .map(T::real)
                .collect();
            space.toeplitz(&f, basis.highest)
        };
        // 1 / (Toeplitz matrix of 1 / permittivity), less the permittivity outside.
        let inverse_rule = |space: Space, half_width: f64| -> Mat<T> {
            let mut f: Vec<T> = slab_coefficients(half_width, section.pitch_nm, 2 * basis.highest)
                .into_iter()
                .map(|c| T::of((section.inside.inv() - section.outside.inv()) * c))
                .collect();
            f[0] += T::of(section.outside.inv());
            let mut inverse = invert(space.toeplitz(&f, basis.highest));
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
        for band in section.outline.bands(0) {
            let across = band_of(y, band.from, band.to);
            add_kronecker(&mut ex, T::real(1.0), &inverse_rule(x, band.half_width), &across);
            add_kronecker(&mut ez, contrast, &laurent(x.derived(), band.half_width), &across);
        }
        let mut ey = outside(basis.rows.len() - basis.rows.of_x);
        for band in section.outline.bands(1) {
            let across = band_of(x.derived(), band.from, band.to);
            add_kronecker(
                &mut ey,
                T::real(1.0),
                &across,
                &inverse_rule(y.derived(), band.half_width),
            );
        }
        Self {
            transverse: [ex, ey],
            z: ez,
        }
    }

    /// A B, whose eigenvalues are the squares of the propagation constants.
    fn operator(&self, rows: &Rows) -> Mat<T> {
        let n = rows.len();
        let offset = [0, rows.of_x];
        // k^T diag(ex, ey), then e^-1 times it.
        let mut divergence = Mat::<T>::zeros(rows.of_z, n);
        for c in [0, 1] {
            let e = &self.transverse[c];
            for j in 0..e.ncols() {
                let from = e.col_as_slice(j);
                let to = divergence.col_as_slice_mut(offset[c] + j);
                for (i, value) in from.iter().enumerate() {
                    let row = &rows.list[offset[c] + i];
                    if let Some(z) = row.z {
                        to[z] += *value * T::real(row.divergence());
                    }
                }
            }
        }
        self.z.partial_piv_lu().solve_in_place(&mut divergence);

        let mut operator = Mat::<T>::zeros(n, n);
        for j in 0..n {
            let c = usize::from(j >= rows.of_x);
            let to = operator.col_as_slice_mut(j);
            let e = self.transverse[c].col_as_slice(j - offset[c]);
            to[offset[c]..offset[c] + e.len()].copy_from_slice(e);
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
    fn curl_of(&self, rows: &Rows, w: &Mat<T>) -> Mat<T> {
        let (n, split) = (rows.len(), rows.of_x);
        let mut out = Mat::<T>::zeros(n, w.ncols());
        for (c, range) in [(0, 0..split), (1, split..n)] {
            matmul(
                out.get_mut(range.clone(), ..),
                Accum::Replace,
                &self.transverse[c],
                w.get(range, ..),
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

/// A uniform medium, whose modes are the plane waves themselves.
pub(super) struct Medium {
    pub permittivity: Complex64,
    /// Propagation constant over k0 of each row.
    pub gamma: Vec<Complex64>,
}

impl Medium {
    pub fn new(permittivity: Complex64, rows: &Rows) -> Self {
        let gamma = rows
            .list
            .iter()
            .map(|row| root(permittivity - row.k[0] * row.k[0] - row.k[1] * row.k[1]))
            .collect();
        Self { permittivity, gamma }
    }

    /// Entries of the admittance G = Y E of a forward wave in the row of a component and its partner's.
    fn entries(&self, row: &FieldRow, gamma: Complex64) -> (Complex64, f64) {
        let across = row.k[1 - row.component];
        ((self.permittivity - across * across) / gamma, row.k[0] * row.k[1])
    }

    /// Y times the columns of a field.
    pub fn admittance(&self, rows: &Rows, field: &Mat<Complex64>) -> Mat<Complex64> {
        let entries: Vec<_> = rows
            .list
            .iter()
            .zip(&self.gamma)
            .enumerate()
            .map(|(i, (row, &gamma))| {
                let (own, other) = self.entries(row, gamma);
                (
                    own,
                    row.partner.unwrap_or(i),
                    row.partner.map_or(Complex64::ZERO, |_| other / gamma),
                )
            })
            .collect();
        let mut out = Mat::zeros(field.nrows(), field.ncols());
        for j in 0..field.ncols() {
            let from = field.col_as_slice(j);
            let to = out.col_as_slice_mut(j);
            for (i, (own, partner, other)) in entries.iter().enumerate() {
                to[i] = from[i] * own + from[*partner] * other;
            }
        }
        out
    }
}
