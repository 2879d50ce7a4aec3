//! Frames that a camera recorded, out of files.

use std::io::Cursor;
use std::path::Path;

use metalith_core::file::{check_unaltered, read_at_most};
use metalith_core::{Error, Result, png};
use metalith_sensor::Camera;
use ndarray::Array2;

use crate::exposure::{Frame, planes_of, recorded};
use crate::imaging_system::ImagingSystem;
use crate::png16::{self, FrameLevels};

/// Meaning of the numbers of a frame's file.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrameNumbers {
    /// Number where there is no signal; 0 if left out.
    pub black_level: Option<u16>,
    /// Number of full scale; if left out that of the file where it says so: 255 of 8 bits.
    pub white: Option<u16>,
}

/// A grey picture as it is stored.
struct Grey {
    numbers: Vec<u16>,
    is_deep: bool,
    /// Levels of a frame that this program wrote and nobody changed.
    own: Option<FrameLevels>,
}

/// The signals, of full scale, of a grey PNG of 8 or 16 bits: the mosaic of a sensor with a colour filter array, else channel by
/// channel below one another, as `metalith picture` writes it.
///
/// # Errors
/// If it cannot be read, is of another run than the files beside it, is of another camera, or neither it nor `numbers` says what its numbers are.
pub fn read_signals(path: &Path, camera: &Camera, numbers: FrameNumbers) -> Result<Vec<Array2<f32>>> {
    check_unaltered(path)?;
    let (rows, columns) = (camera.sensor.rows as usize, camera.sensor.columns as usize);
    let grey = read_grey(path, [rows * planes_of(camera), columns])?;
    let signal = signals(camera, path, &grey, numbers)?;
    let plane = |numbers: &[u16]| {
        let signals = numbers.iter().map(|number| signal(*number)).collect();
        Array2::from_shape_vec((rows, columns), signals).expect("as many numbers as pixels")
    };
    Ok(grey.numbers.chunks_exact(rows * columns).map(plane).collect())
}

/// True if a file is a frame that this program wrote and nobody changed: its light is that of the camera file.
///
/// # Errors
/// If it cannot be read.
pub fn is_simulated(path: &Path) -> Result<bool> {
    let bytes = read_at_most(path, png16::LONGEST, "a frame")?;
    Ok(png16::levels_of(&bytes).is_some())
}

impl ImagingSystem {
    /// The frame of signals that the camera recorded, of full scale, in planes as those of [`Frame::planes`].
    ///
    /// # Errors
    /// If it is of another camera, or has signals that are no numbers.
    pub fn frame_of(&self, signals: Vec<Array2<f32>>) -> Result<Frame> {
        let sensor = &self.camera.sensor;
        let planes = planes_of(&self.camera);
        if signals.len() != planes {
            return Err(Error::refused(
                "restore/plane-count-differs",
                format!("the frame has {} planes, and the camera gives {planes}", signals.len()),
                "give one for a sensor with a colour filter array, else one for each channel",
            ));
        }
        if signals.iter().flatten().any(|v| !v.is_finite()) {
            return Err(Error::refused(
                "restore/not-numbers",
                "the frame has values that are not numbers",
                "give finite signals, full scale being one",
            ));
        }
        let frame = Frame::of_signals(&self.camera, &self.exposure, signals);
        frame.is_of(
            [sensor.rows as usize, sensor.columns as usize],
            self.exposure.gain.len(),
        )?;
        Ok(frame)
    }
}

