//! Modes of one layer.
//!
//! With lengths times k0, E = (Ex, Ey) and G = (Hy, -Hx) times the impedance of free space:
//! dE/dz = i A G, dG/dz = i B E, A = 1 - k e^-1 k^T, B = e_t - q q^T, where k = (kx, ky) leads
//! from Ez and q = (-ky, kx) from Hz, and e_t and e are the permittivity matrices of Ex and Ey and of Ez (see
//! [`permittivity`](super::permittivity)). As k^T q = 0, the square of the propagation constants are eigenvalues of
//! A B = e_t - q q^T - k e^-1 k^T e_t.

use faer::Mat;
use num_complex::Complex64;

use super::Result;
use super::basis::{FieldBasis, FieldRow, Rows};
use super::permittivity::{CrossSection, Permittivity};
use super::scalar::{Eigen, Scalar};

/// Below this the square of a propagation constant over k0 counts as zero, and is moved off it: the
/// wave grazes, and 1 / gamma would not be a number. The field changes by about its square root.
const GRAZING: f64 = 1e-18;

/// Two modes of equal constants may come out as a conjugate pair, apart by rounding. Both run forwards:
/// an imaginary part below this share of the real one does not say that a wave grows.
const ROUNDED: f64 = 1e-7;

/// Modes of a layer: E = w (exp(i gamma z) a + exp(-i gamma z) b), G = v (exp(i gamma z) a - exp(-i gamma z) b).
pub(super) struct Modes {
    pub w: Mat<Complex64>,
    pub v: Mat<Complex64>,
    /// Propagation constants over k0, Im >= 0, and Re > 0 where real.
    pub gamma: Vec<Complex64>,
}

impl Modes {
    pub(crate) fn of(section: &CrossSection<'_>, basis: &FieldBasis) -> Result<Self> {
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
    pub(crate) fn uniform(permittivity: Complex64, rows: &Rows) -> Self {
        let medium = Medium::new(permittivity, rows);
        let identity = Mat::<Complex64>::identity(rows.len(), rows.len());
        Self {
            v: medium.admittance(rows, &identity),
            w: identity,
            gamma: medium.gamma,
        }
    }

    /// Modes of a layer with these permittivity matrices.
    pub(crate) fn structured<T: Scalar>(permittivity: &Permittivity<T>, rows: &Rows) -> Result<Self> {
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

/// A uniform medium, whose modes are the plane waves themselves.
pub(super) struct Medium {
    pub permittivity: Complex64,
    /// Propagation constant over k0 of each row.
    pub gamma: Vec<Complex64>,
}

impl Medium {
    pub(crate) fn new(permittivity: Complex64, rows: &Rows) -> Self {
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
    pub(crate) fn admittance(&self, rows: &Rows, field: &Mat<Complex64>) -> Mat<Complex64> {
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
