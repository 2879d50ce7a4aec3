//! Maps of numbers from TIFF, NPY and text files.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use metalith_core::file::read_at_most;
use metalith_core::text::table_rows;
use metalith_core::{npy, tiff};
use ndarray::Array2;

use crate::number_rows::numbers;

/// Most samples of a map along an axis, and fewest.
const MOST: usize = 2048;
const FEWEST: usize = 16;

/// Longest text of a map (bytes): 24 for each sample.
const LONGEST: u64 = 24 * (MOST * MOST) as u64;

/// Read a map: TIFF of one grey channel or of three equal ones, NPY, or rows of numbers as CSV. Samples may be no finite number. What
/// is wrong comes back in words.
pub(super) fn read(path: &Path) -> Result<Array2<f32>, String> {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    let is_tiff = ["tif", "tiff"].iter().any(|known| ending.eq_ignore_ascii_case(known));
    if is_tiff {
        from_tiff(path)
    } else if ["csv", "txt"].iter().any(|known| ending.eq_ignore_ascii_case(known)) {
        from_text(path)
    } else {
        from_npy(path)
    }
}

fn from_text(path: &Path) -> Result<Array2<f32>, String> {
    let bytes = read_at_most(path, LONGEST, "a map of numbers").map_err(|e| e.to_string())?;
    let text = String::from_utf8_lossy(&bytes);
    let (mut values, mut cols) = (Vec::new(), None);
    for (line, row) in table_rows(&text) {
        let row =
            numbers(row).ok_or_else(|| format!("line {line}: a field is no number; lines of a head begin with #"))?;
        let wanted = *cols.get_or_insert(row.len());
        if row.len() != wanted {
            return Err(format!(
                "line {line} has {} numbers, the first row has {wanted}",
                row.len()
            ));
        }
        values.extend(row.into_iter().map(|v| v as f32));
    }
    let cols = cols.unwrap_or(0);
    let rows = values.len() / cols.max(1);
    check_size(rows, cols)?;
    Array2::from_shape_vec((rows, cols), values).map_err(|e| e.to_string())
}

fn check_size(rows: usize, cols: usize) -> Result<(), String> {
    if [rows, cols].iter().all(|n| (FEWEST..=MOST).contains(n)) {
        Ok(())
    } else {
        Err(format!(
            "it has {rows} x {cols} samples; {FEWEST} to {MOST} along each axis are read"
        ))
    }
}

fn from_npy(path: &Path) -> Result<Array2<f32>, String> {
    let takes = |shape: &[u64]| shape.len() == 2 && shape.iter().all(|n| (FEWEST as u64..=MOST as u64).contains(n));
    let array = npy::read(path, takes).map_err(|e| e.to_string())?;
    let size = (array.shape[0] as usize, array.shape[1] as usize);
    let values = array.values.into_iter().map(|v| v as f32).collect();
    Array2::from_shape_vec(size, values).map_err(|e| e.to_string())
}

fn from_tiff(path: &Path) -> Result<Array2<f32>, String> {
    let file = File::open(path).map_err(|e| format!("it cannot be read: {e}"))?;
    let read = tiff::read(BufReader::new(file), |page, [rows, cols, channels]| {
        match (page, channels) {
            (0, 1 | 3) => check_size(rows, cols),
            (0, _) => Err("its samples are neither grey nor three equal channels".into()),
            _ => Err("it has several pages, a map has one".into()),
        }
    })?;
    let page = &read.pages[0];
    if page
        .values
        .chunks_exact(page.channels)
        .any(|own| own.iter().any(|v| v.to_bits() != own[0].to_bits()))
    {
        return Err("its three channels differ: a map has one value for each sample".into());
    }
    let values = page.values.iter().step_by(page.channels).copied().collect();
    Array2::from_shape_vec((page.rows, page.columns), values).map_err(|e| e.to_string())
}
