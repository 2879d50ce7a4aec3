//! Scenes and how far they are, frames that are restored.

use std::path::Path;

use metalith::Layout;
use metalith::imaging::scene::{SceneFile, read_depth, read_picture, read_scene};
use metalith::imaging::{FrameNumbers, read_signals};

use metalith::sensor::Camera;
use metalith_testing::root;

use super::{Format, Kind, file};
use crate::images;

/// Pixels of the sensor whose frames are restored.
const SENSOR: [u32; 2] = [24, 18];

/// Reads a frame as `metalith restore` does.
fn frames(folder: &Path) -> Format {
    let mut camera = Camera::read(&root().join("cameras/gt1930.toml")).unwrap();
    [camera.sensor.columns, camera.sensor.rows] = SENSOR.map(Into::into);
    let numbers = FrameNumbers {
        black_level: Some(64),
        white: Some(4095),
    };
    let frame = |depth| images::png(SENSOR[0], SENSOR[1], png::ColorType::Grayscale, depth);
    Format::new(
        "frame",
        folder.join("frame.png"),
        Kind::Png,
        [png::BitDepth::Eight, png::BitDepth::Sixteen].map(frame).into(),
        move |path| read_signals(path, &camera, numbers),
    )
}

pub(super) fn all(folder: &Path) -> Vec<Format> {
    let cube = images::npy(&[16, 20, 4], images::FLOAT);
    let pngs = vec![
        images::png(24, 16, png::ColorType::Rgb, png::BitDepth::Eight),
        images::png(24, 16, png::ColorType::Grayscale, png::BitDepth::Sixteen),
        images::coloured_png(),
    ];
    vec![
        frames(folder),
        Format::new("png", folder.join("scene.png"), Kind::Png, pngs, read_picture),
        Format::new(
            "picture",
            folder.join("scene"),
            Kind::Bytes,
            vec![
                images::png(24, 16, png::ColorType::Rgb, png::BitDepth::Eight),
                images::png(24, 16, png::ColorType::Rgb, png::BitDepth::Sixteen),
                images::png(24, 16, png::ColorType::Grayscale, png::BitDepth::Eight),
                file("tests/mutants/small.jpg"),
                images::coloured_png(),
                images::tiff(20, 1),
                images::exr(),
                images::npy(&[16, 20, 3], images::FLOAT),
                images::npy(&[16, 20], images::FLOAT),
            ],
            read_picture,
        ),
        Format::new(
            "drawing",
            folder.join("drawing.dxf"),
            Kind::Text,
            vec![images::DRAWING.into()],
            Layout::open,
        ),
        Format::new("cube", folder.join("cube.npy"), Kind::Bytes, vec![cube], |path| {
            read_scene(&SceneFile {
                path: path.to_owned(),
                wavelengths_nm: Some(vec![450.0, 500.0, 550.0, 600.0]),
                field_deg: 30.0,
                distance_um: 1e6,
            })
        }),
        Format::new(
            "depth",
            folder.join("depth"),
            Kind::Bytes,
            vec![
                images::png(24, 16, png::ColorType::Grayscale, png::BitDepth::Sixteen),
                images::npy(&[16, 20], images::WORD),
            ],
            read_depth,
        ),
    ]
}
