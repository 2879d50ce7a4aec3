//! Grey PNG files.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use super::{Pages, other_size};

/// Rows and columns of a PNG.
pub(crate) fn size(file: BufReader<File>) -> Result<(usize, usize), String> {
    let reader = png::Decoder::new(file).read_info();
    let reader = reader.map_err(|e| format!("it is no PNG file that can be read: {e}"))?;
    Ok((reader.info().height as usize, reader.info().width as usize))
}

/// The values of a grey PNG of 8 or 16 bits.
pub(crate) fn read(path: &Path, rows: usize, cols: usize) -> Result<Pages, String> {
    let wrong = |e: png::DecodingError| format!("it is no PNG file that can be read: {e}");
    let file = File::open(path).map_err(|e| format!("it cannot be read: {e}"))?;
    let mut reader = png::Decoder::new(BufReader::new(file)).read_info().map_err(wrong)?;
    let info = reader.info();
    let size = (info.height as usize, info.width as usize);
    if size != (rows, cols) {
        return Err(other_size(size, rows, cols));
    }
    let (colour, depth) = (info.color_type, info.bit_depth);
    let bytes = match (colour, depth) {
        (png::ColorType::Grayscale, png::BitDepth::Eight) => 1,
        (png::ColorType::Grayscale, png::BitDepth::Sixteen) => 2,
        _ => {
            return Err(format!(
                "its pixels are {colour:?} of {depth:?} bits, not grey of 8 or 16 bits"
            ));
        }
    };
    let mut data = vec![0; bytes * rows * cols];
    if reader.output_buffer_size() != Some(data.len()) {
        return Err("its size is not that of its pixels".into());
    }
    reader.next_frame(&mut data).map_err(wrong)?;
    let value = |b: &[u8]| b.iter().fold(0.0, |sum, byte| 256.0 * sum + f32::from(*byte));
    Ok(Pages {
        values: vec![data.chunks_exact(bytes).map(value).collect()],
        largest: Some(value(&[u8::MAX; 2][..bytes])),
    })
}
