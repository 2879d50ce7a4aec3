//! Distance of each pixel of a scene.

use std::path::Path;

use metalith_core::file::read_at_most;
use metalith_core::{Error, Result};
use ndarray::{Array2, Axis};

use super::SceneImage;
use super::pictures::png_values;
use super::read::{LONGEST, array};

impl SceneImage {
    /// This scene with the distances of its pixels (um).
    ///
    /// # Errors
    /// If there is not one for each pixel.
    pub fn with_depth(mut self, depth_um: Array2<f32>) -> Result<Self> {
        let (rows, columns) = depth_um.dim();
        if (rows, columns) != (self.view.rows, self.view.columns) {
            return Err(Error::refused(
                "scene/depth-map-size-differs",
                format!(
                    "the depth map has {columns} x {rows} pixels, the scene {} x {}",
                    self.view.columns, self.view.rows
                ),
                "give one distance for each pixel of the scene",
            ));
        }
        self.depth_um = Some(depth_um);
        Ok(self)
    }
}

/// Read a depth map: NPY `[row, column]` of millimetres, infinite for what is far, or a grey PNG of 16 bits whose values are
/// millimetres.
///
/// # Errors
/// If the file cannot be read, holds something else, or a distance of less than a millimetre.
pub fn read_depth(path: &Path) -> Result<Array2<f32>> {
    let bytes = read_at_most(path, LONGEST, "a depth map")?;
    let fault = |what: &str| {
        Error::refused(
            "scene/depth-map-unreadable",
            format!("{}: {what}", path.display()),
            "give an NPY of shape (rows, columns) or a grey PNG of 16 bits, distances of a millimetre and more, in millimetres; `inf` in an NPY is far away",
        )
    };
    // A depth map is read as scenes are, and its faults name a depth map.
    let told = |error: Error| match error {
        Error::Table { what, .. } => fault(&what),
        other => other,
    };
    let mm = if bytes.starts_with(b"\x93NUMPY") {
        array(path, &bytes).map_err(told)?.0
    } else if bytes.starts_with(b"\x89PNG") {
        let png = png_values(path, &bytes).map_err(told)?;
        if !png.deep {
            return Err(fault("its values have fewer than 16 bits"));
        }
        png.values * f64::from(u16::MAX)
    } else {
        return Err(fault("it is neither NPY nor PNG"));
    };
    let first = mm.index_axis(Axis(2), 0);
    if mm.axis_iter(Axis(2)).any(|plane| plane != first) {
        return Err(fault("it has colours"));
    }
    if !first.iter().all(|v| *v >= NEAREST_MM) {
        return Err(fault("it holds a distance below a millimetre, or no number"));
    }
    Ok(first.mapv(|v| (v * 1e3) as f32))
}

/// Nearer than this no scene is in front of a chip (mm); the way to the first surface is searched in steps of its inverse.
const NEAREST_MM: f64 = 1.0;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::read::tests::npy_bytes;

    #[test]
    fn distances_are_read_and_odd_ones_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("depth.npy");
        let write = |values: &[f64]| std::fs::write(&path, npy_bytes("(16, 16)", values)).unwrap();
        write(&(1..=256).map(f64::from).collect::<Vec<_>>());
        let depth = read_depth(&path).unwrap();
        assert_eq!((depth[[0, 0]], depth[[15, 15]]), (1e3, 256e3));
        let scene = SceneImage::of_rgb("", &ndarray::Array3::zeros((16, 17, 3)), 60.0, f64::INFINITY);
        assert!(scene.with_depth(depth).is_err());
        std::fs::write(&path, npy_bytes("(8, 8)", &[500.0; 64])).unwrap();
        assert_eq!(read_depth(&path).unwrap_err().id(), "scene/depth-map-unreadable");
        let mut values = [500.0; 256];
        values[17] = f64::INFINITY;
        write(&values);
        assert_eq!(read_depth(&path).unwrap()[[1, 1]], f32::INFINITY);
        for near in [0.0, -2.0, 1e-6, f64::NAN, f64::NEG_INFINITY] {
            let mut values = [500.0; 256];
            values[17] = near;
            write(&values);
            assert!(read_depth(&path).is_err(), "{near}");
        }
        std::fs::write(&path, npy_bytes("(16, 16, 0)", &[])).unwrap();
        assert!(read_depth(&path).is_err(), "no colours");
        std::fs::write(&path, b"\xff\xd8").unwrap();
        assert!(read_depth(&path).is_err());
    }
}
