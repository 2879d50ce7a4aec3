//! Real measurements of other people, where the folder of shared data is there.

use std::path::{Path, PathBuf};

use metalith_core::Silent;
use metalith_metrology::{Diagnosis, SetKind, calibrate, kind_of};

/// Folder of real measurements: beside the project, or as `METALITH_SHARED` says. None where it is not there.
fn real(name: &str) -> Option<PathBuf> {
    let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../..");
    let shared = std::env::var_os("METALITH_SHARED").map_or(project.join("shared"), PathBuf::from);
    let folder = shared.join("real").join(name);
    folder.is_dir().then_some(folder)
}

fn diagnosis(name: &str, kind: SetKind) -> Option<Diagnosis> {
    let Some(folder) = real(name) else {
        eprintln!("skipped: there is no folder of real measurements");
        return None;
    };
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../examples/measured/{name}.toml"));
    let text = std::fs::read_to_string(example).unwrap();
    let schema = format!("schema = 1\nfolder = '{}'", folder.canonicalize().unwrap().display());
    let out = tempfile::tempdir().unwrap();
    let set = out.path().join("measurement.toml");
    std::fs::write(&set, text.replace("schema = 1", &schema)).unwrap();
    assert_eq!(kind_of(&set), Some(kind));
    let answer = calibrate(&set, kind, out.path(), (&[], None), &Silent)
        .unwrap()
        .diagnosis;
    println!("{}", answer.sentence());
    for step in &answer.ladder {
        println!(
            "{:?} fit {:.4} {:?} {:?} {:?} {:?}",
            step.effect, step.fit, step.held_out, step.fitted_figures, step.not_fitted_figures, step.rejected
        );
    }
    for proposal in &answer.proposals {
        println!("{}", proposal.sentence());
    }
    Some(answer)
}

#[test]
#[ignore = "second tier: two minutes of CPU time, in scripts/slow_tests.sh"]
fn relief() {
    let Some(answer) = diagnosis("relief", SetKind::Heights) else {
        return;
    };
    let effect = |name: &str| answer.effects.iter().find(|e| e.name == name);
    for name in ["gain", "level", "blur", "level_by_plate"] {
        assert!(effect(name).is_some(), "{name}");
    }
    assert_eq!(effect("level_by_plate").unwrap().of, "plate");
    // An independent fit found 0.043 for the far field of the plate that was not fitted; 0.388 as drawn.
    let taken = answer.ladder.iter().rfind(|step| step.rejected.is_none()).unwrap();
    assert!(taken.not_fitted_figures[2].1 < 0.042, "{taken:?}");
    let cubic = answer.ranking.iter().find(|t| t.name == "dose_curve").unwrap();
    assert!(
        cubic
            .rejected
            .as_ref()
            .is_some_and(|r| r.starts_with("fits better and predicts worse"))
    );
}

#[test]
fn spectra() {
    let Some(answer) = diagnosis("spectra", SetKind::Spectra) else {
        return;
    };
    let aperture = answer.effects.iter().find(|e| e.name == "numerical_aperture").unwrap();
    let ends: Vec<f64> = serde_json::from_value(aperture.interval.clone()).unwrap();
    // An independent fit found 0.891, and 0.0135 with five effects on the heights that were not fitted.
    assert!(ends[0] < 0.891 && 0.891 < ends[1] && ends[0] > 0.7, "{ends:?}");
    let taken = answer.ladder.iter().rfind(|step| step.rejected.is_none()).unwrap();
    assert!(taken.not_fitted_figures[0].1 < 0.0120, "{taken:?}");
    let offset = answer.ranking.iter().find(|t| t.name == "height_offset").unwrap();
    assert!(
        offset
            .rejected
            .as_ref()
            .is_some_and(|r| r.starts_with("fits better and predicts worse"))
    );
}
