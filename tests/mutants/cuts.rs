//! Pictures and frames that hold less than they say: each is refused, and none takes the memory that it claims.

use std::fs;
use std::path::Path;

use metalith::imaging::scene::{read_depth, read_picture};
use tiff::encoder::{Compression, compression::DeflateLevel};

use crate::damage::chunk;
use crate::plain_png::{COLOUR, COLOUR_AND_OPACITY, GREY, PALETTE, stored};
use crate::{formats, images, process};

/// Formats of numbers in binary files: each file says how many there are.
const COUNTED: [&str; 16] = [
    "frame",
    "png",
    "picture",
    "cube",
    "depth",
    "capture_npy",
    "capture_png",
    "capture_tiff",
    "capture_fits",
    "heights_npy",
    "heights_tiff",
    "stack_frames",
    "stack_mask",
    "stack_mask_png",
    "stack_mask_tiff",
    "stack_mask_fits",
];

/// Parts of each file after which it is cut.
const CUTS: usize = 20;

#[test]
fn no_file_that_was_cut_is_taken_as_whole() {
    let folder = tempfile::tempdir().unwrap();
    let mut names = Vec::new();
    for group in formats::GROUPS {
        let of_group = formats::of_group(group, folder.path());
        for format in of_group.iter().filter(|format| COUNTED.contains(&format.name)) {
            names.push(format.name);
            for (k, whole) in format.corpus.iter().enumerate() {
                let ends = (0..CUTS).map(|part| part * whole.len() / CUTS);
                for end in ends.chain([whole.len() - 1]) {
                    fs::write(&format.file, &whole[..end]).unwrap();
                    let taken = (format.read)().is_ok();
                    assert!(!taken, "{} {k}: {end} of {} bytes", format.name, whole.len());
                }
            }
            fs::write(&format.file, &format.corpus[0]).unwrap();
        }
    }
    names.sort_unstable();
    let mut all = COUNTED;
    all.sort_unstable();
    assert_eq!(names, all);
}

/// Files whose directory stands before the pixels: cut, and with fewer pixels in a whole file.
#[test]
fn a_directory_before_the_pixels_saves_no_cut_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.tif");
    let taken = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        read_picture(&path).is_ok()
    };
    let deflate = || Compression::Deflate(DeflateLevel::Balanced);
    for compression in [|| Compression::Uncompressed, || Compression::Lzw, deflate] {
        let whole = images::directory_first(40, compression(), |length| length);
        assert!(taken(&whole));
        for end in (0..CUTS).map(|part| part * whole.len() / CUTS).chain([whole.len() - 1]) {
            assert!(!taken(&whole[..end]), "{end} of {}", whole.len());
        }
        for part in 0..CUTS {
            let less = images::directory_first(40, compression(), |length| part * length / CUTS);
            assert!(!taken(&less), "{part} of {CUTS} parts of the pixels");
        }
    }
}

/// A PNG that claims this many pixels along each side and has one row of a few.
fn claiming_png(side: u32, kind: u8, bits: u8) -> Vec<u8> {
    let size = [side.to_be_bytes(), side.to_be_bytes()].concat();
    let head = chunk(b"IHDR", &[&size[..], &[bits, kind, 0, 0, 0]].concat());
    let data = chunk(b"IDAT", &stored(&[0, 1, 2, 3]));
    [b"\x89PNG\r\n\x1a\n", &head[..], &data, &chunk(b"IEND", b"")].concat()
}

/// The decoder takes three bytes of a palette for each colour, and as many opacities as it has colours, without a look.
#[test]
fn a_palette_that_is_no_list_of_colours_is_refused() {
    const SIDE: u32 = 16;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("palette.png");
    let size = [SIDE.to_be_bytes(), SIDE.to_be_bytes()].concat();
    let head = chunk(b"IHDR", &[&size[..], &[8, PALETTE, 0, 0, 0]].concat());
    let rows = vec![0; (SIDE * (SIDE + 1)) as usize];
    let taken = |colours: usize, opacities: usize| {
        let palette = chunk(b"PLTE", &vec![9; colours]);
        let opacity = chunk(b"tRNS", &vec![u8::MAX; opacities]);
        let data = chunk(b"IDAT", &stored(&rows));
        let bytes = [
            b"\x89PNG\r\n\x1a\n",
            &head[..],
            &palette,
            &opacity,
            &data,
            &chunk(b"IEND", b""),
        ]
        .concat();
        fs::write(&path, bytes).unwrap();
        read_picture(&path).is_ok()
    };
    assert!(taken(6, 2));
    for (colours, opacities) in [(4, 1), (5, 1), (3, 2), (3 * 257, 1), (2, 1)] {
        assert!(
            !taken(colours, opacities),
            "{colours} bytes of colours, {opacities} of opacity"
        );
    }
}

/// A TIFF that claims this many pixels along each side, with numbers of double precision in three colours, and has a few bytes.
fn claiming_tiff(side: u32, compression: u32, is_tiled: bool) -> Vec<u8> {
    /// Bytes of pixels.
    const LENGTH: u32 = 64;
    let mut tags = vec![
        (256, side),
        (257, side),
        (258, 64),
        (259, compression),
        (262, 2),
        (277, 3),
        (339, 3),
    ];
    tags.extend(if is_tiled {
        vec![(322, side), (323, side), (324, 8), (325, LENGTH)]
    } else {
        vec![(273, 8), (278, side), (279, LENGTH)]
    });
    tags.sort_unstable();
    images::tiff_of_tags(&tags, &[7; LENGTH as usize])
}

#[test]
fn a_claim_of_a_few_bytes_takes_no_memory() {
    /// Largest side of a picture, and one that no picture has.
    const SIDES: [u32; 2] = [4096, 1 << 20];
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture");
    let mut claims = Vec::new();
    for side in SIDES {
        for (kind, bits) in [(GREY, 16), (COLOUR, 8), (COLOUR, 16), (COLOUR_AND_OPACITY, 16)] {
            claims.push(claiming_png(side, kind, bits));
        }
        for compression in [1, 5, 8, 32_773, 32_946] {
            claims.extend([false, true].map(|is_tiled| claiming_tiff(side, compression, is_tiled)));
        }
        let shape = format!("({side}, {side}, 31)");
        claims.push(metalith_testing::npy("<f8", &shape, [7; 64]));
        let window: Vec<u8> = [0, 0, side as i32 - 1, side as i32 - 1]
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        claims.push(replaced(&images::exr(), &window_of(&images::exr()), &window));
    }
    for (k, claim) in claims.iter().enumerate() {
        fs::write(&path, claim).unwrap();
        process::forget_peak();
        let readers: [fn(&Path) -> bool; 2] = [|path| read_picture(path).is_ok(), |path| read_depth(path).is_ok()];
        assert!(readers.iter().all(|taken| !taken(&path)), "claim {k}");
        let peak = process::peak_bytes();
        assert!(peak <= crate::MEMORY, "claim {k}: {peak} bytes");
    }
}

/// The 16 bytes of the window of an EXR.
fn window_of(exr: &[u8]) -> Vec<u8> {
    let begin = exr.windows(5).position(|w| w == b"box2i").unwrap() + 6 + 4;
    exr[begin..begin + 16].to_vec()
}

fn replaced(bytes: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
    let mut out = bytes.to_vec();
    let places: Vec<usize> = (0..bytes.len() - from.len())
        .filter(|at| bytes[*at..].starts_with(from))
        .collect();
    for at in places {
        out[at..at + to.len()].copy_from_slice(to);
    }
    out
}
