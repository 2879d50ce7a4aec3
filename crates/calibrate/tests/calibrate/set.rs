//! The small set that all tests are of, with effects or without.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use metalith_calibrate::{BenchSampling, Diagnosis, MeasuredSet, Session, Settings, Simulations, Synthesizer};
use metalith_core::Silent;
use metalith_gds::extract::PillarsAt;
use metalith_testing::session::small_set;

/// The small set on disk, and a folder for tables of cells: every test would solve the same ones. Both are emptied
/// by the first test that needs them, so that no run depends on another.
pub(crate) static FOLDERS: LazyLock<[PathBuf; 2]> = LazyLock::new(|| {
    ["small-set", "cells"].map(|name| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("calibrate").join(name);
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        folder
    })
});

pub(crate) static LIKE: LazyLock<MeasuredSet> = LazyLock::new(|| {
    let [folder, _] = &*FOLDERS;
    small_set(folder);
    MeasuredSet::read(folder, &PillarsAt::STATED, &Silent).unwrap()
});

/// Simulations with some of the effects whose cells need not be solved again.
pub(crate) static SIMULATIONS: LazyLock<Simulations> =
    LazyLock::new(|| Session::new(&LIKE, settings()).unwrap().simulate(&Silent).unwrap());

pub(crate) static SYNTHESIZER: LazyLock<Synthesizer<'static>> =
    LazyLock::new(|| Synthesizer::new(&LIKE, &settings()).unwrap());

pub(crate) fn settings() -> Settings {
    with_effects(&["cd_bias", "defocus", "tilt", "led_width", "zero_order", "pixel_blur"])
}

pub(crate) fn with_effects(names: &[&str]) -> Settings {
    Settings {
        sampling: BenchSampling {
            spectrum: 0.34,
            ..BenchSampling::default()
        },
        cache: Some(FOLDERS[1].clone()),
        only: names.iter().map(|n| (*n).into()).collect(),
        compare_fidelities: false,
        refine: true,
        ..Settings::default()
    }
}

/// A set like the small one with some effects.
pub(crate) fn synthetic(parts: &[(&str, &[f64])], seed: u64) -> MeasuredSet {
    let images = SYNTHESIZER.with_effects(&[parts.to_vec()], &Silent).unwrap().remove(0);
    SYNTHESIZER.draw(&images, seed)
}

/// Diagnosis of a session whose frames this test simulates.
pub(crate) fn diagnosis_of(session: &Session<'_>) -> Diagnosis {
    session
        .diagnose(&session.simulate(&Silent).unwrap(), &Silent)
        .unwrap()
        .0
}

/// The names of what was found, in order of the alphabet.
pub(crate) fn names(d: &Diagnosis) -> Vec<&str> {
    let mut found: Vec<&str> = d.effects.iter().map(|e| e.name.as_str()).collect();
    found.sort_unstable();
    found
}
