//! The main job through the program: what a design asks for is written, read back, simulated and judged.

use std::fs;
use std::path::Path;

use metalith_testing::{design, golden};
use serde_json::{Value, json};

pub(super) fn metalith(args: &[&str], paths: &[&Path]) -> std::process::Output {
    super::metalith().args(args).args(paths).output().unwrap()
}

/// The program ended with this code; if not, what it said.
pub(super) fn assert_code(output: &std::process::Output, code: i32) {
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{said}");
}

pub(super) fn report(folder: &Path) -> Value {
    serde_json::from_slice(&fs::read(folder.join("report.json")).unwrap()).unwrap()
}

/// Numbers that must not change unnoticed, to as many digits as hold on every machine.
pub(super) fn numbers(report: &Value) -> Value {
    const DIGITS: i32 = 4;
    let round = |v: &Value| {
        let x = v.as_f64().unwrap();
        let scale = 10f64.powi(DIGITS - 1 - x.abs().max(1e-300).log10().floor() as i32);
        (x * scale).round() / scale
    };
    let spots = |element: &Value| {
        let of = |spot: &Value| {
            json!({
                "wavelength_um": spot["wavelength_um"],
                "field": spot["field"],
                "designed_strehl": round(&spot["designed"]["strehl"]),
                "extracted_strehl": spot["extracted"].as_array().unwrap().iter()
                    .map(|pair| json!([pair[0], round(&pair[1]["strehl"])])).collect::<Vec<_>>(),
                "energy_1_pixel": round(&spot["extracted"][0][1]["energy_1_pixel"]),
                "psf_difference": round(&spot["psf_difference"]),
            })
        };
        element["spots"].as_array().unwrap().iter().map(of).collect::<Vec<_>>()
    };
    let white = |element: &Value| {
        let of = |w: &Value| {
            json!({
                "channel": w["channel"],
                "spread_um": round(&w["spread_um"]),
                "energy_2_pixels": round(&w["energy_2_pixels"]),
                "energy_passed": round(&w["energy_passed"]),
                "contrast": w["contrast"].as_array().unwrap().iter()
                    .map(|c| json!([c["lp_mm"], round(&c["mtf"][0]), round(&c["mtf"][1])])).collect::<Vec<_>>(),
            })
        };
        element["white"].as_array().unwrap().iter().map(of).collect::<Vec<_>>()
    };
    let element = |e: &Value| {
        json!({
            "index": e["element"]["index"],
            "copies": e["copies"],
            "rounding_rms_rad": round(&e["phase"]["rounding"]["rms_rad"]),
            "mapping_rms_rad": round(&e["phase"]["mapping"]["rms_rad"]),
            "spots": spots(e),
            "white": white(e),
        })
    };
    let found = &report["verification"];
    let found = if found.is_null() { report } else { found };
    json!({
        "pillars": found["layout"]["pillars"],
        "distinct": found["distinct"].as_array().unwrap().iter().map(element).collect::<Vec<_>>(),
    })
}

/// Share of the light that the sum over pairs puts elsewhere than supercells that it was not fitted to: as of real rows in
/// crates/design/tests/neighbours.rs. Measured for the shipped tables: 0.012 to 0.024.
const LEFT_OUT: f64 = 0.035;

#[test]
fn golden_numbers_of_the_mini_design() {
    let folder = tempfile::tempdir().unwrap();
    let output = metalith(&["run", "--out"], &[folder.path(), &design("mini_3x3")]);
    assert_code(&output, 0);
    let numbers = numbers(&report(folder.path()));
    golden("mini_3x3/report.json", format!("{numbers:#}\n").as_bytes());
    let html = fs::read_to_string(folder.path().join("report.html")).unwrap();
    assert!(html.contains("all 4 limits hold"));
    // The cell that judges says how far it is from supercells, and what it does not count.
    let found = report(folder.path());
    for order in found["distinct"]
        .as_array()
        .unwrap()
        .iter()
        .flat_map(|d| d["orders"].as_array().unwrap())
    {
        let share = order["left_out"].as_f64();
        assert_eq!(share.is_some(), order["fidelity"] == "neighbours", "{order}");
        assert!(share.is_none_or(|share| share > 0.0 && share < LEFT_OUT), "{order}");
    }
    for words in [
        "of the light at 530 nm",
        "on supercells left out of the fit",
        "of what passes in the middle of the outermost element",
        "apart, at the ends of the band",
    ] {
        assert!(html.contains(words), "{words}");
    }
    assert!(
        !html.contains("src=\"http") && !html.contains("href=\"http"),
        "the page needs a network"
    );
}

