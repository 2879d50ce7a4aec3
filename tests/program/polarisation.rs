//! Polarisation of source and detector at rotated rectangles, as a design and the options of `psf` have it.

use std::fs;
use std::path::Path;

use metalith_testing::design;
use serde_json::Value;

use super::refusal;
use super::run::{metalith, report};

/// What `psf` finds of a file with options: the numbers of its PSF, or what it says.
fn psf(layout: &Path, options: &[&str]) -> Result<Value, String> {
    let cell = layout.with_file_name("cell.toml");
    let text = "[cell]\npitch_nm = 354\npillar_height_nm = 600\nwidth_min_nm = 100\nwidth_max_nm = 250\n\
                pillar_material = \"tio2_siefke_2016\"\n";
    fs::write(&cell, text).unwrap();
    let flags = [
        "psf",
        "--distance-um",
        "80",
        "--wavelength-nm",
        "532",
        "--samples",
        "96",
        "--pixel-um",
        "1.4",
        "--json",
    ];
    let output = metalith(&[&flags, options, &["--cell"]].concat(), &[&cell, layout]);
    match output.status.code() {
        Some(0) => Ok(serde_json::from_slice::<Value>(&output.stdout).unwrap()["psfs"][0].clone()),
        Some(2) => Err(String::from_utf8_lossy(&output.stderr).into_owned()),
        code => panic!("{code:?}: {}", String::from_utf8_lossy(&output.stderr)),
    }
}

/// `run` by the design and `psf` by its options simulate the same light, and the page says what of it is focused.
#[test]
#[ignore = "second tier: CPU time, in scripts/slow_tests.sh"]
fn a_design_and_options_name_the_same_light() {
    /// Both sample the peak at the same places; the aperture of `psf` is the circle around the pillars.
    const SAME: f64 = 1e-3;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lens.toml");
    let text = fs::read_to_string(design("geometric_phase_532")).unwrap();
    let light = "[verify]\npolarisation = \"unpolarised\"\nanalyser = \"circular\"\n";
    let text = text
        .replacen("[verify]\n", light, 1)
        .replacen("strehl_ratio_min = 0.8", "strehl_ratio_min = 0.4", 1);
    fs::write(&path, text).unwrap();
    let output = metalith(&["run", "--out"], &[folder.path(), &path]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{said}");
    let html = fs::read_to_string(folder.path().join("report.html")).unwrap();
    for words in [
        "Light arrives unpolarised",
        "a circular analyser passes the hand of focused light alone",
    ] {
        assert!(html.contains(words), "{words}");
    }
    let found = report(folder.path());
    let spot = &found["distinct"][0]["spots"][0]["extracted"][0][1];

    let layout = folder.path().join("geometric_phase_532_pillars.gds");
    let options = [
        "--arriving",
        "unpolarised",
        "--analyser",
        "circular",
        "--focused",
        "left",
    ];
    let same = psf(&layout, &options).unwrap();
    for figure in ["strehl", "energy_1_pixel", "energy_passed"] {
        let [here, there] = [&same, spot].map(|of| of[figure].as_f64().unwrap());
        println!("{figure}: {here:.5} {there:.5}");
        assert!(
            here > 0.2 && (here / there - 1.0).abs() < SAME,
            "{figure}: {here} {there}"
        );
    }

    // A whole design says which light is focused; the pillars must be of its lattice.
    let other = design("mini_3x3");
    let words = [
        "psf",
        "--arriving",
        "45",
        "--analyser",
        "circular",
        "--extract-only",
        "--cell",
    ];
    assert_eq!(metalith(&words, &[&path, &layout]).status.code(), Some(0));
    assert_eq!(metalith(&words, &[&other, &layout]).status.code(), Some(2));
    let said = psf(&layout, &["--arriving", "45", "--analyser", "circular"]).unwrap_err();
    assert!(said.contains(&refusal("light/handedness-missing")), "{said}");
    let said = psf(&layout, &["--arriving", "diagonal"]).unwrap_err();
    assert!(said.contains("'--arriving <"), "{said}");
    assert!(psf(&layout, &["--focused", "left"]).is_err());

    // Half of what a linear analyser passes is focused, whatever hand that is.
    let [all, linear] = [&["--arriving", "45"][..], &["--arriving", "45", "--analyser", "-30"]]
        .map(|options| psf(&layout, options).unwrap());
    let passed = |of: &Value| of["energy_passed"].as_f64().unwrap();
    assert!(
        passed(&linear) > 0.2 && passed(&linear) < 0.8 * passed(&all),
        "{linear} {all}"
    );
    let said = psf(&layout, &["--analyser", "left"]).unwrap_err();
    assert!(said.contains("'--analyser <"), "{said}");
}
