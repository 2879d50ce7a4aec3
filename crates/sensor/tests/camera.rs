//! Camera files: those that are shipped, and those with mistakes.

use std::path::{Path, PathBuf};

use metalith_core::Error;
use metalith_sensor::{Camera, ColourFilter, Illuminant, SensorNoise};

fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cameras").join(name)
}

#[test]
fn shipped_cameras_are_read() {
    let bayer = Camera::read(&shipped("gt1930.toml")).unwrap();
    assert_eq!(bayer.sensor.filter, ColourFilter::Rggb);
    assert_eq!(
        (bayer.sensor.columns, bayer.sensor.rows, bayer.sensor.pixel_um),
        (1936, 1216, 5.86)
    );
    assert_eq!(bayer.illuminant, Illuminant::D65);
    assert_eq!(bayer.files.len(), 4);
    let names: Vec<_> = bayer.channels.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["red", "green", "blue"]);
    let sampling = bayer.sampling([400.0, 700.0], 12.5).unwrap();
    // What lies beyond the infrared cut filter and below 400 nm is a few percent at most.
    assert!(sampling.channels.iter().all(|c| c.counted > 0.97), "{sampling:?}");
    // The middle of the light of each channel is in its colour.
    for (channel, colour) in sampling.channels.iter().zip([570.0..650.0, 510.0..570.0, 430.0..500.0]) {
        let total: f64 = channel.parts.iter().map(|p| p.weight).sum();
        let mean = channel.parts.iter().map(|p| p.weight * p.nm[0]).sum::<f64>() / total;
        assert!(colour.contains(&mean), "{}: {mean} nm", channel.name);
    }
    let mono = Camera::read(&shipped("gt1930_mono.toml")).unwrap();
    assert_eq!(mono.channels.len(), 1);
    assert!(matches!(mono.illuminant, Illuminant::Leds(ref leds) if leds.len() == 3));
    assert!(matches!(mono.sensor.noise, SensorNoise::FullScale { photon, .. } if photon == 4e-5));
}

const PLAIN: &str = r#"schema = 1
name = "plain"
[sensor]
pixel_um = 5.86
columns = 100
rows = 80
filter = "none"
bits = 12
full_well_e = 10000
read_noise_e = 5
[[channel]]
name = "mono"
band_nm = [450, 650]
[exposure]
time_ms = 10
[illuminant]
source = "equal_energy"
"#;

fn read(text: &str) -> Result<Camera, Error> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("camera.toml");
    std::fs::write(&path, text).unwrap();
    Camera::read(&path)
}

#[test]
fn all_mistakes_are_found_at_once() {
    read(PLAIN).unwrap();
    let wrong = PLAIN
        .replace("pixel_um = 5.86", "pixel_um = 0")
        .replace("bits = 12", "bit = 12")
        .replace("\"none\"", "\"rgbg\"")
        .replace("[450, 650]", "[650, 450]")
        .replace("time_ms = 10", "")
        .replace("equal_energy", "sun");
    match read(&wrong) {
        Err(Error::Text(faults)) => {
            let words = faults.to_string();
            assert_eq!(faults.count(), 6, "{words}");
            for (line, what) in [
                (4, "pixel_um"),
                (7, "filter"),
                (8, "bit"),
                (13, "a band must end"),
                (14, "time_ms"),
                (17, "source"),
            ] {
                assert!(
                    words
                        .lines()
                        .any(|l| l.contains(&format!("camera.toml:{line}:")) && l.contains(what)),
                    "{line} {what}: {words}"
                );
            }
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn what_does_not_fit_together_is_said() {
    for (from, to, what) in [
        ("filter = \"none\"", "filter = \"rggb\"", "does not fit the channels"),
        (
            "full_well_e = 10000",
            "full_well_e = 10000\nnoise_photon = 1e-4\nnoise_read = 0",
            "noise is given twice",
        ),
        ("band_nm = [450, 650]", "", "band_nm"),
        (
            "band_nm = [450, 650]",
            "quantum_efficiency = \"none.csv\"",
            "there is no file",
        ),
        ("source = \"equal_energy\"", "source = \"leds\"", "there is no diode"),
        (
            "source = \"equal_energy\"",
            "source = \"d65\"\nfile = \"x.csv\"",
            "of no use",
        ),
        (
            "source = \"equal_energy\"",
            "source = \"leds\"\n[[illuminant.led]]\ncentre_nm = 900\nwidth_nm = 10",
            "counts none of the light",
        ),
        // 4095 steps of one electron are 0.41 of the well.
        ("bits = 12", "bits = 12\ngain_e = 1", "camera.toml:9:"),
    ] {
        let error = read(&PLAIN.replace(from, to)).unwrap_err().to_string();
        assert!(error.contains(what), "{what}: {error}");
        assert!(error.contains("help: "), "{error}");
    }
}

#[test]
fn white_beyond_the_last_step_is_a_fault_where_it_stands() {
    let with = |gain: &str, white: &str| {
        read(
            &PLAIN
                .replace("bits = 12", &format!("bits = 12\n{gain}"))
                .replace("time_ms = 10", &format!("time_ms = 10\n{white}")),
        )
    };
    // 4095 steps of one electron in a well of 10000.
    let error = with("gain_e = 1", "white = 0.42").unwrap_err().to_string();
    assert!(error.contains("camera.toml:17:") && error.contains("4095"), "{error}");
    with("gain_e = 1", "white = 0.4").unwrap();
    // Steps that are the whole of the well end one step below it.
    with("", "white = 1").unwrap();
    // One mistake is one fault.
    match with("gain_e = 0", "white = 0.9") {
        Err(Error::Text(faults)) => assert_eq!(faults.count(), 1, "{faults}"),
        other => panic!("{other:?}"),
    }
}
