//! Frames and maps from NPY, TIFF, FITS, PNG and CSV files.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use metalith_core::{fits, npy, png, tiff};
use ndarray::Array2;
use num_complex::Complex64;

/// Most samples of a map or frame along an axis, and fewest.
const MOST: usize = 8192;
const FEWEST: usize = 8;

/// Most samples of all frames of a file.
const MOST_SAMPLES: usize = 1 << 27;

/// Frames of a file, one or many, all of one size. What is wrong comes back in words.
pub(super) fn frames(path: &Path) -> Result<Vec<Array2<f32>>, String> {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    let frames = match ending.to_ascii_lowercase().as_str() {
        "tif" | "tiff" => from_tiff(path)?,
        "fits" | "fit" | "fts" => from_fits(path)?,
        "png" => vec![from_png(path)?],
        "csv" | "txt" => vec![from_csv(path)?],
        _ => from_npy(path)?,
    };
    if frames.is_empty() {
        return Err("it has no frame".into());
    }
    let wrong = frames.iter().flatten().filter(|v| !v.is_finite()).count();
    match wrong {
        0 => Ok(frames),
        _ => Err(format!("{wrong} of its samples are not finite numbers")),
    }
}

/// One map.
pub(super) fn map(path: &Path) -> Result<Array2<f32>, String> {
    let mut all = frames(path)?;
    match (all.pop(), all.len()) {
        (Some(map), 0) => Ok(map),
        (_, more) => Err(format!("it has {} pages, a map has one", more + 1)),
    }
}

/// Complex values from an NPY file.
pub(super) fn fields(path: &Path) -> Result<Array2<Complex64>, String> {
    let array = npy::read_fields(path, |shape| {
        shape.len() == 2 && shape.iter().all(|&n| along(n as usize))
    });
    let array = array.map_err(|e| e.to_string())?;
    let values: Vec<_> = array
        .values
        .chunks_exact(2)
        .map(|v| Complex64::new(v[0], v[1]))
        .collect();
    if values.iter().any(|v| !v.is_finite()) {
        return Err("some of its samples are not finite numbers".into());
    }
    Array2::from_shape_vec((array.shape[0] as usize, array.shape[1] as usize), values).map_err(|e| e.to_string())
}

fn along(n: usize) -> bool {
    (FEWEST..=MOST).contains(&n)
}

fn check_size(rows: usize, cols: usize) -> Result<(), String> {
    if along(rows) && along(cols) {
        Ok(())
    } else {
        Err(format!(
            "it has {rows} x {cols} samples; {FEWEST} to {MOST} along each axis are read"
        ))
    }
}

fn shaped(rows: usize, cols: usize, values: Vec<f32>) -> Result<Array2<f32>, String> {
    check_size(rows, cols)?;
    Array2::from_shape_vec((rows, cols), values).map_err(|_| "its size differs from the number of its samples".into())
}

fn from_npy(path: &Path) -> Result<Vec<Array2<f32>>, String> {
    let takes = |shape: &[u64]| {
        let n = shape.len();
        let total = shape.iter().try_fold(1u64, |all, n| all.checked_mul(*n));
        (2..=3).contains(&n)
            && shape[n - 2..].iter().all(|&n| along(n as usize))
            && total.is_some_and(|n| n <= MOST_SAMPLES as u64)
    };
    let array = npy::read(path, takes).map_err(|e| e.to_string())?;
    let [rows, cols] = [array.shape.len() - 2, array.shape.len() - 1].map(|k| array.shape[k] as usize);
    let frames = array.values.chunks_exact(rows * cols);
    frames
        .map(|own| shaped(rows, cols, own.iter().map(|&v| v as f32).collect()))
        .collect()
}

fn from_png(path: &Path) -> Result<Array2<f32>, String> {
    let mut size = (0, 0);
    let read = png::read_grey(opened(path)?, |rows, cols| {
        size = (rows, cols);
        check_size(rows, cols)
    })?;
    shaped(size.0, size.1, read.numbers.into_iter().map(f32::from).collect())
}

fn from_csv(path: &Path) -> Result<Array2<f32>, String> {
    let text = metalith_core::document::load(path).map_err(|e| e.to_string())?;
    let (mut values, mut rows, mut cols) = (Vec::new(), 0, 0);
    for (k, line) in text.lines().enumerate() {
        let line = line.trim().trim_start_matches('\u{feff}');
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let before = values.len();
        for field in line.split([',', ';', '\t']).filter(|f| !f.trim().is_empty()) {
            let v: f32 = field
                .trim()
                .parse()
                .map_err(|_| format!("line {}: a field is no number", k + 1))?;
            values.push(v);
        }
        let own = values.len() - before;
        if rows > 0 && own != cols || values.len() > MOST_SAMPLES {
            return Err(format!("line {} has {own} fields, the lines before have {cols}", k + 1));
        }
        (rows, cols) = (rows + 1, own);
    }
    shaped(rows, cols, values)
}

fn from_tiff(path: &Path) -> Result<Vec<Array2<f32>>, String> {
    let mut first = None;
    let read = tiff::read(opened(path)?, |page, [rows, cols, channels]| {
        check_size(rows, cols)?;
        let other_size = *first.get_or_insert((rows, cols)) != (rows, cols);
        match (channels, (page + 1) * rows * cols) {
            _ if other_size => Err(format!("page {} has another size than the first", page + 1)),
            (1, 0..=MOST_SAMPLES) => Ok(()),
            (1, _) => Err(format!("it has more than {page} pages")),
            _ => Err(format!("its samples have {channels} channels, not grey")),
        }
    })?;
    let pages = read.pages.into_iter();
    pages.map(|page| shaped(page.rows, page.columns, page.values)).collect()
}

fn from_fits(path: &Path) -> Result<Vec<Array2<f32>>, String> {
    let read = fits::read(opened(path)?, |[count, rows, cols]| {
        check_size(rows, cols)?;
        match count.checked_mul(rows * cols) {
            Some(0..=MOST_SAMPLES) => Ok(()),
            _ => Err(format!("it has {count} frames")),
        }
    })?;
    let frames = read.values.into_iter();
    frames.map(|values| shaped(read.rows, read.columns, values)).collect()
}

fn opened(path: &Path) -> Result<BufReader<File>, String> {
    let file = File::open(path).map_err(|e| format!("it cannot be read: {e}"))?;
    Ok(BufReader::new(file))
}
