//! Fourier coefficients of a pillar, and of the direction of its normal over it.
//!
//! The normal n enters by the matrix P = n n^T = (1 + [[c, s], [s, -c]]) / 2, where c and s are cosine and sine of twice its
//! angle. They are given at the rim, and continued over the pillar by functions that are as smooth as may be there; outside
//! of it they are not needed (see `normal_vector`).

use std::f64::consts::{PI, TAU};

use crate::outline::SlantedForm;
use crate::stack::CellLattice;

/// Fourier coefficients of a function of the cell for orders of -highest..=highest along each axis; those of opposite order
/// are equal, as the function is alike after half a turn.
pub(super) struct Coefficients {
    highest: [i32; 2],
    values: Vec<f64>,
}

impl Coefficients {
    fn new(highest: [usize; 2]) -> Self {
        let [x, y] = highest.map(|highest| 2 * highest + 1);
        Self {
            highest: highest.map(|highest| highest as i32),
            values: vec![0.0; x * y],
        }
    }

    fn place(&self, m: i32, n: i32) -> usize {
        let [x, y] = self.highest;
        ((m + x) * (2 * y + 1) + n + y) as usize
    }

    pub(crate) fn at(&self, m: i32, n: i32) -> f64 {
        self.values[self.place(m, n)]
    }
}

/// Coefficients of a pillar and of the normal over it.
pub(super) struct Moments {
    /// Coefficients of the function that is one in the pillar and zero outside.
    pub pillar: Coefficients,
    /// Coefficients of c in the pillar, zero outside.
    pub cosine: Coefficients,
    /// Coefficients of s in the pillar, zero outside.
    pub sine: Coefficients,
    /// Coefficients of c c + s s in the pillar, zero outside.
    pub square: Coefficients,
}

impl Moments {
    /// Moments for orders up to `highest` along each axis, which are equal on a square lattice. Staggered rows have
    /// circles.
    pub(crate) fn of(form: &SlantedForm, pitch_nm: f64, lattice: CellLattice, highest: [usize; 2]) -> Self {
        match (*form, lattice) {
            (SlantedForm::Circle { diameter_nm }, CellLattice::Square) => {
                Self::of_circle(diameter_nm / pitch_nm, highest[0])
            }
            (SlantedForm::Circle { diameter_nm }, CellLattice::Staggered { row_nm }) => {
                Self::of_staggered_circle(diameter_nm / pitch_nm, row_nm / pitch_nm, highest)
            }
            (SlantedForm::Rectangle { halves_nm, rotation }, _) => {
                Self::of_rectangle(halves_nm.map(|half| half / pitch_nm), rotation, highest[0])
            }
        }
    }

    /// Moments of a circle whose diameter is this share of the pitch. The normal is the radius; c and s are continued
    /// by harmonic functions, r^2 cos 2a and r^2 sin 2a over the radius squared; the sum of their squares is r^4 over
    /// R^4.
    fn of_circle(duty: f64, highest: usize) -> Self {
        let [mut pillar, mut cosine, mut sine, mut fourth] = [(); 4].map(|()| Coefficients::new([highest; 2]));
        let area = PI * duty * duty / 4.0;
        let last = highest as i32;
        for m in 0..=last {
            for n in 0..=m {
                let square = f64::from(m * m + n * n);
                let [disc, twice, r4] = disc_integrals(area, PI * duty * square.sqrt(), square);
                let (c, s) = (twice * f64::from(m * m - n * n), twice * f64::from(2 * m * n));
                for (p, q, turn) in [(m, n, 1.0), (n, m, -1.0)] {
                    for (x, y, mirror) in [(p, q, 1.0), (-p, q, -1.0), (p, -q, -1.0), (-p, -q, 1.0)] {
                        let place = pillar.place(x, y);
                        pillar.values[place] = disc;
                        fourth.values[place] = r4;
                        cosine.values[place] = turn * c;
                        sine.values[place] = mirror * s;
                    }
                }
            }
        }
        Self {
            pillar,
            cosine,
            sine,
            square: fourth,
        }
    }

    /// Variant of [`Moments::of_circle`] for two circles in a rectangle of one pitch by two rows, each row this share
    /// of the pitch: one in the middle, one at the corners. Where the sum of both orders is odd they cancel, and all is
    /// zero.
    fn of_staggered_circle(duty: f64, row: f64, highest: [usize; 2]) -> Self {
        let [mut pillar, mut cosine, mut sine, mut fourth] = [(); 4].map(|()| Coefficients::new(highest));
        for m in 0..=highest[0] as i32 {
            for n in (m % 2..=highest[1] as i32).step_by(2) {
                let [disc, c, s, r4] = disc_moments(duty, row, [f64::from(m), f64::from(n) / (2.0 * row)]);
                for (p, q, mirror) in [(m, n, 1.0), (-m, n, -1.0), (m, -n, -1.0), (-m, -n, 1.0)] {
                    let place = pillar.place(p, q);
                    pillar.values[place] = disc;
                    fourth.values[place] = r4;
                    cosine.values[place] = c;
                    sine.values[place] = mirror * s;
                }
            }
        }
        Self {
            pillar,
            cosine,
            sine,
            square: fourth,
        }
    }

