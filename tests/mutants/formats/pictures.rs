//! Scenes and how far they are, frames that are restored.

use std::fs;
use std::path::Path;

use exr::prelude::Encoding;
use metalith::Layout;
use metalith::imaging::scene::{SceneFile, read_depth, read_picture, read_scene};
use metalith::imaging::{FrameNumbers, read_signals};

use metalith::sensor::Camera;
use metalith::text::hex;
use metalith_testing::root;
use sha2::{Digest, Sha256};
use tiff::encoder::{Compression, compression::DeflateLevel};

use super::{Format, Kind, file};
use crate::damage::chunk;
use crate::images;
use crate::plain_png::{COLOUR, GREY, PALETTE, interlaced, stored};

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
        [png::BitDepth::Eight, png::BitDepth::Sixteen]
            .map(frame)
            .into_iter()
            .chain([interlaced(SENSOR.map(|n| n as usize), GREY, 16)])
            .collect(),
        move |path| read_signals(path, &camera, numbers),
    )
}

/// What a frame of this program says of its numbers, with the digest of all of it.
fn levels(folder: &Path) -> Format {
    let mut camera = Camera::three_bands(5.86);
    [camera.sensor.columns, camera.sensor.rows] = SENSOR.map(Into::into);
    let own = folder.join("own.png");
    let [width, height] = [camera.sensor.columns, 3 * camera.sensor.rows];
    let data = vec![1u8; 2 * (width * height) as usize];
    let read = move |words: &Path| -> metalith::Result<()> {
        let words: String = fs::read(words).unwrap().into_iter().map(char::from).collect();
        // Texts of PNG end before a zero.
        let words = words.replace('\0', " ");
        let bytes: Vec<u8> = words.chars().map(|c| c as u8).collect();
        let digest = hex(&Sha256::digest([&data[..], words.as_bytes()].concat()));
        let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
        let size = [width.to_be_bytes(), height.to_be_bytes()].concat();
        file.extend(chunk(b"IHDR", &[&size[..], &[16, 0, 0, 0, 0]].concat()));
        file.extend(chunk(b"tEXt", format!("metalith source\0x {digest}").as_bytes()));
        file.extend(chunk(b"tEXt", &[b"metalith levels\0", &bytes[..]].concat()));
        let rows = data.chunks(2 * width as usize).flat_map(|row| [&[0], row].concat());
        file.extend(chunk(b"IDAT", &stored(&rows.collect::<Vec<u8>>())));
        file.extend(chunk(b"IEND", b""));
        fs::write(&own, file).unwrap();
        match read_signals(&own, &camera, FrameNumbers::default()) {
            // The example is of no camera.
            Err(error) if error.id() == "restore/frame-of-another-camera" => Ok(()),
            other => other.map(drop),
        }
    };
    let words = format!("black 94 white 65535 camera {}", "5e".repeat(32));
    Format::new(
        "levels of a frame",
        folder.join("levels.txt"),
        Kind::Text,
        vec![words.into_bytes()],
        read,
    )
}

pub(super) fn all(folder: &Path) -> Vec<Format> {
    let cube = images::npy(&[16, 20, 4], images::FLOAT);
    let pngs = vec![
        images::png(24, 16, png::ColorType::Rgb, png::BitDepth::Eight),
        images::png(24, 16, png::ColorType::Grayscale, png::BitDepth::Sixteen),
        images::coloured_png(),
        interlaced([24, 16], COLOUR, 8),
        interlaced([24, 16], GREY, 16),
        interlaced([24, 16], PALETTE, 8),
    ];
    vec![
        frames(folder),
        levels(folder),
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
                images::packed_tiff(20, 1, Compression::Lzw),
                images::packed_tiff(20, 1, Compression::Deflate(DeflateLevel::Balanced)),
                images::packed_tiff(20, 1, Compression::Packbits),
                images::exr(),
                images::packed_exr(Encoding::FAST_LOSSLESS),
                images::packed_exr(Encoding::SMALL_FAST_LOSSLESS),
                images::packed_exr(Encoding::SMALL_LOSSLESS),
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
