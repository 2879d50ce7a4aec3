//! Small pictures and arrays in the formats that are read.

use std::io::Cursor;

use exr::prelude::{Encoding, Image, Layer, LayerAttributes, SpecificChannels, WritableImage};
use tiff::encoder::{Compression, TiffEncoder, colortype};

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
    packed_tiff(size, pages, Compression::Uncompressed)
}

/// Variant of [`tiff`] with a compression.
pub(crate) fn packed_tiff(size: usize, pages: usize, compression: Compression) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut bytes).unwrap().with_compression(compression);
    for page in 0..pages {
        let values: Vec<u16> = (0..size * size).map(|i| (i * 3 % 4000 + page) as u16).collect();
        encoder
            .write_image::<colortype::Gray16>(size as u32, size as u32, &values)
            .unwrap();
    }
    bytes.into_inner()
}

/// A PNG with a colour profile and a rotation.
pub(crate) fn coloured_png() -> Vec<u8> {
    let mut info = png::Info::with_size(16, 20);
    info.color_type = png::ColorType::Rgb;
    info.bit_depth = png::BitDepth::Eight;
    let mut profile = vec![0; 128];
    profile[16..20].copy_from_slice(b"GRAY");
    profile[36..40].copy_from_slice(b"acsp");
    profile.extend([1u32.to_be_bytes(), *b"kTRC", 144u32.to_be_bytes(), 16u32.to_be_bytes()].concat());
    profile.extend(b"curv\0\0\0\0\0\0\0\x02\0\0\xff\xff");
    info.icc_profile = Some(profile.into());
    info.exif_metadata = Some(b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"[..].into());
    let mut bytes = Vec::new();
    let mut writer = png::Encoder::with_info(&mut bytes, info)
        .unwrap()
        .write_header()
        .unwrap();
    writer.write_image_data(&[9; 3 * 16 * 20]).unwrap();
    writer.finish().unwrap();
    bytes
}

/// An EXR of one channel in half precision, not compressed.
pub(crate) fn exr() -> Vec<u8> {
    const SIDE: i32 = 16;
    let mut out = b"\x76\x2f\x31\x01\x02\0\0\0".to_vec();
    let mut attribute = |name: &str, kind: &str, value: &[u8]| {
        out.extend([name.as_bytes(), b"\0", kind.as_bytes(), b"\0"].concat());
        out.extend((value.len() as u32).to_le_bytes());
        out.extend(value);
    };
    let channel = [
        &b"Y\0"[..],
        &1i32.to_le_bytes(),
        &[0; 4],
        &1i32.to_le_bytes(),
        &1i32.to_le_bytes(),
        b"\0",
    ]
    .concat();
    let window: Vec<u8> = [0, 0, SIDE - 1, SIDE - 1]
        .iter()
        .flat_map(|v: &i32| v.to_le_bytes())
        .collect();
    attribute("channels", "chlist", &channel);
    attribute("compression", "compression", &[0]);
    attribute("dataWindow", "box2i", &window);
    attribute("displayWindow", "box2i", &window);
    attribute("lineOrder", "lineOrder", &[0]);
    attribute("pixelAspectRatio", "float", &1f32.to_le_bytes());
    attribute("screenWindowCenter", "v2f", &[0; 8]);
    attribute("screenWindowWidth", "float", &1f32.to_le_bytes());
    out.push(0);
    let (table, line) = (8 * SIDE as usize, 8 + 2 * SIDE as usize);
    let first = out.len() + table;
    out.extend((0..SIDE as usize).flat_map(|y| ((first + y * line) as u64).to_le_bytes()));
    for y in 0..SIDE {
        out.extend([y, 2 * SIDE].iter().flat_map(|v| v.to_le_bytes()));
        out.extend((0..SIDE as u16).flat_map(|x| (0x3000 + 64 * x).to_le_bytes()));
    }
    out
}

/// An EXR of three channels in half precision, with an encoding.
pub(crate) fn packed_exr(encoding: Encoding) -> Vec<u8> {
    const SIDE: usize = 40;
    let channels = SpecificChannels::rgb(|at: exr::math::Vec2<usize>| {
        let value = |k: usize| exr::prelude::f16::from_f32(((7 * at.x() + 5 * at.y() + k) % 61) as f32 / 60.0);
        (value(0), value(1), value(2))
    });
    let layer = Layer::new((SIDE, SIDE), LayerAttributes::named("light"), encoding, channels);
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer)
        .write()
        .non_parallel()
        .to_buffered(&mut bytes)
        .unwrap();
    bytes.into_inner()
}

