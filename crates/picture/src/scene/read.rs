//! Files of scenes.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use metalith_core::file::read_at_most;
use metalith_core::{Error, Result, npy, srgb};
use ndarray::Array3;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::{SceneImage, cube};
use crate::SceneView;

/// Shortest and longest side of a picture of a scene (pixels).
const SIDES: std::ops::RangeInclusive<usize> = 16..=4096;
/// Longest file (bytes): a cube of 1024 x 1024 with 31 bands in double precision, and some more.
pub(super) const LONGEST: u64 = 512 << 20;

/// A file, and what it does not say of its scene.
#[derive(Clone, Debug)]
pub struct SceneFile {
    pub path: PathBuf,
    /// Wavelengths of the bands of a spectral cube (nm); none for pictures in colour.
    pub wavelengths_nm: Option<Vec<f64>>,
    /// Angle from the left to the right edge (degrees).
    pub field_deg: f64,
    /// Distance of the scene (um).
    pub distance_um: f64,
}

/// Read a scene that is far away and no spectral cube; `field_deg` from its left to its right edge.
///
/// # Errors
/// As [`read_scene`].
pub fn read_far_scene(path: &Path, field_deg: f64) -> Result<SceneImage> {
    read_scene(&SceneFile {
        path: path.to_owned(),
        wavelengths_nm: None,
        field_deg,
        distance_um: f64::INFINITY,
    })
}

/// Read a scene: PNG of 8 or 16 bits or JPEG in sRGB; NPY of linear light, `[row, column]` or `[row, column, colour]`;
/// NPY `[row, column, band]` of reflectance with the wavelengths of its bands.
///
/// # Errors
/// If the file cannot be read or holds something else; the text says what is wrong and what to give.
pub fn read_scene(file: &SceneFile) -> Result<SceneImage> {
    let path = &file.path;
    let name = path
        .file_stem()
        .map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let bytes = read_at_most(path, LONGEST, "a picture of a scene")?;
    let is_npy = is_npy(&bytes);
    match (&file.wavelengths_nm, is_npy) {
        (Some(_), false) => Err(fault(path, "wavelengths are given, but this is no NPY file")),
        (Some(nm), true) => {
            let array = array(path, &bytes)?;
            let bands = array.dim().2;
            if nm.len() != bands || nm.len() < 2 || !nm.is_sorted_by(|a, b| a < b) || nm[0] <= 0.0 {
                return Err(fault(
                    path,
                    format!(
                        "{} wavelengths are given for {bands} bands, or they do not rise",
                        nm.len()
                    ),
                ));
            }
            let (basis, planes, left_out) = cube::planes(&array, nm);
            let (rows, columns, _) = array.dim();
            Ok(SceneImage {
                name,
                view: SceneView {
                    rows,
                    columns,
                    field_deg: file.field_deg,
                    distance_um: file.distance_um,
                },
                basis,
                planes,
                left_out,
                depth_um: None,
            })
        }
        (None, _) => {
            let rgb = match is_npy {
                true => grey_or_colour(path, array(path, &bytes)?)?,
                false => values(path, &bytes)?.mapv(srgb::linear),
            };
            Ok(SceneImage::of_rgb(&name, &rgb, file.field_deg, file.distance_um))
        }
    }
}

/// Read a picture, `[row, column, colour]` in sRGB values from 0 to 1: the same files as [`read_scene`], but for cubes.
///
/// # Errors
/// If the file cannot be read or holds something else.
pub fn read_picture(path: &Path) -> Result<Array3<f64>> {
    let bytes = read_at_most(path, LONGEST, "a picture")?;
    if is_npy(&bytes) {
        return Ok(grey_or_colour(path, array(path, &bytes)?)?.mapv(srgb::encoded));
    }
    values(path, &bytes)
}

fn is_npy(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x93NUMPY")
}

/// Values of an image file as they are stored, full scale being one.
fn values(path: &Path, bytes: &[u8]) -> Result<Array3<f64>> {
    if bytes.starts_with(b"\x89PNG") {
        Ok(png_values(path, bytes)?.0)
    } else if bytes.starts_with(&[0xff, 0xd8]) {
        jpeg(path, bytes)
    } else {
        Err(fault(path, "it is neither PNG, JPEG nor NPY"))
    }
}

