//! Files of scenes.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use metalith_core::file::read_at_most;
use metalith_core::{Error, Result, npy, srgb};
use ndarray::Array3;

use super::pictures::{Stored, stored};
use super::pixel_count::{SIDES, sides_words};
use super::{SceneImage, cube};
use crate::geometry::SceneView;

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

/// Read a scene: PNG, JPEG or TIFF of 8 or 16 bits, in sRGB or with a colour profile; TIFF with a decimal point, EXR or NPY of
/// linear light, `[row, column]` or `[row, column, colour]`; NPY `[row, column, band]` of reflectance with the wavelengths
/// of its bands.
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
            let array = light(path, &bytes)?;
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
            let rgb = if is_npy {
                grey_or_colour(path, light(path, &bytes)?)?
            } else {
                match stored(path, &bytes)? {
                    Stored::Srgb(values) => values.mapv_into(srgb::linear),
                    Stored::Light(light) => light,
                }
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
        return Ok(grey_or_colour(path, light(path, &bytes)?)?.mapv_into(srgb::encoded));
    }
    Ok(match stored(path, &bytes)? {
        Stored::Srgb(values) => values,
        Stored::Light(light) => light.mapv_into(srgb::encoded),
    })
}

fn is_npy(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x93NUMPY")
}

pub(super) fn fault(path: &Path, what: impl Into<String>) -> Error {
    let hint = format!(
        "give a PNG or TIFF (8 or 16 bits, opaque) or a JPEG, in sRGB or with a colour profile, an EXR, TIFF or NPY of linear light of shape (rows, columns) or (rows, columns, 3), or an NPY cube with its wavelengths, {}",
        sides_words()
    );
    Error::table(path, None, what, hint)
}

pub(super) fn check_sides(path: &Path, rows: usize, columns: usize) -> Result<()> {
    sides(rows, columns).map_err(|what| fault(path, what))
}

pub(super) fn sides(rows: usize, columns: usize) -> Result<(), String> {
    if SIDES.contains(&rows) && SIDES.contains(&columns) {
        return Ok(());
    }
    Err(format!("it has {columns} x {rows} pixels"))
}

/// An array of two or three axes, and whether it has whole numbers; one of two axes gets a third of one entry.
pub(super) fn array(path: &Path, bytes: &[u8]) -> Result<(Array3<f64>, bool)> {
    let sides = |shape: &[u64]| (2..=3).contains(&shape.len()) && shape.iter().all(|n| *n <= *SIDES.end() as u64);
    let found = npy::read_from(Cursor::new(bytes), sides).map_err(|e| fault(path, e.to_string()))?;
    let shape: Vec<usize> = found.shape.iter().map(|n| *n as usize).collect();
    check_sides(path, shape[0], shape[1])?;
    let bands = shape.get(2).copied().unwrap_or(1);
    if bands == 0 {
        return Err(fault(path, "it has no colours"));
    }
    let array = Array3::from_shape_vec((shape[0], shape[1], bands), found.values);
    Ok((array.map_err(|e| fault(path, e.to_string()))?, found.whole))
}

