//! PNG files of 16 bits.

use std::io::Cursor;
use std::path::Path;

use metalith_core::text::hex;
use metalith_core::{AtomicFile, Result};
use metalith_sensor::Camera;
use ndarray::{Array2, Array3};
use sha2::{Digest, Sha256};

/// Keyword of the text that says what a picture was made from, with the digest of its numbers.
const SOURCE: &str = "metalith source";
/// Number of full scale.
pub(crate) const WHITE: u16 = u16::MAX;
/// Longest file (bytes), and most bytes of its numbers.
pub(crate) const LONGEST: u64 = 1 << 30;
/// Bytes that a whole file ends with.
const END: &[u8] = b"\0\0\0\0IEND\xaeB`\x82";

/// Keyword of the text that says what the numbers of a frame mean.
const LEVELS: &str = "metalith levels";

/// Meaning of the numbers of a frame that this program wrote. It stands in the file of the frame, because a file is renamed and moved
/// without those beside it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct FrameLevels {
    /// Number where there is no signal; full scale is [`WHITE`].
    pub black: u16,
    /// Digest of the camera: see [`camera_digest`].
    pub camera: String,
}

impl FrameLevels {
    fn words(&self) -> String {
        format!("black {} white {WHITE} camera {}", self.black, self.camera)
    }

    fn of_words(words: &str) -> Option<Self> {
        let ["black", black, "white", white, "camera", camera] = words.split(' ').collect::<Vec<_>>()[..] else {
            return None;
        };
        (white.parse() == Ok(WHITE)).then_some(())?;
        Some(Self {
            black: black.parse().ok()?,
            camera: camera.to_owned(),
        })
    }
}

/// Digest of all that a camera does to light, whatever it is called: SHA-256 in hexadecimal.
pub(crate) fn camera_digest(camera: &Camera) -> String {
    let parts = (&camera.sensor, &camera.channels, &camera.illuminant, &camera.exposure);
    digest_of(&serde_json::to_vec(&parts).expect("plain data serialises"))
}

/// Levels of a frame that this program wrote; none of another file.
pub(crate) fn levels_of(bytes: &[u8]) -> Option<FrameLevels> {
    let reader = png::Decoder::new(Cursor::new(bytes)).read_info().ok()?;
    let texts = &reader.info().uncompressed_latin1_text;
    FrameLevels::of_words(&texts.iter().find(|t| t.keyword == LEVELS)?.text)
}

/// Planes below one another, full scale being one, and what they were made from.
pub(crate) fn grey(planes: &[Array2<f32>], levels: &FrameLevels, source: &str) -> Vec<u8> {
    let black = levels.black;
    let (rows, columns) = planes[0].dim();
    let numbers = planes.iter().flatten();
    let data: Vec<u8> = numbers.flat_map(|v| number(f64::from(*v), black)).collect();
    encode(
        rows * planes.len(),
        columns,
        png::ColorType::Grayscale,
        &data,
        Some(source),
        Some(levels),
    )
}

/// Red, green and blue `[row, column, colour]`, full scale being one, and what they were made from.
pub(crate) fn colour(values: &Array3<f64>, source: Option<&str>) -> Vec<u8> {
    let (rows, columns, _) = values.dim();
    let data: Vec<u8> = values.iter().flat_map(|v| number(*v, 0)).collect();
    encode(rows, columns, png::ColorType::Rgb, &data, source, None)
}

/// Write a picture `[row, column, colour]` of sRGB values from 0 to 1 as a PNG of 16 bits.
///
/// # Errors
/// If it cannot be written; then what stood there before still does.
pub fn write_picture(path: &Path, values: &Array3<f64>) -> Result<()> {
    AtomicFile::write(path, &colour(values, None))
}

/// Source that the picture of a file was made from; `None` if the file is damaged or does not say so, or its numbers
/// are not those that were written with it.
pub(crate) fn source_of(bytes: &[u8]) -> Option<String> {
    if !bytes.ends_with(END) {
        return None;
    }
    let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().ok()?;
    let mut data = vec![0; reader.output_buffer_size().filter(|n| *n as u64 <= LONGEST)?];
    reader.next_frame(&mut data).ok()?;
    reader.finish().ok()?;
    let texts = &reader.info().uncompressed_latin1_text;
    let words_of = |keyword: &str| texts.iter().find(|t| t.keyword == keyword).map(|t| t.text.as_str());
    let (source, digest) = words_of(SOURCE)?.rsplit_once(' ')?;
    (digest == digest_of_all(&data, words_of(LEVELS))).then(|| source.to_owned())
}

