//! Camera frames from NPY files.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use ndarray::Array2;

/// Read a mean frame of exactly `rows` x `cols` finite numbers. What is wrong comes back in words.
pub fn read(path: &Path, rows: usize, cols: usize) -> Result<Array2<f32>, String> {
    let file = File::open(path).map_err(|e| format!("it cannot be read: {e}"))?;
    let npy = npyz::NpyFile::new(BufReader::new(file)).map_err(|e| format!("it is no NPY file: {e}"))?;
    let shape = npy.shape().to_vec();
    if shape != [rows as u64, cols as u64] || npy.order() != npyz::Order::C {
        return Err(format!(
            "it holds an array of shape {shape:?}, the camera says [{rows}, {cols}]"
        ));
    }
    let values: Vec<f32> = match npy.try_data::<f32>() {
        Ok(data) => data.collect::<std::io::Result<_>>(),
        Err(npy) => npy
            .try_data::<f64>()
            .map_err(|_| "its entries are neither float32 nor float64".to_owned())?
            .map(|v| v.map(|v| v as f32))
            .collect(),
    }
    .map_err(|e| format!("it ends early: {e}"))?;
    let wrong = values.iter().filter(|v| !v.is_finite()).count();
    if wrong > 0 {
        return Err(format!("{wrong} of its {} pixels are not finite numbers", values.len()));
    }
    Array2::from_shape_vec((rows, cols), values).map_err(|e| e.to_string())
}