fn fault(path: &Path, what: impl Into<String>) -> Error {
    Error::Table {
        path: path.to_owned(),
        line: None,
        what: what.into(),
        hint: format!(
            "give a PNG (8 or 16 bits, opaque) or JPEG in sRGB, an NPY of linear light of shape (rows, columns) or (rows, columns, 3), or an NPY cube with its wavelengths; {} to {} pixels a side",
            SIDES.start(),
            SIDES.end()
        ),
    }
}

fn check_sides(path: &Path, rows: usize, columns: usize) -> Result<()> {
    if SIDES.contains(&rows) && SIDES.contains(&columns) {
        return Ok(());
    }
    Err(fault(path, format!("it has {columns} x {rows} pixels")))
}

/// An array of two or three axes; one of two gets a third of one entry.
pub(super) fn array(path: &Path, bytes: &[u8]) -> Result<Array3<f64>> {
    let sides = |shape: &[u64]| (2..=3).contains(&shape.len()) && shape.iter().all(|n| *n <= *SIDES.end() as u64);
    let found = npy::read_from(Cursor::new(bytes), sides).map_err(|e| fault(path, e.to_string()))?;
    let shape: Vec<usize> = found.shape.iter().map(|n| *n as usize).collect();
    check_sides(path, shape[0], shape[1])?;
    if found.values.iter().any(|v| !v.is_finite() || *v < 0.0) {
        return Err(fault(path, "it holds light that is negative or no number"));
    }
    let bands = shape.get(2).copied().unwrap_or(1);
    Array3::from_shape_vec((shape[0], shape[1], bands), found.values).map_err(|e| fault(path, e.to_string()))
}

fn grey_or_colour(path: &Path, array: Array3<f64>) -> Result<Array3<f64>> {
    let (rows, columns, bands) = array.dim();
    match bands {
        3 => Ok(array),
        1 => Ok(Array3::from_shape_fn((rows, columns, 3), |(y, x, _)| array[[y, x, 0]])),
        _ => Err(fault(
            path,
            format!("it has {bands} bands and no wavelengths: give --wavelengths-nm"),
        )),
    }
}

/// Red, green and blue of an opaque PNG as they are stored, full scale being one; and whether values have 16 bits.
pub(super) fn png_values(path: &Path, bytes: &[u8]) -> Result<(Array3<f64>, bool)> {
    let wrong = |e: png::DecodingError| fault(path, e.to_string());
    let mut decoder = png::Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(wrong)?;
    let (columns, rows) = (reader.info().width as usize, reader.info().height as usize);
    check_sides(path, rows, columns)?;
    let size = reader
        .output_buffer_size()
        .ok_or_else(|| fault(path, "it is too large"))?;
    let mut data = vec![0; size];
    let info = reader.next_frame(&mut data).map_err(wrong)?;
    let samples = info.color_type.samples();
    let deep = info.bit_depth == png::BitDepth::Sixteen;
    let value = |y: usize, x: usize, c: usize| {
        let at = y * info.line_size + (x * samples + c) * if deep { 2 } else { 1 };
        if deep {
            f64::from(u16::from_be_bytes([data[at], data[at + 1]])) / 65535.0
        } else {
            f64::from(data[at]) / 255.0
        }
    };
    if samples % 2 == 0 && (0..rows).any(|y| (0..columns).any(|x| value(y, x, samples - 1) < 1.0)) {
        return Err(fault(path, "parts of it are transparent"));
    }
    let colours = Array3::from_shape_fn((rows, columns, 3), |(y, x, c)| {
        value(y, x, if samples < 3 { 0 } else { c })
    });
    Ok((colours, deep))
}