/// The signal, of full scale, that a number of a file stands for.
fn signals<'a>(
    camera: &'a Camera,
    path: &Path,
    grey: &Grey,
    numbers: FrameNumbers,
) -> Result<Box<dyn Fn(u16) -> f32 + 'a>> {
    let contradicts = |own: &FrameLevels| {
        let differs = |given: Option<u16>, own: u16| given.is_some_and(|given| given != own);
        differs(numbers.black_level, own.black) || differs(numbers.white, png16::WHITE)
    };
    if let Some(own) = grey.own.as_ref().filter(|own| contradicts(own)) {
        return Err(Error::refused(
            "restore/levels-differ",
            format!(
                "{} states that no signal has the number {} in it and full scale {}, and the options state others",
                path.display(),
                own.black,
                png16::WHITE
            ),
            "leave --black-level and --white out",
        ));
    }
    if let Some(own) = grey
        .own
        .as_ref()
        .filter(|_| numbers.black_level.is_none() && numbers.white.is_none())
    {
        if own.camera != png16::camera_digest(camera) {
            return Err(Error::refused(
                "restore/frame-of-another-camera",
                format!(
                    "{} was recorded by another camera than {}: no signal has the number {} in it",
                    path.display(),
                    camera.name,
                    own.black
                ),
                format!(
                    "give the camera that it was simulated with, and its --lux and --time-ms, or say what its numbers mean: --black-level {} --white {}",
                    own.black,
                    png16::WHITE
                ),
            ));
        }
        let black = f64::from(own.black);
        let range = f64::from(png16::WHITE) - black;
        // In steps of the sensor, as it was before it had 16 bits.
        return Ok(Box::new(move |number| {
            recorded(camera, (f64::from(number) - black) / range)
        }));
    }
    let black = numbers.black_level.unwrap_or(0);
    let white = match (numbers.white, grey.is_deep) {
        (Some(white), _) => white,
        (None, false) => u16::from(u8::MAX),
        (None, true) => {
            return Err(fault(
                path,
                "a frame of 16 bits does not say which number is full scale",
                "add --white, such as 4095 of 12 bits or 65520 where these are shifted up, and --black-level if no signal has another number than 0",
            ));
        }
    };
    if white <= black {
        return Err(fault(
            path,
            &format!("full scale is {white}, and no signal {black}"),
            "give a --white above --black-level",
        ));
    }
    let range = f64::from(white) - f64::from(black);
    let largest = camera.sensor.largest_signal();
    let full = recorded(camera, f64::INFINITY);
    Ok(Box::new(move |number| {
        if number >= white {
            full
        } else {
            (largest * (f64::from(number) - f64::from(black)) / range) as f32
        }
    }))
}

fn read_grey(path: &Path, [rows, columns]: [usize; 2]) -> Result<Grey> {
    const SAVE: &str = "give a grey PNG of 8 or 16 bits as the sensor recorded it, no colours and no corrections";
    let bytes = read_at_most(path, png16::LONGEST, "a frame")?;
    let mut other_size = None;
    let read = png::read_grey(Cursor::new(&bytes), |found_rows, found_columns| {
        if (found_rows, found_columns) == (rows, columns) {
            return Ok(());
        }
        other_size = Some("give the camera that it was recorded with, and the whole frame");
        Err(format!(
            "the frame is of another camera: it has {found_columns} x {found_rows} pixels, and the camera gives {columns} x {rows}"
        ))
    });
    let read = read.map_err(|what| fault(path, &what, other_size.unwrap_or(SAVE)))?;
    Ok(Grey {
        numbers: read.numbers,
        is_deep: read.is_deep,
        own: png16::source_of(&bytes).and_then(|_| png16::levels_of(&bytes)),
    })
}