/// An array of linear light, white being one.
fn light(path: &Path, bytes: &[u8]) -> Result<Array3<f64>> {
    let (array, whole) = array(path, bytes)?;
    if whole {
        let what = "it has whole numbers, and linear light of which white is 1 has fractions";
        let hint = "divide it by its white and save it as float32 or float64: `numpy.save(file, values / white)`; of values in sRGB make a PNG";
        return Err(Error::table(path, None, what, hint));
    }
    if array.iter().any(|v| !v.is_finite() || *v < 0.0) {
        return Err(fault(path, "it holds light that is negative or no number"));
    }
    Ok(array)
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

#[cfg(test)]
pub(super) mod tests {
    use super::super::colours::Colours;
    use super::super::colours::tests::{P3, curve_of_srgb, profile};
    use super::super::pictures::orientation;
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
    pub(crate) fn npy_bytes(shape: &str, values: &[f64]) -> Vec<u8> {
        metalith_testing::npy("<f8", shape, values.iter().flat_map(|v| v.to_le_bytes()))
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

    /// A JPEG of a camera that was held otherwise is turned upright, whatever the order of its bytes.
    #[test]
    fn photographs_stand_upright() {
        let plain = std::fs::read("../../tests/mutants/small.jpg").unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.jpg");
        let read = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            read_picture(&path).unwrap()
        };
        let stored = read(&plain);
        let (rows, columns, _) = stored.dim();
        assert_ne!(rows, columns);
        let held = |orientation: u8, little: bool| {
            let entry = |tag: u16, value: u16| {
                let words = [tag, 3, 1, value];
                let bytes = words.map(|w| if little { w.to_le_bytes() } else { w.to_be_bytes() });
                // The number of values has four bytes, the value two of its four.
                let count = if little { [bytes[2], [0; 2]] } else { [[0; 2], bytes[2]] };
                [bytes[0], bytes[1], count[0], count[1], bytes[3], [0; 2]].concat()
            };
            let head: &[u8] = if little {
                b"II*\0\x08\0\0\0\x02\0"
            } else {
                b"MM\0*\0\0\0\x08\0\x02"
            };
            let exif = [
                &b"Exif\0\0"[..],
                head,
                &entry(256, 7),
                &entry(274, orientation.into()),
                &[0; 4],
            ]
            .concat();
            let length = (exif.len() as u16 + 2).to_be_bytes();
            [&plain[..2], &[0xff, 0xe1], &length, &exif, &plain[2..]].concat()
        };
        assert!(read(&held(1, true)) == stored);
        // Places of the stored picture, by row and column of what was seen.
        let (last_row, last_column) = (rows - 1, columns - 1);
        let at = |orientation: u8, y: usize, x: usize| match orientation {
            2 => [y, last_column - x],
            3 => [last_row - y, last_column - x],
            5 => [x, y],
            6 => [last_row - x, y],
            _ => [x, last_column - y],
        };
        for orientation in [2, 3, 5, 6, 8] {
            for little in [true, false] {
                let turned = read(&held(orientation, little));
                assert_eq!(turned.dim().0, if orientation < 5 { rows } else { columns });
                for ((y, x, c), v) in turned.indexed_iter() {
                    let [row, column] = at(orientation, y, x);
                    assert!(*v == stored[[row, column, c]], "{orientation} {y} {x}");
                }
            }
        }
        assert!(
            [&b"II*\0\xff\xff\xff\xff"[..], b"MM", b""]
                .iter()
                .all(|exif| orientation(exif) == 1)
        );
    }

    /// A PNG of one colour, with chunks behind its head.
    fn png_with(colour: [u8; 3], chunks: impl FnOnce(&mut png::Info<'_>)) -> Vec<u8> {
        let mut info = png::Info::with_size(16, 20);
        info.color_type = png::ColorType::Rgb;
        info.bit_depth = png::BitDepth::Eight;
        chunks(&mut info);
        let mut bytes = Vec::new();
        let encoder = png::Encoder::with_info(&mut bytes, info).unwrap();
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(&colour.repeat(16 * 20)).unwrap();
        writer.finish().unwrap();
        bytes
    }

    /// Profiles, gamma and rotation of PNG, and profiles of JPEG and TIFF, are used.
    #[test]
    fn colours_are_those_that_a_file_states() {
        /// Digits of a profile.
        const TOLERANCE: f64 = 5e-4;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.bin");
        let scene = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            read_scene(&file(&path, None)).unwrap()
        };
        let light = |bytes: &[u8]| {
            let rgb = scene(bytes).rgb();
            [0, 1, 2].map(|c| rgb[[0, 0, c]])
        };
        let near = |found: [f64; 3], want: [f64; 3]| {
            let apart = (0..3).map(|c| (found[c] - want[c]).abs()).fold(0.0, f64::max);
            assert!(apart < TOLERANCE, "{found:?} {want:?}");
        };
        let grey = 100.0 / 255.0;
        near(
            light(&png_with([100; 3], |info| {
                info.source_gamma = Some(png::ScaledFloat::new(1.0));
            })),
            [grey; 3],
        );
        near(
            light(&png_with([100; 3], |info| {
                info.source_gamma = Some(png::ScaledFloat::new(0.45455));
            })),
            [srgb::linear(grey); 3],
        );
        let p3 = profile(P3, &curve_of_srgb());
        let red = [1.22494, 0.0, 0.0];
        near(
            light(&png_with([255, 0, 0], |info| {
                info.icc_profile = Some(p3.clone().into());
            })),
            red,
        );
        // A picture is cut to what sRGB has.
        let values = read_picture(&path).unwrap();
        assert!((values[[0, 0, 0]] - 1.0).abs() < 1e-6 && values[[0, 0, 1]] == 0.0);
        let odd = png_with([255, 0, 0], |info| info.icc_profile = Some(b"no profile".into()));
        std::fs::write(&path, odd).unwrap();
        assert!(read_scene(&file(&path, None)).is_err());
        let exif = [&b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0"[..], &[0; 4]].concat();
        let turned = scene(&png_with([9; 3], |info| info.exif_metadata = Some(exif.into())));
        assert_eq!((turned.view.rows, turned.view.columns), (16, 20));

        let plain = std::fs::read("../../tests/mutants/small.jpg").unwrap();
        let chunk = [&b"ICC_PROFILE\0\x01\x01"[..], &p3].concat();
        let length = (chunk.len() as u16 + 2).to_be_bytes();
        let marked = [&plain[..2], &[0xff, 0xe2], &length, &chunk, &plain[2..]].concat();
        let (of_srgb, of_p3) = (scene(&plain).rgb(), scene(&marked).rgb());
        let colours = Colours::of_profile(&p3).unwrap();
        let wanted = colours.light(&of_srgb.mapv(srgb::encoded));
        assert!(of_p3.iter().zip(&wanted).all(|(a, b)| (a - b).abs() < TOLERANCE));
        assert!(
            of_p3
                .iter()
                .zip(&of_srgb)
                .any(|(a, b)| (a - b).abs() > 10.0 * TOLERANCE)
        );
    }

    #[test]
    fn tiff_and_exr_are_read() {
        use ::exr::prelude::{f16, write_rgb_file};
        use ::tiff::encoder::{TiffEncoder, colortype};
        /// Digits of half precision.
        const HALF: f64 = 5e-4;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.bin");
        let half = srgb::linear(188.0 / 255.0);
        let check = |want: f64| {
            let rgb = read_scene(&file(&path, None)).unwrap().rgb();
            assert!(rgb.iter().all(|v| (v - want).abs() < HALF), "{} {want}", rgb[[0, 0, 0]]);
        };
        fn encoded<C: ::tiff::encoder::colortype::ColorType>(path: &Path, values: &[C::Inner])
        where
            [C::Inner]: ::tiff::encoder::TiffValue,
        {
            let mut encoder = TiffEncoder::new(std::fs::File::create(path).unwrap()).unwrap();
            encoder.write_image::<C>(16, 16, values).unwrap();
        }
        encoded::<colortype::RGB8>(&path, &[188; 768]);
        check(half);
        encoded::<colortype::Gray16>(&path, &[48316; 256]);
        check(half);
        encoded::<colortype::RGB32Float>(&path, &[half as f32; 768]);
        check(half);
        encoded::<colortype::RGBA8>(&path, &[7; 1024]);
        assert!(read_scene(&file(&path, None)).is_err());
        let exr = folder.path().join("scene.exr");
        let write = |value: f32| write_rgb_file(&exr, 16, 16, |_, _| [value; 3].map(f16::from_f32).into()).unwrap();
        write(half as f32);
        std::fs::copy(&exr, &path).unwrap();
        check(half);
        // White is 1, and light may be more.
        write(7.5);
        std::fs::copy(&exr, &path).unwrap();
        check(7.5);
        write(f32::NAN);
        std::fs::copy(&exr, &path).unwrap();
        assert!(read_scene(&file(&path, None)).is_err());
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
        refused(b"unknown", None, "neither");
        refused(b"GIF89a", None, "GIF");
        refused(b"RIFF\0\0\0\0WEBPVP8 ", None, "dwebp");
        refused(b"\0\0\0\x1cftypavif", None, "avifdec");
        refused(b"II*\0\x08\0\0\0", None, "TIFF");
        refused(&[0x76, 0x2f, 0x31, 0x01, 2, 0], None, "EXR");
        refused(&npy_bytes("(16, 16, 4)", &[0.1; 1024]), None, "bands");
        refused(
            &npy_bytes("(16, 16, 4)", &[0.1; 1024]),
            Some(vec![500.0, 400.0]),
            "wavelengths",
        );
        refused(&npy_bytes("(16, 16)", &[-0.1; 256]), None, "negative");
        refused(&npy_bytes("(16, 16)", &[f64::INFINITY; 256]), None, "no number");
        refused(
            &metalith_testing::npy("|u1", "(16, 16)", [128; 256]),
            None,
            "divide it by its white",
        );
        refused(
            &metalith_testing::npy("<u2", "(16, 16)", [117; 512]),
            None,
            "divide it by its white",
        );
        assert!(read_picture(&path).is_err());
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
