//! Plane waves of the lattice, and the symmetric combinations of them that a mirror plane leaves.

use faer::Mat;
use num_complex::Complex64;

use super::scalar::Scalar;

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
    /// Where the derivative leads to.
    pub fn derived(self) -> Self {
        match self {
            Self::Full => Self::Full,
            Self::Even => Self::Odd,
            Self::Odd => Self::Even,
        }
    }

    /// The orders of its functions, ascending.
    pub fn orders(self, highest: usize) -> std::ops::RangeInclusive<i32> {
        let m = highest as i32;
        match self {
            Self::Full => -m..=m,
            Self::Even => 0..=m,
            Self::Odd => 1..=m,
        }
    }

    pub fn len(self, highest: usize) -> usize {
        match self {
            Self::Full => 2 * highest + 1,
            Self::Even => highest + 1,
            Self::Odd => highest,
        }
    }

    /// Place of an order among its functions.
    pub fn position(self, order: i32, highest: usize) -> Option<usize> {
        let first = *self.orders(highest).start();
        (order >= first && order <= highest as i32).then(|| (order - first) as usize)
    }

    /// Part of the plane wave e_order in a function of this space: where it stands, and by what factor.
    pub fn plane_wave(self, order: i32, highest: usize) -> Option<(usize, f64)> {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        match self {
            Self::Full => self.position(order, highest).map(|p| (p, 1.0)),
            Self::Even if order == 0 => Some((0, 1.0)),
            Self::Even => self.position(order.abs(), highest).map(|p| (p, half)),
            Self::Odd => self
                .position(order.abs(), highest)
                .map(|p| (p, if order < 0 { -half } else { half })),
        }
    }

    /// Multiplication by an even function with Fourier coefficients `f` (orders 0..=2 highest).
    pub fn toeplitz<T: Scalar>(self, f: &[T], highest: usize) -> Mat<T> {
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
    pub fn divergence(&self) -> f64 {
        self.k[self.component]
    }

    /// Entry of the curl, that maps this row to Hz: -ky for Ex, kx for Ey.
    pub fn curl(&self) -> f64 {
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
    pub fn len(&self) -> usize {
        self.list.len()
    }
}

/// The transverse field of a lattice in one symmetry.
///
/// Ex is in the space `x` times `y`, Ey in their derived spaces, Ez in `x` derived times `y`.
#[derive(Clone)]
pub(super) struct FieldBasis {
    pub highest: usize,
    pub x: Space,
    pub y: Space,
    pub rows: Rows,
}

impl FieldBasis {
    /// `k` is the wave vector of the zero order over k0, `step` the wavelength over the pitch. The k of
    /// an axis in an even or odd space is zero.
    pub fn new(highest: usize, x: Space, y: Space, k: [f64; 2], step: f64) -> Self {
        let spaces = [(x, y), (x.derived(), y.derived()), (x.derived(), y)];
        let place = |(sx, sy): (Space, Space), m: i32, n: i32| -> Option<usize> {
            Some(sx.position(m, highest)? * sy.len(highest) + sy.position(n, highest)?)
        };
        let rows_of = |(sx, sy): (Space, Space)| sx.len(highest) * sy.len(highest);
        let rows_x = rows_of(spaces[0]);
        let mut rows = Vec::with_capacity(rows_x + rows_of(spaces[1]));
        for component in [0, 1] {
            let (sx, sy) = spaces[component];
            for m in sx.orders(highest) {
                for n in sy.orders(highest) {
                    let partner = place(spaces[1 - component], m, n);
                    rows.push(FieldRow {
                        component,
                        k: [k[0] + f64::from(m) * step, k[1] + f64::from(n) * step],
                        partner: partner.map(|p| if component == 0 { rows_x + p } else { p }),
                        z: place(spaces[2], m, n),
                    });
                }
            }
        }
        Self {
            highest,
            x,
            y,
            rows: Rows {
                list: rows,
                of_x: rows_x,
                of_z: rows_of(spaces[2]),
            },
        }
    }

    /// Spaces of a component along x and y.
    fn spaces(&self, component: usize) -> (Space, Space) {
        match component {
            0 => (self.x, self.y),
            _ => (self.x.derived(), self.y.derived()),
        }
    }

    /// Row and factor of the plane wave of order (m, n) in a component.
    pub fn plane_wave(&self, component: usize, m: i32, n: i32) -> Option<(usize, f64)> {
        let (sx, sy) = self.spaces(component);
        let (i, a) = sx.plane_wave(m, self.highest)?;
        let (j, b) = sy.plane_wave(n, self.highest)?;
        Some((component * self.rows.of_x + i * sy.len(self.highest) + j, a * b))
    }

    /// The plane-wave amplitudes of order (m, n) of the field in column `column` of `field`.
    pub fn amplitude(&self, field: &Mat<Complex64>, column: usize, m: i32, n: i32) -> [Complex64; 2] {
        [0, 1].map(|component| {
            self.plane_wave(component, m, n)
                .map_or(Complex64::ZERO, |(row, factor)| field[(row, column)] * factor)
        })
    }
}
