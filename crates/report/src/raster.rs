//! Matrices as small PNG images, embedded as text.

use ndarray::ArrayView2;

use super::bitmap::{address, reduced};
use super::colour::ColourMap;

/// Index of what has no value: transparent.
const EMPTY: u8 = 255;
/// Colours of an image; one index is left for what has no value.
const SHADES: f64 = 254.0;
/// More pixels an axis than a page shows are averaged away.
const LARGEST: usize = 720;

/// Shading: how values become shares of the colour map.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shading {
    pub map: ColourMap,
    pub low: f64,
    pub high: f64,
    pub logarithmic: bool,
}

impl Shading {
    fn share(&self, x: f64) -> f64 {
        if self.logarithmic {
            if x <= self.low {
                return if x.is_nan() { x } else { 0.0 };
            }
            (x / self.low).ln() / (self.high / self.low).ln()
        } else {
            (x - self.low) / (self.high - self.low)
        }
    }
}

/// The matrix as an image, row 0 at the bottom, as `data:` address.
pub(super) fn image(values: ArrayView2<f64>, shading: &Shading) -> String {
    let values = reduced(values, LARGEST);
    let (rows, cols) = values.dim();
    let mut index = Vec::with_capacity(rows * cols);
    for row in values.rows().into_iter().rev() {
        index.extend(row.iter().map(|&x| {
            let share = shading.share(x);
            if share.is_nan() {
                EMPTY
            } else {
                (share.clamp(0.0, 1.0) * SHADES).round() as u8
            }
        }));
    }
    encode(cols, rows, &index, shading.map)
}

/// The colour map from bottom to top, one pixel wide.
pub(super) fn bar(map: ColourMap) -> String {
    let index: Vec<u8> = (0..=SHADES as u8).rev().collect();
    encode(1, index.len(), &index, map)
}

fn encode(width: usize, height: usize, index: &[u8], map: ColourMap) -> String {
    let mut palette: Vec<u8> = (0..EMPTY).flat_map(|i| map.rgb(f64::from(i) / SHADES)).collect();
    palette.extend([128; 3]);
    let mut opacity = vec![255; 256];
    opacity[usize::from(EMPTY)] = 0;

    address((height, width), index, &[EMPTY], |encoder| {
        encoder.set_color(png::ColorType::Indexed);
        encoder.set_palette(palette);
        encoder.set_trns(opacity);
    })
}

#[cfg(test)]
mod tests {
    use super::super::bitmap::tests::decode;
    use super::*;
    use ndarray::Array2;

    #[test]
    fn a_matrix_becomes_an_image_with_its_first_row_below() {
        let values = ndarray::arr2(&[[0.0, 1.0], [f64::NAN, 0.5]]);
        let shading = Shading {
            map: ColourMap::Sequential,
            low: 0.0,
            high: 1.0,
            logarithmic: false,
        };
        let (info, pixels) = decode(&image(values.view(), &shading));
        assert_eq!((info.width, info.height), (2, 2));
        assert_eq!(pixels[3], 0, "no value is transparent");
        assert_eq!(pixels[4..7], ColourMap::Sequential.rgb(0.5));
        assert_eq!(pixels[8..11], ColourMap::Sequential.rgb(0.0));
        assert_eq!(pixels[12..15], ColourMap::Sequential.rgb(1.0));
    }

    #[test]
    fn large_and_empty_matrices_stay_bounded() {
        let shading = Shading {
            map: ColourMap::Diverging,
            low: 1e-3,
            high: 1.0,
            logarithmic: true,
        };
        let (info, _) = decode(&image(Array2::from_elem((2000, 1500), 1.0).view(), &shading));
        assert!(info.width as usize <= LARGEST && info.height as usize <= LARGEST);
        for empty in [(0, 0), (0, 5)] {
            let (info, _) = decode(&image(Array2::zeros(empty).view(), &shading));
            assert_eq!((info.width, info.height), (1, 1));
        }
    }
}
