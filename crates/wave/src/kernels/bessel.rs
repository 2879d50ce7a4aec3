//! Bessel functions J0 and J1 from a table, for arguments up to a few hundred, and the transform of a disc.

/// Spacing of the table. Cubic Hermite interpolation then errs by step^4 / 384 = 1e-9.
const STEP: f64 = 0.025;

/// A table of J0 and J1.
#[derive(Clone, Debug)]
pub struct Bessel {
    /// J0 and J1 at multiples of `STEP`.
    table: Vec<(f64, f64)>,
}

impl Bessel {
    /// A table for arguments from zero to `largest`.
    ///
    /// The values are Bessel's integrals by the trapezoidal rule, which for a periodic integrand is exact
    /// once the number of points exceeds the argument by a few tens.
    pub fn up_to(largest: f64) -> Self {
        let count = (largest / STEP).ceil() as usize + 2;
        let table = (0..count).map(|i| integrals(i as f64 * STEP)).collect();
        Self { table }
    }

    /// J0 and J1 at `x` >= 0. Beyond the table, its end.
    pub fn j0_j1(&self, x: f64) -> (f64, f64) {
        let at = (x / STEP).min((self.table.len() - 2) as f64);
        let i = at as usize;
        let (t, x0) = (at - i as f64, i as f64 * STEP);
        let (a, b) = (self.table[i], self.table[i + 1]);
        // J0' = -J1, J1' = J0 - J1 / x
        let slope1 = |j: (f64, f64), x: f64| if x == 0.0 { 0.5 } else { j.0 - j.1 / x };
        (
            hermite(t, a.0, b.0, -a.1, -b.1),
            hermite(t, a.1, b.1, slope1(a, x0), slope1(b, x0 + STEP)),
        )
    }
}

fn hermite(t: f64, a: f64, b: f64, slope_a: f64, slope_b: f64) -> f64 {
    let (m, n) = (slope_a * STEP, slope_b * STEP);
    let (c2, c3) = (3.0 * (b - a) - 2.0 * m - n, 2.0 * (a - b) + m + n);
    a + t * (m + t * (c2 + t * c3))
}

/// J_n(x) is the mean over half a turn of cos(n a - x sin a).
fn integrals(x: f64) -> (f64, f64) {
    let points = 30 + (0.6 * x) as usize;
    let (mut j0, mut j1) = (0.0, 0.0);
    for i in 0..points {
        let angle = std::f64::consts::PI * (i as f64 + 0.5) / points as f64;
        let path = x * angle.sin();
        j0 += path.cos();
        j1 += (angle - path).cos();
    }
    (j0 / points as f64, j1 / points as f64)
}

/// 2 J1(q) / q, the transform of a uniform disc of radius one, by its power series. Zero beyond q = 20, where it is
/// below 0.02 and terms of the series would cancel: light of extended sources has no such frequencies.
pub fn jinc(q: f64) -> f64 {
    const END: f64 = 20.0;
    const TERMS: u32 = 60;
    // Terms fall faster than a geometric series once they are this small.
    const LAST_TERM: f64 = 1e-15;
    if q > END {
        return 0.0;
    }
    let x = -0.25 * q * q;
    let (mut term, mut sum) = (1.0, 1.0);
    for k in 1..TERMS {
        term *= x / (f64::from(k) * (f64::from(k) + 1.0));
        sum += term;
        if term.abs() < LAST_TERM {
            break;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Error of the table's interpolation, `STEP`, twice.
    const TABLE: f64 = 2e-9;

    /// Abramowitz and Stegun, tables 9.1 and 9.2, and zeros of J0 and J1.
    #[test]
    fn known_values() {
        let bessel = Bessel::up_to(400.0);
        for (x, j0, j1) in [
            (0.0, 1.0, 0.0),
            (1.0, 0.765_197_686_557_966_6, 0.440_050_585_744_933_5),
            (2.404_825_557_695_773, 0.0, 0.519_147_497_289_466_7),
            (10.0, -0.245_935_764_451_348_3, 0.043_472_746_168_861_44),
            (100.0, 0.019_985_850_304_223_12, -0.077_145_352_014_112_16),
        ] {
            let (a, b) = bessel.j0_j1(x);
            assert!((a - j0).abs() < TABLE && (b - j1).abs() < TABLE, "{x}: {a} {b}");
        }
    }

    /// The recurrence J0' = -J1 by differences, at arguments between the table's.
    #[test]
    fn consistent_to_the_end() {
        let bessel = Bessel::up_to(400.0);
        let h = 1e-3;
        // Third order over the step, and the table's error over it.
        const DIFFERENCE: f64 = 1e-5;
        for x in [17.013, 211.707, 399.1] {
            let slope = (bessel.j0_j1(x + h).0 - bessel.j0_j1(x - h).0) / (2.0 * h);
            assert!((slope + bessel.j0_j1(x).1).abs() < DIFFERENCE, "{x}");
        }
    }

    /// The series and the table, one against the other, to the end of both.
    #[test]
    fn a_disc_blurs_as_j1_says() {
        /// Tolerance for cancelled terms: at q = 20 the largest term of the series is 2e6.
        const CANCELLED: f64 = 1e-8;
        let bessel = Bessel::up_to(20.0);
        for q in [0.3, 1.0, 2.0, 3.831_705_970_2, 7.7, 19.9] {
            assert!((jinc(q) - 2.0 * bessel.j0_j1(q).1 / q).abs() < CANCELLED, "{q}");
        }
        assert_eq!(jinc(0.0), 1.0);
    }
}
