//! Maps of numbers from TIFF and NPY files.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use metalith_core::npy;
use ndarray::Array2;
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};

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
    let wrong = |e: tiff::TiffError| format!("it is no TIFF file that can be read: {e}");
    let file = File::open(path).map_err(|e| format!("it cannot be read: {e}"))?;
    let mut limits = Limits::default();
    limits.decoding_buffer_size = 16 * MOST * MOST;
    limits.intermediate_buffer_size = 16 * MOST * MOST;
    let mut decoder = Decoder::new(BufReader::new(file)).map_err(wrong)?.with_limits(limits);
    let (width, height) = decoder.dimensions().map_err(wrong)?;
    let (rows, cols) = (height as usize, width as usize);
    check_size(rows, cols)?;
    let colour = decoder.colortype().map_err(wrong)?;
    let channels = match colour {
        ColorType::Gray(_) => 1,
        ColorType::RGB(_) => 3,
        _ => {
            return Err(format!(
                "its samples are {colour:?}, neither grey nor three equal channels"
            ));
        }
    };
    let values: Vec<f32> = match decoder.read_image().map_err(wrong)? {
        DecodingResult::U8(v) => v.into_iter().map(f32::from).collect(),
        DecodingResult::U16(v) => v.into_iter().map(f32::from).collect(),
        DecodingResult::F32(v) => v,
        _ => {
            return Err(format!(
                "its samples are {colour:?}; 8 or 16 bits are read, or 32 with a decimal point"
            ));
        }
    };
    if values.len() != rows * cols * channels {
        return Err("its size is not that of its samples".into());
    }
    if values
        .chunks_exact(channels)
        .any(|own| own.iter().any(|v| *v != own[0]))
    {
        return Err("its three channels differ: a map has one value for each sample".into());
    }
    let values = values.into_iter().step_by(channels).collect();
    Array2::from_shape_vec((rows, cols), values).map_err(|e| e.to_string())
}
