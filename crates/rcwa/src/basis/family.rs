//! Functions of the cell that a component of the field is made of.

use std::f64::consts::FRAC_1_SQRT_2;

use super::Space;

/// Plane waves of the lattice, or those combinations of them that have a symmetry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Family {
    /// Products of functions of x and of y.
    Product(Space, Space),
    /// (e_k + e_-k) / sqrt 2, and one: half a turn leaves them alike. For waves along the normal.
    Alike,
    /// (e_k - e_-k) / sqrt 2: half a turn reverses them.
    Reversed,
}

impl Family {
    /// Families of Ex, Ey and Ez for this one of Ex.
    pub(crate) fn of_components(self) -> [Self; 3] {
        match self {
            Self::Product(x, y) => {
                [(x, y), (x.derived(), y.derived()), (x.derived(), y)].map(|(x, y)| Self::Product(x, y))
            }
            Self::Alike => [Self::Alike, Self::Alike, Self::Reversed],
            Self::Reversed => [Self::Reversed, Self::Reversed, Self::Alike],
        }
    }

    /// The orders of its functions, ascending along x, then along y.
    pub(crate) fn orders(self, highest: usize) -> Vec<[i32; 2]> {
        let last = highest as i32;
        match self {
            Self::Product(x, y) => {
                let of_row = |m: i32| y.orders(highest).map(move |n| [m, n]);
                x.orders(highest).flat_map(of_row).collect()
            }
            Self::Alike | Self::Reversed => {
                let first = i32::from(self == Self::Reversed);
                let axis = (first..=last).map(|n| [0, n]);
                axis.chain((1..=last).flat_map(|m| (-last..=last).map(move |n| [m, n])))
                    .collect()
            }
        }
    }

    /// Place of an order among its functions.
    pub(crate) fn position(self, [m, n]: [i32; 2], highest: usize) -> Option<usize> {
        let last = highest as i32;
        match self {
            Self::Product(x, y) => Some(x.position(m, highest)? * y.len(highest) + y.position(n, highest)?),
            Self::Alike | Self::Reversed => {
                let first = i32::from(self == Self::Reversed);
                let at = match m {
                    0 if n >= first && n <= last => n - first,
                    1.. if m <= last && n.abs() <= last => last + 1 - first + (m - 1) * (2 * last + 1) + n + last,
                    _ => return None,
                };
                Some(at as usize)
            }
        }
    }

    /// The order of the function that the plane wave of an order is part of, and the factor of that part.
    pub(crate) fn function(self, [m, n]: [i32; 2]) -> ([i32; 2], f64) {
        match self {
            Self::Product(x, y) => {
                let ((m, a), (n, b)) = (x.function(m), y.function(n));
                ([m, n], a * b)
            }
            Self::Alike | Self::Reversed => {
                let upper = m > 0 || (m == 0 && n >= 0);
                let factor = match self {
                    Self::Alike if m == 0 && n == 0 => 1.0,
                    Self::Reversed if !upper => -FRAC_1_SQRT_2,
                    _ => FRAC_1_SQRT_2,
                };
                (if upper { [m, n] } else { [-m, -n] }, factor)
            }
        }
    }

    /// The waves that a function joins to that of its own order, by the signs of both axes, and the sign of each.
    pub(crate) fn images(self) -> Vec<([i32; 2], f64)> {
        let along = |space: Space| -> Vec<(i32, f64)> {
            match space {
                Space::Full => vec![(1, 1.0)],
                Space::Even => vec![(1, 1.0), (-1, 1.0)],
                Space::Odd => vec![(1, 1.0), (-1, -1.0)],
            }
        };
        match self {
            Self::Product(x, y) => along(x)
                .into_iter()
                .flat_map(|(p, a)| along(y).into_iter().map(move |(q, b)| ([p, q], a * b)))
                .collect(),
            Self::Alike => vec![([1, 1], 1.0), ([-1, -1], 1.0)],
            Self::Reversed => vec![([1, 1], 1.0), ([-1, -1], -1.0)],
        }
    }
}
