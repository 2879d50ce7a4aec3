//! Camera frames from NPY, PNG, TIFF and FITS files, what the sensor itself adds to them, and several exposures as one.

mod expected;
mod file;
mod merge_exposures;
mod orientation;
mod sensor;

pub use expected::expected;
pub use file::{ENDINGS, size};
pub use merge_exposures::{ExposedFrame, joined};
pub use orientation::Orientation;
pub use sensor::{DarkPixels, SensorFrame, SensorFrames, SensorPixels};

use std::path::Path;

use ndarray::Array2;

use crate::relay::SATURATED;

/// Most pixels of a stack of frames (1 GB in single precision).
const MOST_PIXELS: u64 = 1 << 28;

/// Frames of one file, each with one value for each pixel.
struct Pages {
    values: Vec<Vec<f32>>,
    /// The largest number that the format holds, if it holds whole numbers alone.
    largest: Option<f32>,
}

/// A frame as its file has it.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    /// Mean of the pages of the file (DN).
    pub dn: Array2<f32>,
    /// Frames in the file.
    pub pages: u32,
    /// True if the file holds whole numbers alone.
    whole: bool,
    /// Largest power of two that divides all its values; one for values that are no whole numbers.
    pub step_dn: u32,
}

impl Recorded {
    /// Variance that rounding to whole numbers adds (DN^2) if this is the mean of so many frames: means that are stored as whole
    /// numbers were rounded afterwards, and the read noise of the camera does not have that in it.
    pub fn rounding_dn2(&self, frames: u32) -> f64 {
        if self.whole && frames > self.pages {
            OF_ROUNDING / f64::from(self.pages)
        } else {
            0.0
        }
    }
}

/// Largest power of two that divides every value of these frames; one where values are no whole numbers.
/// A camera that writes 12 bits at the left of 16 has 16.
fn step_of(values: &[Vec<f32>]) -> u32 {
    let mut all = 0;
    for v in values.iter().flatten() {
        if v.fract() != 0.0 || *v < 0.0 || *v > MOST_SHIFTED {
            return 1;
        }
        all |= *v as u32;
    }
    if all == 0 { 1 } else { 1 << all.trailing_zeros() }
}

/// Largest number of 16 bits.
const MOST_SHIFTED: f32 = 65_535.0;

/// Variance of a number that is rounded to whole ones.
const OF_ROUNDING: f64 = 1.0 / 12.0;

/// Read frames of exactly `rows` x `cols` finite numbers, whose values are DN: NPY, grey PNG, grey TIFF or FITS, recognised by their
/// first bytes. NPY and FITS of three axes and TIFF of several pages are stacks: what comes back is their mean, and pixels that are saturated in any frame
/// have `saturation_dn`, which a mean would hide. Files that end below `saturation_dn` must not be full. The first row of the file
/// is row 0.
///
/// # Errors
/// What is wrong with the file, in words.
pub fn read(path: &Path, rows: usize, cols: usize, saturation_dn: f64) -> Result<Recorded, String> {
    let pages = file::pages(path, rows, cols)?;
    let values = || pages.values.iter().flatten();
    if let Some(largest) = pages.largest.filter(|v| f64::from(*v) < SATURATED * saturation_dn) {
        let full = values().filter(|v| **v >= largest).count();
        if full > 0 {
            return Err(format!(
                "{full} of its pixels have {largest}, the largest number that it holds, and `saturation_dn` is {saturation_dn}"
            ));
        }
    }
    Ok(Recorded {
        dn: mean(&pages.values, rows, cols, saturation_dn)?,
        pages: pages.values.len() as u32,
        whole: pages.largest.is_some(),
        step_dn: step_of(&pages.values),
    })
}

fn mean(frames: &[Vec<f32>], rows: usize, cols: usize, saturation_dn: f64) -> Result<Array2<f32>, String> {
    let wrong = frames.iter().flatten().filter(|v| !v.is_finite()).count();
    if wrong > 0 {
        let all = frames.len() * rows * cols;
        return Err(format!("{wrong} of its {all} pixels are not finite numbers"));
    }
    let full = (SATURATED * saturation_dn) as f32;
    let values = (0..rows * cols).map(|at| match frames {
        [one] => one[at],
        many if many.iter().any(|f| f[at] >= full) => saturation_dn as f32,
        many => (many.iter().map(|f| f64::from(f[at])).sum::<f64>() / many.len() as f64) as f32,
    });
    Array2::from_shape_vec((rows, cols), values.collect()).map_err(|e| e.to_string())
}

/// Message for a file of another size.
fn other_size(found: (usize, usize), rows: usize, cols: usize) -> String {
    format!(
        "it is {} x {} pixels, the camera says [{rows}, {cols}]",
        found.0, found.1
    )
}

