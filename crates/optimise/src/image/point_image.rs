//! The image of a point on pixels, for photographs.

use metalith_core::Result;
use metalith_wave::camera::{Blur, kernel_of_otf};
use ndarray::Array2;
use num_complex::Complex64;

use crate::PixelWindow;
use crate::image::imaging::OpticalTransfer;

/// What white light of each colour makes of a point, red first: the mean of the transfer functions of a third of the
/// wavelengths each, as pixels.
///
/// `transfers` are those of one angle at ascending wavelengths. Kernels have one pixel an axis more than the window.
///
/// # Errors
/// If there are fewer than three wavelengths, or the window has an odd number of pixels or none.
pub fn blurs_of_colours(transfers: &[OpticalTransfer], window: PixelWindow) -> Result<[Blur; 3]> {
    let third = |colour: usize| -> Result<Blur> {
        let count = transfers.len();
        let some = &transfers[(2 - colour) * count / 3..(3 - colour) * count / 3];
        Ok(Blur::uniform(kernel_of_otf(&mean(some, window))?)?)
    };
    let [red, green, blue] = [0, 1, 2].map(third);
    Ok([red?, green?, blue?])
}

/// Mean of transfer functions, from the quarter plane that they are given on to all frequencies of a window.
fn mean(transfers: &[OpticalTransfer], window: PixelWindow) -> Array2<Complex64> {
    let (n, side) = (window.pixels, window.pixels / 2 + 1);
    let at = |m: usize| {
        let all = transfers.iter().map(|t| Complex64::new(t[m].re.into(), t[m].im.into()));
        all.sum::<Complex64>() / transfers.len() as f64
    };
    Array2::from_shape_fn((n, n), |(y, x)| {
        let h = at(y.min(n - y) * side + x.min(n - x));
        if x > n / 2 { h.conj() } else { h }
    })
}

#[cfg(test)]
mod tests {
    use num_complex::Complex32;

    use super::*;

    const WINDOW: PixelWindow = PixelWindow {
        pixels: 16,
        pixel_um: 5.86,
    };

    /// Transfer function of a shift by so many pixels along x.
    fn shift(pixels: f64) -> OpticalTransfer {
        let side = WINDOW.pixels / 2 + 1;
        let turns = |m: usize| pixels * (m % side) as f64 / WINDOW.pixels as f64;
        (0..side * side)
            .map(|m| Complex32::cis(-(std::f64::consts::TAU * turns(m)) as f32))
            .collect()
    }

    #[test]
    fn colours_are_thirds_of_the_wavelengths_and_phases_are_places() {
        // Transfer functions are single precision.
        const SINGLE: f64 = 1e-6;
        let [red, green, blue] = blurs_of_colours(&[shift(0.0), shift(1.0), shift(2.0)], WINDOW).unwrap();
        let mut scene = Array2::zeros((20, 24));
        scene[[9, 11]] = 1.0;
        for (blur, moved) in [(blue, 0), (green, 1), (red, 2)] {
            let image = blur.image(&scene);
            assert!((image[[9, 11 + moved]] - 1.0).abs() < SINGLE, "{moved}");
            assert!((image.sum() - 1.0).abs() < SINGLE);
        }
        assert!(blurs_of_colours(&[shift(0.0)], WINDOW).is_err());
    }
}