fn fault(path: &Path, what: &str, hint: &str) -> Error {
    Error::table(path, None, what, hint)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exposure::{ChosenExposure, expose};
    use crate::files::FrameFile;
    use metalith_core::FolderLock;
    use metalith_sensor::ColourFilter;

    /// A small sensor with a filter, and its frame of light that fills it here and there.
    fn recorded_by(filter: ColourFilter) -> (Camera, Frame) {
        let mut camera = Camera::three_bands(5.86);
        (camera.sensor.rows, camera.sensor.columns, camera.sensor.bits) = (18, 24, 12);
        camera.sensor.filter = filter;
        for (channel, name) in camera.channels.iter_mut().zip(["red", "green", "blue"]) {
            channel.name = name.into();
        }
        let light = |c: usize| Array2::from_shape_fn((18, 24), |(y, x)| ((5 * y + 3 * x + c) % 12) as f32 / 10.0);
        let light: Vec<_> = (0..3).map(light).collect();
        let frame = expose(&camera, &ChosenExposure::of_gain(&camera, &[1.0; 3]), &light, 7);
        (camera, frame)
    }

    #[test]
    fn frames_of_this_program_come_back_as_they_were() {
        let folder = tempfile::tempdir().unwrap();
        for filter in [ColourFilter::Rggb, ColourFilter::None] {
            let (camera, frame) = recorded_by(filter);
            let path = FrameFile::of(&camera, &frame).write(&frame, folder.path()).unwrap();
            let planes = read_signals(&path, &camera, FrameNumbers::default()).unwrap();
            assert_eq!(planes, frame.planes);
            let again = Frame::of_signals(&camera, &ChosenExposure::of_gain(&camera, &[1.0; 3]), planes);
            assert!(again.saturated == frame.saturated && again.saturated > 0);
        }
    }

    /// A camera with more noise has another black level; its picture would be wrong.
    #[test]
    fn a_frame_of_another_camera_needs_its_levels_said() {
        let folder = tempfile::tempdir().unwrap();
        let (camera, frame) = recorded_by(ColourFilter::Rggb);
        let file = FrameFile::of(&camera, &frame);
        let path = file.write(&frame, folder.path()).unwrap();
        let mut other = camera.clone();
        other.exposure.time_s *= 2.0;
        let refused = read_signals(&path, &other, FrameNumbers::default()).unwrap_err();
        assert_eq!(refused.id(), "restore/frame-of-another-camera");
        let stated = FrameNumbers {
            black_level: Some(file.black_level),
            white: Some(file.white),
        };
        assert_eq!(read_signals(&path, &other, stated).unwrap().len(), frame.planes.len());
        let (black, white) = (Some(file.black_level - 1), Some(file.white - 1));
        for (black_level, white) in [(black, None), (None, white), (black, white)] {
            let refused = read_signals(&path, &camera, FrameNumbers { black_level, white }).unwrap_err();
            assert_eq!(refused.id(), "restore/levels-differ");
        }
        // A name changes nothing.
        other = camera.clone();
        other.name = "another name".into();
        assert_eq!(
            read_signals(&path, &other, FrameNumbers::default()).unwrap(),
            frame.planes
        );
    }

    #[test]
    fn a_frame_of_another_run_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let (camera, frame) = recorded_by(ColourFilter::Rggb);
        let turn = FolderLock::of(folder.path()).unwrap();
        let path = folder.path().join(FrameFile::NAME);
        let write = |into: &Path| FrameFile::of(&camera, &frame).write(&frame, into).map(drop);
        turn.publish("picture", &[], write).unwrap();
        read_signals(&path, &camera, FrameNumbers::default()).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        let last = bytes.len() - 1;
        bytes[last] ^= 1;
        std::fs::write(&path, bytes).unwrap();
        let refused = read_signals(&path, &camera, FrameNumbers::default()).unwrap_err();
        assert_eq!(refused.id(), "file/altered");
    }

    /// Twelve bits in a file of sixteen, above a level of black, and eight bits that need no word.
    #[test]
    fn frames_of_others_need_their_full_scale_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frame.png");
        let (camera, _) = recorded_by(ColourFilter::Rggb);
        let write = |depth, of: &dyn Fn(usize) -> Vec<u8>| {
            let mut bytes = Vec::new();
            let mut encoder = ::png::Encoder::new(&mut bytes, 24, 18);
            encoder.set_color(::png::ColorType::Grayscale);
            encoder.set_depth(depth);
            let data: Vec<u8> = (0..18 * 24).flat_map(of).collect();
            encoder.write_header().unwrap().write_image_data(&data).unwrap();
            std::fs::write(&path, bytes).unwrap();
        };
        write(::png::BitDepth::Sixteen, &|i| {
            ((100 + 10 * i.min(399)) as u16).to_be_bytes().to_vec()
        });
        let read = |black_level, white| read_signals(&path, &camera, FrameNumbers { black_level, white });
        let error = read(None, None).unwrap_err().to_string();
        assert!(error.contains("add --white"), "{error}");
        let plane = read(Some(100), Some(4090)).unwrap().remove(0);
        assert_eq!(plane[[0, 0]], 0.0);
        let full = recorded(&camera, 9.0);
        assert!(plane.iter().filter(|v| **v == full).count() == 18 * 24 - 399 && plane[[16, 14]] < full);
        assert!(
            read(Some(100), Some(100))
                .unwrap_err()
                .to_string()
                .contains("above --black-level")
        );
        write(::png::BitDepth::Eight, &|i| vec![(i % 256) as u8]);
        let plane = read(None, None).unwrap().remove(0);
        assert!(plane[[10, 15]] == full && plane[[10, 16]] == 0.0);
        let mut other = camera.clone();
        other.sensor.columns = 26;
        let error = read_signals(&path, &other, FrameNumbers::default())
            .unwrap_err()
            .to_string();
        assert!(error.contains("another camera"), "{error}");
        // A picture in colours is no frame.
        let colours = ndarray::Array3::from_elem((18, 24, 3), 0.5);
        png16::write_picture(&path, &colours).unwrap();
        assert!(
            read(None, None)
                .unwrap_err()
                .to_string()
                .contains("as the sensor recorded it")
        );
    }
}
