//! Similarity of one image to another.

use metalith_core::{Error, Result};
use ndarray::{Array2, ArrayView, ArrayView2, ArrayView3, Axis, Dimension};

/// Half of the window of structural similarity, without its middle (pixels).
const REACH: usize = 5;

/// Peak signal to noise ratio (dB), for images between zero and one, grey or in colour; infinite where they are equal.
///
/// # Errors
/// If the shapes differ.
pub fn psnr_db<D: Dimension>(image: ArrayView<'_, f64, D>, reference: ArrayView<'_, f64, D>) -> Result<f64> {
    same_shape(image.shape(), reference.shape())?;
    let pairs = image.iter().zip(&reference);
    let error = pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>() / image.len() as f64;
    Ok(-10.0 * error.log10())
}

/// Structural similarity, the mean over all places where its window fits, for grey images between zero and one.
///
/// Wang et al., IEEE Trans. Image Process. 13, 600 (2004): a Gaussian window of 11 x 11 with a deviation of 1.5 pixels,
/// K1 = 0.01, K2 = 0.03.
///
/// # Errors
/// If the shapes differ or an image is smaller than the window.
pub fn ssim(image: ArrayView2<'_, f64>, reference: ArrayView2<'_, f64>) -> Result<f64> {
    const C1: f64 = 0.01 * 0.01;
    const C2: f64 = 0.03 * 0.03;
    same_shape(image.shape(), reference.shape())?;
    let (rows, columns) = image.dim();
    if rows.min(columns) <= 2 * REACH {
        let least = 2 * REACH + 1;
        return Err(Error::refused(
            "score/too-small",
            format!("an image of {rows} x {columns} pixels"),
            format!("give an image of at least {least} x {least} pixels"),
        ));
    }
    let mean_a = smooth(image);
    let mean_b = smooth(reference);
    let aa = smooth((&image * &image).view());
    let bb = smooth((&reference * &reference).view());
    let ab = smooth((&image * &reference).view());
    let mut sum = 0.0;
    for (i, a) in mean_a.indexed_iter() {
        let b = mean_b[i];
        let (variances, covariance) = (aa[i] - a * a + bb[i] - b * b, ab[i] - a * b);
        sum += (2.0 * a * b + C1) * (2.0 * covariance + C2) / ((a * a + b * b + C1) * (variances + C2));
    }
    Ok(sum / mean_a.len() as f64)
}

/// [`ssim`] of images in colour, `[row, column, colour]`: the mean over the colours.
///
/// # Errors
/// As [`ssim`].
pub fn ssim_colour(image: ArrayView3<'_, f64>, reference: ArrayView3<'_, f64>) -> Result<f64> {
    same_shape(image.shape(), reference.shape())?;
    let pairs = image.axis_iter(Axis(2)).zip(reference.axis_iter(Axis(2)));
    let each = pairs.map(|(a, b)| ssim(a, b)).collect::<Result<Vec<_>>>()?;
    Ok(each.iter().sum::<f64>() / each.len() as f64)
}

fn same_shape(image: &[usize], reference: &[usize]) -> Result<()> {
    let plane = |shape: &[usize]| [0, 1].map(|axis| shape.get(axis).copied().unwrap_or(1));
    if image == reference {
        return Ok(());
    }
    Err(Error::refused(
        "score/sizes-differ",
        format!(
            "an image of shape {:?} where {:?} is needed",
            plane(image),
            plane(reference)
        ),
        "give two images of one shape",
    ))
}

/// Mean under the window at all places where it fits.
fn smooth(image: ArrayView2<'_, f64>) -> Array2<f64> {
    const DEVIATION: f64 = 1.5;
    let (rows, columns) = image.dim();
    let weight = |i: usize| (-((i as f64 - REACH as f64) / DEVIATION).powi(2) / 2.0).exp();
    let total: f64 = (0..=2 * REACH).map(weight).sum();
    let weights: Vec<f64> = (0..=2 * REACH).map(|i| weight(i) / total).collect();
    let along_x = Array2::from_shape_fn((rows, columns - 2 * REACH), |(y, x)| {
        weights
            .iter()
            .enumerate()
            .map(|(i, w)| w * image[[y, x + i]])
            .sum::<f64>()
    });
    Array2::from_shape_fn((rows - 2 * REACH, columns - 2 * REACH), |(y, x)| {
        weights.iter().enumerate().map(|(i, w)| w * along_x[[y + i, x]]).sum()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array3;

    /// Tolerance of sums over a few thousand values of size one.
    const ROUNDING: f64 = 1e-12;

    #[test]
    fn ratios_and_similarities_of_known_images() {
        let wave = Array2::from_shape_fn((40, 50), |(y, x)| 0.5 + 0.3 * (0.4 * x as f64 + 0.3 * y as f64).sin());
        assert_eq!(psnr_db(wave.view(), wave.view()).unwrap(), f64::INFINITY);
        // An error of 0.01 everywhere is 40 dB, to the digits that 0.01 has left of values near one.
        assert!((psnr_db((&wave + 0.01).view(), wave.view()).unwrap() - 40.0).abs() < 1e3 * ROUNDING);
        assert!((ssim(wave.view(), wave.view()).unwrap() - 1.0).abs() < ROUNDING);
        // Flat images differ in luminance alone.
        let (a, b) = (0.3, 0.6);
        let flat = |v: f64| Array2::from_elem((20, 20), v);
        let want = (2.0 * a * b + 1e-4) / (a * a + b * b + 1e-4);
        assert!((ssim(flat(a).view(), flat(b).view()).unwrap() - want).abs() < ROUNDING);
        // The negative has the opposite structure.
        assert!(ssim((1.0 - &wave).view(), wave.view()).unwrap() < -0.5);
    }

    #[test]
    fn colours_count_alike() {
        let colour = |flat: [f64; 3]| Array3::from_shape_fn((12, 14, 3), |(_, _, c)| flat[c]);
        let (a, b) = (colour([0.3, 0.3, 0.3]), colour([0.3, 0.3, 0.6]));
        let one = ssim(a.index_axis(Axis(2), 2), b.index_axis(Axis(2), 2)).unwrap();
        assert!((ssim_colour(a.view(), b.view()).unwrap() - (2.0 + one) / 3.0).abs() < ROUNDING);
        // 0.09 in one colour of three.
        let psnr = psnr_db(a.view(), b.view()).unwrap();
        assert!((psnr + 10.0 * 0.03_f64.log10()).abs() < ROUNDING);
    }

    #[test]
    fn what_cannot_be_compared_is_refused() {
        let (small, wide) = (Array2::zeros((10, 20)), Array2::zeros((20, 10)));
        let of_shapes = psnr_db(small.view(), wide.view()).unwrap_err().to_string();
        assert!(
            of_shapes.contains("[10, 20]") && of_shapes.contains("[20, 10]"),
            "{of_shapes}"
        );
        let of_size = ssim(small.view(), small.view()).unwrap_err().to_string();
        assert!(of_size.contains("at least 11 x 11"), "{of_size}");
    }
}
