//! Planned sessions: what is planned for is found in what comes back, read as it was written. They simulate whole sessions,
//! so they are of the second tier.

use std::fs;
use std::path::{Path, PathBuf};

use metalith_bench_plan::{BenchFile, MeasurementPlan, PlanRequest, plan};
use metalith_calibrate::{BenchSampling, MeasuredSet, Session, Settings, Synthesizer};
use metalith_core::Silent;
use metalith_design::{Design, PillarArray};
use metalith_gds::extract::PillarsAt;
use metalith_layout::write_pillars;
use metalith_testing::session::{self, PIXELS, write_npy};
use ndarray::Array2;

/// The bench of the small session, with what may be taken and what is wanted.
fn small_bench() -> String {
    let bench = session::bench();
    format!(
        r"schema = 1

{bench}
[captures]
elements = [0, 0, 1, 0]
distance_um = [139.0, 144.0, 149.0]
frames = [16, 64]

[sem]
sites = 24
sigma_nm = 1.5
edge_offset_nm = 1.0

[wanted]
defocus = 2.0
cd_bias = 6.0
"
    )
}

/// Plan a session for a design.
fn planned(folder: &Path, design: &Design, bench: &str, only: &[&str]) -> MeasurementPlan {
    let array = PillarArray::build(design, &Silent).unwrap();
    let layout = folder.join("layout.gds");
    write_pillars(design, &array, design.layout.hierarchy, &layout, &Silent).unwrap();
    let file = folder.join("bench.toml");
    fs::write(&file, bench).unwrap();
    let request = PlanRequest {
        design,
        bench: &BenchFile::read(&file).unwrap(),
        layout: &layout,
        layout_in_set: "layout.gds".into(),
        folder,
        into: folder,
        only: only.iter().map(|n| (*n).into()).collect(),
        cache: None,
    };
    plan(&request, &PillarsAt::STATED, &Silent).unwrap()
}

fn mini() -> Design {
    Design::read(&metalith_testing::root().join("designs/mini_3x3.toml")).unwrap()
}

/// Fill the folder with frames; dark ones where none are given.
fn fill(folder: &Path, plan: &MeasurementPlan, set: Option<&MeasuredSet>) {
    std::fs::create_dir_all(folder.join("captures")).unwrap();
    for (k, measurement) in plan.measurements.iter().enumerate() {
        let dark = Array2::from_elem((PIXELS, PIXELS), 40.0);
        let frame = set.map_or(dark, |set| set.measurements.raw[k].dn.clone());
        write_npy(&folder.join(&measurement.file), &frame);
    }
}

fn read(folder: &Path) -> MeasuredSet {
    MeasuredSet::read(folder, &PillarsAt::STATED, &Silent).unwrap()
}

fn settings(cache: PathBuf, only: &[&str]) -> Settings {
    Settings {
        sampling: BenchSampling {
            spectrum: 0.34,
            ..BenchSampling::default()
        },
        cache: Some(cache),
        only: only.iter().map(|n| (*n).into()).collect(),
        compare_fidelities: false,
        ..Settings::default()
    }
}

/// Effects on the chip of a session come back in its measurements, and are found with their sizes.
fn each_is_found(folder: &Path, plan: &MeasurementPlan, like: &MeasuredSet, settings: &Settings) {
    let synthesizer = Synthesizer::new(like, settings).unwrap();
    for (name, size) in [("cd_bias", 6.0), ("defocus", 2.0)] {
        let images = synthesizer.with_effect(name, &[size], &Silent).unwrap();
        fill(folder, plan, Some(&synthesizer.draw(&images, 41)));
        let came_back = read(folder);
        let session = Session::new(&came_back, settings.clone()).unwrap();
        let found = session
            .diagnose(&session.simulate(&Silent).unwrap(), &Silent)
            .unwrap()
            .0;
        let names: Vec<&str> = found.effects.iter().map(|e| e.name.as_str()).collect();
        assert_eq!(names, [name], "{}", found.sentence());
        assert_eq!(found.effects[0].holds(size), Some(true), "{}", found.sentence());
    }
}

