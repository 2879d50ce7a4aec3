//! The transmission of pillars as a smooth function of their width.

use metalith_core::{Error, Result};
use num_complex::Complex64;

/// Complex transmission over width: cubics between widths that were solved, each with the slopes of the parabolas through
/// three neighbouring widths at its ends. The transmission and its slope are continuous.
#[derive(Clone, Debug)]
pub struct TransmissionCurve {
    widths_nm: Vec<f64>,
    t: Vec<Complex64>,
    slopes: Vec<Complex64>,
}

impl TransmissionCurve {
    /// The curve through the transmissions `t` of pillars of these widths (nm), which rise.
    ///
    /// # Errors
    /// If there are fewer than two widths, they do not rise, a number is not finite, or there is not one transmission for each.
    pub fn new(widths_nm: Vec<f64>, t: Vec<Complex64>) -> Result<Self> {
        let rise = widths_nm.windows(2).all(|pair| pair[0] < pair[1]);
        let finite = widths_nm.iter().all(|w| w.is_finite()) && t.iter().all(|t| t.re.is_finite() && t.im.is_finite());
        if widths_nm.len() < 2 || t.len() != widths_nm.len() || !rise || !finite {
            return Err(Error::refused(
                "cell/no-curve",
                format!("{} widths with {} transmissions are no curve", widths_nm.len(), t.len()),
                "give two or more rising widths (nm), and one finite transmission for each",
            ));
        }
        let slopes = slopes(&widths_nm, &t);
        Ok(Self { widths_nm, t, slopes })
    }

    /// Least and greatest width (nm).
    pub fn range_nm(&self) -> [f64; 2] {
        [self.widths_nm[0], self.widths_nm[self.widths_nm.len() - 1]]
    }

    /// Transmission of a width (nm), and its derivative (1/nm); `None` outside of the range.
    pub fn at(&self, width_nm: f64) -> Option<(Complex64, Complex64)> {
        let [least, greatest] = self.range_nm();
        if !(least..=greatest).contains(&width_nm) {
            return None;
        }
        let above = self.widths_nm.partition_point(|w| *w <= width_nm);
        let i = above.clamp(1, self.widths_nm.len() - 1) - 1;
        let h = self.widths_nm[i + 1] - self.widths_nm[i];
        let u = (width_nm - self.widths_nm[i]) / h;
        let (t, s) = (&self.t[i..], &self.slopes[i..]);
        let rest = 1.0 - u;
        let value =
            t[0] * ((1.0 + 2.0 * u) * rest * rest) + t[1] * (u * u * (3.0 - 2.0 * u)) + s[0] * (h * u * rest * rest)
                - s[1] * (h * u * u * rest);
        let slope =
            (t[1] - t[0]) * (6.0 * u * rest / h) + s[0] * (rest * (1.0 - 3.0 * u)) + s[1] * (u * (3.0 * u - 2.0));
        Some((value, slope))
    }
}

/// Slopes of the parabola through each value and its neighbours; of the first and the last three at the ends.
fn slopes(x: &[f64], y: &[Complex64]) -> Vec<Complex64> {
    let n = x.len();
    let rise = |i: usize| (y[i + 1] - y[i]) / (x[i + 1] - x[i]);
    if n == 2 {
        return vec![rise(0); 2];
    }
    let slope = |i: usize| {
        let k = i.clamp(1, n - 2);
        let (before, after) = (rise(k - 1), rise(k));
        let bend = (after - before) / (x[k + 1] - x[k - 1]);
        before + bend * (2.0 * x[i] - x[k - 1] - x[k])
    };
    (0..n).map(slope).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding of cubics of numbers of size one.
    const ROUNDING: f64 = 1e-12;

    #[test]
    fn parabolas_are_reproduced_with_their_slopes() {
        let of = |x: f64| Complex64::new(0.3 + 0.2 * x - 0.01 * x * x, 0.5 - 0.03 * x * x);
        let widths = vec![1.0, 2.0, 4.0, 5.0, 5.5];
        let curve = TransmissionCurve::new(widths.clone(), widths.iter().map(|x| of(*x)).collect()).unwrap();
        for x in [1.0, 1.3, 2.0, 3.9, 5.2, 5.5] {
            let (t, slope) = curve.at(x).unwrap();
            assert!((t - of(x)).norm() < ROUNDING, "{x}");
            assert!(
                (slope - Complex64::new(0.2 - 0.02 * x, -0.06 * x)).norm() < ROUNDING,
                "{x}"
            );
        }
        assert!(curve.at(0.99).is_none() && curve.at(5.51).is_none() && curve.at(f64::NAN).is_none());
        assert!(TransmissionCurve::new(vec![2.0, 1.0], vec![Complex64::ONE; 2]).is_err());
    }
}
