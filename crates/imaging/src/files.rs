//! The frame and the restored pictures as files beside their page.

use std::path::{Path, PathBuf};

use metalith_core::{AtomicFile, Result, srgb};
use metalith_restoration::RestorationMethod;
use metalith_sensor::Camera;
use ndarray::Array3;
use serde::Serialize;

use crate::dataset::black_level;
use crate::exposure::Frame;
use crate::png16::{self, FrameLevels};

/// A frame as a PNG of 16 bits.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FrameFile {
    /// Name of the file: with a colour filter array the mosaic, else channel by channel below one another.
    pub file: String,
    /// Number where there is no signal.
    pub black_level: u16,
    /// Number of full scale.
    pub white: u16,
    /// Digest of the camera, without its name: SHA-256 in hexadecimal. It stands in the file of the frame too.
    pub camera_sha256: String,
    /// Signal of a unit of light in each channel, of full scale: light is (number - black_level) / (white - black_level) / gain.
    pub gain: Vec<f64>,
}

impl FrameFile {
    /// Name of the file.
    pub const NAME: &'static str = "frame.png";

    /// File of a frame of a camera.
    pub fn of(camera: &Camera, frame: &Frame) -> Self {
        Self {
            file: Self::NAME.into(),
            black_level: black_level(camera),
            white: png16::WHITE,
            camera_sha256: png16::camera_digest(camera),
            gain: frame.gain.clone(),
        }
    }

    /// Write it into a folder.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, frame: &Frame, folder: &Path) -> Result<PathBuf> {
        let path = folder.join(&self.file);
        let levels = FrameLevels {
            black: self.black_level,
            camera: self.camera_sha256.clone(),
        };
        let bytes = png16::grey(&frame.planes, &levels, "frame of metalith picture");
        AtomicFile::write(&path, &bytes)?;
        Ok(path)
    }
}

/// Name of the file of a picture that was restored by a method, by all elements at once or by each alone.
pub fn picture_file(method: RestorationMethod, joint: bool) -> String {
    let way = if joint { "" } else { "_each_alone" };
    format!("restored_{}{way}.png", method.name())
}

/// Write a picture in linear sRGB as a PNG of 16 bits in sRGB.
///
/// # Errors
/// If it cannot be written.
pub(crate) fn write_restored(path: &Path, picture: &Array3<f64>) -> Result<()> {
    png16::write_picture(path, &picture.mapv(srgb::encoded))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exposure::{ChosenExposure, expose};
    use crate::scene::read_picture;
    use ndarray::Array2;

    #[test]
    fn frames_and_pictures_come_back_from_their_files() {
        /// Half a number of 16 bits.
        const HALF: f64 = 0.5 / 65_535.0;
        let folder = tempfile::tempdir().unwrap();
        let camera = Camera::three_bands(5.86);
        let light: Vec<Array2<f32>> = [0.0, 0.3, 0.7].map(|v| Array2::from_elem((20, 24), v)).into();
        let frame = expose(&camera, &ChosenExposure::of_gain(&camera, &[0.5; 3]), &light, 4);
        let file = FrameFile::of(&camera, &frame);
        let path = file.write(&frame, folder.path()).unwrap();
        let numbers = png16::tests::numbers(&std::fs::read(path).unwrap());
        let range = f64::from(file.white - file.black_level);
        for (number, signal) in numbers.iter().zip(frame.planes.iter().flatten()) {
            let found = (f64::from(*number) - f64::from(file.black_level)) / range;
            assert!(
                (found - f64::from(*signal)).abs() < 1.1 * HALF * 65_535.0 / range,
                "{number} {signal}"
            );
        }
        let picture = Array3::from_shape_fn((16, 20, 3), |(y, x, c)| ((y + 2 * x + c) % 9) as f64 / 8.0);
        let name = picture_file(RestorationMethod::TotalVariation, false);
        assert_eq!(name, "restored_tv_each_alone.png");
        let path = folder.path().join(name);
        write_restored(&path, &picture).unwrap();
        let shown = read_picture(&path).unwrap();
        assert!(
            shown
                .iter()
                .zip(&picture)
                .all(|(a, b)| (a - srgb::encoded(*b)).abs() < 1.1 * HALF)
        );
    }
}
