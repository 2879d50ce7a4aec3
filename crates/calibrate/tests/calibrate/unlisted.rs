//! Effects outside the list: declared by an expression, or proposed and adopted.

use std::fs;

use metalith_calibrate::{DeclaredEffect, Session, SetVerdict, Settings, Synthesizer, UnlistedEffect, propose};
use metalith_core::Silent;
use metalith_made::CalibratedModel;

use crate::set::{FOLDERS, LIKE, SYNTHESIZER, names, settings, with_effects};

/// An effect that is in no list, declared by an expression: found, with its value, and written into the model.
#[test]
fn a_declared_effect_is_found_and_kept_in_the_model() {
    const BOW_NM: f64 = 60.0;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("effects.toml");
    fs::write(
        &file,
        "[[effect]]\nname = \"bow\"\nunit = \"nm\"\nrange = [-300.0, 300.0]\nprior = 30.0\n\
         stage = \"pupil\"\nopd_nm = \"a * (x^2 - y^2) / R^2\"\n",
    )
    .unwrap();
    let settings = Settings {
        declared: DeclaredEffect::read(&file).unwrap(),
        ..with_effects(&["bow", "gap", "cd_bias"])
    };
    let synthesizer = Synthesizer::new(&LIKE, &settings).unwrap();
    let images = synthesizer.with_effect("bow", &[BOW_NM], &Silent).unwrap();
    let set = synthesizer.draw(&images, 25);
    let session = Session::new(&set, settings).unwrap();
    let simulations = session.simulate(&Silent).unwrap();
    let (d, evidence) = session.diagnose(&simulations, &Silent).unwrap();
    assert_eq!(names(&d), ["bow"], "{}", d.sentence());
    assert_eq!(d.effects[0].holds(BOW_NM), Some(true), "{}", d.sentence());
    let made = session.simulator.perturbation(&evidence.unwrap().finding.after.theta);
    let path = folder.path().join("model.toml");
    CalibratedModel::new("set".into(), d.sentence(), made.clone())
        .write(&path)
        .unwrap();
    assert_eq!(CalibratedModel::read(&path).unwrap().perturbation, made);
    assert!((made.geometry.declared[0].values["a"] / BOW_NM - 1.0).abs() < 0.1);
}

/// A second image of 4 % whose spots are blurred by 0.5 um, as a lens behind the relay makes one.
const BLURRED_GHOST: &str = include_str!("../../../../golden/ghost.toml");

/// What is left leads to the effect that the list lacks: proposed, adopted, and it explains the set. One proposal of a second
/// image serves sharp and blurred ones.
#[test]
fn an_effect_outside_the_list_is_proposed_and_adopted() {
    /// Reduced chi-square per pixel that may be left on captures left out: the aim, and what the coarse spectrum of these
    /// tests leaves.
    const EXPLAINED: f64 = 1.1 + 0.1;
    /// Relative: synthetic sets have another sampling.
    const TOLERANCE: f64 = 0.1;
    let tried = ["gap", "cd_bias"];
    let file = FOLDERS[0].join("ghost.toml");
    fs::write(&file, BLURRED_GHOST).unwrap();
    let declaring = Settings {
        declared: DeclaredEffect::read(&file).unwrap(),
        ..settings()
    };
    let off_list = |what| SYNTHESIZER.off_list(what, &Silent).unwrap();
    // The file starts from a place of (5, -3) um.
    let blurred = Synthesizer::new(&LIKE, &declaring)
        .and_then(|s| s.with_effect("ghost", &[0.04, 0.5, -0.5], &Silent))
        .unwrap();
    for (images, name, expected) in [
        (blurred, "ghost", vec![0.04, 5.5, -3.5, 0.5 * 0.5]),
        (
            off_list(UnlistedEffect::Ghost(0.1, [4.0, -3.0])),
            "ghost",
            vec![0.1, 4.0, -3.0],
        ),
        (
            off_list(UnlistedEffect::Astigmatism(25.0)),
            "wavefront_path",
            vec![25.0],
        ),
    ] {
        let set = SYNTHESIZER.draw(&images, 27);
        let session = Session::new(&set, with_effects(&tried)).unwrap();
        let (before, evidence) = session.diagnose(&session.simulate(&Silent).unwrap(), &Silent).unwrap();
        assert!(
            matches!(before.verdict, SetVerdict::Unexplained | SetVerdict::Partly),
            "{}",
            before.sentence()
        );
        let proposed = propose(&session, &evidence.unwrap());
        let copies = proposed.iter().filter(|e| e.name == "ghost").count();
        assert!(proposed.iter().any(|e| e.name == name) && copies <= 1, "{proposed:?}");
        let wider = session.adopting(proposed).unwrap();
        let (after, _) = wider.diagnose(&wider.simulate(&Silent).unwrap(), &Silent).unwrap();
        assert_eq!(names(&after), [name], "{} {:?}", after.sentence(), after.error);
        assert!(after.error.after.held_out < EXPLAINED, "{:?}", after.error);
        let values = &after.effects[0].value;
        let values: Vec<f64> = match values.as_array() {
            Some(all) => all.iter().map(|v| v.as_f64().unwrap()).collect(),
            None => vec![values.as_f64().unwrap()],
        };
        for truth in expected {
            let is_found = values.iter().any(|found| (found / truth - 1.0).abs() < TOLERANCE);
            assert!(is_found, "{}", after.sentence());
        }
    }
}