/// Pixels that are saturated or beside one that is, diagonally too.
pub fn saturated(dn: &Array2<f32>, saturation_dn: f64) -> Array2<bool> {
    let mut out = Array2::from_elem(dn.dim(), false);
    let (rows, cols) = dn.dim();
    for ((y, x), v) in dn.indexed_iter() {
        if f64::from(*v) >= SATURATED * saturation_dn {
            for ny in y.saturating_sub(1)..(y + 2).min(rows) {
                for nx in x.saturating_sub(1)..(x + 2).min(cols) {
                    out[(ny, nx)] = true;
                }
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use std::fs::File;

    use npyz::WriterBuilder;

    use super::*;

    const FULL: f64 = 60_000.0;

    #[test]
    fn grey_png_files_hold_dn() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let write = |depth: png::BitDepth, data: &[u8]| {
            let mut encoder = png::Encoder::new(File::create(&path).unwrap(), 3, 2);
            encoder.set_color(png::ColorType::Grayscale);
            encoder.set_depth(depth);
            encoder.write_header().unwrap().write_image_data(data).unwrap();
        };
        write(png::BitDepth::Eight, &[1, 2, 3, 4, 5, 255]);
        assert_eq!(
            read(&path, 2, 3, 255.0).unwrap().dn,
            ndarray::arr2(&[[1.0, 2.0, 3.0], [4.0, 5.0, 255.0]])
        );
        // A file of 8 bits does not say how far its full pixels went.
        assert!(read(&path, 2, 3, FULL).unwrap_err().contains("largest number"));
        write(png::BitDepth::Sixteen, &[0, 1, 1, 0, 0, 3, 0, 4, 0, 5, 255, 255]);
        assert_eq!(
            read(&path, 2, 3, FULL).unwrap().dn,
            ndarray::arr2(&[[1.0, 256.0, 3.0], [4.0, 5.0, 65535.0]])
        );
        assert!(read(&path, 3, 3, FULL).unwrap_err().contains("2 x 3"));
        write(png::BitDepth::One, &[0, 0]);
        assert!(read(&path, 2, 3, FULL).unwrap_err().contains("not grey of 8 or 16"));
    }

    /// A stack of TIFF pages and one of NPY frames are their mean; a pixel that is saturated once is saturated.
    #[test]
    fn stacks_are_means_and_keep_what_is_saturated() {
        use ::tiff::encoder::{TiffEncoder, colortype};
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tif");
        let pages: [[u16; 6]; 2] = [[1, 2, 3, 4, 5, 600], [3, 4, 5, 6, 7, 0]];
        {
            let mut encoder = TiffEncoder::new(File::create(&path).unwrap()).unwrap();
            for page in &pages {
                encoder.write_image::<colortype::Gray16>(3, 2, page).unwrap();
            }
        }
        let want = ndarray::arr2(&[[2.0, 3.0, 4.0], [5.0, 6.0, 600.0]]);
        let stack = read(&path, 2, 3, 600.0).unwrap();
        assert_eq!((&stack.dn, stack.pages), (&want, 2));
        // Two frames as they were recorded have the read noise of the camera; the mean of ten more was rounded afterwards.
        assert_eq!(stack.rounding_dn2(2), 0.0);
        assert_eq!(stack.rounding_dn2(20), 1.0 / 24.0);
        assert!(read(&path, 3, 2, 600.0).unwrap_err().contains("2 x 3"));
        let npy = folder.path().join("a.npy");
        let mut bytes = Vec::new();
        let mut writer = npyz::WriteOptions::new()
            .default_dtype()
            .shape(&[2, 2, 3])
            .writer(&mut bytes)
            .begin_nd()
            .unwrap();
        writer.extend(pages.concat()).unwrap();
        writer.finish().unwrap();
        std::fs::write(&npy, bytes).unwrap();
        assert_eq!(read(&npy, 2, 3, 600.0).unwrap().dn, want);
        std::fs::write(&path, b"II*\0nothing").unwrap();
        assert!(read(&path, 2, 3, 600.0).unwrap_err().contains("no TIFF"));
    }

    /// Frames as other programs write them, whatever the file is called: FITS with BZERO, NPY by columns, TIFF of 32 bits.
    #[test]
    fn frames_of_other_programs_are_read() {
        use ::tiff::encoder::{TiffEncoder, colortype};
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frame.dat");
        let want = ndarray::arr2(&[[1.0, 2.0, 3.0], [4.0, 5.0, 40_000.0]]);
        let same = |path: &Path| {
            assert_eq!(read(path, 2, 3, FULL).unwrap().dn, want);
            assert_eq!(size(path), Ok((2, 3)));
        };
        let cards = [
            "SIMPLE  = T",
            "BITPIX  = 16",
            "NAXIS   = 2",
            "NAXIS1  = 3",
            "NAXIS2  = 2",
            "BZERO   = 32768",
            "END",
        ];
        let mut fits: Vec<u8> = cards
            .iter()
            .flat_map(|card| format!("{card:<80}").into_bytes())
            .collect();
        fits.resize(2880, b' ');
        fits.extend(want.iter().flat_map(|v| ((*v as i32 - 32768) as i16).to_be_bytes()));
        std::fs::write(&path, &fits).unwrap();
        same(&path);
        assert!(read(&path, 3, 3, FULL).unwrap_err().contains("2 x 3"));

        let header = "{'descr': '<u4', 'fortran_order': True, 'shape': (2, 3), }";
        let head = [
            &b"\x93NUMPY\x01\0"[..],
            &(header.len() as u16).to_le_bytes(),
            header.as_bytes(),
        ]
        .concat();
        let columns = want
            .t()
            .iter()
            .flat_map(|v| (*v as u32).to_le_bytes())
            .collect::<Vec<_>>();
        std::fs::write(&path, [head, columns].concat()).unwrap();
        same(&path);

        let wide: Vec<u32> = want.iter().map(|v| *v as u32).collect();
        let mut encoder = TiffEncoder::new(File::create(&path).unwrap()).unwrap();
        encoder.write_image::<colortype::Gray32>(3, 2, &wide).unwrap();
        drop(encoder);
        same(&path);
        std::fs::rename(&path, folder.path().join("frame.DNG")).unwrap();
        let raw = folder.path().join("frame.DNG");
        assert_eq!(read(&raw, 2, 3, FULL).unwrap_err(), metalith_core::file_kind::RAW);
        std::fs::write(&path, b"\xff\xd8\xff\xe0").unwrap();
        assert!(read(&path, 2, 3, FULL).unwrap_err().contains("JPEG"));
    }
}