/// A layout that may not be simulated in the memory that is allowed is compared pillar by pillar, which is said before.
#[test]
fn what_is_too_large_to_be_simulated_is_compared_all_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let mini = design("mini_3x3");
    let output = metalith(
        &["run", "--memory-mb", "1", "--oasis", "compact", "--out"],
        &[folder.path(), &mini],
    );
    let (said, found) = (String::from_utf8(output.stderr).unwrap(), report(folder.path()));
    assert_eq!(output.status.code(), Some(0), "{said}");
    let notes: Vec<_> = said.lines().filter(|line| line.contains("--memory-mb")).collect();
    assert!(!notes.is_empty(), "{said}");
    assert!(found["distinct"].as_array().unwrap().is_empty());
    // A sample stands for each distinct element, and judges what it tells.
    let none = &found["not_simulated"];
    assert!(none["why"].is_string() && none["sampled"]["not_covered"].is_string());
    assert_eq!(none["sampled"]["elements"].as_array().unwrap().len(), 3);
    for (key, sampled) in [("mapping_phase_rms_max_rad", true), ("wrong_widths_max", false)] {
        assert_eq!(check(&found, key)["sampled"] == true, sampled, "{key}");
        assert!(holds(&found, key), "{key}");
    }
    let elements = found["elements"].as_array().unwrap();
    let pillars: u64 = elements.iter().map(|e| e["widths"]["pillars"].as_u64().unwrap()).sum();
    assert_eq!(
        (elements.len(), Some(pillars)),
        (9, found["layout"]["pillars"].as_u64())
    );
    // A pillar that is off its site is found.
    let right = |found: &Value| holds(found, "wrong_widths_max") && holds(found, "foreign_shapes_max");
    let gds = metalith(&["layout", "--hierarchy", "flat", "--out"], &[folder.path(), &mini]);
    assert!(gds.status.success());
    let path = folder.path().join("mini_3x3_pillars.gds");
    let mut bytes = fs::read(&path).unwrap();
    // The last but one boundary of five points moves by half a pitch: off its site.
    let at = bytes.windows(4).rposition(|w| w == [0, 0x2C, 0x10, 3]).unwrap();
    let pillar = bytes[..at].windows(4).rposition(|w| w == [0, 0x2C, 0x10, 3]).unwrap();
    for x in (0..5).map(|k| pillar + 4 + 8 * k) {
        let moved = i32::from_be_bytes(bytes[x..x + 4].try_into().unwrap()) + 175;
        bytes[x..x + 4].copy_from_slice(&moved.to_be_bytes());
    }
    fs::write(&path, bytes).unwrap();
    metalith(&["verify", "--memory-mb", "1", "--out"], &[folder.path(), &mini, &path]);
    assert!(!right(&report(folder.path())));
    // A limit that no sample tells does not hold.
    let limited = folder.path().join("limited.toml");
    let limits = "[verify.limits]\nstrehl_min = 0.01\nmtf_difference_max = 0.5";
    let text = fs::read_to_string(&mini).unwrap().replace("[verify.limits]", limits);
    fs::write(&limited, text).unwrap();
    let layout = folder.path().join("mini_3x3_pillars.oas");
    metalith(
        &["verify", "--memory-mb", "1", "--out"],
        &[folder.path(), &limited, &layout],
    );
    let found = report(folder.path());
    let [told, not_told] = ["strehl_min", "mtf_difference_max"].map(|key| check(&found, key));
    assert!(told["sampled"] == true && not_told["sampled"].is_null() && not_told["reached"].is_null());
}

/// A layout of elements that would be too large for a simulation of the usual kind: in parts, every figure is the same.
#[test]
fn a_simulation_in_parts_is_the_whole_one() {
    let folder = tempfile::tempdir().unwrap();
    let design = metalith::Design::read(&design("mini_3x3")).unwrap();
    let array = metalith::PillarArray::build(&design, &metalith::Silent).unwrap();
    let file = folder.path().join("mini.oas");
    let format = metalith::layout::LayoutFormat::of_name(&file);
    let hierarchy = metalith::Hierarchy::Folded;
    metalith::layout::write_pillars_as(&design, &array, hierarchy, format, &file, &metalith::Silent).unwrap();
    let cells = metalith::cell_models(&design, &[metalith::Fidelity::Published]).unwrap();
    let cases = metalith::SimulationCases::of_cells(&cells).unwrap();
    let (accuracy, silent) = (metalith::Accuracy::Fast, &metalith::Silent);
    let whole = metalith::verify(&design, &array, &file, &cases, accuracy, silent).unwrap();
    let parts = metalith::verify::verify_in_parts(&design, &array, &file, &cases, accuracy, 1, silent).unwrap();
    let text = |found: &metalith::Verification| serde_json::to_string(found).unwrap();
    assert_eq!(text(&parts), text(&whole));
    assert!(!whole.distinct.is_empty() && whole.distinct.iter().all(|d| !d.white.is_empty()));
}

