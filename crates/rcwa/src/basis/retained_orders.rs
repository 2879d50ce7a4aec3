//! Choice of the plane waves of a lattice that are retained.

use super::Family;

/// A choice of orders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RetainedOrders {
    /// Orders of a square lattice up to this order along either axis.
    Square(usize),
    /// Orders of a square lattice in a circle, where m^2 + n^2 is at most this: for pillars whose sides face all ways,
    /// which are met by fewer orders than in a square. A quarter of a turn leaves the choice alike.
    Disc(usize),
    /// Orders of staggered rows, by the orders (m, n) of two pillars in a rectangle: those whose sum is even, in a
    /// circle, where 3 m^2 + n^2 is at most this: 4 for the nearest orders of a hexagonal lattice. A sixth of a turn
    /// leaves the choice alike, and what rows are rounded to does not change it.
    Circle(usize),
}

/// m^2 + n^2 of an order.
fn square([m, n]: [i32; 2]) -> usize {
    (m * m + n * n) as usize
}

/// 3 m^2 + n^2 of an order.
fn staggered_square([m, n]: [i32; 2]) -> usize {
    (3 * m * m + n * n) as usize
}

/// The largest bound on a square that no more orders keep than a square lattice has with so many along an axis.
fn largest(along_axis: usize, squares: impl Fn(i32) -> Vec<usize>) -> usize {
    // Circles reach 1.13 times as far as a square of as many orders, those of staggered rows 1.05 times.
    let mut squares = squares((23 * along_axis / 40) as i32 * 2 + 2);
    squares.sort_unstable();
    let beyond = squares[along_axis * along_axis];
    squares[..squares.partition_point(|s| *s < beyond)]
        .last()
        .copied()
        .unwrap_or(0)
}

impl RetainedOrders {
    /// The largest circle of a square lattice with no more orders than are kept with so many along an axis.
    pub(crate) fn disc(along_axis: usize) -> Self {
        let all = |last: i32| {
            let of_row = |m: i32| (-last..=last).map(move |n| square([m, n]));
            (-last..=last).flat_map(of_row).collect()
        };
        Self::Disc(largest(along_axis, all))
    }

    /// The largest circle of staggered rows with no more orders than a square lattice keeps with so many along an axis.
    pub(crate) fn circle(along_axis: usize) -> Self {
        let all = |last: i32| {
            let of_row = |m: i32| (-last..=last).map(move |n| [m, n]);
            let sites = (-last..=last).flat_map(of_row).filter(|[m, n]| (m + n) % 2 == 0);
            sites.map(staggered_square).collect()
        };
        Self::Circle(largest(along_axis, all))
    }

    /// The largest order along both axes.
    pub(crate) fn reach(self) -> [usize; 2] {
        match self {
            Self::Square(highest) => [highest; 2],
            Self::Disc(most) => [most.isqrt(); 2],
            Self::Circle(most) => [(most / 3).isqrt(), most.isqrt()],
        }
    }

    /// True if an order is retained.
    pub(crate) fn has(self, [m, n]: [i32; 2]) -> bool {
        match self {
            Self::Square(highest) => [m, n].iter().all(|order| order.unsigned_abs() as usize <= highest),
            Self::Disc(most) => square([m, n]) <= most,
            Self::Circle(most) => (m + n) % 2 == 0 && staggered_square([m, n]) <= most,
        }
    }

    /// The orders of the functions of a family, ascending along x, then along y.
    pub(crate) fn orders(self, family: Family) -> Vec<[i32; 2]> {
        match self {
            Self::Square(highest) => family.orders(highest),
            Self::Disc(most) | Self::Circle(most) => {
                let mut orders = family.orders(most.isqrt());
                orders.retain(|order| self.has(*order));
                orders
            }
        }
    }

    /// Place of an order among `orders`, those of the family.
    pub(crate) fn position(self, family: Family, orders: &[[i32; 2]], order: [i32; 2]) -> Option<usize> {
        match self {
            Self::Square(highest) => family.position(order, highest),
            Self::Disc(_) | Self::Circle(_) => orders.binary_search(&order).ok(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::Space;

    #[test]
    fn a_sixth_of_a_turn_leaves_the_circle_alike() {
        let all = RetainedOrders::Circle(100).orders(Family::Product(Space::Full, Space::Full));
        assert!(all.contains(&[0, 10]) && all.contains(&[5, 5]));
        for [m, n] in &all {
            // By a sixth of a turn (m, n / sqrt 3) goes to ((m - n) / 2, (3 m + n) / 2 / sqrt 3).
            let turned = [(m - n) / 2, (3 * m + n) / 2];
            assert!(all.contains(&turned), "{m} {n}: {turned:?}");
        }
        let [x, y] = RetainedOrders::Circle(100).reach();
        let most = |axis: usize| all.iter().map(|o| o[axis]).max().unwrap() as usize;
        assert_eq!([most(0), most(1)], [x, y]);
    }

    #[test]
    fn a_circle_has_as_many_orders_as_a_square_or_a_shell_less() {
        for along_axis in [1, 3, 5, 9, 13, 17, 33, 127] {
            let count = |kept: RetainedOrders| kept.orders(Family::Product(Space::Full, Space::Full)).len();
            type Counted = fn(usize) -> RetainedOrders;
            let bounds: [(RetainedOrders, Counted); 2] = [
                (RetainedOrders::disc(along_axis), RetainedOrders::Disc),
                (RetainedOrders::circle(along_axis), RetainedOrders::Circle),
            ];
            for (kept, of) in bounds {
                assert!(count(kept) <= along_axis * along_axis, "{along_axis} {kept:?}");
                let (RetainedOrders::Disc(most) | RetainedOrders::Circle(most)) = kept else {
                    unreachable!()
                };
                let next = (most + 1..).find(|s| count(of(*s)) > count(kept)).unwrap();
                assert!(count(of(next)) > along_axis * along_axis, "{along_axis} {kept:?}");
            }
        }
        assert_eq!(RetainedOrders::circle(3), RetainedOrders::Circle(4));
        assert_eq!(RetainedOrders::disc(3), RetainedOrders::Disc(2));
    }

    #[test]
    fn every_order_has_its_place() {
        for kept in [
            RetainedOrders::Square(3),
            RetainedOrders::Disc(11),
            RetainedOrders::Circle(36),
        ] {
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
