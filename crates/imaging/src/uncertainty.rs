//! Uncertainty of a restored picture: samples of the pictures that the frame may be of.

use ndarray::{Array2, Array3, Axis};
use serde::Serialize;

use crate::score::{ZoneScore, scores};
use metalith_core::{Result, srgb};

/// Statistics of samples.
#[derive(Clone, Debug)]
pub struct Uncertainty {
    /// Mean of the pictures, linear sRGB `[row, column, colour]`.
    pub mean: Array3<f64>,
    /// Deviation of the pictures from it, root mean square over the colours, of sRGB values `[row, column]`.
    pub spread: Array2<f64>,
    pub samples: usize,
}

/// Uncertainty beside the truth.
#[derive(Clone, Debug, Serialize)]
pub struct UncertaintyReport {
    pub samples: usize,
    /// Scores of the mean of the samples.
    pub scores: Vec<ZoneScore>,
    /// Mean deviation of the samples (sRGB values).
    pub spread: f64,
    /// Mean error of their mean, in the same unit: more than the spread, as samples know nothing of what all of them miss.
    pub error: f64,
    /// Rank correlation (Spearman's) of the order of the pixels by their uncertainty with the order by their error.
    pub rank_correlation: f64,
}

impl Uncertainty {
    /// Uncertainty from pictures in linear sRGB; at least two.
    pub fn of(pictures: &[Array3<f64>]) -> Self {
        let n = pictures.len() as f64;
        let mut mean = Array3::zeros(pictures[0].dim());
        pictures.iter().for_each(|p| mean.scaled_add(1.0 / n, p));
        let shown = |p: &Array3<f64>| p.mapv(srgb::encoded);
        let mut shown_mean = Array3::zeros(mean.dim());
        pictures.iter().for_each(|p| shown_mean.scaled_add(1.0 / n, &shown(p)));
        let mut squares = Array2::zeros((mean.dim().0, mean.dim().1));
        for picture in pictures {
            squares += &root_mean_square(&shown(picture), &shown_mean).mapv(|v| v * v);
        }
        Self {
            mean,
            // One less: their mean is of the same samples.
            spread: squares.mapv(|v: f64| (v / (n - 1.0).max(1.0)).sqrt()),
            samples: pictures.len(),
        }
    }

    /// Beside the truth, in linear sRGB.
    ///
    /// # Errors
    /// If the picture is too small to be scored.
    pub fn report(&self, truth: &Array3<f64>) -> Result<UncertaintyReport> {
        let error = root_mean_square(&self.mean.mapv(srgb::encoded), &truth.mapv(srgb::encoded));
        Ok(UncertaintyReport {
            samples: self.samples,
            scores: scores(&self.mean, truth)?,
            spread: self.spread.mean().unwrap_or(0.0),
            error: error.mean().unwrap_or(0.0),
            rank_correlation: rank_correlation(&self.spread, &error),
        })
    }
}

/// Difference of two pictures, root mean square over the colours.
pub(crate) fn root_mean_square(a: &Array3<f64>, b: &Array3<f64>) -> Array2<f64> {
    let difference = a - b;
    difference.map_axis(Axis(2), |c| {
        (c.iter().map(|v| v * v).sum::<f64>() / c.len() as f64).sqrt()
    })
}

/// Correlation of ranks, equal values having the mean of theirs.
fn rank_correlation(a: &Array2<f64>, b: &Array2<f64>) -> f64 {
    let (a, b) = (ranks(a), ranks(b));
    let mean = (a.len() as f64 - 1.0) / 2.0;
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (a, b) in a.iter().zip(&b) {
        let (a, b) = (a - mean, b - mean);
        ab += a * b;
        aa += a * a;
        bb += b * b;
    }
    ab / (aa * bb).sqrt().max(f64::MIN_POSITIVE)
}

fn ranks(values: &Array2<f64>) -> Vec<f64> {
    let values: Vec<f64> = values.iter().copied().collect();
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|i, k| values[*i].total_cmp(&values[*k]));
    let mut ranks = vec![0.0; values.len()];
    let mut before = 0;
    for group in order.chunk_by(|i, k| values[*i] == values[*k]) {
        let rank = before as f64 + (group.len() as f64 - 1.0) / 2.0;
        group.iter().for_each(|i| ranks[*i] = rank);
        before += group.len();
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_are_compared_and_not_values() {
        let values = Array2::from_shape_fn((5, 6), |(y, x)| ((y * 6 + x) * 7 % 30) as f64);
        assert!((rank_correlation(&values, &values.mapv(|v| v.powi(3))) - 1.0).abs() < 1e-12);
        assert!((rank_correlation(&values, &values.mapv(|v| -v)) + 1.0).abs() < 1e-12);
        // Half of the values equal: their ranks are one, and the correlation with the rest is that of two groups.
        let halves = values.mapv(|v| f64::from(v >= 15.0));
        assert!((rank_correlation(&values, &halves) - 0.75f64.sqrt()).abs() < 1e-2);
    }

    #[test]
    fn samples_that_differ_in_one_place_are_uncertain_there() {
        let one = Array3::from_elem((20, 20, 3), 0.5);
        let mut other = one.clone();
        other[[3, 4, 1]] = 0.7;
        let uncertainty = Uncertainty::of(&[one.clone(), other]);
        assert!((uncertainty.mean[[3, 4, 1]] - 0.6).abs() < 1e-12);
        let step = srgb::encoded(0.7) - srgb::encoded(0.5);
        // Two samples of one colour in three: half of the step squared, twice, over one, over three.
        assert!((uncertainty.spread[[3, 4]] - step * (0.5f64 / 3.0).sqrt()).abs() < 1e-12);
        assert_eq!(uncertainty.spread[[0, 0]], 0.0);
    }
}
