//! Pictures of PNG, JPEG and TIFF, and what they say of their colours and of the way that the camera was held.

use std::io::Cursor;
use std::path::Path;

use metalith_core::{Result, file_kind, png, tiff};
use ndarray::Array3;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::colours::Colours;
use super::pixel_count::SIDES;
use super::read::{check_sides, fault, sides};
use super::{exr, jpeg};

/// Pixels of an image file.
pub(super) enum Stored {
    /// Values in sRGB, full scale being one.
    Srgb(Array3<f64>),
    /// Linear sRGB, white being one.
    Light(Array3<f64>),
}

impl Stored {
    fn of(values: Array3<f64>, colours: &Colours) -> Self {
        if colours.is_srgb() {
            Self::Srgb(values)
        } else {
            Self::Light(colours.light(&values))
        }
    }
}

pub(super) fn stored(path: &Path, bytes: &[u8]) -> Result<Stored> {
    if bytes.starts_with(b"\x89PNG") {
        let png = png_values(path, bytes)?;
        let colours = png.colours.map_err(|what| fault(path, what))?;
        let (rows, columns, _) = png.values.dim();
        let values = match png.orientation {
            1 => png.values,
            other => upright([rows, columns], other, |y, x, c| png.values[[y, x, c]]),
        };
        Ok(Stored::of(values, &colours))
    } else if bytes.starts_with(&[0xff, 0xd8]) {
        jpeg_values(path, bytes)
    } else if [&b"II*\0"[..], b"MM\0*", b"II+\0", b"MM\0+"]
        .iter()
        .any(|m| bytes.starts_with(m))
    {
        tiff_values(path, bytes)
    } else if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        let (light, colours) = exr::light(bytes, sides).map_err(|what| fault(path, what))?;
        finite(path, &light)?;
        Ok(Stored::Light(colours.light(&light)))
    } else {
        let named = file_kind::words(bytes);
        Err(fault(
            path,
            named.unwrap_or("it is neither PNG, JPEG, TIFF, EXR nor NPY"),
        ))
    }
}

fn finite(path: &Path, light: &Array3<f64>) -> Result<()> {
    if light.iter().all(|v| v.is_finite()) {
        Ok(())
    } else {
        Err(fault(path, "it holds light that is no number"))
    }
}

/// Pixels of the first page of a TIFF: whole numbers are values in sRGB or of the profile, others are linear light.
fn tiff_values(path: &Path, bytes: &[u8]) -> Result<Stored> {
    let read = tiff::read(Cursor::new(bytes), |page, [rows, columns, _]| match page {
        0 => sides(rows, columns),
        _ => Err("it has several pages: write the one that is meant".into()),
    });
    let read = read.map_err(|what| fault(path, what))?;
    let page = &read.pages[0];
    let full = page.largest.map_or(1.0, f64::from);
    let (own, colours) = (page.channels, if page.channels < 3 { 1 } else { 3 });
    let value = |y: usize, x: usize, c: usize| f64::from(page.values[(y * page.columns + x) * own + c]) / full;
    let (rows, columns) = (page.rows, page.columns);
    if own > colours && (0..rows).any(|y| (0..columns).any(|x| value(y, x, colours) < 1.0)) {
        return Err(fault(path, TRANSPARENT));
    }
    let values = upright([rows, columns], read.orientation, |y, x, c| {
        value(y, x, c.min(colours - 1))
    });
    finite(path, &values)?;
    let colours = match (&read.profile, page.largest) {
        (Some(profile), _) => Some(Colours::of_profile(profile).map_err(|what| fault(path, what))?),
        (None, Some(_)) => None,
        (None, None) => Some(Colours::linear(None)),
    };
    Ok(match colours {
        Some(colours) => Stored::of(values, &colours),
        None => Stored::Srgb(values),
    })
}

/// Word on a picture that is not opaque.
const TRANSPARENT: &str = "parts of it are transparent";

/// An opaque PNG.
pub(super) struct Png {
    /// Red, green and blue as they are stored, full scale being one.
    pub values: Array3<f64>,
    /// True if values have 16 bits.
    pub deep: bool,
    /// What the values are in light, or what is wrong with it.
    colours: Result<Colours, String>,
    /// As EXIF numbers it.
    orientation: u16,
}