/// A FITS file of 16 bits.
pub(crate) fn fits(size: usize) -> Vec<u8> {
    let axes = ["NAXIS1", "NAXIS2"].map(|key| format!("{key:<8}= {size}"));
    let cards = [
        "SIMPLE  = T",
        "BITPIX  = 16",
        "NAXIS   = 2",
        &axes[0],
        &axes[1],
        "BZERO   = 32768",
        "END",
    ];
    let mut out: Vec<u8> = cards
        .iter()
        .flat_map(|card| format!("{card:<80}").into_bytes())
        .collect();
    out.resize(2880, b' ');
    out.extend((0..size * size).flat_map(|i| ((i * 3 % 4000) as i16).to_be_bytes()));
    out
}

/// A drawing in DXF with one of each kind.
pub(crate) const DRAWING: &str = "0\nSECTION\n2\nHEADER\n9\n$INSUNITS\n70\n13\n0\nENDSEC\n0\nSECTION\n2\nBLOCKS\n\
    0\nBLOCK\n2\nP\n10\n0\n20\n0\n0\nCIRCLE\n8\n0\n10\n1\n20\n1\n40\n0.2\n0\nENDBLK\n0\nENDSEC\n0\nSECTION\n2\nENTITIES\n\
    0\nLWPOLYLINE\n8\nA\n70\n1\n10\n0\n20\n0\n42\n0.5\n10\n1\n20\n0\n10\n1\n20\n1\n\
    0\nINSERT\n8\n2\n2\nP\n10\n3\n20\n0\n41\n2\n42\n1\n50\n30\n70\n2\n71\n2\n44\n1\n45\n1\n\
    0\nLINE\n8\n1\n10\n0\n20\n0\n11\n1\n21\n0\n0\nARC\n8\n1\n10\n0.5\n20\n0\n40\n0.5\n50\n0\n51\n180\n\
    0\nTEXT\n8\n1\n10\n0\n20\n0\n1\nlens\n0\nENDSEC\n0\nEOF\n";

/// A grey TIFF of 16 bits whose directory stands before its one strip, as programs that write while they record do it; `keep` is how
/// much of the strip is there, of which the directory says that it is all.
pub(crate) fn directory_first(size: usize, compression: Compression, keep: impl Fn(usize) -> usize) -> Vec<u8> {
    let written = packed_tiff(size, 1, compression);
    let number = |at: usize| u32::from_le_bytes(written[at..at + 4].try_into().unwrap());
    let directory = number(4) as usize;
    let entries = usize::from(u16::from_le_bytes(
        written[directory..directory + 2].try_into().unwrap(),
    ));
    let value = |tag: u16| {
        let mut places = (0..entries).map(|k| directory + 2 + 12 * k);
        let at = places.find(|at| written[*at..at + 2] == tag.to_le_bytes()).unwrap();
        number(at + 8)
    };
    let (offset, length) = (value(273) as usize, value(279) as usize);
    let side = size as u32;
    let all = written[offset..][..keep(length)].to_vec();
    let tags = [
        (256, side),
        (257, side),
        (258, 16),
        (259, value(259) & 0xFFFF),
        (262, 1),
        (273, 0),
        (277, 1),
        (278, side),
        (279, all.len() as u32),
    ];
    tiff_of_tags(&tags, &all)
}

/// A TIFF whose directory has these tags in rising order, and stands before its pixels: where these begin is put in place of the
/// value of their tag.
pub(crate) fn tiff_of_tags(tags: &[(u16, u32)], pixels: &[u8]) -> Vec<u8> {
    /// Length of the header, of an entry, and the tags of strips and tiles.
    const HEADER: usize = 8;
    const ENTRY: usize = 12;
    const BEGIN: [u16; 2] = [273, 324];
    let begin = (HEADER + 2 + ENTRY * tags.len() + 4) as u32;
    let mut out = [
        &b"II*\0"[..],
        &(HEADER as u32).to_le_bytes(),
        &(tags.len() as u16).to_le_bytes(),
    ]
    .concat();
    for (tag, value) in tags {
        out.extend([tag.to_le_bytes(), 4u16.to_le_bytes()].concat());
        let value = if BEGIN.contains(tag) { begin } else { *value };
        out.extend([1, value].map(u32::to_le_bytes).concat());
    }
    out.extend([0; 4]);
    out.extend(pixels);
    out
}
