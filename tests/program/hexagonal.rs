//! A design on a hexagonal lattice through the program: written, read back, simulated and judged; and what does not know it.

use std::fs;
use std::path::PathBuf;

use metalith::compensate::compensate;
use metalith::optics::{CalibratedModel, Perturbation};
use metalith::optimise::{OptimiseTask, lens_alone};
use metalith::{Design, Fidelity, PillarArray, Silent, cell_models};
use metalith_testing::{design, golden};
use serde_json::Value;

use super::run::{assert_code, metalith, numbers, report};

/// The text of the shipped design with changes of it, in a folder.
fn changed(folder: &tempfile::TempDir, changes: &[(&str, &str)]) -> PathBuf {
    let path = folder.path().join("hexagonal.toml");
    fs::write(&path, metalith_testing::changed("hexagonal_1550", changes)).unwrap();
    path
}

#[test]
fn golden_numbers_of_the_hexagonal_design() {
    let folder = tempfile::tempdir().unwrap();
    let path = design("hexagonal_1550");
    let output = metalith(&["run", "--out"], &[folder.path(), &path]);
    assert_code(&output, 0);
    let run = report(folder.path());
    golden("hexagonal_1550.json", format!("{:#}\n", numbers(&run)).as_bytes());
    let html = fs::read_to_string(folder.path().join("report.html")).unwrap();
    assert!(html.contains("limits hold") && html.contains("on a hexagonal lattice of 700 nm"));

    // Either format, by itself, is what was simulated.
    let other = tempfile::tempdir().unwrap();
    let layout = folder.path().join("hexagonal_1550_pillars.gds");
    let oasis = other.path().join("pillars.oas");
    assert_eq!(metalith(&["convert"], &[&layout, &oasis]).status.code(), Some(0));
    let output = metalith(&["verify", "--out"], &[other.path(), &path, &oasis]);
    assert_code(&output, 0);
    assert_eq!(numbers(&report(other.path())), numbers(&run));

    // Without a design: the lattice is found, and the lens is as sharp.
    let args = [
        "psf",
        "--distance-um",
        "240",
        "--wavelength-nm",
        "1550",
        "--samples",
        "96",
        "--json",
        "--cell",
    ];
    let output = metalith(&args, &[&path, &layout]);
    assert_code(&output, 0);
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(found["elements"][0]["lattice"], "hexagonal");
    assert_eq!(found["elements"][0]["pillars"], found["pillars"]);
    let strehl = |numbers: &Value| {
        numbers["distinct"][0]["spots"][0]["extracted_strehl"][0][1]
            .as_f64()
            .unwrap()
    };
    let (here, there) = (found["psfs"][0]["strehl"].as_f64().unwrap(), strehl(&numbers(&run)));
    // Both sample the peak on the same lattice of samples; the rest is rounding to four digits.
    const FOUR_DIGITS: f64 = 1e-3;
    assert!((here / there - 1.0).abs() < FOUR_DIGITS, "{here} against {there}");
    let output = metalith(&["psf", "--fidelity", "published"], &[&layout]);
    assert_eq!(output.status.code(), Some(2));
}

/// Elements that are steered apart, a lens of its own among them, one of a polygon: a limit that does not hold fails the run.
#[test]
fn steered_elements_own_lenses_and_polygons_are_simulated() {
    let folder = tempfile::tempdir().unwrap();
    let elements = "\
[[element]]
x_um = -40
y_um = 0
steering_x_deg = 8

[[element]]
x_um = 40
y_um = 0
diameter_um = 40
focal_length_um = 60
aperture = \"regular\"
aperture_sides = 6
steering_y_deg = 5

[[element]]
x_um = 0
y_um = 70
aperture = \"rectangle\"
aperture_um = [40, 30]
rotation_deg = 20
";
    let path = changed(
        &folder,
        &[
            ("diameter_um = 160", "diameter_um = 50"),
            ("focal_length_um = 240", "focal_length_um = 75"),
            ("elements = [1, 1]\nspacing_um = 250\n", ""),
            ("[mapping]", &format!("{elements}\n[mapping]")),
        ],
    );
    let output = metalith(&["run", "--out"], &[folder.path(), &path]);
    assert_code(&output, 0);
    let found = report(folder.path());
    let distinct = found["verification"]["distinct"]
        .as_array()
        .or_else(|| found["distinct"].as_array())
        .unwrap();
    assert_eq!(distinct.len(), 3);
    for element in distinct {
        // Along the axis of the element's field a lens is perfect but for the cells, which blur it by a tenth or so.
        let spot = &element["spots"][0];
        let designed = spot["designed"]["strehl"].as_f64().unwrap();
        let extracted = spot["extracted"][0][1]["strehl"].as_f64().unwrap();
        assert!(designed > 0.98, "{designed}");
        assert!(extracted > 0.8 && extracted < designed, "{extracted}");
    }
    // A pillar that is wider than it was designed is found.
    let layout = folder.path().join("hexagonal_1550_pillars.gds");
    let mut text = fs::read_to_string(&path).unwrap();
    text = text.replacen("coefficients = [0.2363", "coefficients = [0.2263", 1);
    let other = folder.path().join("other.toml");
    fs::write(&other, text).unwrap();
    let output = metalith(&["verify", "--out"], &[folder.path(), &other, &layout]);
    assert_code(&output, 1);
}