    /// A rectangle with these half-widths over the pitch, turned. Its normals are turned by that angle or a quarter more, so
    /// that c and s are cosine and sine of twice the angle times one function, 1 on the first pair of sides and -1 on the
    /// second (see [`Interior`]).
    fn of_rectangle(halves: [f64; 2], rotation: f64, highest: usize) -> Self {
        let [mut pillar, mut cosine, mut sine, mut square] = [(); 4].map(|()| Coefficients::new([highest; 2]));
        let ((sin, cos), (sin2, cos2)) = (rotation.sin_cos(), (2.0 * rotation).sin_cos());
        let interior = Interior::of(halves);
        let last = highest as i32;
        for m in 0..=last {
            for n in -last..=last {
                let k = [m, n].map(|order| TAU * f64::from(order));
                let k = [k[0] * cos + k[1] * sin, k[1] * cos - k[0] * sin];
                let area = slab(k[0], halves[0]) * slab(k[1], halves[1]);
                let [v, v_squared] = interior.transform(k);
                for place in [pillar.place(m, n), pillar.place(-m, -n)] {
                    pillar.values[place] = area;
                    square.values[place] = v_squared;
                    cosine.values[place] = v * cos2;
                    sine.values[place] = v * sin2;
                }
            }
        }
        Self {
            pillar,
            cosine,
            sine,
            square,
        }
    }
}

/// Moments of a circle of which there is one on a row of this share of the pitch, its diameter `duty` of it: of the pillar, of c and
/// s, and of c c + s s in it, at a wave vector times the pitch, over one turn.
pub(crate) fn disc_moments(duty: f64, row: f64, [x, y]: [f64; 2]) -> [f64; 4] {
    let square = x * x + y * y;
    let [disc, twice, r4] = disc_integrals(PI * duty * duty / (4.0 * row), PI * duty * square.sqrt(), square);
    [disc, twice * (x * x - y * y), twice * 2.0 * x * y, r4]
}

/// Integrals over a disc with this share of the cell, with g = k R for the wave vector k and the radius R, and the square of k in
/// the units that c and s count in: of one, 2 pi R^2 J1(g) / g; of (r / R)^2 times cosine or sine of twice the angle, with
/// twice the angle of k, -2 pi R^2 J3(g) / g, here over that square; of (r / R)^4,
/// 2 pi R^2 (J1(g) / g - 4 J2(g) / g^2 + 8 J3(g) / g^3).
fn disc_integrals(filling: f64, g: f64, square: f64) -> [f64; 3] {
    if square == 0.0 {
        return [filling, 0.0, filling / 3.0];
    }
    let [first, second, third] = [libm::j1(g), libm::jn(2, g), libm::jn(3, g)];
    [
        2.0 * filling * first / g,
        -2.0 * filling * third / g / square,
        2.0 * filling * (first - (4.0 * second - 8.0 * third / g) / g) / g,
    ]
}

/// Integral of cos(k x) over |x| < half.
fn slab(k: f64, half: f64) -> f64 {
    let x = k * half;
    2.0 * half * if x == 0.0 { 1.0 } else { x.sin() / x }
}

/// Rate at which the direction of the normal turns from one side of a rectangle to the next: (b^q - a^q) / (b^q + a^q)
/// at distances a and b from the nearest sides of the first pair and the second. Of 1.5 to 4 (and of a harmonic
/// function) this one needs the fewest orders: a slower turn is right at too few places of the sides, a faster one
/// needs more orders itself.
const TURN: f64 = 2.5;

/// Points along half an edge by which the function is integrated; the step shrinks to nothing at the middle and at the sides, so
/// that the rule of rectangles is as good as one of high order (see the tests).
const POINTS: usize = 48;

/// The function of [`Moments::of_rectangle`] over a quarter of the rectangle; all four are alike.
struct Interior {
    /// Places along each half edge, over the pitch.
    places: [Vec<f64>; 2],
    /// Values times weights, and their squares times weights, the second place running fastest.
    values: [Vec<f64>; 2],
}

impl Interior {
    fn of(halves: [f64; 2]) -> Self {
        let nodes: Vec<[f64; 2]> = (0..POINTS)
            .map(|i| {
                let t = (i as f64 + 0.5) / POINTS as f64;
                let (sin, cos) = (TAU * t).sin_cos();
                [t - sin / TAU, (1.0 - cos) / POINTS as f64]
            })
            .collect();
        let mut values = [(); 2].map(|()| Vec::with_capacity(POINTS * POINTS));
        for [x, weight_x] in &nodes {
            for [y, weight_y] in &nodes {
                let [a, b] = [(1.0 - x) * halves[0], (1.0 - y) * halves[1]].map(|distance| distance.powf(TURN));
                // Each quarter has as much of a wave that half a turn leaves alike.
                let weight = 4.0 * halves[0] * weight_x * halves[1] * weight_y;
                let turned = (b - a) / (b + a);
                values[0].push(weight * turned);
                values[1].push(weight * turned * turned);
            }
        }
        Self {
            places: halves.map(|half| nodes.iter().map(|[t, _]| t * half).collect()),
            values,
        }
    }