pub(super) fn png_values(path: &Path, bytes: &[u8]) -> Result<Png> {
    let png = png::read(Cursor::new(bytes), |info| {
        sides(info.height as usize, info.width as usize)
    });
    let png = png.map_err(|what| fault(path, what))?;
    let (rows, columns, samples) = (png.info.height as usize, png.info.width as usize, png.channels);
    let value = |y: usize, x: usize, c: usize| {
        let at = y * png.row_bytes + (x * samples + c) * if png.is_deep { 2 } else { 1 };
        if png.is_deep {
            f64::from(u16::from_be_bytes([png.data[at], png.data[at + 1]])) / 65535.0
        } else {
            f64::from(png.data[at]) / 255.0
        }
    };
    if samples % 2 == 0 && (0..rows).any(|y| (0..columns).any(|x| value(y, x, samples - 1) < 1.0)) {
        return Err(fault(path, TRANSPARENT));
    }
    let values = Array3::from_shape_fn((rows, columns, 3), |(y, x, c)| {
        value(y, x, if samples < 3 { 0 } else { c })
    });
    Ok(Png {
        values,
        deep: png.is_deep,
        colours: Colours::of_png(&png.info),
        orientation: png.info.exif_metadata.as_deref().map_or(1, orientation),
    })
}

fn jpeg_values(path: &Path, bytes: &[u8]) -> Result<Stored> {
    jpeg::check_whole(bytes).map_err(|what| fault(path, what))?;
    let options = DecoderOptions::default()
        .jpeg_set_out_colorspace(ColorSpace::RGB)
        .set_strict_mode(true)
        .set_max_width(*SIDES.end())
        .set_max_height(*SIDES.end());
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    let data = decoder.decode().map_err(|e| fault(path, e.to_string()))?;
    let (columns, rows) = decoder.dimensions().ok_or_else(|| fault(path, "it has no size"))?;
    check_sides(path, rows, columns)?;
    if data.len() != rows * columns * 3 {
        return Err(fault(path, "its colours are not those of a picture"));
    }
    // A decoder takes blocks that are missing before the mark of the end as grey.
    let differs = |probed: Vec<u8>| {
        let probed = JpegDecoder::new_with_options(ZCursor::new(&probed[..]), options.set_strict_mode(false)).decode();
        probed.map_or(Some(0), |probed| {
            data.iter().zip(&probed).position(|(own, other)| own != other)
        })
    };
    if let Some(first) = jpeg::probed(bytes).and_then(differs) {
        let row = first / (3 * columns);
        return Err(fault(
            path,
            format!("it ends early: its data stop by row {row} of {rows}"),
        ));
    }
    let orientation = decoder.exif().map_or(1, |exif| orientation(exif));
    let stored = upright([rows, columns], orientation, |y, x, c| {
        f64::from(data[(y * columns + x) * 3 + c]) / 255.0
    });
    drop(data);
    Ok(match decoder.icc_profile() {
        Some(profile) => Stored::of(
            stored,
            &Colours::of_profile(&profile).map_err(|what| fault(path, what))?,
        ),
        None => Stored::Srgb(stored),
    })
}

/// Orientation in which a camera was held, as EXIF numbers it from 1 to 8 (tag 274); 1, upright, if the file does not
/// say.
pub(super) fn orientation(exif: &[u8]) -> u16 {
    const TAG: u16 = 274;
    /// Bytes of an entry, and those before its value.
    const ENTRY: [usize; 2] = [12, 8];
    let little = exif.starts_with(b"II");
    let word = |at: usize| {
        let bytes = exif.get(at..at.checked_add(2)?)?.try_into().ok()?;
        Some(if little {
            u16::from_le_bytes(bytes)
        } else {
            u16::from_be_bytes(bytes)
        })
    };
    let said = || {
        let halves = [word(4)?, word(6)?].map(usize::from);
        let first = if little {
            halves[0] | halves[1] << 16
        } else {
            halves[0] << 16 | halves[1]
        };
        let mut entries = (0..usize::from(word(first)?)).map(|k| first + 2 + k * ENTRY[0]);
        word(entries.find(|at| word(*at) == Some(TAG))? + ENTRY[1])
    };
    said().filter(|o| (1..=8).contains(o)).unwrap_or(1)
}

/// A picture of so many rows and columns as it was seen by a camera that was held so. Made at once from `stored`, row, column and
/// colour: a copy of a large picture costs as much memory as everything else.
fn upright([rows, columns]: [usize; 2], orientation: u16, stored: impl Fn(usize, usize, usize) -> f64) -> Array3<f64> {
    let is_turned = orientation >= 5;
    let (seen_rows, seen_columns) = if is_turned { (columns, rows) } else { (rows, columns) };
    Array3::from_shape_fn((seen_rows, seen_columns, 3), |(y, x, c)| {
        let y = if matches!(orientation, 3 | 4 | 7 | 8) {
            seen_rows - 1 - y
        } else {
            y
        };
        let x = if matches!(orientation, 2 | 3 | 6 | 7) {
            seen_columns - 1 - x
        } else {
            x
        };
        if is_turned { stored(x, y, c) } else { stored(y, x, c) }
    })
}
