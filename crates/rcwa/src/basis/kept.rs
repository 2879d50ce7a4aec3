//! Which plane waves of a lattice are kept.

use super::Family;

/// A choice of orders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kept {
    /// Of a square lattice, all up to this order along either axis.
    Square(usize),
    /// Of staggered rows, by the orders of two pillars in a rectangle: those whose sum is even, in a circle that reaches so
    /// many times as far as the nearest order of the hexagonal lattice. A sixth of a turn leaves the choice alike, and what
    /// rows are rounded to does not change it.
    Circle(usize),
}

impl Kept {
    /// The largest order along both axes.
    pub fn reach(self) -> [usize; 2] {
        match self {
            Self::Square(highest) => [highest; 2],
            Self::Circle(shells) => [(4 * shells * shells / 3).isqrt(), 2 * shells],
        }
    }

    /// Whether an order is kept.
    pub fn has(self, [m, n]: [i32; 2]) -> bool {
        match self {
            Self::Square(highest) => [m, n].iter().all(|order| order.unsigned_abs() as usize <= highest),
            Self::Circle(shells) => {
                let shells = shells as i32;
                (m + n) % 2 == 0 && 3 * m * m + n * n <= 4 * shells * shells
            }
        }
    }

    /// The orders of the functions of a family, ascending along x, then along y.
    pub fn orders(self, family: Family) -> Vec<[i32; 2]> {
        match self {
            Self::Square(highest) => family.orders(highest),
            Self::Circle(shells) => {
                let mut orders = family.orders(2 * shells);
                orders.retain(|order| self.has(*order));
                orders
            }
        }
    }

    /// Place of an order among `orders`, those of the family.
    pub fn position(self, family: Family, orders: &[[i32; 2]], order: [i32; 2]) -> Option<usize> {
        match self {
            Self::Square(highest) => family.position(order, highest),
            Self::Circle(_) => orders.binary_search(&order).ok(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::Space;

    #[test]
    fn a_sixth_of_a_turn_leaves_the_circle_alike() {
        let all = Kept::Circle(5).orders(Family::Product(Space::Full, Space::Full));
        assert!(all.contains(&[0, 10]) && all.contains(&[5, 5]));
        for [m, n] in &all {
            // By a sixth of a turn (m, n / sqrt 3) goes to ((m - n) / 2, (3 m + n) / 2 / sqrt 3).
            let turned = [(m - n) / 2, (3 * m + n) / 2];
            assert!(all.contains(&turned), "{m} {n}: {turned:?}");
        }
        let [x, y] = Kept::Circle(5).reach();
        let most = |axis: usize| all.iter().map(|o| o[axis]).max().unwrap() as usize;
        assert_eq!([most(0), most(1)], [x, y]);
    }

    #[test]
    fn every_order_has_its_place() {
        for kept in [Kept::Square(3), Kept::Circle(3)] {
            for x in [Space::Full, Space::Even, Space::Odd] {
                for y in [Space::Full, Space::Even, Space::Odd] {
                    let family = Family::Product(x, y);
                    let orders = kept.orders(family);
                    for (place, order) in orders.iter().enumerate() {
                        assert_eq!(kept.position(family, &orders, *order), Some(place));
                    }
                    assert_eq!(kept.position(family, &orders, [9, 9]), None);
                }
            }
        }
    }
}
