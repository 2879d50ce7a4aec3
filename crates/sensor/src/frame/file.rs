//! Formats of frames, recognised by their first bytes.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use metalith_core::{file_kind, fits, npy, png, tiff};

use super::{MOST_PIXELS, Pages, other_size};

/// Endings of the names of frames.
pub const ENDINGS: [&str; 7] = ["npy", "png", "tif", "tiff", "fits", "fit", "fts"];

/// Endings of raw files of cameras that begin as TIFF does.
const RAW: [&str; 7] = ["dng", "cr2", "nef", "arw", "orf", "rw2", "pef"];

/// Bytes by which formats are recognised.
const BEGIN: u64 = 32;

/// Format of a frame.
#[derive(Clone, Copy, PartialEq)]
enum Format {
    Png,
    Tiff,
    Fits,
    Npy,
}

impl Format {
    fn of(path: &Path) -> Result<Self, String> {
        let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        let ending = ending.to_ascii_lowercase();
        if RAW.contains(&&ending[..]) {
            return Err(file_kind::RAW.into());
        }
        let mut first = Vec::new();
        let read = opened(path)?.take(BEGIN).read_to_end(&mut first);
        read.map_err(|e| format!("it cannot be read: {e}"))?;
        match &first[..] {
            [0x89, b'P', b'N', b'G', ..] => Ok(Self::Png),
            [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => Ok(Self::Tiff),
            [b'S', b'I', b'M', b'P', b'L', b'E', ..] => Ok(Self::Fits),
            [0xFF, 0xD8, ..] => {
                Err("it is JPEG, whose numbers are no longer those of the sensor: record NPY, PNG, TIFF or FITS".into())
            }
            other => match (file_kind::words(other), &ending[..]) {
                (Some(words), _) => Err(words.into()),
                (_, "png") => Ok(Self::Png),
                (_, "tif" | "tiff") => Ok(Self::Tiff),
                (_, "fits" | "fit" | "fts") => Ok(Self::Fits),
                _ => Ok(Self::Npy),
            },
        }
    }
}

fn opened(path: &Path) -> Result<BufReader<File>, String> {
    let file = File::open(path).map_err(|e| format!("it cannot be read: {e}"))?;
    if !file.metadata().is_ok_and(|meta| meta.is_file()) {
        return Err("it is not an ordinary file".into());
    }
    Ok(BufReader::new(file))
}

/// Frames of a file, each of so many rows and columns.
pub(super) fn pages(path: &Path, rows: usize, cols: usize) -> Result<Pages, String> {
    let sized = |found| {
        if found == (rows, cols) {
            Ok(())
        } else {
            Err(other_size(found, rows, cols))
        }
    };
    let in_bounds = |count: usize| match count as u64 * (rows * cols) as u64 {
        0..=MOST_PIXELS => Ok(()),
        _ => Err(format!(
            "it has {count} pages or more, which are more than {MOST_PIXELS} pixels"
        )),
    };
    match Format::of(path)? {
        Format::Png => {
            let read = png::read_grey(opened(path)?, |own_rows, own_cols| sized((own_rows, own_cols)))?;
            Ok(Pages {
                largest: Some(read.largest().into()),
                values: vec![read.numbers.into_iter().map(f32::from).collect()],
            })
        }
        Format::Tiff => {
            let read = tiff::read(opened(path)?, |page, [own_rows, own_cols, channels]| {
                sized((own_rows, own_cols))?;
                if channels > 1 {
                    return Err(format!("its pixels have {channels} colours, not grey"));
                }
                in_bounds(page + 1)
            })?;
            Ok(Pages {
                largest: read.pages.first().and_then(|page| page.largest),
                values: read.pages.into_iter().map(|page| page.values).collect(),
            })
        }
        Format::Fits => {
            let read = fits::read(opened(path)?, |[count, own_rows, own_cols]| {
                sized((own_rows, own_cols))?;
                in_bounds(count)
            })?;
            Ok(Pages {
                values: read.values,
                largest: read.largest,
            })
        }
        Format::Npy => from_npy(path, rows, cols),
    }
}

/// Rows and columns of the frames of a file.
///
/// # Errors
/// What is wrong with the file, in words.
pub fn size(path: &Path) -> Result<(usize, usize), String> {
    let mut size = None;
    // The shape is all that is wanted: no array is read.
    let read = match Format::of(path)? {
        Format::Png => return png::size(opened(path)?),
        Format::Tiff => return tiff::size(opened(path)?),
        Format::Fits => fits::read(opened(path)?, |[_, rows, cols]| {
            size = Some((rows, cols));
            Err(String::new())
        })
        .err(),
        Format::Npy => npy::read(path, |shape| {
            size = match shape {
                [.., rows, cols] if shape.len() <= 3 => Some((*rows as usize, *cols as usize)),
                _ => None,
            };
            false
        })
        .err()
        .map(|e| e.to_string()),
    };
    size.ok_or_else(|| read.unwrap_or_default())
}

fn from_npy(path: &Path, rows: usize, cols: usize) -> Result<Pages, String> {
    let one = [rows as u64, cols as u64];
    let takes = |shape: &[u64]| {
        shape == one
            || (shape.len() == 3 && shape[1..] == one && shape[0] > 0 && shape[0] <= MOST_PIXELS / (one[0] * one[1]))
    };
    let array = npy::read(path, takes).map_err(|error| match error {
        npy::NpyError::Shape { .. } => format!("{error}, the camera says [{rows}, {cols}]"),
        other => other.to_string(),
    })?;
    let frames = array.values.chunks_exact(rows * cols);
    Ok(Pages {
        values: frames.map(|f| f.iter().map(|&v| v as f32).collect()).collect(),
        largest: None,
    })
}
