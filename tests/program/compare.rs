//! `metalith compare`: one table from photographs; bad input is one clear error each.

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use predicates::prelude::*;
use predicates::str::contains;

use super::refusal;

fn compare(arguments: &[&str], out: &str) -> Command {
    let mut command = super::metalith();
    command.arg("compare").args(arguments).args(["--out", out]);
    command
}

/// A grey PNG of 8 bits.
fn photograph(path: &Path, side: u32) -> String {
    let mut encoder = png::Encoder::new(fs::File::create(path).unwrap(), side, side);
    encoder.set_color(png::ColorType::Grayscale);
    let bytes: Vec<u8> = (0..side * side)
        .map(|i| if (i % side + i / side) % 20 < 10 { 200 } else { 40 })
        .collect();
    encoder.write_header().unwrap().write_image_data(&bytes).unwrap();
    path.display().to_string()
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let one = photograph(&folder.path().join("one.png"), 32);
    let other = photograph(&folder.path().join("other.png"), 40);
    let out = folder.path().join("out").display().to_string();
    let camera = ["--camera", "cameras/gt1930.toml"];
    let flatcam = ["--baselines", "flatcam"];
    let cases: [(&[&str], &str); 9] = [
        (&[&one], "error[compare/no-camera]"),
        (
            &[&one, &other, flatcam[0], flatcam[1]],
            "error[compare/photographs-differ-in-size]",
        ),
        (&[&one, "--baselines", "pinhole"], "'--baselines <"),
        (&[&one, "--design", "a=b:c:d:e:f"], "'--design <"),
        (&[&one, "--design", "designs/tio2_532.toml"], "error[compare/no-layout]"),
        (
            &[&one, "--design", "designs/mini_3x3.toml:none.gds", "--method", "magic"],
            "error[restore/unknown-method]",
        ),
        (
            &[&one, flatcam[0], flatcam[1], "--mask-distance-um", "0"],
            "error[flatcam/geometry-out-of-range]",
        ),
        (
            &[&one, "--baselines", "diffusercam", "--diffuser-opening", "9"],
            "error[diffusercam/geometry-out-of-range]",
        ),
        (
            &[&one, flatcam[0], flatcam[1], "--lpips", "cameras/gt1930.toml"],
            "error[table/malformed]: cameras/gt1930.toml",
        ),
    ];
    for (arguments, id) in cases {
        compare(&[arguments, &camera].concat(), &out)
            .assert()
            .code(2)
            .stderr(contains(id));
        assert!(!Path::new(&out).exists(), "nothing is left of {arguments:?}");
    }
}

#[test]
fn a_table_comes_out_of_photographs() {
    let folder = tempfile::tempdir().unwrap();
    photograph(&folder.path().join("stripes.png"), 48);
    let photographs = folder.path().display().to_string();
    let out = folder.path().join("out").display().to_string();
    let arguments = [
        &photographs,
        "--camera",
        "cameras/gt1930.toml",
        "--baselines",
        "flatcam",
        "--field-deg",
        "60",
    ];
    compare(&arguments, &out)
        .assert()
        .success()
        .stdout(contains("| FlatCam, ours | tikhonov |").and(contains("1 photograph of 48 x 48 pixels")))
        // Nobody has given the weights of that measure: its column stays empty.
        .stdout(contains("| SSIM | 1 - LPIPS |").and(contains(" |  | ")));
    let page = fs::read_to_string(Path::new(&out).join("compare.html")).unwrap();
    assert!(page.contains("Cameras side by side"));
    let numbers = fs::read_to_string(Path::new(&out).join("compare.json")).unwrap();
    assert!(numbers.contains("psnr_linear_db"));
    // Seconds are printed; in files they would make two runs differ.
    assert!(numbers.contains("\"cpu_s\": null"));
    assert!(!page.contains("CPU time") && !page.contains("CPU seconds"));
}

