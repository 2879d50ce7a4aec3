//! Propagation of one incident wave to the fields at both ends of a stack.
//!
//! From the far side inwards, each layer sees what follows as an admittance, G = Y E; its backward
//! waves at its far end are b = (v + Y w)^-1 (v - Y w) X a, where X only ever decays, so that no height
//! is too large. What decays to nothing on the way across the layer does not couple its two ends: those
//! columns are left out, to rounding.

use std::sync::Arc;

use faer::linalg::matmul::matmul;
use faer::linalg::solvers::{PartialPivLu, Solve};
use faer::{Accum, Mat, Par};
use num_complex::Complex64;

use super::Result;
use super::basis::Rows;
use super::layer::{Medium, Modes};

/// A wave that decays by more than this across a layer is not there at its other end; it is far below
/// the rounding of the waves that are.
const GONE: f64 = 1e-15;

/// A layer with its modes, and its thickness times k0.
struct Slab {
    modes: Arc<Modes>,
    depth: f64,
}

/// Fields for each incident wave (columns).
pub(super) struct Ends {
    /// Ex, Ey that leave at the far end.
    pub transmitted: Mat<Complex64>,
    /// Ex, Ey that return at the near end.
    pub reflected: Mat<Complex64>,
}

/// Load: what follows a layer.
enum Load<'a> {
    Medium(&'a Medium),
    Admittance(Mat<Complex64>),
}

/// Quantities that the way back through a layer needs.
struct Crossed<'a> {
    modes: &'a Modes,
    /// Modes that reach the other end, and by what factor.
    through: Vec<(usize, Complex64)>,
    /// Backward waves at the far end for each of those.
    backward: Mat<Complex64>,
    /// Factors of the field at the near end, E = p a.
    near: PartialPivLu<Complex64>,
}

/// Fields at both ends of a stack for the zero order of a plane wave arriving from below.
///
/// `indices`: of the half-spaces below and above. `layers`: modes and thickness (nm) of each layer from below. `incident`:
/// transverse amplitudes, for each column. `zero_order`: row and factor of the zero order in a component, if it has one.
pub(super) fn propagate_wave(
    rows: &Rows,
    indices: [Complex64; 2],
    layers: impl Iterator<Item = Result<(Arc<Modes>, f64)>>,
    k0_per_nm: f64,
    incident: &[[Complex64; 2]],
    zero_order: impl Fn(usize) -> Option<(usize, f64)>,
) -> Result<Ends> {
    let [below, above] = indices.map(|n| Medium::new(n * n, rows));
    let slabs = layers
        .map(|layer| {
            let (modes, height_nm) = layer?;
            Ok(Slab {
                modes,
                depth: height_nm * k0_per_nm,
            })
        })
        .collect::<Result<Vec<_>>>()?;
    let mut arriving = Mat::zeros(rows.len(), incident.len());
    for (column, amplitudes) in incident.iter().enumerate() {
        for (component, amplitude) in amplitudes.iter().enumerate() {
            if let Some((row, factor)) = zero_order(component) {
                arriving[(row, column)] = amplitude / factor;
            }
        }
    }
    Ok(propagate(rows, &below, &slabs, &above, &arriving))
}

/// Fields at both ends for the transverse fields `incident` arriving from `below`.
fn propagate(rows: &Rows, below: &Medium, slabs: &[Slab], above: &Medium, incident: &Mat<Complex64>) -> Ends {
    let n = rows.len();
    // At the near end G + Y E = 2 Y E_inc, and E is what arrives and what returns.
    let mut drive = below.admittance(rows, incident);
    drive *= faer::Scale(Complex64::new(2.0, 0.0));
    let Some((first, rest)) = slabs.split_first() else {
        let identity = Mat::identity(n, n);
        let sum = above.admittance(rows, &identity) + below.admittance(rows, &identity);
        sum.partial_piv_lu().solve_in_place(&mut drive);
        let reflected = &drive - incident;
        return Ends {
            transmitted: drive,
            reflected,
        };
    };

    let mut load = Load::Medium(above);
    let mut crossed = Vec::with_capacity(rest.len());
    for slab in rest.iter().rev() {
        let (through, backward, p, q) = cross(rows, slab, &load);
        let near = p.partial_piv_lu();
        // Y = q p^-1, and p^T Y^T = q^T.
        let mut y = q.transpose().to_owned();
        near.solve_transpose_in_place(&mut y);
        load = Load::Admittance(y.transpose().to_owned());
        crossed.push(Crossed {
            modes: &slab.modes,
            through,
            backward,
            near,
        });
    }

    let (through, backward, p, q) = cross(rows, first, &load);
    let matched = q + below.admittance(rows, &p);
    matched.partial_piv_lu().solve_in_place(&mut drive);
    let reflected = &p * &drive - incident;
    let mut field = far_field(&first.modes, &through, &backward, &drive);
    for layer in crossed.iter().rev() {
        layer.near.solve_in_place(&mut field);
        field = far_field(layer.modes, &layer.through, &layer.backward, &field);
    }
    Ends {
        transmitted: field,
        reflected,
    }
}

type Through = Vec<(usize, Complex64)>;

/// One layer before its load: the modes that reach through, their backward waves at the far end, and
/// E = p a, G = q a at the near end, for forward waves a there.
fn cross(rows: &Rows, slab: &Slab, load: &Load<'_>) -> (Through, Mat<Complex64>, Mat<Complex64>, Mat<Complex64>) {
    let Modes { w, v, gamma } = &*slab.modes;
    let n = rows.len();
    let through: Through = gamma
        .iter()
        .map(|g| (Complex64::I * g * slab.depth).exp())
        .enumerate()
        .filter(|(_, x)| x.norm() > GONE)
        .collect();
    let yw = match load {
        Load::Medium(medium) => medium.admittance(rows, w),
        Load::Admittance(y) => y * w,
    };
    let mut backward = Mat::from_fn(n, through.len(), |i, j| {
        let (mode, x) = through[j];
        (v[(i, mode)] - yw[(i, mode)]) * x
    });
    (yw + v).partial_piv_lu().solve_in_place(&mut backward);

    let returned = Mat::from_fn(through.len(), through.len(), |i, j| {
        let (mode, x) = through[i];
        backward[(mode, j)] * x
    });
    let (mut p, mut q) = (w.clone(), v.clone());
    for (target, source, sign) in [(&mut p, w, 1.0), (&mut q, v, -1.0)] {
        let columns = Mat::from_fn(n, through.len(), |i, j| source[(i, through[j].0)]);
        let change = &columns * &returned;
        for (j, (mode, _)) in through.iter().enumerate() {
            for (to, from) in target.col_as_slice_mut(*mode).iter_mut().zip(change.col_as_slice(j)) {
                *to += from * sign;
            }
        }
    }
    (through, backward, p, q)
}

/// E at the far end of a layer for forward waves at its near end.
fn far_field(
    modes: &Modes,
    through: &[(usize, Complex64)],
    backward: &Mat<Complex64>,
    forward: &Mat<Complex64>,
) -> Mat<Complex64> {
    let arrived = Mat::from_fn(through.len(), forward.ncols(), |i, j| {
        let (mode, _) = through[i];
        forward[(mode, j)]
    });
    let mut waves = backward * &arrived;
    for (i, (mode, x)) in through.iter().enumerate() {
        for j in 0..forward.ncols() {
            waves[(*mode, j)] += arrived[(i, j)] * x;
        }
    }
    let mut field = Mat::zeros(forward.nrows(), forward.ncols());
    matmul(&mut field, Accum::Replace, &modes.w, &waves, Complex64::ONE, Par::Seq);
    field
}