/// The judgement of a report on the limit with this key.
fn check<'a>(report: &'a Value, key: &str) -> &'a Value {
    let mut checks = report["checks"].as_array().unwrap().iter();
    checks.find(|check| check["key"] == key).unwrap()
}

/// True if a report finds a limit held.
fn holds(report: &Value, key: &str) -> bool {
    let check = check(report, key);
    let [reached, limit] = ["reached", "limit"].map(|name| check[name].as_f64().unwrap());
    match check["sense"].as_str() {
        Some("at_least") => reached >= limit,
        Some("at_most") => reached <= limit,
        other => panic!("{other:?}"),
    }
}

#[test]
fn limits_on_white_light_decide_and_name_the_channel() {
    let folder = tempfile::tempdir().unwrap();
    let camera = metalith_testing::root().join("cameras/gt1930_mono.toml");
    let text = fs::read_to_string(design("mini_3x3")).unwrap();
    let text = text.replace("pixel_um = 5.86", &format!("pixel_um = 5.86\ncamera = {camera:?}"))
        + "polychromatic_mtf_min = 0.9\npolychromatic_mtf_lp_mm = 30\npolychromatic_energy_2_pixels_min = 0.05\n";
    let path = folder.path().join("white.toml");
    fs::write(&path, &text).unwrap();
    let fast = ["run", "--fast", "--fidelity", "published", "--out"];
    let output = metalith(&fast, &[folder.path(), &path]);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let found = report(folder.path());
    assert!(!holds(&found, "polychromatic_mtf_min") && holds(&found, "polychromatic_energy_2_pixels_min"));
    // Where the worst of it is.
    let printed = String::from_utf8(output.stdout).unwrap();
    assert!(printed.contains("channel mono"), "{printed}");
    assert_eq!(found["camera"]["name"], "gt1930_mono");
    // Light of three diodes from 455 to 660 nm, drawn out by the wedge: f sin(psi) / lambda_w times as much.
    for element in found["distinct"].as_array().unwrap() {
        let wedge = &element["element"]["wedge"];
        let sine = |key: &str| wedge[key].as_f64().unwrap();
        let way = 144.0 * sine("sin_x").hypot(sine("sin_y")) / 550.0;
        let white = &element["white"][0];
        let nm = |i: usize| white["wavelengths_nm"][i].as_f64().unwrap();
        let spread = white["spread_um"].as_f64().unwrap();
        // The tangent of a direction is longer than its sine by 1 % at most.
        assert!((spread - way * (nm(2) - nm(0))).abs() <= 0.01 * spread, "{spread} um");
    }
    // A camera that is not there is a mistake of the design, and nothing is written.
    fs::write(&path, text.replace("gt1930_mono", "gt1931")).unwrap();
    let output = metalith(&["run", "--out"], &[&folder.path().join("none"), &path]);
    assert_eq!(output.status.code(), Some(2));
    assert!(!folder.path().join("none").exists());
}

#[test]
fn one_wrong_pillar_fails_the_run_that_finds_it() {
    let folder = tempfile::tempdir().unwrap();
    let mini = design("mini_3x3");
    let output = metalith(&["layout", "--hierarchy", "flat", "--out"], &[folder.path(), &mini]);
    assert_eq!(output.status.code(), Some(0));
    let layout = folder.path().join("mini_3x3_pillars.gds");
    let mut bytes = fs::read(&layout).unwrap();
    // The last pillar of the file: its record ends before ENDSTR and ENDLIB. Two of its corners move by 2 nm,
    // so that it is a rectangle, no longer a pillar.
    let record = bytes.len() - 8 - 64;
    let (lower_right_x, upper_right_x) = (2, 4);
    for corner in [lower_right_x, upper_right_x] {
        let at = record + 20 + 4 * corner;
        let x = i32::from_be_bytes(bytes[at..at + 4].try_into().unwrap()) + 2;
        bytes[at..at + 4].copy_from_slice(&x.to_be_bytes());
    }
    fs::write(&layout, &bytes).unwrap();
    let fast = ["verify", "--fast", "--fidelity", "published", "--json"];
    let output = metalith(&fast, &[&mini, &layout]);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    for limit in ["wrong_widths_max", "foreign_shapes_max"] {
        assert_eq!(check(&found, limit)["reached"], 1.0, "{limit}");
        assert!(!holds(&found, limit), "{limit}");
    }
}

