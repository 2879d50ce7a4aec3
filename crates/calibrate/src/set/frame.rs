//! Camera frames from NPY and PNG files, and what the sensor itself adds to them.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use metalith_core::npy;
use ndarray::Array2;

use super::{RelayCamera, SATURATED};

/// Read a mean frame of exactly `rows` x `cols` finite numbers: NPY, or a grey PNG of 8 or 16 bits whose values are DN.
/// The first row of either is row 0. What is wrong comes back in words.
pub fn read(path: &Path, rows: usize, cols: usize) -> Result<Array2<f32>, String> {
    let is_png = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png"));
    let values = if is_png {
        from_png(path, rows, cols)?
    } else {
        let array = npy::read(path, |shape| shape == [rows as u64, cols as u64]).map_err(|error| match error {
            npy::NpyError::Shape { .. } => format!("{error}, the camera says [{rows}, {cols}]"),
            other => other.to_string(),
        })?;
        array.values.iter().map(|&v| v as f32).collect::<Vec<f32>>()
    };
    let wrong = values.iter().filter(|v| !v.is_finite()).count();
    if wrong > 0 {
        return Err(format!("{wrong} of its {} pixels are not finite numbers", values.len()));
    }
    Array2::from_shape_vec((rows, cols), values).map_err(|e| e.to_string())
}

fn from_png(path: &Path, rows: usize, cols: usize) -> Result<Vec<f32>, String> {
    let wrong = |e: png::DecodingError| format!("it is no PNG file that can be read: {e}");
    let file = File::open(path).map_err(|e| format!("it cannot be read: {e}"))?;
    let mut reader = png::Decoder::new(BufReader::new(file)).read_info().map_err(wrong)?;
    let info = reader.info();
    let size = (info.height as usize, info.width as usize);
    if size != (rows, cols) {
        return Err(format!(
            "it is {} x {} pixels, the camera says [{rows}, {cols}]",
            size.0, size.1
        ));
    }
    let (colour, depth) = (info.color_type, info.bit_depth);
    let bytes = match (colour, depth) {
        (png::ColorType::Grayscale, png::BitDepth::Eight) => 1,
        (png::ColorType::Grayscale, png::BitDepth::Sixteen) => 2,
        _ => {
            return Err(format!(
                "its pixels are {colour:?} of {depth:?} bits, not grey of 8 or 16 bits"
            ));
        }
    };
    let mut data = vec![0; bytes * rows * cols];
    if reader.output_buffer_size() != Some(data.len()) {
        return Err("its size is not that of its pixels".into());
    }
    reader.next_frame(&mut data).map_err(wrong)?;
    Ok(data
        .chunks_exact(bytes)
        .map(|b| b.iter().fold(0.0, |sum, byte| 256.0 * sum + f32::from(*byte)))
        .collect())
}

/// Frames without light and in even light: what the sensor adds by itself.
#[derive(Default)]
pub struct SensorFrames {
    /// Without light, black level included (DN).
    pub dark: Option<Array2<f32>>,
    /// In even light, dark frame included (DN).
    pub flat: Option<Array2<f32>>,
}

impl SensorFrames {
    /// Take both out of a frame: every pixel has the stated black level and the mean response after. Saturated pixels
    /// stay saturated.
    pub fn take_out(&self, dn: &mut Array2<f32>, camera: &RelayCamera) {
        if self.dark.is_none() && self.flat.is_none() {
            return;
        }
        let (black, full) = (camera.black_level_dn as f32, camera.saturation_dn as f32);
        let dark = |at: (usize, usize)| self.dark.as_ref().map_or(black, |d| d[at]);
        let mean = self.flat.as_ref().map_or(1.0, |flat| {
            let sum: f64 = flat.indexed_iter().map(|(at, v)| f64::from(v - dark(at))).sum();
            (sum / flat.len() as f64) as f32
        });
        for (at, v) in dn.indexed_iter_mut() {
            if f64::from(*v) >= SATURATED * camera.saturation_dn {
                *v = full;
                continue;
            }
            let response = self.flat.as_ref().map_or(1.0, |flat| (flat[at] - dark(at)) / mean);
            // A dead pixel tells nothing: it is masked like a saturated one.
            *v = if response > LEAST_RESPONSE {
                black + (*v - dark(at)) / response
            } else {
                full
            };
        }
    }
}

/// Response of a pixel, relative to the mean, below which it is dead.
const LEAST_RESPONSE: f32 = 0.1;

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> RelayCamera {
        RelayCamera {
            pixel_um: 1.0,
            rows: 2,
            cols: 3,
            black_level_dn: 40.0,
            gain_e_per_dn: 1.0,
            read_noise_dn: 1.0,
            saturation_dn: 1000.0,
            registration_sigma_px: 0.5,
            flux_sigma: 0.01,
        }
    }

    #[test]
    fn grey_png_files_hold_dn() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let write = |depth: png::BitDepth, data: &[u8]| {
            let mut encoder = png::Encoder::new(File::create(&path).unwrap(), 3, 2);
            encoder.set_color(png::ColorType::Grayscale);
            encoder.set_depth(depth);
            encoder.write_header().unwrap().write_image_data(data).unwrap();
        };
        write(png::BitDepth::Eight, &[1, 2, 3, 4, 5, 255]);
        assert_eq!(
            read(&path, 2, 3).unwrap(),
            ndarray::arr2(&[[1.0, 2.0, 3.0], [4.0, 5.0, 255.0]])
        );
        write(png::BitDepth::Sixteen, &[0, 1, 1, 0, 0, 3, 0, 4, 0, 5, 255, 255]);
        assert_eq!(
            read(&path, 2, 3).unwrap(),
            ndarray::arr2(&[[1.0, 256.0, 3.0], [4.0, 5.0, 65535.0]])
        );
        assert!(read(&path, 3, 3).unwrap_err().contains("2 x 3"));
        write(png::BitDepth::One, &[0, 0]);
        assert!(read(&path, 2, 3).unwrap_err().contains("not grey of 8 or 16"));
    }

    #[test]
    fn dark_and_flat_frames_are_taken_out() {
        let frames = SensorFrames {
            dark: Some(ndarray::arr2(&[[41.0, 40.0, 40.0], [40.0, 40.0, 40.0]])),
            // Responses of 0.5 and 1.5 of the mean, and a dead pixel.
            flat: Some(ndarray::arr2(&[[91.0, 190.0, 240.0], [240.0, 40.0, 240.0]])),
        };
        let mean: f32 = (50.0 + 150.0 + 200.0 + 200.0 + 0.0 + 200.0) / 6.0;
        let mut dn = ndarray::arr2(&[[66.0, 115.0, 999.0], [140.0, 50.0, 140.0]]);
        frames.take_out(&mut dn, &camera());
        // Single precision.
        const ROUNDING: f32 = 1e-3;
        for (at, want) in [
            ((0, 0), 40.0 + 25.0 * mean / 50.0),
            ((0, 1), 40.0 + 75.0 * mean / 150.0),
            ((0, 2), 1000.0),
            ((1, 0), 40.0 + 100.0 * mean / 200.0),
            ((1, 1), 1000.0),
        ] {
            assert!((dn[at] - want).abs() < ROUNDING, "{at:?}: {}", dn[at]);
        }
    }
}
