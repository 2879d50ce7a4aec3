//! Effects outside the list: declared by an expression, or proposed and adopted.

use std::fs;

use metalith_calibrate::{
    DeclaredEffect, Evidence, MeasuredSet, Session, Settings, Synthesizer, UnlistedEffect, propose,
};
use metalith_core::Silent;
use metalith_gds::extract::PillarsAt;
use metalith_optics::CalibratedModel;
use metalith_testing::session::set_of_three;

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
        ..with_effects(&["bow", "defocus", "cd_bias"])
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

/// The effects that are proposed for what a session leaves.
fn proposed(session: &Session<'_>, evidence: &Evidence) -> Vec<DeclaredEffect> {
    let proposed = propose(session, evidence, &Silent).unwrap();
    proposed.into_iter().map(|p| p.effect).collect()
}

/// A second image of 4 % whose spots are blurred by 0.5 um, as a lens behind the relay makes one.
const BLURRED_GHOST: &str = include_str!("../../../../golden/ghost.toml");

/// Residuals lead to the effect that the list lacks: proposed, adopted, and it explains the set. One proposal of a
/// second image serves sharp and blurred ones.
#[test]
fn an_effect_outside_the_list_is_proposed_and_adopted() {
    /// Reduced chi-square per pixel that may be left on measurements left out: the aim, and what the coarse spectrum of these
    /// tests leaves.
    const EXPLAINED: f64 = 1.1 + 0.1;
    /// Relative: synthetic sets have another sampling.
    const TOLERANCE: f64 = 0.1;
    let tried = ["defocus", "cd_bias"];
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
        assert!(before.verdict.leaves_a_residual(), "{}", before.sentence());
        let proposed = proposed(&session, &evidence.unwrap());
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

/// With the tilt of the sensor and a bias that rises over the chip out of the list: the free values by element lead to
/// both, and they are adopted with their slopes.
#[test]
#[ignore = "second tier: CPU time, in scripts/slow_tests.sh"]
fn what_is_linear_in_the_place_of_the_element_is_proposed_and_adopted() {
    /// Reduced chi-square per pixel that may be left on measurements left out, as above.
    const EXPLAINED: f64 = 1.1 + 0.1;
    /// Relative to the steeper slope: synthetic sets have another sampling.
    const TOLERANCE: f64 = 0.05;
    let folder = tempfile::tempdir().unwrap();
    set_of_three(folder.path());
    let like = MeasuredSet::read(folder.path(), &PillarsAt::STATED, &Silent).unwrap();
    // A tilt in mrad is um per mm; the bias rises from (75, 75) um on.
    let file = folder.path().join("bias.toml");
    fs::write(
        &file,
        "[[effect]]\nname = \"rising\"\nunit = \"nm\"\nrange = [-1.0, 1.0]\nprior = 0.05\n\
         stage = \"width\"\nwidth_nm = \"a * (X - 75) - 0.5 * a * (Y - 75)\"\n",
    )
    .unwrap();
    let declaring = Settings {
        declared: DeclaredEffect::read(&file).unwrap(),
        ..settings()
    };
    let synthesizer = Synthesizer::new(&like, &declaring).unwrap();
    for (name, truth, proposal, slopes) in [
        ("sensor_tilt", vec![60.0, -35.0], "defocus_gradient", [60.0, -35.0]),
        ("rising", vec![0.08], "cd_bias_gradient", [80.0, -40.0]),
    ] {
        let images = synthesizer.with_effect(name, &truth, &Silent).unwrap();
        let set = synthesizer.draw(&images, 33);
        let session = Session::new(&set, with_effects(&["defocus", "cd_bias"])).unwrap();
        let (before, evidence) = session.diagnose(&session.simulate(&Silent).unwrap(), &Silent).unwrap();
        assert!(before.verdict.leaves_a_residual(), "{}", before.sentence());
        let trend = before.patterns[0].linear_trend.as_ref().unwrap();
        assert!(
            trend.is_linear && trend.degrees_of_freedom == 0 && trend.remark.is_some(),
            "{trend:?}"
        );
        let effects = proposed(&session, &evidence.unwrap());
        assert!(effects.iter().any(|e| e.name == proposal), "{effects:?}");
        // It is in the form of the files that a person writes.
        fs::write(&file, DeclaredEffect::text(&effects)).unwrap();
        assert_eq!(DeclaredEffect::read(&file).unwrap(), effects);
        let wider = session.adopting(effects).unwrap();
        let (after, _) = wider.diagnose(&wider.simulate(&Silent).unwrap(), &Silent).unwrap();
        assert_eq!(names(&after), [proposal], "{} {:?}", after.sentence(), after.error);
        assert!(after.error.after.held_out < EXPLAINED, "{:?}", after.error);
        let found: Vec<f64> = serde_json::from_value(after.effects[0].value.clone()).unwrap();
        for (found, slope) in found.iter().zip(slopes) {
            assert!((found - slope).abs() < TOLERANCE * slopes[0], "{}", after.sentence());
        }
    }
}