/// What a process and a bench do to a chip costs a lens the same share of its Strehl ratio on either lattice.
#[test]
#[ignore = "second tier: CPU time, in scripts/slow_tests.sh"]
fn a_chip_as_made_loses_as_much_as_on_a_square_lattice() {
    /// Pillars of the two lattices differ in how they answer to a bias, and rims have other sites.
    const ALIKE: f64 = 0.015;
    /// What the effects are made to cost, together.
    const COSTS: f64 = 0.7;
    let folder = tempfile::tempdir().unwrap();
    let smaller = [
        ("diameter_um = 160", "diameter_um = 80"),
        ("focal_length_um = 240", "focal_length_um = 120"),
    ];
    // In [cell] and in [mapping.cell].
    let square = [
        smaller[0],
        smaller[1],
        ("lattice = \"hexagonal\"", "lattice = \"square\""),
        ("lattice = \"hexagonal\"", "lattice = \"square\""),
    ];
    let effects = [
        "wavefront_nm = [120.0, 0.0, 60.0]\ncd_bias_density_nm = 20.0",
        "stitching = [{ axis = 0, at_um = 5.0, by_nm = [180.0, 90.0] }, { axis = 1, at_um = -10.0, by_nm = [-60.0, 240.0] }]",
        "missing_pillars = 0.05\naperture_offset_um = [8.0, -5.0]",
    ];
    let paths = ["source_per_m = 150.0", "tilt_mrad = [40.0, 25.0]", "defocus_um = 5.0"];
    let strehl = |changes: &[(&str, &str)], geometry: &str, path: &str| {
        let design = changed(&folder, changes);
        let layout = folder.path().join("hexagonal_1550_pillars.gds");
        let output = metalith(&["layout", "--out"], &[folder.path(), &design]);
        assert_code(&output, 0);
        let model = folder.path().join("model.toml");
        let text = format!(
            "schema = 2\nset = \"made up\"\nfinding = \"made up\"\n[perturbation.geometry]\n{geometry}\n[perturbation.cell]\n\
             [perturbation.path]\n{path}\n[perturbation.light]\n[perturbation.camera]\n"
        );
        fs::write(&model, text).unwrap();
        let flags = ["verify", "--fast", "--out"];
        let output = metalith(&flags, &[folder.path(), &design, &layout, "--model".as_ref(), &model]);
        assert_code(&output, 0);
        numbers(&report(folder.path()))["distinct"][0]["spots"][0]["extracted_strehl"][0][1]
            .as_f64()
            .unwrap()
    };
    let plain = [&smaller[..], &square[..]].map(|lattice| strehl(lattice, "", ""));
    let mut all = 1.0;
    for (geometry, path) in effects.into_iter().zip(paths) {
        let [hexagonal, square] = [(&smaller[..], plain[0]), (&square[..], plain[1])]
            .map(|(lattice, plain)| strehl(lattice, geometry, path) / plain);
        println!("{geometry}; {path}: {hexagonal:.4}, {square:.4}");
        assert!(
            (hexagonal - square).abs() < ALIKE,
            "{geometry}; {path}: {hexagonal}, {square}"
        );
        all *= hexagonal;
    }
    assert!(all < COSTS, "{all}");
}

