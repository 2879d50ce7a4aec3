//! PNG files of 16 bits.

use std::path::Path;

use metalith_core::{Result, WholeFile};
use ndarray::{Array2, Array3};

/// Keyword of the text that says what a picture was made from.
const SOURCE: &str = "metalith source";

/// Planes below one another, full scale being one, and what they were made from.
pub(crate) fn grey(planes: &[Array2<f32>], source: &str) -> Vec<u8> {
    let (rows, columns) = planes[0].dim();
    let data: Vec<u8> = planes.iter().flatten().flat_map(|v| sixteen(f64::from(*v))).collect();
    encode(
        rows * planes.len(),
        columns,
        png::ColorType::Grayscale,
        &data,
        Some(source),
    )
}

/// Red, green and blue `[row, column, colour]`, full scale being one, and what they were made from.
pub(crate) fn colour(values: &Array3<f64>, source: Option<&str>) -> Vec<u8> {
    let (rows, columns, _) = values.dim();
    let data: Vec<u8> = values.iter().flat_map(|v| sixteen(*v)).collect();
    encode(rows, columns, png::ColorType::Rgb, &data, source)
}

/// Write a picture `[row, column, colour]` of sRGB values from 0 to 1 as a PNG of 16 bits.
///
/// # Errors
/// If it cannot be written; then what stood there before still does.
pub fn write_picture(path: &Path, values: &Array3<f64>) -> Result<()> {
    WholeFile::write(path, &colour(values, None))
}

/// What a picture was made from; none if there is no such file, or it does not say so.
pub(crate) fn source_of(path: &Path) -> Option<String> {
    let file = std::io::BufReader::new(std::fs::File::open(path).ok()?);
    let reader = png::Decoder::new(file).read_info().ok()?;
    let texts = &reader.info().uncompressed_latin1_text;
    texts.iter().find(|t| t.keyword == SOURCE).map(|t| t.text.clone())
}

fn sixteen(value: f64) -> [u8; 2] {
    ((value.clamp(0.0, 1.0) * 65535.0).round() as u16).to_be_bytes()
}

fn encode(rows: usize, columns: usize, colour: png::ColorType, data: &[u8], source: Option<&str>) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, columns as u32, rows as u32);
    encoder.set_color(colour);
    encoder.set_depth(png::BitDepth::Sixteen);
    if let Some(source) = source {
        encoder
            .add_text_chunk(SOURCE.into(), source.into())
            .expect("digits and plain words");
    }
    // Writing to memory fails only for a wrong size, which is ours to keep.
    let mut writer = encoder.write_header().expect("a header fits in memory");
    writer.write_image_data(data).expect("as many bytes as pixels");
    writer.finish().expect("an end fits in memory");
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixteen_bits_are_kept() {
        let plane = Array2::from_shape_fn((4, 6), |(y, x)| (y * 6 + x) as f32 / 24.0);
        let bytes = grey(&[plane.clone(), plane.clone()], "a1b2");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frame.png");
        std::fs::write(&path, &bytes).unwrap();
        assert_eq!(source_of(&path).as_deref(), Some("a1b2"));
        assert_eq!(source_of(&folder.path().join("none.png")), None);
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut data = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut data).unwrap();
        assert_eq!((reader.info().width, reader.info().height), (6, 8));
        let value = f64::from(u16::from_be_bytes([data[2 * 29], data[2 * 29 + 1]])) / 65535.0;
        // Half a step of sixteen bits, and single precision.
        assert!((value - 5.0 / 24.0).abs() < 1e-5);
    }
}
