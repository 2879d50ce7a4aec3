//! Frames with mistakes of a camera or of the lab: each is named, and masked, left out or refused.

use std::fs;

use metalith_calibrate::{Diagnosis, MeasuredSet, MeasurementIndex, Session};
use metalith_core::{Result, Silent};
use metalith_gds::extract::PillarsAt;
use metalith_sensor::frame::Orientation;
use metalith_testing::session::{PIXELS, small_set, write_npy};
use ndarray::Array2;

use crate::set::{SIMULATIONS, names, settings, synthetic};

/// Nanometres added to every width of the chip.
const BIAS_NM: f64 = -8.0;

fn diagnosed(set: &MeasuredSet) -> Result<Diagnosis> {
    let session = Session::new(set, settings())?;
    Ok(session.diagnose(&SIMULATIONS, &Silent)?.0)
}

/// The bias of a set that has no other effect, as it is without its mistake.
fn is_the_bias(found: &Diagnosis, sound: &Diagnosis) {
    /// Share of the interval that masked pixels may move a value by: they are some of many.
    const MOVED: f64 = 0.2;
    assert_eq!(names(found), ["cd_bias"], "{} {:?}", found.sentence(), found.error);
    assert_eq!(found.verdict, sound.verdict, "{} {:?}", found.sentence(), found.error);
    let [(value, _), (as_sound, [low, high])] = [found, sound].map(|d| d.effects[0].numbers()[0]);
    assert!((value - as_sound).abs() < MOVED * (high - low), "{value} {as_sound}");
}

#[test]
fn mistakes_of_frames_are_named_before_anything_is_fitted() {
    let sound_set = synthetic(&[("cd_bias", &[BIAS_NM])], 51);
    let sound = diagnosed(&sound_set).unwrap();
    assert!(sound.warnings.is_empty(), "{:?}", sound.warnings);
    is_the_bias(&sound, &sound);

    // Six hot pixels, some in the light, and a dead one in the middle of every image.
    let mut set = sound_set.clone();
    let full = set.camera.saturation_dn as f32;
    let hot = [(3, 5), (9, 40), (20, 11), (30, 33), (41, 8), (44, 44)];
    for c in &mut set.measurements {
        for (k, at) in hot.into_iter().enumerate() {
            c.dn[at] = (0.1 + 0.1 * k as f32) * full;
        }
        c.dn[(24, 24)] = 0.0;
    }
    let d = diagnosed(&set).unwrap();
    for part in [
        "6 hot and 1 dead pixels are masked",
        "hot at row 9, column 40 in 8 of 8",
        "dead at row 24, column 24",
    ] {
        assert!(d.warnings.iter().any(|w| w.contains(part)), "{part}: {:?}", d.warnings);
    }
    is_the_bias(&d, &sound);

    // A bright peak.
    let mut set = sound_set.clone();
    for c in set.measurements.iter_mut().take(1) {
        c.dn[(24, 24)] = full;
    }
    let d = diagnosed(&set).unwrap();
    assert!(d.warnings[0].contains("saturated pixels"), "{:?}", d.warnings);
    is_the_bias(&d, &sound);

    // The images of a lens that steers along x are not symmetric along it.
    let mut set = sound_set.clone();
    for c in &mut set.measurements {
        c.dn = Orientation::MirroredX.upright(&c.dn);
    }
    let error = diagnosed(&set).unwrap_err();
    assert_eq!(error.id(), "set/orientation");
    assert!(error.to_string().contains("`orientation = \"mirrored_x\"`"), "{error}");
    let mut set = sound_set.clone();
    for c in &mut set.measurements {
        c.dn = Orientation::Turned90.upright(&c.dn);
    }
    let error = diagnosed(&set).unwrap_err().to_string();
    assert!(error.contains("`orientation = \"turned_270\"`"), "{error}");

    // A dark frame of a longer exposure took out too much of one measurement.
    let mut set = sound_set.clone();
    set.measurements[MeasurementIndex::from(2)].dn -= 9.0;
    let d = diagnosed(&set).unwrap();
    assert!(
        d.left_out.len() == 1 && d.left_out[0].reason.contains("below dark"),
        "{:?}",
        d.left_out
    );
    is_the_bias(&d, &sound);

    // Two frames of one element that were exchanged.
    let mut set = sound_set.clone();
    let [a, b] = [0, 2].map(MeasurementIndex::from);
    let first = set.measurements[a].dn.clone();
    set.measurements[a].dn = set.measurements[b].dn.clone();
    set.measurements[b].dn = first;
    let d = diagnosed(&set).unwrap();
    let reasons: Vec<&str> = d.left_out.iter().map(|l| l.reason.as_str()).collect();
    assert!(
        reasons.len() == 2 && reasons[0].contains("the one of `e0_560_z0`"),
        "{reasons:?}"
    );
    is_the_bias(&d, &sound);
}

/// A camera of 12 bits that writes them at the left of 16, and frames that are upright as stated.
#[test]
fn bits_at_the_left_are_refused_and_frames_are_turned_as_stated() {
    let folder = tempfile::tempdir().unwrap();
    let path = small_set(folder.path());
    let text = fs::read_to_string(&path).unwrap();
    let frame = Array2::from_shape_fn((PIXELS, PIXELS), |(y, x)| (40 + y + 2 * x) as f32);
    let name = "e0_500_z0.npy";
    let read = || MeasuredSet::read(folder.path(), &PillarsAt::STATED, &Silent);
    write_npy(&folder.path().join(name), &(&frame * 16.0));
    let error = read().unwrap_err().to_string();
    assert!(error.contains("`saturation_dn`"), "{error}");
    write_npy(&folder.path().join(name), &frame);
    assert_eq!(read().unwrap().measurements.raw[0].dn, frame);
    fs::write(
        &path,
        text.replace("flux_sigma = 0.01", "flux_sigma = 0.01\norientation = \"mirrored_x\""),
    )
    .unwrap();
    assert_eq!(
        read().unwrap().measurements.raw[0].dn,
        Orientation::MirroredX.upright(&frame)
    );
}
