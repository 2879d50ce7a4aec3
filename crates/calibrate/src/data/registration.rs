//! Registration of a window to within a pixel, before anything is fitted: cross-correlation.

use metalith_fourier::{Fft, forward, inverse};
use ndarray::Array2;
use num_complex::Complex32;

/// Largest shift that is searched, along each axis (pixels): of a lens of 1 mm, light tilted by 10 mrad.
const REACH: i64 = 48;

/// A shift is taken if it raises the correlation by this factor: the fit finds smaller shifts by itself.
const BETTER: f32 = 1.02;

/// Whole pixels (x, y) by which a window is off: the shift at which `seen` and `expected` correlate best.
pub(crate) fn whole_pixel_shift(seen: &Array2<f32>, expected: &Array2<f32>) -> [f64; 2] {
    let (rows, cols) = seen.dim();
    let along_x = forward(cols);
    let along_y = forward(rows);
    let a = spectrum(seen, &*along_x, &*along_y);
    let b = spectrum(expected, &*along_x, &*along_y);
    let product = Array2::from_shape_fn((rows, cols), |i| a[i].conj() * b[i]);
    let back_x = inverse(cols);
    let back_y = inverse(rows);
    let correlation = transformed(product, &*back_x, &*back_y);
    let at = |dy: i64, dx: i64| {
        let place = [dy.rem_euclid(rows as i64) as usize, dx.rem_euclid(cols as i64) as usize];
        correlation[place].re
    };
    // Farther than half a window, a shift is the same as a nearer one the other way.
    let reach = |pixels: usize| REACH.min((pixels as i64 - 1) / 2);
    let (far_y, far_x) = (reach(rows), reach(cols));
    let mut best = (0, 0);
    for dy in -far_y..=far_y {
        for dx in -far_x..=far_x {
            if at(dy, dx) > at(best.0, best.1) {
                best = (dy, dx);
            }
        }
    }
    if at(best.0, best.1) > BETTER * at(0, 0) {
        [best.1 as f64, best.0 as f64]
    } else {
        [0.0; 2]
    }
}

fn spectrum(image: &Array2<f32>, along_x: &dyn Fft<f32>, along_y: &dyn Fft<f32>) -> Array2<Complex32> {
    let mean = image.mean().unwrap_or(0.0);
    transformed(image.mapv(|v| Complex32::new(v - mean, 0.0)), along_x, along_y)
}

fn transformed(image: Array2<Complex32>, along_x: &dyn Fft<f32>, along_y: &dyn Fft<f32>) -> Array2<Complex32> {
    let (rows, cols) = image.dim();
    let mut lines: Vec<Complex32> = image.iter().copied().collect();
    along_x.process(&mut lines);
    let mut columns: Vec<Complex32> = (0..rows * cols).map(|i| lines[(i % rows) * cols + i / rows]).collect();
    along_y.process(&mut columns);
    Array2::from_shape_fn((rows, cols), |(y, x)| columns[x * rows + y])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spot_in(size: (usize, usize), cx: f32, cy: f32) -> Array2<f32> {
        Array2::from_shape_fn(size, |(y, x)| {
            let r2 = (x as f32 - cx).powi(2) + (y as f32 - cy).powi(2);
            2.0 + 100.0 * (-r2 / 8.0).exp()
        })
    }

    /// Of a window that is smaller than the reach, a pixel to one side is not the rest of the window to the other.
    #[test]
    fn small_windows_move_by_the_nearest_shift() {
        let spot = |cx: f32, cy: f32| spot_in((16, 20), cx, cy);
        assert_eq!(whole_pixel_shift(&spot(9.0, 9.0), &spot(10.0, 8.0)), [1.0, -1.0]);
        assert_eq!(whole_pixel_shift(&spot(10.0, 8.0), &spot(9.0, 9.0)), [-1.0, 1.0]);
    }

    #[test]
    fn a_moved_spot_is_found() {
        let spot = |cx: f32, cy: f32| spot_in((48, 64), cx, cy);
        // In a window that is off by (5, -3), the spot appears on the opposite side.
        assert_eq!(whole_pixel_shift(&spot(27.0, 27.0), &spot(32.0, 24.0)), [5.0, -3.0]);
        assert_eq!(whole_pixel_shift(&spot(32.2, 24.0), &spot(32.0, 24.0)), [0.0, 0.0]);
    }
}