fn jpeg(path: &Path, bytes: &[u8]) -> Result<Array3<f64>> {
    let options = DecoderOptions::default()
        .jpeg_set_out_colorspace(ColorSpace::RGB)
        .set_max_width(*SIDES.end())
        .set_max_height(*SIDES.end());
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    let data = decoder.decode().map_err(|e| fault(path, e.to_string()))?;
    let (columns, rows) = decoder.dimensions().ok_or_else(|| fault(path, "it has no size"))?;
    check_sides(path, rows, columns)?;
    if data.len() != rows * columns * 3 {
        return Err(fault(path, "its colours are not those of a picture"));
    }
    Ok(Array3::from_shape_fn((rows, columns, 3), |(y, x, c)| {
        f64::from(data[(y * columns + x) * 3 + c]) / 255.0
    }))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    fn file(path: &Path, nm: Option<Vec<f64>>) -> SceneFile {
        SceneFile {
            path: path.to_owned(),
            wavelengths_nm: nm,
            field_deg: 60.0,
            distance_um: f64::INFINITY,
        }
    }

    fn png_bytes(colour: png::ColorType, depth: png::BitDepth, data: &[u8], side: u32) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, side, side);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(data).unwrap();
        writer.finish().unwrap();
        bytes
    }

    /// An NPY file of doubles in rows; `shape` as Python writes it.
    pub fn npy_bytes(shape: &str, values: &[f64]) -> Vec<u8> {
        let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        values.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
        bytes
    }

    #[test]
    fn every_format_gives_its_light() {
        // Single precision of the planes.
        const SINGLE: f64 = 1e-6;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.bin");
        let half = srgb::linear(188.0 / 255.0);
        let deep: Vec<u8> = (0..16 * 16).flat_map(|_| 48316u16.to_be_bytes()).collect();
        let cases = [
            (
                png_bytes(png::ColorType::Rgb, png::BitDepth::Eight, &[188; 16 * 16 * 3], 16),
                half,
            ),
            (
                png_bytes(png::ColorType::Grayscale, png::BitDepth::Sixteen, &deep, 16),
                half,
            ),
            (npy_bytes("(16, 16)", &[half; 256]), half),
            (npy_bytes("(16, 16, 3)", &[half; 768]), half),
        ];
        for (bytes, want) in cases {
            std::fs::write(&path, bytes).unwrap();
            let scene = read_scene(&file(&path, None)).unwrap();
            assert!(
                scene.rgb().iter().all(|v| (v - want).abs() < 10.0 * SINGLE),
                "{}",
                scene.rgb()[[0, 0, 0]]
            );
        }
        let cube: Vec<f64> = (0..16 * 16).flat_map(|_| [0.2, 0.4, 0.6, 0.8]).collect();
        std::fs::write(&path, npy_bytes("(16, 16, 4)", &cube)).unwrap();
        let nm = vec![400.0, 500.0, 600.0, 700.0];
        let scene = read_scene(&file(&path, Some(nm))).unwrap();
        let at = |nm: f64| -> f64 {
            let planes = scene.basis.iter().zip(&scene.planes);
            planes.map(|(b, p)| b.at(nm) * f64::from(p[[3, 5]])).sum()
        };
        assert!((at(550.0) - 0.5).abs() < SINGLE);
    }

    #[test]
    fn odd_files_are_refused_with_a_reason() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.bin");
        let refused = |bytes: &[u8], nm: Option<Vec<f64>>, word: &str| {
            std::fs::write(&path, bytes).unwrap();
            let error = read_scene(&file(&path, nm)).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        };
        refused(b"GIF89a", None, "neither");
        refused(&npy_bytes("(16, 16, 4)", &[0.1; 1024]), None, "bands");
        refused(
            &npy_bytes("(16, 16, 4)", &[0.1; 1024]),
            Some(vec![500.0, 400.0]),
            "wavelengths",
        );
        refused(&npy_bytes("(16, 16)", &[-0.1; 256]), None, "negative");
        refused(&npy_bytes("(8, 16)", &[0.1; 128]), None, "pixels");
        refused(
            &png_bytes(png::ColorType::Rgba, png::BitDepth::Eight, &[7; 1024], 16),
            None,
            "transparent",
        );
        refused(&[0xff, 0xd8, 0xff, 0x00, 1, 2, 3], None, "help");
        let whole = png_bytes(png::ColorType::Rgb, png::BitDepth::Eight, &[188; 768], 16);
        refused(&whole[..whole.len() / 2], None, "help");
    }
}
