//! Maps of numbers from TIFF and NPY files.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use metalith_core::{npy, tiff};
use ndarray::Array2;

/// Most samples of a map along an axis, and fewest.
const MOST: usize = 2048;
const FEWEST: usize = 16;

/// Read a map: TIFF of one grey channel or of three equal ones, or NPY. What is wrong comes back in words.
pub(super) fn read(path: &Path) -> Result<Array2<f32>, String> {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    let is_tiff = ["tif", "tiff"].iter().any(|known| ending.eq_ignore_ascii_case(known));
    let map = if is_tiff { from_tiff(path)? } else { from_npy(path)? };
    let wrong = map.iter().filter(|v| !v.is_finite()).count();
    match wrong {
        0 => Ok(map),
        _ => Err(format!("{wrong} of its {} samples are not finite numbers", map.len())),
    }
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
        .any(|own| own.iter().any(|v| *v != own[0]))
    {
        return Err("its three channels differ: a map has one value for each sample".into());
    }
    let values = page.values.iter().step_by(page.channels).copied().collect();
    Array2::from_shape_vec((page.rows, page.columns), values).map_err(|e| e.to_string())
}