#[test]
fn a_layout_from_anywhere_is_found_and_simulated() {
    let folder = tempfile::tempdir().unwrap();
    let output = metalith(
        &["layout", "--hierarchy", "sref", "--out"],
        &[folder.path(), &design("mini_3x3")],
    );
    assert_eq!(output.status.code(), Some(0));
    let layout = folder.path().join("mini_3x3_pillars.gds");
    let args = [
        "psf",
        "--distance-um",
        "144",
        "--wavelength-nm",
        "530",
        "--samples",
        "64",
        "--json",
    ];
    let output = metalith(&args, &[&layout]);
    assert_code(&output, 0);
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    let elements = found["elements"].as_array().unwrap();
    assert_eq!(elements.len(), 9);
    assert!(elements.iter().all(|e| e["pitch_nm"] == 350 && e["pillars"] == 23_092));
    // The centre element, in light along the normal, is what `run` simulates too.
    let centre = elements.iter().find(|e| e["centre_nm"] == json!([0, 0])).unwrap();
    let psf = found["psfs"]
        .as_array()
        .unwrap()
        .iter()
        .find(|p| p["element"] == centre["name"])
        .unwrap();
    let golden: Value =
        serde_json::from_slice(&fs::read(metalith_testing::root().join("golden/mini_3x3/report.json")).unwrap())
            .unwrap();
    let run = golden["distinct"]
        .as_array()
        .unwrap()
        .iter()
        .find(|d| d["index"] == json!([0, 0]))
        .unwrap();
    let spot = &run["spots"]
        .as_array()
        .unwrap()
        .iter()
        .find(|s| s["wavelength_um"] == 0.53)
        .unwrap();
    // Without a design, `psf` takes neighbours for equals.
    let cells = spot["extracted_strehl"].as_array().unwrap();
    let rigorous = cells.iter().find(|cell| cell[0] == "rigorous").unwrap();
    let (here, there) = (psf["strehl"].as_f64().unwrap(), rigorous[1].as_f64().unwrap());
    // Both sample the peak on the same lattice of samples; the rest is rounding to four digits.
    const FOUR_DIGITS: f64 = 1e-3;
    assert!((here / there - 1.0).abs() < FOUR_DIGITS, "{here} against {there}");
    // For people it says what its Strehl ratios are against.
    let words = [
        "psf",
        "--fidelity",
        "published",
        "--distance-um",
        "144",
        "--samples",
        "16",
    ];
    let printed = String::from_utf8(metalith(&words, &[&layout]).stdout).unwrap();
    assert!(printed.contains("against the sites that hold a pillar"), "{printed}");
}

