//! Camera files: those that are shipped, and those with mistakes.

use std::path::{Path, PathBuf};

use metalith_core::{Error, Fault};
use metalith_sensor::{Camera, ColourFilter, Illuminant, LightLevel, SensorNoise, StatedExposure};

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

/// The text of an error without the folder of the camera, which is another each time.
fn words(error: &Error) -> String {
    let text = error.to_string();
    let lines = text.lines().map(|line| match line.find("camera.toml:") {
        Some(begin) => &line[begin..],
        None => line,
    });
    // A path from the root of the machine is shown by its file.
    let name = |word: &str| match word.strip_prefix('/').and_then(|path| path.rsplit('/').next()) {
        Some(file) => file.to_owned(),
        None => word.to_owned(),
    };
    let lines = lines.map(|line| line.split(' ').map(name).collect::<Vec<_>>().join(" "));
    lines.collect::<Vec<_>>().join("\n")
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
            let place = |fault: &Fault| (faults.line_column(fault.span.start).0, fault.id());
            let found: Vec<_> = faults.faults().iter().map(place).collect();
            let wanted = [
                (4, "sensor.pixel_um/out-of-range"),
                (7, "sensor.filter/unknown-choice"),
                (8, "sensor.bit/unknown"),
                (13, "channel#0.band_nm/inconsistent"),
                (14, "exposure.time_ms/missing"),
                (17, "illuminant.source/unknown-choice"),
            ];
            assert_eq!(found, wanted.map(|(line, id)| (line, id.to_owned())), "{faults}");
        }
        other => panic!("{other:?}"),
    }
}

/// Tables that cannot be used are mistakes of the keys that name them, with the lines of both, among the others of the file.
#[test]
fn mistakes_of_tables_are_those_of_their_keys() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("camera.toml");
    for (name, table) in [
        ("qe.csv", "nm,value\n500,0.5\n510,1.5\n"),
        ("angles.csv", "deg,value\n5,1\n"),
        ("light.csv", "nm,value\n500,x\n"),
    ] {
        std::fs::write(folder.path().join(name), table).unwrap();
    }
    let wrong = PLAIN
        .replace("bits = 12", "bits = 12\nangular_response = \"angles.csv\"")
        .replace("band_nm = [450, 650]", "quantum_efficiency = \"qe.csv\"")
        .replace("time_ms = 10", "time_ms = 0")
        .replace("source = \"equal_energy\"", "source = \"file\"\nfile = \"light.csv\"");
    std::fs::write(&path, wrong).unwrap();
    let Err(Error::Text(faults)) = Camera::read(&path) else {
        panic!("tables are wrong")
    };
    let place = |fault: &Fault| (faults.line_column(fault.span.start).0, fault.id());
    let found: Vec<_> = faults.faults().iter().map(place).collect();
    let wanted = [
        (9, "sensor.angular_response/unusable-file"),
        (14, "channel#0.quantum_efficiency/unusable-file"),
        (16, "exposure.time_ms/out-of-range"),
        (19, "illuminant.file/unusable-file"),
    ];
    assert_eq!(found, wanted.map(|(line, id)| (line, id.to_owned())), "{faults}");
    insta::assert_snapshot!(words(&Error::Text(faults)), @r"
    camera.toml:9:20: `angular_response`: angles.csv, line 2: 5 degrees with 1, where 0 degrees with 1 should be
      help: give a header `deg,value` and lines of both, angles rising from 0 to at most 90, values from 0 to 2 and 1 at 0 degrees
    camera.toml:14:22: `quantum_efficiency`: qe.csv, line 3: 510 nm with 1.5 cannot be
      help: give a header `nm,value` and lines of both, wavelengths rising, values from 0 to 1, not all zero
    camera.toml:16:11: `time_ms` cannot be 0
      help: it must be a number from 0.001 to 1000000 ms
    camera.toml:19:8: `file`: light.csv, line 2: `x` in column `value` is not a finite number
      help: give a header `nm,value` and lines of both, wavelengths rising, values of 0 or more, not all zero
    ");
}

