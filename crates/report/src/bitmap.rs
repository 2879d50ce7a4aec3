//! Bitmaps: averaged until they fit a page, and embedded as text.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use metalith_core::part;
use ndarray::{Array2, ArrayView2};
use png::Encoder;

/// Averaged over whole blocks of values until no axis has more than `largest` of them; a block at the far border is what is
/// left there. What has no value (NaN) does not count, and a block of it alone has none.
pub(super) fn reduced(values: ArrayView2<f64>, largest: usize) -> Array2<f64> {
    let (rows, cols) = values.dim();
    let block = rows.max(cols).div_ceil(largest);
    if block <= 1 {
        return values.to_owned();
    }
    Array2::from_shape_fn((rows.div_ceil(block), cols.div_ceil(block)), |(i, j)| {
        let part = part(
            values,
            i * block..rows.min((i + 1) * block),
            j * block..cols.min((j + 1) * block),
        );
        let (sum, n) = part
            .iter()
            .filter(|x| !x.is_nan())
            .fold((0.0, 0u32), |(sum, n), &x| (sum + x, n + 1));
        sum / f64::from(n)
    })
}

/// A PNG as `data:` address. `pixels` row by row from the top, one byte for each of their channels; `kind` says what the bytes
/// are. A picture without pixels is shown as one, `empty`.
pub(super) fn address(
    (rows, columns): (usize, usize),
    pixels: &[u8],
    empty: &[u8],
    kind: impl FnOnce(&mut Encoder<'_, &mut Vec<u8>>),
) -> String {
    let (rows, columns, pixels) = if pixels.is_empty() {
        (1, 1, empty)
    } else {
        (rows, columns, pixels)
    };
    let mut file = Vec::new();
    let mut encoder = Encoder::new(&mut file, columns as u32, rows as u32);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    kind(&mut encoder);
    // Writing to memory fails only for a wrong size, which is ours to keep.
    let mut writer = encoder.write_header().expect("a header fits in memory");
    writer.write_image_data(pixels).expect("as many bytes as pixels");
    writer.finish().expect("an end fits in memory");
    format!("data:image/png;base64,{}", STANDARD.encode(file))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Size and bytes of a picture, colours and opacity of palettes written out.
    pub(crate) fn decode(address: &str) -> (png::OutputInfo, Vec<u8>) {
        let bytes = STANDARD
            .decode(address.strip_prefix("data:image/png;base64,").unwrap())
            .unwrap();
        let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        (info, pixels)
    }

    #[test]
    fn the_last_block_is_the_mean_of_what_is_left() {
        let values = Array2::from_shape_fn((1, 7), |(_, x)| x as f64);
        let means = reduced(values.view(), 3);
        assert_eq!(means, ndarray::arr2(&[[1.0, 4.0, 6.0]]));
        assert_eq!(reduced(values.view(), 7), values);
    }
}