fn digest_of(data: &[u8]) -> String {
    hex(&Sha256::digest(data))
}

/// Digest of the numbers of a picture, and of what they mean.
fn digest_of_all(data: &[u8], levels: Option<&str>) -> String {
    match levels {
        Some(words) => digest_of(&[data, words.as_bytes()].concat()),
        None => digest_of(data),
    }
}

fn number(value: f64, black: u16) -> [u8; 2] {
    let white = f64::from(WHITE);
    let number = f64::from(black) + value * (white - f64::from(black));
    (number.round().clamp(0.0, white) as u16).to_be_bytes()
}

fn encode(
    rows: usize,
    columns: usize,
    colour: png::ColorType,
    data: &[u8],
    source: Option<&str>,
    levels: Option<&FrameLevels>,
) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, columns as u32, rows as u32);
    encoder.set_color(colour);
    encoder.set_depth(png::BitDepth::Sixteen);
    let levels = levels.map(FrameLevels::words);
    if let Some(source) = source {
        encoder
            .add_text_chunk(
                SOURCE.into(),
                format!("{source} {}", digest_of_all(data, levels.as_deref())),
            )
            .expect("digits and plain words");
    }
    if let Some(levels) = levels {
        encoder
            .add_text_chunk(LEVELS.into(), levels)
            .expect("digits and plain words");
    }
    // Writing to memory fails only for a wrong size, which is ours to keep.
    let mut writer = encoder.write_header().expect("a header fits in memory");
    writer.write_image_data(data).expect("as many bytes as pixels");
    writer.finish().expect("an end fits in memory");
    bytes
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Levels above a number, of no camera.
    pub(crate) fn above(black: u16) -> FrameLevels {
        FrameLevels {
            black,
            camera: "c0".into(),
        }
    }

    /// The numbers of a picture of 16 bits, row by row.
    pub(crate) fn numbers(bytes: &[u8]) -> Vec<u16> {
        let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().unwrap();
        let mut data = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut data).unwrap();
        data.as_chunks().0.iter().map(|b| u16::from_be_bytes(*b)).collect()
    }

    #[test]
    fn sixteen_bits_are_kept() {
        let plane = Array2::from_shape_fn((4, 6), |(y, x)| (y * 6 + x) as f32 / 24.0);
        let bytes = grey(&[plane.clone(), plane.clone()], &above(0), "a1b2 frame");
        assert_eq!(source_of(b""), None);
        assert_eq!(levels_of(&bytes), Some(above(0)));
        assert_eq!(source_of(&bytes).as_deref(), Some("a1b2 frame"));
        let reader = png::Decoder::new(Cursor::new(&bytes)).read_info().unwrap();
        assert_eq!((reader.info().width, reader.info().height), (6, 8));
        let value = f64::from(numbers(&bytes)[29]) / 65535.0;
        // Half a step of sixteen bits, and single precision.
        assert!((value - 5.0 / 24.0).abs() < 1e-5);
    }

    #[test]
    fn signals_below_nothing_are_kept_above_a_black_level() {
        const BLACK: u16 = 1000;
        let step = 1.0 / f64::from(WHITE - BLACK);
        let plane = Array2::from_shape_fn((1, 4), |(_, x)| [-300.0 * step, 0.0, 0.25, 1.0][x] as f32);
        let quarter = (f64::from(BLACK) + 0.25 / step).round() as u16;
        assert_eq!(
            numbers(&grey(&[plane], &above(BLACK), "")),
            [700, BLACK, quarter, WHITE]
        );
    }

    /// A file that was cut, changed anywhere or has other pixels with the same words says nothing.
    #[test]
    fn damaged_pictures_are_noticed() {
        let plane = Array2::from_shape_fn((9, 8), |(y, x)| ((y * 5 + x * 3) % 7) as f32 / 7.0);
        let whole = grey(&[plane], &above(64), "a1b2 frame");
        assert!(source_of(&whole).is_some());
        for end in [0, 20, whole.len() / 2, whole.len() - 1] {
            assert_eq!(source_of(&whole[..end]), None, "{end}");
        }
        assert_eq!(source_of(&[&whole[..], b"more"].concat()), None);
        for k in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[k] ^= 1;
            assert_eq!(source_of(&bytes), None, "byte {k}");
        }
        let text = format!("a1b2 frame {}", digest_of(b"others"));
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 1, 1);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(png::BitDepth::Sixteen);
        encoder.add_text_chunk(SOURCE.into(), text).unwrap();
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(&[1, 2]).unwrap();
        writer.finish().unwrap();
        assert_eq!(source_of(&bytes), None);
    }
}
