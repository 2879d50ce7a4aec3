//! Camera frames from NPY files.

use std::path::Path;

use metalith_core::npy;
use ndarray::Array2;

/// Read a mean frame of exactly `rows` x `cols` finite numbers. What is wrong comes back in words.
pub fn read(path: &Path, rows: usize, cols: usize) -> Result<Array2<f32>, String> {
    let array = npy::read(path, |shape| shape == [rows as u64, cols as u64]).map_err(|error| match error {
        npy::NpyError::Shape { .. } => format!("{error}, the camera says [{rows}, {cols}]"),
        other => other.to_string(),
    })?;
    let values: Vec<f32> = array.values.iter().map(|&v| v as f32).collect();
    let wrong = values.iter().filter(|v| !v.is_finite()).count();
    if wrong > 0 {
        return Err(format!("{wrong} of its {} pixels are not finite numbers", values.len()));
    }
    Array2::from_shape_vec((rows, cols), values).map_err(|e| e.to_string())
}