#[test]
#[ignore = "second tier: CPU time, run by .ci/run"]
fn what_is_planned_for_is_found_in_what_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let tried = ["cd_bias", "defocus", "pixel_blur"];
    let plan = planned(folder.path(), &mini(), &small_bench(), &tried);
    assert!(plan.finds_all(), "{}", plan.sentence());
    assert!(
        plan.measurements.len() >= 4 && plan.measurements.len() < plan.candidates / 2,
        "{}",
        plan.sentence()
    );
    assert_eq!(plan.confusions.len(), 0, "{:?}", plan.confusions);
    let page = fs::read_to_string(&plan.page).unwrap();
    assert!(plan.measurements.iter().all(|c| page.contains(&c.file)));
    // The brightest pixel is where the bench asked for it: three digits of the exposure.
    for c in &plan.measurements {
        assert!(
            (c.brightest_dn / (0.7 * 4095.0) - 1.0).abs() < 0.01,
            "{}",
            c.brightest_dn
        );
    }

    fill(folder.path(), &plan, None);
    let like = read(folder.path());
    assert!(like.sem.is_empty(), "no width has been measured yet");
    each_is_found(
        folder.path(),
        &plan,
        &like,
        &settings(folder.path().join("cells"), &tried),
    );
}

/// One distance in focus cannot distinguish a defocus from a source that is near; three distances do.
#[test]
#[ignore = "second tier: CPU time, in scripts/slow_tests.sh"]
fn what_measurements_cannot_split_is_named_with_what_can() {
    let folder = tempfile::tempdir().unwrap();
    let bench = small_bench()
        .replace("[139.0, 144.0, 149.0]", "[144.0]")
        .replace("elements = [0, 0, 1, 0]", "elements = [0, 0]")
        .replace("defocus = 2.0", "defocus = 0.06");
    let plan = planned(
        folder.path(),
        &mini(),
        &bench,
        &["defocus", "source_distance", "cd_bias", "corner_rounding"],
    );
    let pair = plan.confusions.iter().find(|c| {
        let both = [c.effect.as_str(), c.looks_like.as_str()];
        both.contains(&"defocus") && both.contains(&"source_distance")
    });
    let pair = pair.unwrap_or_else(|| panic!("{:#?} {:#?}", plan.confusions, plan.effects));
    assert!(pair.gain < pair.needed && !pair.measurements_could);
    assert!(pair.separate_by.is_some() && !pair.sem_decides);
}

/// The plan says the lattice, the set is read on it, and what was done to the chip is found.
#[test]
#[ignore = "second tier: CPU time, run by .ci/run"]
fn a_session_of_a_hexagonal_lens_is_planned_and_diagnosed() {
    let path = metalith_testing::design("hexagonal_1550");
    let text = fs::read_to_string(&path).unwrap();
    let small = text
        .replace("diameter_um = 160", "diameter_um = 30")
        .replace("focal_length_um = 240", "focal_length_um = 45");
    let design = Design::parse(&path, &small).unwrap();
    let bench = small_bench()
        .replace("[[led]]\ncentre_nm = 560\nfwhm_nm = 6.0\n", "")
        .replace("centre_nm = 500", "centre_nm = 1550")
        .replace("elements = [0, 0, 1, 0]", "elements = [0, 0]")
        .replace("[139.0, 144.0, 149.0]", "[39.0, 45.0, 51.0]");
    let folder = tempfile::tempdir().unwrap();
    let tried = ["cd_bias", "defocus"];
    let plan = planned(folder.path(), &design, &bench, &tried);
    assert!(plan.finds_all(), "{}", plan.sentence());
    let said = fs::read_to_string(folder.path().join("measurement.toml")).unwrap();
    assert!(said.contains("shape = \"circle\"\nlattice = \"hexagonal\"\n"), "{said}");
    // Widths to measure are those of pillars, which stand on every other place.
    let sem = fs::read_to_string(folder.path().join("cd_sem.csv")).unwrap();
    assert_eq!(sem.lines().filter(|l| l.starts_with("0,0,")).count(), 24, "{sem}");
    for wrong in [
        "lattice = \"hexagonal\"\nshape = \"square\"",
        "lattice = \"rhombic\"\nshape = \"circle\"",
    ] {
        let other = said.replace("shape = \"circle\"\nlattice = \"hexagonal\"", wrong);
        fs::write(folder.path().join("measurement.toml"), other).unwrap();
        let error = MeasuredSet::read(folder.path(), &PillarsAt::STATED, &Silent)
            .unwrap_err()
            .to_string();
        assert!(error.contains("lattice"), "{error}");
    }
    fs::write(folder.path().join("measurement.toml"), said).unwrap();

    fill(folder.path(), &plan, None);
    let like = read(folder.path());
    let array = PillarArray::build(&design, &Silent).unwrap();
    assert_eq!(like.elements.raw[0].pillars, *array.widths(array.central()));
    each_is_found(
        folder.path(),
        &plan,
        &like,
        &settings(folder.path().join("cells"), &tried),
    );
}
