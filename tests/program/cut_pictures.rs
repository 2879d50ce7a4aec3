//! Pictures and frames that end early: no command that reads them takes one as whole.

use std::fs;
use std::io::Cursor;
use std::path::Path;

use exr::prelude::{f16, write_rgb_file};
use metalith_testing::session::small_set;
use tiff::encoder::{TiffEncoder, colortype};

const LAYOUT: &str = "golden/mini_3x3/folded.gds.gz";
const DESIGN: [&str; 2] = ["--design", "designs/mini_3x3.toml"];
const CAMERA: [&str; 2] = ["--camera", "cameras/gt1930.toml"];

/// A grey PNG of 16 bits.
fn grey(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let data: Vec<u8> = (0..2 * width * height).map(|k| (k % 13) as u8).collect();
    encoder.write_header().unwrap().write_image_data(&data).unwrap();
    bytes
}

/// Whole pictures of all formats, by the endings of their names.
fn pictures(folder: &Path) -> Vec<(&'static str, Vec<u8>)> {
    const SIDE: u32 = 48;
    let mut tiff = Cursor::new(Vec::new());
    let values: Vec<u16> = (0..SIDE * SIDE).map(|k| (k * 3 % 4000) as u16).collect();
    let mut encoder = TiffEncoder::new(&mut tiff).unwrap();
    encoder.write_image::<colortype::Gray16>(SIDE, SIDE, &values).unwrap();
    let exr = folder.join("whole.exr");
    let side = SIDE as usize;
    write_rgb_file(&exr, side, side, |x, y| {
        [0.1, 0.2, ((x + y) % 7) as f32].map(f16::from_f32).into()
    })
    .unwrap();
    let light = (0..SIDE * SIDE).flat_map(|k| ((k % 11) as f32 / 11.0).to_le_bytes());
    vec![
        ("png", grey(SIDE, SIDE)),
        ("jpg", fs::read("tests/mutants/small.jpg").unwrap()),
        ("tif", tiff.into_inner()),
        ("exr", fs::read(exr).unwrap()),
        ("npy", metalith_testing::npy("<f4", &format!("({SIDE}, {SIDE})"), light)),
    ]
}

/// The program refuses these arguments as bad input, by a message that names the file, and writes nothing to `out`.
fn refused(arguments: &[&str], file: &Path, out: &Path) {
    let mut command = super::metalith();
    command.args(arguments).arg("--out").arg(out);
    let done = command.output().unwrap();
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert_eq!(done.status.code(), Some(2), "{arguments:?}: {said}");
    let name = file.file_name().unwrap().to_str().unwrap();
    assert!(said.contains(name), "{arguments:?}: {said}");
    assert!(!out.exists() || out.is_dir(), "{arguments:?}");
}

#[test]
fn no_command_takes_a_picture_that_was_cut() {
    let folder = tempfile::tempdir().unwrap();
    let (images, out) = (folder.path().join("images"), folder.path().join("out"));
    fs::create_dir_all(&images).unwrap();
    for (ending, whole) in pictures(folder.path()) {
        let file = images.join(format!("cut.{ending}"));
        for end in [whole.len() / 2, whole.len() - 1] {
            fs::write(&file, &whole[..end]).unwrap();
            let [path, all] = [&file, &images].map(|path| path.to_str().unwrap());
            refused(&["denoise", path, "--noise", "5"], &file, &out.join("clean.png"));
            let chip = [&DESIGN[..], &CAMERA[..]].concat();
            let with = |arguments: &[&'static str], path| [arguments, &[path], &chip[..]].concat();
            refused(&with(&["picture", LAYOUT], path), &file, &out);
            refused(&with(&["dataset", "--layout", LAYOUT], all), &file, &out);
            refused(
                &["train", all, "--piece", "32"],
                &file,
                &out.join("weights.safetensors"),
            );
            refused(
                &[&["compare", path, "--baselines", "flatcam"][..], &CAMERA].concat(),
                &file,
                &out,
            );
        }
        fs::remove_file(file).unwrap();
    }
}

#[test]
fn no_command_takes_a_frame_that_was_cut() {
    let folder = tempfile::tempdir().unwrap();
    let (file, out) = (folder.path().join("frame.png"), folder.path().join("out"));
    let whole = grey(1936, 1216);
    for end in [whole.len() / 2, whole.len() - 1] {
        fs::write(&file, &whole[..end]).unwrap();
        let frame = ["restore", LAYOUT, file.to_str().unwrap(), "--white", "4095"];
        refused(&[&frame[..], &DESIGN, &CAMERA].concat(), &file, &out);
    }
    let set = small_set(folder.path());
    let text = fs::read_to_string(&set).unwrap();
    let name = text
        .split("file = \"")
        .nth(1)
        .and_then(|t| t.split('"').next())
        .unwrap();
    let capture = set.with_file_name(name);
    let whole = fs::read(&capture).unwrap();
    for end in [whole.len() / 2, whole.len() - 1] {
        fs::write(&capture, &whole[..end]).unwrap();
        refused(&["calibrate", set.to_str().unwrap()], &capture, &out);
    }
}
