//! Small pictures and arrays in the formats that are read.

use std::io::Cursor;

use tiff::encoder::{TiffEncoder, colortype};

/// Types of numbers in NPY files, as their headers name them, and the bytes of one.
pub(crate) const FLOAT: (&str, usize) = ("<f4", 4);
pub(crate) const WORD: (&str, usize) = ("<u2", 2);

/// A PNG whose values rise and fall.
pub(crate) fn png(width: u32, height: u32, colour: png::ColorType, depth: png::BitDepth) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    let size = encoder_bytes(width, height, colour, depth);
    let mut writer = encoder.write_header().unwrap();
    let values: Vec<u8> = (0..size).map(|i| (i * 7 % 251 + 1) as u8).collect();
    writer.write_image_data(&values).unwrap();
    writer.finish().unwrap();
    bytes
}

fn encoder_bytes(width: u32, height: u32, colour: png::ColorType, depth: png::BitDepth) -> usize {
    let bytes = if depth == png::BitDepth::Sixteen { 2 } else { 1 };
    width as usize * height as usize * colour.samples() * bytes
}

/// An NPY file of positive numbers.
pub(crate) fn npy(shape: &[usize], (kind, size): (&str, usize)) -> Vec<u8> {
    let axes: String = shape.iter().map(|n| format!("{n}, ")).collect();
    let number = |i: usize| match size {
        2 => (i as u16 % 4000 + 1).to_le_bytes().to_vec(),
        _ => (i as f32 / 997.0 + 0.01).to_le_bytes().to_vec(),
    };
    let numbers = (0..shape.iter().product()).flat_map(number);
    metalith_testing::npy(kind, &format!("({axes})"), numbers)
}

/// A grey TIFF of 16 bits and some pages.
pub(crate) fn tiff(size: usize, pages: usize) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut bytes).unwrap();
    for page in 0..pages {
        let values: Vec<u16> = (0..size * size).map(|i| (i * 3 % 4000 + page) as u16).collect();
        encoder
            .write_image::<colortype::Gray16>(size as u32, size as u32, &values)
            .unwrap();
    }
    bytes.into_inner()
}