/// White light on the axis, by dissimilar neighbours: as `run` has it with the design, which knows by its mapping how
/// often each width stands beside which others, where `psf` counts the widths of the layout.
#[test]
fn white_light_without_a_design_is_that_of_a_run() {
    /// Of shares and contrasts between 0.4 and 0.9. Tables by the two counts differ by 0.003; equal neighbours are 0.024 off.
    const SAME: f64 = 0.005;
    let folder = tempfile::tempdir().unwrap();
    let camera = metalith_testing::root().join("cameras/gt1930.toml");
    let text = fs::read_to_string(design("mini_3x3")).unwrap();
    let with_camera = format!("[verify]\ncamera = \"{}\"", camera.display());
    let path = folder.path().join("mini_3x3.toml");
    fs::write(&path, text.replace("[verify]", &with_camera)).unwrap();
    let output = metalith(&["run", "--quiet", "--out"], &[folder.path(), &path]);
    assert_eq!(output.status.code(), Some(0));
    let run: Value = serde_json::from_slice(&fs::read(folder.path().join("report.json")).unwrap()).unwrap();
    let layout = folder.path().join("mini_3x3_pillars.gds");
    let white = |fidelity: &str| -> Vec<f64> {
        let args = [
            "psf",
            "--distance-um",
            "144",
            "--json",
            "--fidelity",
            fidelity,
            "--camera",
        ];
        let output = metalith(&args, &[&camera, &layout]);
        let found: Value = serde_json::from_slice(&output.stdout).unwrap();
        let elements = found["elements"].as_array().unwrap();
        let centre = elements.iter().find(|e| e["centre_nm"] == json!([0, 0])).unwrap();
        let all = found["white"].as_array().unwrap();
        let own = all.iter().find(|w| w["element"] == centre["name"]).unwrap();
        figures(&own["channels"])
    };
    let of_run = run["distinct"].as_array().unwrap().iter();
    let [want] = of_run
        .filter(|d| d["element"]["index"] == json!([0, 0]))
        .map(|d| figures(&d["white"]))
        .collect::<Vec<_>>()
        .try_into()
        .unwrap();
    let off = |found: &[f64]| -> f64 {
        let pairs = found.iter().zip(&want);
        pairs.map(|(a, b): (&f64, &f64)| (a - b).abs()).fold(0.0, f64::max)
    };
    let [neighbours, equals] = ["neighbours", "rigorous"].map(white);
    assert_eq!(neighbours.len(), want.len());
    assert!(off(&neighbours) < SAME, "{neighbours:?} {want:?}");
    assert!(off(&equals) > 2.0 * SAME, "{equals:?} {want:?}");
}

/// Energy in two pixels and contrasts at 20 lp/mm of each channel.
fn figures(channels: &Value) -> Vec<f64> {
    let channels = channels.as_array().unwrap().iter();
    let of = |c: &Value| {
        [
            &c["energy_2_pixels"],
            &c["contrast"][1]["mtf"][0],
            &c["contrast"][1]["mtf"][1],
        ]
        .map(|v| v.as_f64().unwrap())
    };
    channels.flat_map(of).collect()
}

#[test]
fn what_cannot_be_read_is_bad_input() {
    let folder = tempfile::tempdir().unwrap();
    let junk = folder.path().join("junk.gds");
    fs::write(&junk, b"this is no layout").unwrap();
    let output = metalith(&["psf"], &[&junk]);
    assert_eq!(output.status.code(), Some(2));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let place = format!("{}{}, byte 0: ", super::refusal("layout/malformed"), junk.display());
    assert!(said.contains(&place), "{said}");
    let output = metalith(&["run"], &[&folder.path().join("nowhere.toml")]);
    assert_eq!(output.status.code(), Some(2));
}

/// A mapping that errs is outside of the limits, which is all that a quiet run prints; warnings come first otherwise.
#[test]
fn an_error_of_the_mapping_is_a_limit() {
    let folder = tempfile::tempdir().unwrap();
    let text = fs::read_to_string(design("tio2_532")).unwrap();
    let table = design("tio2_532").with_file_name("mappings/tio2_532.csv");
    let text = text
        .replacen(
            "\"mappings/tio2_532.csv\"",
            &format!("{:?}", table.display().to_string()),
            1,
        )
        .replacen("diameter_um = 80", "diameter_um = 20", 1)
        .replacen("wavelength_nm = 532", "wavelength_nm = 540", 1)
        .replacen(
            "[verify.limits]",
            "[verify.limits]\nmapping_phase_rms_max_rad = 0.01",
            1,
        );
    let path = folder.path().join("lens.toml");
    fs::write(&path, text).unwrap();
    let run = |quiet: &str| metalith(&["run", "--fast", quiet, "--out"], &[folder.path(), &path]);
    let output = run("--quiet");
    let said = String::from_utf8(output.stdout).unwrap();
    assert_eq!((output.status.code(), said.lines().count()), (Some(1), 1), "{said}");
    assert!(said.starts_with("FAILS: "), "{said}");
    assert!(output.stderr.is_empty());
    let found = report(folder.path());
    assert_eq!(found["checks"][0]["key"], "mapping_phase_rms_max_rad");
    assert_eq!(found["warnings"][0]["id"], "design/wavelengths-differ");
    let page = fs::read_to_string(folder.path().join("report.html")).unwrap();
    assert!(page.contains("phase 540 nm; mapping 532 nm"));
    let said = String::from_utf8(run("--threads=2").stderr).unwrap();
    assert!(
        said.starts_with("warning: ") && said.contains("[design/wavelengths-differ]"),
        "{said}"
    );
}
