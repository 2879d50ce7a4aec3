//! Plane waves of the lattice, and the symmetric combinations of them that a mirror plane leaves.

mod family;
mod retained_orders;

use faer::Mat;
use num_complex::Complex64;

use super::scalar::Scalar;
pub(super) use family::Family;
pub(super) use retained_orders::RetainedOrders;

/// Functions of one axis.
///
/// With e_m = exp(i k_m x): all of them; or, for a wave along the normal of that axis, the even
/// combinations e_0 and (e_m + e_-m) / sqrt 2, or the odd ones (e_m - e_-m) / sqrt 2, m > 0. The
/// derivative maps even to odd and odd to even by i k_m, just as it maps e_m to itself, so that all
/// operators have one form in all three.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Space {
    Full,
    Even,
    Odd,
}

impl Space {
    /// Component that the derivative leads to.
    pub(crate) fn derived(self) -> Self {
        match self {
            Self::Full => Self::Full,
            Self::Even => Self::Odd,
            Self::Odd => Self::Even,
        }
    }

    /// The orders of its functions, ascending.
    pub(crate) fn orders(self, highest: usize) -> std::ops::RangeInclusive<i32> {
        let m = highest as i32;
        match self {
            Self::Full => -m..=m,
            Self::Even => 0..=m,
            Self::Odd => 1..=m,
        }
    }

    pub(crate) fn len(self, highest: usize) -> usize {
        match self {
            Self::Full => 2 * highest + 1,
            Self::Even => highest + 1,
            Self::Odd => highest,
        }
    }

    /// Place of an order among its functions.
    pub(crate) fn position(self, order: i32, highest: usize) -> Option<usize> {
        let first = *self.orders(highest).start();
        (order >= first && order <= highest as i32).then(|| (order - first) as usize)
    }

    /// The order of the function that the plane wave e_order is part of, and the factor of that part.
    pub(crate) fn function(self, order: i32) -> (i32, f64) {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        match self {
            Self::Full => (order, 1.0),
            Self::Even if order == 0 => (0, 1.0),
            Self::Even => (order.abs(), half),
            Self::Odd => (order.abs(), if order < 0 { -half } else { half }),
        }
    }

    /// Multiplication by an even function with Fourier coefficients `f` (orders 0..=2 highest).
    pub(crate) fn toeplitz<T: Scalar>(self, f: &[T], highest: usize) -> Mat<T> {
        let orders: Vec<i32> = self.orders(highest).collect();
        let n = orders.len();
        Mat::from_fn(n, n, |i, j| {
            let (m, l) = (orders[i], orders[j]);
            let near = f[m.abs_diff(l) as usize];
            match self {
                Self::Full => near,
                Self::Even if m == 0 && l == 0 => near,
                Self::Even if m == 0 || l == 0 => near * T::real(std::f64::consts::SQRT_2),
                Self::Even => near + f[(m + l) as usize],
                Self::Odd => near - f[(m + l) as usize],
            }
        })
    }
}

/// One row of the transverse field: a component of E in one order.
#[derive(Clone, Copy, Debug)]
pub(super) struct FieldRow {
    /// Component: 0 for Ex, 1 for Ey.
    pub component: usize,
    /// Transverse wave vector over k0.
    pub k: [f64; 2],
    /// Row of the other component in the same order.
    pub partner: Option<usize>,
    /// Row of Ez in the same order.
    pub z: Option<usize>,
}

impl FieldRow {
    /// Entry of the divergence, that maps this row to Ez: k along the component.
    pub(crate) fn divergence(&self) -> f64 {
        self.k[self.component]
    }

    /// Entry of the curl, that maps this row to Hz: -ky for Ex, kx for Ey.
    pub(crate) fn curl(&self) -> f64 {
        if self.component == 0 { -self.k[1] } else { self.k[0] }
    }
}

/// The components of the transverse field that are solved for: rows of Ex, then of Ey.
#[derive(Clone)]
pub(super) struct Rows {
    pub list: Vec<FieldRow>,
    /// Number of rows of Ex.
    pub of_x: usize,
    /// Number of rows of Ez.
    pub of_z: usize,
}

impl Rows {
    pub(crate) fn len(&self) -> usize {
        self.list.len()
    }
}

/// The transverse field of a lattice in one symmetry.
#[derive(Clone)]
pub(super) struct FieldBasis {
    pub kept: RetainedOrders,
    /// Families that make up Ex, Ey and Ez.
    pub families: [Family; 3],
    /// The orders of their functions.
    pub orders: [Vec<[i32; 2]>; 3],
    pub rows: Rows,
}

impl FieldBasis {
    /// `family` is that of Ex, `k` the wave vector of the zero order over k0, `steps` the wavelength over the periods along
    /// the axes. The k of an axis in an even or odd space is zero, and both are in a family that half a turn tells.
    pub(crate) fn new(kept: RetainedOrders, family: Family, k: [f64; 2], steps: [f64; 2]) -> Self {
        let families = family.of_components();
        let orders = families.map(|f| kept.orders(f));
        let place = |c: usize, order: [i32; 2]| kept.position(families[c], &orders[c], order);
        let rows_x = orders[0].len();
        let mut rows = Vec::with_capacity(rows_x + orders[1].len());
        for component in [0, 1] {
            for &order in &orders[component] {
                let partner = place(1 - component, order);
                rows.push(FieldRow {
                    component,
                    k: [0, 1].map(|axis| k[axis] + f64::from(order[axis]) * steps[axis]),
                    partner: partner.map(|p| if component == 0 { rows_x + p } else { p }),
                    z: place(2, order),
                });
            }
        }
        Self {
            kept,
            families,
            rows: Rows {
                list: rows,
                of_x: rows_x,
                of_z: orders[2].len(),
            },
            orders,
        }
    }

    /// Row and factor of the plane wave of order (m, n) in a component.
    pub(crate) fn plane_wave(&self, component: usize, m: i32, n: i32) -> Option<(usize, f64)> {
        let family = self.families[component];
        let (order, factor) = family.function([m, n]);
        let place = self.kept.position(family, &self.orders[component], order)?;
        Some((component * self.rows.of_x + place, factor))
    }

    /// The plane-wave amplitudes of order (m, n) of the field in column `column` of `field`.
    pub(crate) fn amplitude(&self, field: &Mat<Complex64>, column: usize, m: i32, n: i32) -> [Complex64; 2] {
        [0, 1].map(|component| {
            self.plane_wave(component, m, n)
                .map_or(Complex64::ZERO, |(row, factor)| field[(row, column)] * factor)
        })
    }
}