#[test]
fn what_does_not_fit_together_is_said() {
    let cases = [
        ("filter = \"none\"", "filter = \"rggb\"", "sensor.filter/inconsistent"),
        (
            "full_well_e = 10000",
            "full_well_e = 10000\nnoise_photon = 1e-4\nnoise_read = 0",
            "sensor.full_well_e/inconsistent sensor.read_noise_e/inconsistent",
        ),
        ("band_nm = [450, 650]", "", "channel#0.band_nm/missing"),
        (
            "band_nm = [450, 650]",
            "quantum_efficiency = \"none.csv\"",
            "channel#0.quantum_efficiency/no-file",
        ),
        (
            "source = \"equal_energy\"",
            "source = \"leds\"",
            "illuminant.source/inconsistent",
        ),
        (
            "source = \"equal_energy\"",
            "source = \"d65\"\nfile = \"x.csv\"",
            "illuminant.file/unknown illuminant.file/inconsistent",
        ),
        (
            "source = \"equal_energy\"",
            "source = \"leds\"\n[[illuminant.led]]\ncentre_nm = 900\nwidth_nm = 10",
            "camera/channel-without-light",
        ),
        // 4095 steps of one electron are 0.41 of the well.
        ("bits = 12", "bits = 12\ngain_e = 1", "sensor.gain_e/inconsistent"),
    ];
    let errors = cases.map(|(from, to, _)| read(&PLAIN.replace(from, to)).unwrap_err());
    insta::assert_snapshot!(errors.each_ref().map(words).join("\n"), @r#"
        camera.toml:7:10: this colour filter array does not fit the channels
          help: name three channels red, green and blue, or use `filter = "none"`
        camera.toml:9:15: noise is given twice: `full_well_e`, and in units of full scale
          help: keep `noise_photon` and `noise_read`, or the numbers in electrons
        camera.toml:12:16: noise is given twice: `read_noise_e`, and in units of full scale
          help: keep `noise_photon` and `noise_read`, or the numbers in electrons
        camera.toml:11:1: [channel] lacks `band_nm`
          help: add `band_nm`: a list of 2 numbers
        camera.toml:13:22: there is no file none.csv
          help: relative paths count from the folder of this file
        camera.toml:17:10: there is no diode
          help: add one or more sections [[illuminant.led]]
        camera.toml:18:1: unknown key `file` in [illuminant]
          help: known here: illuminance_lux, led, radiance_w_m2_sr, reflectance, source
        camera.toml:18:8: `file` is of no use with this source
          help: remove it, or change `source`
        camera.toml: channel `mono` receives no light of the illuminant
          help: let the efficiency of each channel and the illuminant overlap in wavelength
        camera.toml:9:10: most of a picture would be at its limit: a white surface has 0.9 of full scale, 9000 electrons, and pixel values end at 4095
          help: give a smaller `white`, or a `gain_e` of 2.1978 electrons a step and more
        "#);
    assert_eq!(errors.map(|error| error.ids().join(" ")), cases.map(|case| case.2));
}

#[test]
fn the_light_is_stated_once_and_in_a_unit_that_it_has() {
    let with = |exposure: &str, light: &str| {
        let text = PLAIN.replace("time_ms = 10", exposure);
        read(&format!("{text}{light}"))
    };
    let camera = with(
        "time_ms = \"auto\"\nlongest_ms = 20",
        "illuminance_lux = 300\nreflectance = 0.5",
    )
    .unwrap();
    assert!(camera.exposure.auto && camera.exposure.time_s == 0.02);
    assert_eq!(camera.exposure.light.level, Some(LightLevel::IlluminanceLux(300.0)));
    assert_eq!(camera.exposure.light.reflectance, 0.5);
    // A file that says nothing of the light.
    let silent = with("time_ms = 10", "").unwrap();
    assert!(!silent.exposure.auto && silent.exposure.light.level.is_none());
    for (exposure, light, id) in [
        (
            "time_ms = 10",
            "illuminance_lux = 3\nradiance_w_m2_sr = 1",
            "illuminant.radiance_w_m2_sr/inconsistent",
        ),
        (
            "time_ms = 10",
            "radiance_w_m2_sr = 1\nreflectance = 0.5",
            "illuminant.reflectance/inconsistent",
        ),
        ("time_ms = 10\nlongest_ms = 20", "", "exposure.longest_ms/inconsistent"),
        ("time_ms = \"long\"", "", "exposure.time_ms/wrong-type"),
    ] {
        assert_eq!(with(exposure, light).unwrap_err().ids(), [id]);
    }
    let stated = |lux: Option<f64>, time_ms: Option<f64>| {
        silent.clone().stated(&StatedExposure {
            lux,
            time_ms,
            longest_ms: None,
        })
    };
    let lit = stated(Some(20.0), Some(5.0)).unwrap();
    assert_eq!(lit.exposure.light.level, Some(LightLevel::IlluminanceLux(20.0)));
    assert_eq!((lit.exposure.time_s, lit.exposure.auto), (0.005, false));
    assert_eq!(stated(None, None).unwrap(), silent);
    for (lux, time_ms) in [
        (Some(f64::NAN), None),
        (Some(-1.0), None),
        (None, Some(0.0)),
        (None, Some(1e9)),
    ] {
        assert_eq!(stated(lux, time_ms).unwrap_err().id(), "camera/exposure-out-of-range");
    }
    let up_to = |longest_ms: f64, time_ms: Option<f64>| {
        silent.clone().stated(&StatedExposure {
            lux: None,
            time_ms,
            longest_ms: Some(longest_ms),
        })
    };
    let chosen = up_to(20.0, None).unwrap();
    assert_eq!((chosen.exposure.time_s, chosen.exposure.auto), (0.02, true));
    assert_eq!(up_to(20.0, Some(5.0)).unwrap_err().id(), "camera/two-times");
    assert_eq!(up_to(-1.0, None).unwrap_err().id(), "camera/exposure-out-of-range");
    let infrared = PLAIN
        .replace("[450, 650]", "[1500, 1600]")
        .replace("equal_energy", "leds");
    let diode = "[[illuminant.led]]\ncentre_nm = 1550\nwidth_nm = 30";
    let error = read(&format!("{infrared}illuminance_lux = 500\n{diode}")).unwrap_err();
    assert_eq!(error.ids(), ["camera/light-not-visible"]);
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
    let error = with("gain_e = 1", "white = 0.42").unwrap_err();
    insta::assert_snapshot!(words(&error), @"
        camera.toml:17:9: most of a picture would be at its limit: a white surface has 0.42 of full scale, 4200 electrons, and pixel values end at 4095
          help: give a smaller `white`, or a `gain_e` of 1.0256 electrons a step and more
        ");
    assert_eq!(error.ids(), ["exposure.white/inconsistent"]);
    with("gain_e = 1", "white = 0.4").unwrap();
    // Steps that are the whole of the well end one step below it.
    with("", "white = 1").unwrap();
    // One mistake is one fault.
    match with("gain_e = 0", "white = 0.9") {
        Err(Error::Text(faults)) => assert_eq!(faults.count(), 1, "{faults}"),
        other => panic!("{other:?}"),
    }
}
