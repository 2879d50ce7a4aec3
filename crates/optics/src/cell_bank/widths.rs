//! Tables over the width of a pillar, or over what both edges of rotated rectangles are off by.

use num_complex::Complex64;

/// Distance of the widths of a bank (nm) where transmission is smooth.
pub(super) const STEP_NM: f64 = 1.0;

/// Parts that a step is divided into where it is not: guided-mode resonances are a fraction of a nanometre wide.
const FINE_PARTS: usize = 8;

/// Distance of a width from the cubic through its four neighbours above which transmission is not smooth.
const ROUGH: f64 = 0.01;

/// Steps on either side of such a width that are divided too: a resonance moves with the pillar.
const BESIDE: usize = 2;

/// Widths that are solved beyond both ends, so that a cubic has its four points.
const BEYOND: usize = 2;

/// The widths from the narrowest to the widest (nm) that are solved at first.
pub(super) fn coarse([low, high]: [f64; 2]) -> Vec<f64> {
    // A whole number of steps below the narrowest.
    let first = (low / STEP_NM).floor() * STEP_NM - BEYOND as f64 * STEP_NM;
    let nodes = ((high - first) / STEP_NM).ceil() as usize + 1 + BEYOND;
    (0..nodes).map(|k| first + k as f64 * STEP_NM).collect()
}

/// One wavelength of a bank.
#[derive(Debug, PartialEq)]
pub(super) struct Colour {
    /// Widths that are solved (nm), rising.
    pub widths_nm: Vec<f64>,
    /// Transmissions by stack, width and number of a pillar; the last of each row is a site without pillar.
    pub t: Vec<Complex64>,
}

impl Colour {
    /// Weights of four widths for any between them; none outside.
    pub(crate) fn weights(&self, width_nm: f64) -> Option<[(usize, f64); 4]> {
        let (first, last) = (self.widths_nm.first()?, self.widths_nm.last()?);
        if !(*first..=*last).contains(&width_nm) {
            return None;
        }
        let above = self.widths_nm.partition_point(|w| *w <= width_nm);
        let from = above.clamp(2, self.widths_nm.len() - 2) - 2;
        let at = |k: usize| self.widths_nm[from + k];
        // Lagrange's polynomial through four points at any distances.
        Some(std::array::from_fn(|k| {
            let others = (0..4).filter(|j| *j != k);
            (from + k, others.map(|j| (width_nm - at(j)) / (at(k) - at(j))).product())
        }))
    }

    /// One row of all widths, and of a site without pillar, for these stacks and weights; `each` numbers a width.
    pub(crate) fn row(&self, stacks: &[(usize, f64)], each: usize) -> Vec<Complex64> {
        let length = (self.widths_nm.len() + 1) * each;
        let mut row = vec![Complex64::ZERO; length];
        for (stack, weight) in stacks {
            for (sum, t) in row.iter_mut().zip(&self.t[stack * length..]) {
                *sum += t * weight;
            }
        }
        row
    }

    /// Numbers that a file stores.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = f64> {
        let count = std::iter::once(self.widths_nm.len() as f64);
        let t = self.t.iter().flat_map(|z| [z.re, z.im]);
        count.chain(self.widths_nm.iter().copied()).chain(t)
    }

    /// One wavelength from the front of the numbers of a file: `rows` for a width.
    pub(crate) fn take(rest: &mut &[f64], rows: usize) -> Option<Self> {
        let (count, after) = rest.split_first()?;
        let count = *count as usize;
        let (widths, after) = after.split_at_checked(count)?;
        let (t, after) = after.split_at_checked(2 * rows.checked_mul(count + 1)?)?;
        *rest = after;
        (count >= 4).then(|| Self {
            widths_nm: widths.to_vec(),
            t: complex(t).collect(),
        })
    }
}

/// Pairs of real and imaginary parts.
pub(super) fn complex(numbers: &[f64]) -> impl Iterator<Item = Complex64> {
    numbers.chunks_exact(2).map(|z| Complex64::new(z[0], z[1]))
}

/// Widths between these where any of the rows, which have `each` numbers a width, is not smooth.
pub(super) fn between(widths_nm: &[f64], rows: &[Vec<Complex64>], each: usize) -> Vec<f64> {
    let last = widths_nm.len() - 1;
    let mut divided = vec![false; last];
    for (row, number) in rows.iter().flat_map(|row| (0..each).map(move |number| (row, number))) {
        for k in 2..last - 1 {
            let [a, b, c, d, e] = [k - 2, k - 1, k, k + 1, k + 2].map(|k| row[k * each + number]);
            if ((b + d) * (2.0 / 3.0) - (a + e) / 6.0 - c).norm() > ROUGH {
                divided[k.saturating_sub(1 + BESIDE)..(k + 1 + BESIDE).min(last)].fill(true);
            }
        }
    }
    let parts = |k: usize| {
        let (low, high) = (widths_nm[k], widths_nm[k + 1]);
        (1..FINE_PARTS).map(move |p| low + (high - low) * p as f64 / FINE_PARTS as f64)
    };
    (0..last).filter(|k| divided[*k]).flat_map(parts).collect()
}

/// Two sets of widths of one wavelength, each with its rows, as one.
pub(super) fn merged(
    (coarse, rows): (&[f64], &[Vec<Complex64>]),
    (added, fine): (&[f64], &[Vec<Complex64>]),
    each: usize,
) -> Colour {
    let mut order: Vec<(f64, bool, usize)> = coarse.iter().enumerate().map(|(k, w)| (*w, false, k)).collect();
    order.extend(added.iter().enumerate().map(|(k, w)| (*w, true, k)));
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let whole = rows.iter().zip(fine).flat_map(|(row, fine)| {
        let widths = order.iter().flat_map(move |(_, is_fine, k)| {
            let from = if *is_fine { fine } else { row };
            from[k * each..][..each].iter().copied()
        });
        widths.chain(row[coarse.len() * each..].iter().copied())
    });
    Colour {
        t: whole.collect(),
        widths_nm: order.iter().map(|o| o.0).collect(),
    }
}