/// A cell that is made of square lattices is refused where it is asked for, before anything is written; left out, the best of
/// the others judges.
#[test]
fn unlike_neighbours_are_refused_before_a_layout_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let asked = changed(&folder, &[("fidelity = \"rigorous\"", "fidelity = \"neighbours\"")]);
    let line = 1 + fs::read_to_string(&asked)
        .unwrap()
        .lines()
        .position(|l| l.starts_with("fidelity"))
        .unwrap();
    let out = folder.path().join("out");
    let run = |path: &std::path::Path, flags: &[&str]| {
        let output = metalith(&[&["run"], flags, &["--out"]].concat(), &[out.as_path(), path]);
        (
            output.status.code(),
            String::from_utf8_lossy(&output.stderr).into_owned(),
        )
    };
    let (code, said) = run(&asked, &[]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains(&format!("hexagonal.toml:{line}:")), "{said}");
    let (code, said) = run(&design("hexagonal_1550"), &["--fidelity", "neighbours"]);
    assert_eq!(code, Some(2), "{said}");
    assert!(
        said.contains(&super::refusal("cell/fidelity-not-for-pillars")) && !out.exists(),
        "{said}"
    );
    let silent = changed(&folder, &[("fidelity = \"rigorous\"", "")]);
    assert_eq!(Design::read(&silent).unwrap().verify.fidelity, Fidelity::Rigorous);
}

/// A picture behind the camera for its band: most of the light is in the image. Where it lands is tested in the crate of pictures.
#[test]
fn a_hexagonal_lens_takes_a_picture() {
    /// Share of the light that passes the lens in the windows of the kernels; 0.996 at full size.
    const IN_IMAGE: f64 = 0.95;
    let folder = tempfile::tempdir().unwrap();
    let path = changed(&folder, &[("diameter_um = 160", "diameter_um = 100")]);
    let out = folder.path().join("out");
    assert_eq!(metalith(&["layout", "--out"], &[&out, &path]).status.code(), Some(0));
    let layout = out.join("hexagonal_1550_pillars.gds");
    let camera = metalith_testing::root().join("cameras/swir.toml");
    let output = metalith(
        &[
            "picture",
            "--field-deg",
            "30",
            "--pixels",
            "64",
            "--no-forecast",
            "--out",
        ],
        &[
            &out,
            &layout,
            "star".as_ref(),
            "--design".as_ref(),
            &path,
            "--camera".as_ref(),
            &camera,
        ],
    );
    assert_code(&output, 0);
    let listed = String::from_utf8_lossy(&output.stdout);
    for file in ["picture.html", "frame.png", "restored_tikhonov.png"] {
        assert!(out.join(file).is_file() && listed.contains(file), "{file}: {listed}");
    }
    let found: Value = serde_json::from_str(&fs::read_to_string(out.join("picture.json")).unwrap()).unwrap();
    // Pixels of the scene are finer than half of those of the sensor.
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("64 x 64") && said.contains("51 x 51"), "{said}");
    assert_eq!(
        found["points"].as_array().unwrap().len(),
        found["budget"].as_array().unwrap().len()
    );
    let shares = &found["budget"][0]["shares"];
    let light = |key: &str| shares[key].as_f64().unwrap();
    let in_image = light("in_kernels") / (light("arrives") - light("not_passed"));
    assert!(in_image > IN_IMAGE, "{shares}");
}

/// Widths that are drawn for what a line does to them: a bias of whole steps is drawn the other way, and what follows density is
/// followed, here of circles, which fill less than their squares.
#[test]
#[ignore = "second tier: CPU time, in scripts/slow_tests.sh"]
fn a_hexagonal_layout_is_compensated() {
    /// Relative error: rounding of tables of some hundred widths.
    const ROUNDING: f64 = 1e-9;
    /// A relative change that nobody would call rounding.
    const FELT: f64 = 0.05;
    /// Steps of 2 nm leave a part of a bias that differs from site to site.
    const FOLLOWED: f64 = 0.6;
    let folder = tempfile::tempdir().unwrap();
    let path = changed(
        &folder,
        &[
            ("diameter_um = 160", "diameter_um = 40"),
            ("focal_length_um = 240", "focal_length_um = 60"),
            ("width_min_nm = 150", "width_min_nm = 130"),
        ],
    );
    let design = Design::read(&path).unwrap();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let summary = |change: &dyn Fn(&mut Perturbation)| {
        let mut perturbation = Perturbation::default();
        change(&mut perturbation);
        let model = CalibratedModel::new("twin".into(), "as made".into(), perturbation);
        compensate(&design, &array, &model, &Silent).unwrap().summary
    };
    let wide = summary(&|d| d.geometry.cd_bias_nm = 8.0);
    let [before, after] = wide.error;
    assert!(before > FELT && after < ROUNDING, "{before} {after}");
    assert!((wide.moved_rms_nm - 8.0).abs() < ROUNDING, "{}", wide.moved_rms_nm);
    let [before, after] = summary(&|d| d.geometry.cd_bias_density_nm = 80.0).error;
    assert!(before > FELT && after < FOLLOWED * before, "{before} {after}");
}