    /// Transforms of the function and of its square at a wave vector along the sides of the rectangle.
    fn transform(&self, k: [f64; 2]) -> [f64; 2] {
        let [x, y] = [0, 1]
            .map(|axis: usize| -> Vec<f64> { self.places[axis].iter().map(|place| (k[axis] * place).cos()).collect() });
        [0, 1].map(|which: usize| {
            let rows = self.values[which].chunks_exact(POINTS).zip(&x);
            rows.map(|(row, x)| x * row.iter().zip(&y).map(|(v, y)| v * y).sum::<f64>())
                .sum()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums of a few products of numbers of size one.
    const ROUNDING: f64 = 1e-13;

    /// The rule of rectangles along the radius, 400 points; angles are exact.
    const SUMMED: f64 = 1e-5;

    /// The four moments of a disc in a cell of unit area, by sums over a fine polar grid; the wave vector times the pitch,
    /// over one turn.
    fn disc_sums(duty: f64, [x, y]: [f64; 2]) -> [f64; 4] {
        let mut sums = [0.0; 4];
        for i in 0..400 {
            let r = (f64::from(i) + 0.5) / 400.0;
            for j in 0..200 {
                let angle = TAU * f64::from(j) / 200.0;
                let (sin, cos) = angle.sin_cos();
                let wave = (TAU * 0.5 * duty * r * (x * cos + y * sin)).cos();
                let area = 0.25 * duty * duty * r / 400.0 * TAU / 200.0;
                let turn = r * r;
                let values = [1.0, turn * (2.0 * angle).cos(), turn * (2.0 * angle).sin(), turn * turn];
                for (sum, value) in sums.iter_mut().zip(values) {
                    *sum += wave * area * value;
                }
            }
        }
        sums
    }

    fn assert_has(moments: &Moments, m: i32, n: i32, sums: [f64; 4]) {
        let found = [&moments.pillar, &moments.cosine, &moments.sine, &moments.square].map(|c| c.at(m, n));
        for (a, b) in found.iter().zip(sums) {
            assert!((a - b).abs() < SUMMED, "{m} {n}: {found:?} {sums:?}");
        }
    }

    #[test]
    fn a_circle_has_the_moments_of_its_disc() {
        let duty = 0.6;
        let moments = Moments::of_circle(duty, 4);
        for (m, n) in [(0, 0), (1, 0), (2, 3), (-4, 1)] {
            assert_has(&moments, m, n, disc_sums(duty, [m, n].map(f64::from)));
        }
    }

    /// The cell of staggered rows holds one disc; two in a rectangle have the same coefficients.
    #[test]
    fn a_staggered_circle_has_the_moments_of_its_disc() {
        let (duty, row) = (0.7, 0.9);
        let moments = Moments::of_staggered_circle(duty, row, [3, 5]);
        for (m, n) in [(0, 0), (1, 1), (2, -4), (-3, 5), (0, 2)] {
            let sums = disc_sums(duty, [f64::from(m), f64::from(n) / (2.0 * row)]);
            assert_has(&moments, m, n, sums.map(|s| s / row));
        }
        assert_eq!(moments.pillar.at(1, 2), 0.0);
    }

    /// Half a square has its normal along one axis, half along the other: there is no mean. At the wave vector of one side the
    /// integral is that of twice as many points.
    #[test]
    fn the_interior_of_a_rectangle_is_integrated() {
        // Coefficients count against the area of the rectangle, 0.15 here.
        const INTEGRATED: f64 = 1e-5;
        let square = Interior::of([0.3, 0.3]);
        assert!(square.transform([0.0, 0.0])[0].abs() < ROUNDING);
        let [one, other] = [[8.0, 3.0], [3.0, 8.0]].map(|k| square.transform(k));
        assert!((one[0] + other[0]).abs() < ROUNDING && (one[1] - other[1]).abs() < ROUNDING);
        let halves = [0.15, 0.25];
        let rectangle = Interior::of(halves);
        for k in [[0.0, 0.0], [20.0, 0.0], [9.0, 60.0], [100.0, 100.0]] {
            let fine = 1000;
            let mut sums = [0.0; 2];
            for i in 0..fine {
                for j in 0..fine {
                    let [x, y] = [i, j].map(|i| (f64::from(i) + 0.5) / f64::from(fine));
                    let [a, b] = [(1.0 - x) * halves[0], (1.0 - y) * halves[1]].map(|distance| distance.powf(TURN));
                    let turned = (b - a) / (b + a);
                    let wave = (k[0] * x * halves[0]).cos() * (k[1] * y * halves[1]).cos();
                    sums[0] += turned * wave;
                    sums[1] += turned * turned * wave;
                }
            }
            let found = rectangle.transform(k);
            for (found, sum) in found.into_iter().zip(sums) {
                let sum = sum * 4.0 * halves[0] * halves[1] / f64::from(fine * fine);
                assert!((found - sum).abs() < INTEGRATED, "{k:?}: {found} {sum}");
            }
        }
    }
}
