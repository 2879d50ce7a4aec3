//! Zernike polynomials over the unit disc.

/// One polynomial: its radial order, and its azimuthal frequency, negative for sines.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Zernike {
    pub n: u32,
    pub m: i32,
}

impl Zernike {
    /// Number `j`, from one, in the order of Noll (J. Opt. Soc. Am. 66, 207 (1976)): "Zernike standard" in optical design
    /// programs.
    pub fn noll(j: u32) -> Self {
        let mut n = 0;
        while (n + 1) * (n + 2) / 2 < j {
            n += 1;
        }
        // Within an order, frequencies rise from n's parity, each but zero twice; even j is a cosine.
        let place = j - n * (n + 1) / 2 - 1;
        let m = if n.is_multiple_of(2) {
            place.div_ceil(2) * 2
        } else {
            (place / 2) * 2 + 1
        };
        let m = if j.is_multiple_of(2) { m as i32 } else { -(m as i32) };
        Self { n, m }
    }

    /// Number of polynomials of the University of Arizona's set.
    pub const FRINGE_SET: u32 = 37;

    /// Number `j`, from one, of the set of the University of Arizona: "Zernike fringe". The last, 37, is the spherical
    /// aberration of twelfth order and not what would follow in the order of the others.
    ///
    /// # Panics
    /// If `j` is not from 1 to [`Zernike::FRINGE_SET`]: the set has no other.
    pub fn fringe(j: u32) -> Self {
        assert!(
            (1..=Self::FRINGE_SET).contains(&j),
            "no fringe polynomial has the number {j}"
        );
        if j == Self::FRINGE_SET {
            return Self { n: 12, m: 0 };
        }
        // Groups of equal n + |m| = 2 (d - 1) end at squares; within one, frequencies fall, cosines first.
        let mut d = 1;
        while d * d < j {
            d += 1;
        }
        let place = j - (d - 1) * (d - 1) - 1;
        let m = d - 1 - place / 2;
        let signed = if place.is_multiple_of(2) { m as i32 } else { -(m as i32) };
        Self {
            n: 2 * (d - 1) - m,
            m: signed,
        }
    }

    /// Value at a place of the unit disc; the largest value is one.
    pub fn value(self, x: f64, y: f64) -> f64 {
        let (n, a) = (self.n, self.m.unsigned_abs());
        let r = x.hypot(y);
        let factorial = |k: u32| (1..=k).map(f64::from).product::<f64>();
        let radial: f64 = (0..=(n - a) / 2)
            .map(|k| {
                let sign = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
                sign * factorial(n - k) / (factorial(k) * factorial((n + a) / 2 - k) * factorial((n - a) / 2 - k))
                    * r.powi((n - 2 * k) as i32)
            })
            .sum();
        let angle = f64::from(a) * y.atan2(x);
        match self.m {
            0 => radial,
            m if m > 0 => radial * angle.cos(),
            _ => radial * angle.sin(),
        }
    }

    /// Factor that brings the rms of [`Zernike::value`] over the disc to one.
    pub fn norm(self) -> f64 {
        let norm = f64::from(self.n + 1).sqrt();
        if self.m == 0 { norm } else { norm * 2f64.sqrt() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_are_orthonormal_over_the_disc() {
        let grid = 200;
        let mut products = [[0.0; 12]; 12];
        let mut count = 0.0;
        for i in 0..grid * grid {
            let at = |k: i32| (f64::from(k) + 0.5) / f64::from(grid) * 2.0 - 1.0;
            let (x, y) = (at(i % grid), at(i / grid));
            if x * x + y * y > 1.0 {
                continue;
            }
            count += 1.0;
            let one = |j: u32| Zernike::noll(j).norm() * Zernike::noll(j).value(x, y);
            let z: Vec<f64> = (1..=12).map(one).collect();
            for (a, row) in products.iter_mut().enumerate() {
                for (b, p) in row.iter_mut().enumerate() {
                    *p += z[a] * z[b];
                }
            }
        }
        // Midpoints of 200 x 200 squares cut the rim of the disc roughly.
        const RIM: f64 = 0.02;
        for (a, row) in products.iter().enumerate() {
            for (b, p) in row.iter().enumerate() {
                let want = f64::from(u8::from(a == b));
                assert!((p / count - want).abs() < RIM, "{} {}: {}", a + 1, b + 1, p / count);
            }
        }
    }

    /// The set ends with the polynomial that is printed as its last, behind all of n + |m| up to 10.
    #[test]
    fn the_last_of_the_fringe_set_is_the_printed_polynomial() {
        // Terms up to 3150 in double precision.
        const ROUNDING: f64 = 1e-11;
        let printed = |r: f64| {
            let s = r * r;
            924.0 * s.powi(6) - 2772.0 * s.powi(5) + 3150.0 * s.powi(4) - 1680.0 * s.powi(3) + 420.0 * s.powi(2)
                - 42.0 * s
                + 1.0
        };
        for k in 0..=20 {
            let r = f64::from(k) / 20.0;
            let value = Zernike::fringe(37).value(0.6 * r, -0.8 * r);
            assert!((value - printed(r)).abs() < ROUNDING, "{r}: {value}");
        }
        assert_eq!(Zernike::fringe(36), Zernike { n: 10, m: 0 });
    }

    #[test]
    #[should_panic(expected = "no fringe polynomial has the number 38")]
    fn the_fringe_set_has_no_more() {
        Zernike::fringe(38);
    }

    #[test]
    fn both_orders_begin_as_their_tables_do() {
        let noll = [
            (0, 0),
            (1, 1),
            (1, -1),
            (2, 0),
            (2, -2),
            (2, 2),
            (3, -1),
            (3, 1),
            (3, -3),
            (3, 3),
            (4, 0),
        ];
        let fringe = [
            (0, 0),
            (1, 1),
            (1, -1),
            (2, 0),
            (2, 2),
            (2, -2),
            (3, 1),
            (3, -1),
            (4, 0),
            (3, 3),
            (3, -3),
            (4, 2),
        ];
        for (k, (n, m)) in noll.into_iter().enumerate() {
            assert_eq!(Zernike::noll(k as u32 + 1), Zernike { n, m }, "{}", k + 1);
        }
        for (k, (n, m)) in fringe.into_iter().enumerate() {
            assert_eq!(Zernike::fringe(k as u32 + 1), Zernike { n, m }, "{}", k + 1);
        }
        // Spherical aberration at the middle, the rim and where its slope is zero.
        const ROUNDING: f64 = 1e-12;
        for (r, want) in [(0.0, 1.0), (1.0, 1.0), (0.5_f64.sqrt(), -0.5)] {
            assert!((Zernike::fringe(9).value(r, 0.0) - want).abs() < ROUNDING);
        }
    }
}