/// Weights of the perceptual distance that find no difference anywhere: zeros of the shapes of AlexNet.
fn weights_of_zeros(path: &Path) -> String {
    let convolutions = [
        ("net.slice1.0", 64, 3, 11),
        ("net.slice2.3", 192, 64, 5),
        ("net.slice3.6", 384, 192, 3),
        ("net.slice4.8", 256, 384, 3),
        ("net.slice5.10", 256, 256, 3),
    ];
    let (mut header, mut end) = (Vec::new(), 0);
    let mut put = |name: String, shape: &[usize]| {
        let begin = end;
        end += 4 * shape.iter().product::<usize>();
        header.push(format!(
            r#""{name}":{{"dtype":"F32","shape":{shape:?},"data_offsets":[{begin},{end}]}}"#
        ));
    };
    for (k, (name, to, from, taps)) in convolutions.into_iter().enumerate() {
        put(format!("{name}.weight"), &[to, from, taps, taps]);
        put(format!("{name}.bias"), &[to]);
        put(format!("lin{k}.model.1.weight"), &[1, to, 1, 1]);
    }
    let header = format!("{{{}}}", header.join(","));
    let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
    bytes.extend(header.bytes());
    bytes.resize(bytes.len() + end, 0);
    fs::write(path, bytes).unwrap();
    path.display().to_string()
}

#[test]
fn a_perceptual_distance_fills_its_column() {
    let folder = tempfile::tempdir().unwrap();
    let stripes = photograph(&folder.path().join("stripes.png"), 48);
    let weights = weights_of_zeros(&folder.path().join("zeros.safetensors"));
    let out = folder.path().join("out").display().to_string();
    let camera = ["--camera", "cameras/gt1930.toml", "--field-deg", "60"];
    compare(
        &[
            &[stripes.as_str(), "--baselines", "flatcam", "--lpips", &weights],
            &camera[..],
        ]
        .concat(),
        &out,
    )
    .assert()
    .success()
    .stdout(contains(" | 1.000 | "));
}

#[test]
fn a_last_stage_is_taught_and_used_by_its_camera_alone() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.png", "b.png", "c.png"] {
        photograph(&folder.path().join(name), 56);
    }
    let photographs = folder.path().display().to_string();
    let at = |name: &str| folder.path().join("out").join(name).display().to_string();
    let camera = ["--camera", "cameras/gt1930.toml", "--field-deg", "60", "--pixels", "48"];
    let train = |stage: &str| {
        let mut command = super::metalith();
        command
            .args(["train", &photographs, "--stage", stage, "--steps", "2", "--batch", "1"])
            .args(["--piece", "32", "--out", &at("stage.safetensors")])
            .args(camera);
        command
    };
    train("blending")
        .assert()
        .code(2)
        .stderr(contains(refusal("train/stage-not-for-camera")));
    train("magic").assert().code(2).stderr(contains("'--stage <"));
    train("flatnet").assert().success().stdout(contains("weights"));
    let whole = fs::read(at("stage.safetensors")).unwrap();
    // Pictures that are there are taken again.
    fs::remove_file(at("stage.safetensors.state")).ok();
    let kept = Path::new(&at("stage.safetensors.pictures")).join("000001.safetensors");
    let before = fs::metadata(&kept).unwrap().modified().unwrap();
    train("flatnet").assert().success();
    assert_eq!(fs::metadata(&kept).unwrap().modified().unwrap(), before);
    assert!(fs::read(at("stage.safetensors")).unwrap() == whole);

    let learnt = ["--baselines", "flatcam", "--learnt", &at("stage.safetensors")];
    compare(
        &[&[photographs.as_str()], &camera[..], &learnt].concat(),
        &at("compare"),
    )
    .assert()
    .success()
    .stdout(contains("| FlatCam, ours | FlatNet-like |"));
    let other = ["--camera", "cameras/gt1930.toml", "--field-deg", "50", "--pixels", "48"];
    compare(&[&[photographs.as_str()], &other[..], &learnt].concat(), &at("compare"))
        .assert()
        .code(2)
        .stderr(contains(refusal("compare/stage-without-camera")));
    fs::write(at("stage.safetensors"), &whole[..whole.len() - 1]).unwrap();
    compare(
        &[&[photographs.as_str()], &camera[..], &learnt].concat(),
        &at("compare"),
    )
    .assert()
    .code(2)
    .stderr(contains(format!(
        "{}{}",
        refusal("table/malformed"),
        at("stage.safetensors")
    )));
}