/// Draws of a study are simulated on the lattice of the design.
#[test]
fn a_hexagonal_design_is_studied() {
    let folder = tempfile::tempdir().unwrap();
    let path = changed(
        &folder,
        &[
            ("diameter_um = 160", "diameter_um = 30"),
            ("focal_length_um = 240", "focal_length_um = 45"),
            (
                "field_x_deg = [0, 10]\nfield_y_deg = [0, 0]",
                "field_x_deg = [0]\nfield_y_deg = [0]",
            ),
        ],
    );
    let study = folder.path().join("tolerance.toml");
    let text = format!(
        "schema = 1\ndesign = {path:?}\ndraws = 2\n[[vary]]\neffect = \"defocus\"\ndistribution = \"uniform\"\nlow = -2.0\nhigh = 2.0\n\
         [[limit]]\nfigure = \"strehl_1550nm_0deg\"\nat_least = 0.5\n"
    );
    fs::write(&study, text).unwrap();
    let plan = folder.path().join("plan");
    for (command, last) in [("plan", &study), ("run", &plan)] {
        let mut arguments: Vec<&std::path::Path> = vec![command.as_ref(), last];
        match command {
            "plan" => arguments.extend(["--out".as_ref(), plan.as_path()]),
            _ => arguments.push("--missing".as_ref()),
        }
        let output = metalith(&["study"], &arguments);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{command}: {said}");
    }
}

/// The optimised phase of the program becomes a layout that is as good as its rings, and published polynomials are refused.
#[test]
fn a_hexagonal_lens_is_optimised() {
    /// Single sums in another order.
    const SAME: f64 = 1e-9;
    let folder = tempfile::tempdir().unwrap();
    let how = |cell: &str| {
        let section = format!(
            "[optimise]\ncell = {cell:?}\nband_nm = [1510, 1590]\nstep_nm = 10\nchains = 1\nhot_sweeps = 5\n\n[verify.limits]"
        );
        changed(
            &folder,
            &[
                ("diameter_um = 160", "diameter_um = 60"),
                ("focal_length_um = 240", "focal_length_um = 90"),
                ("[verify.limits]", &section),
            ],
        )
    };
    let phase = folder.path().join("phase.csv");
    let asked = |path: &std::path::Path| {
        let flags: [&std::path::Path; 5] = [
            "--no-report".as_ref(),
            "--phase".as_ref(),
            &phase,
            "--out".as_ref(),
            folder.path(),
        ];
        metalith(&["optimise"], &[&[path], &flags[..]].concat())
    };
    let refused = asked(&how("published"));
    assert_eq!(refused.status.code(), Some(2));
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(said.contains("error[cell/fidelity-not-for-pillars]"), "{said}");
    let path = how("fitted");
    let output = asked(&path);
    assert_code(&output, 0);

    let design = Design::read(&path).unwrap();
    let alone = lens_alone(&design, &phase).unwrap();
    let (task, before) = (OptimiseTask::of(&alone).unwrap(), OptimiseTask::of(&design).unwrap());
    let cell = cell_models(&design, &[Fidelity::Fitted]).unwrap().remove(0);
    let rings = task.judge_rings(&task.own_waves, cell.as_ref()).unwrap();
    let array = PillarArray::build(&alone, &Silent).unwrap();
    let found = task
        .judge_layout(&array.widths(array.central()), cell.as_ref())
        .unwrap();
    assert!((found.geometric_mean / rings.geometric_mean - 1.0).abs() < SAME);
    let hyperbola = before.judge_rings(&before.own_waves, cell.as_ref()).unwrap();
    assert!(
        rings.geometric_mean > hyperbola.geometric_mean,
        "{} {}",
        rings.geometric_mean,
        hyperbola.geometric_mean
    );
}
