//! How near an image is to another.

use ndarray::Array2;

/// Peak signal to noise ratio [dB], for images between zero and one; infinite where they are equal.
///
/// # Panics
/// If the shapes differ.
pub fn psnr_db(image: &Array2<f64>, reference: &Array2<f64>) -> f64 {
    assert_eq!(image.dim(), reference.dim(), "images of one shape");
    let pairs = image.iter().zip(reference);
    let error = pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>() / image.len() as f64;
    -10.0 * error.log10()
}

/// Structural similarity, the mean over all places where its window fits, for images between zero and one.
///
/// Wang et al., IEEE Trans. Image Process. 13, 600 (2004): a Gaussian window of 11 x 11 with a deviation of 1.5 pixels,
/// K1 = 0.01, K2 = 0.03.
///
/// # Panics
/// If the shapes differ or an image is smaller than the window.
pub fn ssim(image: &Array2<f64>, reference: &Array2<f64>) -> f64 {
    const C1: f64 = 1e-4;
    const C2: f64 = 9e-4;
    assert_eq!(image.dim(), reference.dim(), "images of one shape");
    let mean_a = smooth(image);
    let mean_b = smooth(reference);
    let aa = smooth(&(image * image));
    let bb = smooth(&(reference * reference));
    let ab = smooth(&(image * reference));
    let mut sum = 0.0;
    for (i, a) in mean_a.indexed_iter() {
        let b = mean_b[i];
        let (variances, covariance) = (aa[i] - a * a + bb[i] - b * b, ab[i] - a * b);
        sum += (2.0 * a * b + C1) * (2.0 * covariance + C2) / ((a * a + b * b + C1) * (variances + C2));
    }
    sum / mean_a.len() as f64
}

/// Mean under the window at all places where it fits.
fn smooth(image: &Array2<f64>) -> Array2<f64> {
    const REACH: usize = 5;
    const DEVIATION: f64 = 1.5;
    let (rows, columns) = image.dim();
    assert!(
        rows > 2 * REACH && columns > 2 * REACH,
        "an image of at least 11 x 11 pixels"
    );
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

    #[test]
    fn ratios_and_similarities_of_known_images() {
        let wave = Array2::from_shape_fn((40, 50), |(y, x)| 0.5 + 0.3 * (0.4 * x as f64 + 0.3 * y as f64).sin());
        assert_eq!(psnr_db(&wave, &wave), f64::INFINITY);
        assert!((psnr_db(&(&wave + 0.01), &wave) - 40.0).abs() < 1e-9);
        assert!((ssim(&wave, &wave) - 1.0).abs() < 1e-12);
        // Flat images differ in luminance alone.
        let (a, b) = (0.3, 0.6);
        let flat = |v: f64| Array2::from_elem((20, 20), v);
        let want = (2.0 * a * b + 1e-4) / (a * a + b * b + 1e-4);
        assert!((ssim(&flat(a), &flat(b)) - want).abs() < 1e-12);
        // The negative has the opposite structure.
        assert!(ssim(&(1.0 - &wave), &wave) < -0.5);
    }
}
