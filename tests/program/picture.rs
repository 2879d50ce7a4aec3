//! `metalith picture`: bad input is one clear error each, before any simulation.

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use predicates::str::contains;

use super::refusal;

const DESIGN: &str = "designs/mini_3x3.toml";

fn picture(arguments: &[&str]) -> Command {
    let mut command = super::metalith();
    command
        .args(["picture", "golden/mini_3x3/folded.gds.gz", "star", "--design", DESIGN])
        .args(arguments);
    command
}

#[test]
fn what_cannot_be_pictured_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let plain = fs::read_to_string("cameras/gt1930.toml").unwrap();
    let write = |name: &str, from: &str, to: &str| {
        for curve in ["red", "green", "blue"] {
            let file = format!("bayer_{curve}.csv");
            fs::copy(Path::new("cameras").join(&file), folder.path().join(&file)).unwrap();
        }
        let path = folder.path().join(name);
        let text = plain.replace(from, to);
        assert_ne!(text, plain);
        fs::write(&path, text).unwrap();
        path.display().to_string()
    };
    let beside = write("beside.toml", "offset_um = [0, 0] ", "offset_um = [9000, 0] ");
    let dark = write(
        "dark.toml",
        &plain[plain.find("source = \"d65\"").unwrap()..],
        "source = \"leds\"\nradiance_w_m2_sr = 1\n[[illuminant.led]]\ncentre_nm = 900\nwidth_nm = 5\n",
    );
    let gt = "cameras/gt1930.toml";
    let cases: [(&[&str], &str); 6] = [
        (&["--camera", &beside], "error[camera/sensor-misplaced]"),
        (&["--camera", &dark], "error[camera/channel-without-light]"),
        (&["--camera", gt, "--method", "magic"], "error[restore/unknown-method]"),
        (&["--camera", gt, "--distance-mm", "0"], "error[option/out-of-range]"),
        (
            &["--camera", gt, "--field-deg", "NaN"],
            "error[scene/field-out-of-range]",
        ),
        (&["--camera", "cameras/none.toml"], "error[file/operation-failed]"),
    ];
    for (arguments, id) in cases {
        let out = folder.path().join("out").display().to_string();
        picture(arguments)
            .args(["--out", &out])
            .assert()
            .code(2)
            .stderr(contains(id));
        assert!(!Path::new(&out).exists(), "nothing is left of {arguments:?}");
    }
}

/// A layout of another array, and a scene of whole numbers: before any kernel is simulated.
#[test]
fn files_that_are_not_what_they_seem_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let [layouts, out] = ["layouts", "out"].map(|name| folder.path().join(name).display().to_string());
    let metalith = |arguments: &[&str]| {
        let mut command = super::metalith();
        command.args(arguments);
        command
    };
    metalith(&["layout", DESIGN, "--out", &layouts]).assert().code(0);
    let layout = format!("{layouts}/mini_3x3_pillars.gds");
    let at = |design: &str, scene: &str| {
        let mut command = metalith(&["picture", &layout, scene, "--design", design, "--field-deg", "20"]);
        command.args(["--camera", "cameras/gt1930.toml", "--out", &out]);
        command
    };
    at("designs/array_2x4.toml", "star")
        .assert()
        .code(2)
        .stderr(contains(refusal("layout/element-not-found")));
    let whole = folder.path().join("whole.npy");
    fs::write(&whole, metalith_testing::npy("|u1", "(40, 40)", [128; 1600])).unwrap();
    at(DESIGN, &whole.display().to_string())
        .assert()
        .code(2)
        .stderr(contains(format!("{}{}", refusal("table/malformed"), whole.display())));
    assert!(!Path::new(&out).exists());
}

/// What no frame of the camera is, and what does not say its full scale, before any kernel is simulated.
#[test]
fn frames_that_cannot_be_restored_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let grey = |name: &str, width: u32, height: u32| {
        let path = folder.path().join(name);
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(png::BitDepth::Sixteen);
        let data = 9u16.to_be_bytes().repeat((width * height) as usize);
        encoder.write_header().unwrap().write_image_data(&data).unwrap();
        fs::write(&path, bytes).unwrap();
        path.display().to_string()
    };
    let [small, whole] = [grey("small.png", 64, 64), grey("whole.png", 1936, 1216)];
    let out = folder.path().join("out").display().to_string();
    let mut said = Vec::new();
    for (frame, more, id) in [
        (&small, &[][..], "error[table/malformed]"),
        (&whole, &[], "error[table/malformed]"),
        (
            &whole,
            &["--white", "20", "--black-level", "20"],
            "error[table/malformed]",
        ),
        (
            &whole,
            &["--white", "4095", "--method", "magic"],
            "error[restore/unknown-method]",
        ),
    ] {
        let mut command = super::metalith();
        command
            .args(["restore", "golden/mini_3x3/folded.gds.gz", frame, "--design", DESIGN])
            .args(["--camera", "cameras/gt1930.toml", "--out", &out])
            .args(more);
        let refused = command.assert().code(2).stderr(contains(id));
        let text = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
        said.push(text[text.find("error").unwrap()..].to_owned());
        assert!(!Path::new(&out).exists());
    }
    // Which of the three is wrong with a frame is in the words.
    let folder = folder.path();
    insta::assert_snapshot!(metalith_testing::without_folder(said[..3].concat().trim_end(), folder), @"
    error[table/malformed]: small.png: the frame is of another camera: it has 64 x 64 pixels, and the camera gives 1936 x 1216
      help: give the camera that it was recorded with, and the whole frame
    error[table/malformed]: whole.png: a frame of 16 bits does not say which number is full scale
      help: add --white, such as 4095 of 12 bits or 65520 where these are shifted up, and --black-level if no signal has another number than 0
    error[table/malformed]: whole.png: full scale is 20, and no signal 20
      help: give a --white above --black-level
    ");
}
