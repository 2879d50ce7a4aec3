//! Tests of what a validation counts, and of names that it does not know.

use metalith_calibrate::{Session, Settings, ValidationPlan, calibrate, validate};
use metalith_core::Silent;
use metalith_gds::extract::PillarsAt;

use crate::set::{FOLDERS, LIKE, settings};

#[test]
fn a_validation_counts_claims() {
    let plan = ValidationPlan {
        nulls: 3,
        threshold_nulls: 1,
        effects: vec!["defocus".into()],
        off_list: false,
        ..ValidationPlan::default()
    };
    let validation = validate(&LIKE, &settings(), &plan, &Silent).unwrap();
    assert_eq!(
        (validation.nulls, validation.false_claims, validation.trials.len()),
        (3, 0, 6)
    );
    assert_eq!(validation.limits.len(), 1);
    assert!(
        validation.limits[0].named_from.is_some_and(|s| s <= 1.0),
        "{}",
        validation.text()
    );
    assert!(validation.largest_gain_by_chance < validation.least_gain);
}

#[test]
fn unknown_effects_are_refused_all_at_once() {
    let wrong = ["cd_bais", "defocus", "wavefront"].map(String::from).to_vec();
    let settings = Settings {
        only: wrong.clone(),
        ..settings()
    };
    let by_session = Session::new(&LIKE, settings.clone()).err().unwrap();
    let plan = ValidationPlan {
        effects: wrong,
        ..ValidationPlan::default()
    };
    let outs = [FOLDERS[0].join("out")];
    let by_run = calibrate(&FOLDERS[..1], &outs, &settings, &PillarsAt::STATED, &Silent)
        .err()
        .unwrap();
    let by_validation = validate(&LIKE, &self::settings(), &plan, &Silent).err().unwrap();
    // A validation knows the effects that are tried; a session all of them.
    for (error, known) in [
        (by_session, "led_centre_500"),
        (by_run, "led_centre_500"),
        (by_validation, "pixel_blur"),
    ] {
        assert_eq!(error.exit_code(), 2);
        let text = error.to_string();
        for part in ["`cd_bais` (did you mean `cd_bias`?)", "`wavefront`", known] {
            assert!(text.contains(part), "{part} is not in:\n{text}");
        }
        assert!(!text.contains("`defocus`"), "{text}");
    }
    assert!(!outs[0].exists());
}
