//! Grey TIFF files, of one page or many.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};

use super::{MOST_PIXELS, Pages, other_size};

/// Rows and columns of the first page.
pub(crate) fn size(file: File) -> Result<(usize, usize), String> {
    let wrong = |e: tiff::TiffError| format!("it is no TIFF file that can be read: {e}");
    let mut decoder = Decoder::new(BufReader::new(file)).map_err(wrong)?;
    let (width, height) = decoder.dimensions().map_err(wrong)?;
    Ok((height as usize, width as usize))
}

/// The values of each page: grey of 8 or 16 bits, or of 32 bits with a decimal point.
pub(crate) fn read(path: &Path, rows: usize, cols: usize) -> Result<Pages, String> {
    let wrong = |e: tiff::TiffError| format!("it is no TIFF file that can be read: {e}");
    let file = File::open(path).map_err(|e| format!("it cannot be read: {e}"))?;
    let mut limits = Limits::default();
    // A page of the size that is asked for, and no more.
    limits.decoding_buffer_size = 16 * rows * cols;
    limits.intermediate_buffer_size = 16 * rows * cols + (1 << 20);
    let mut decoder = Decoder::new(BufReader::new(file)).map_err(wrong)?.with_limits(limits);
    let (mut pages, mut largest) = (Vec::new(), None);
    loop {
        let (width, height) = decoder.dimensions().map_err(wrong)?;
        let size = (height as usize, width as usize);
        if size != (rows, cols) {
            return Err(other_size(size, rows, cols));
        }
        let colour = decoder.colortype().map_err(wrong)?;
        let ColorType::Gray(bits) = colour else {
            return Err(format!("its pixels are {colour:?}, not grey"));
        };
        let page: Vec<f32> = match decoder.read_image().map_err(wrong)? {
            DecodingResult::U8(v) => {
                largest = Some(f32::from(u8::MAX));
                v.into_iter().map(f32::from).collect()
            }
            DecodingResult::U16(v) => {
                largest = Some(f32::from(u16::MAX));
                v.into_iter().map(f32::from).collect()
            }
            DecodingResult::F32(v) => v,
            _ => {
                return Err(format!(
                    "its pixels are grey of {bits} bits; 8 or 16 bits are read, or 32 with a decimal point"
                ));
            }
        };
        if page.len() != rows * cols {
            return Err("its size is not that of its pixels".into());
        }
        pages.push(page);
        if !decoder.more_images() {
            return Ok(Pages { values: pages, largest });
        }
        if (pages.len() + 1) as u64 * (rows * cols) as u64 > MOST_PIXELS {
            return Err(format!("it has more than {} pages", pages.len()));
        }
        decoder.next_image().map_err(wrong)?;
    }
}
