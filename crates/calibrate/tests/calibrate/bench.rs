//! What comes from a bench: faults of a set, exposures, filters, saturated pixels.

use std::fs;

use metalith_attribution::Measurements;
use metalith_calibrate::{MeasuredSet, Session};
use metalith_core::Silent;
use metalith_gds::extract::PillarsAt;
use metalith_testing::session::{PIXELS, small_set, write_npy};
use ndarray::Array2;

use crate::set::{SIMULATIONS, names, settings, synthetic};

#[test]
fn every_fault_of_a_set_is_named_in_one_go() {
    let folder = tempfile::tempdir().unwrap();
    let path = small_set(folder.path());
    assert!(MeasuredSet::read(folder.path(), &PillarsAt::STATED, &Silent).is_ok());
    fs::remove_file(folder.path().join("e0_500_z0.npy")).unwrap();
    write_npy(
        &folder.path().join("e0_500_z1.npy"),
        &Array2::zeros((PIXELS, PIXELS - 1)),
    );
    let mut holed = Array2::zeros((PIXELS, PIXELS));
    holed[[3, 4]] = f32::NAN;
    write_npy(&folder.path().join("e0_560_z0.npy"), &holed);
    fs::write(folder.path().join("e0_560_z1.npy"), b"not an array").unwrap();
    let text = fs::read_to_string(&path).unwrap();
    let text = text
        .replace("centre_nm = 560\nfwhm_nm = 6.0", "centre_nm = 710\nfwhm_nm = 30.0")
        .replace("led_nm = 560", "led_nm = 710")
        .replace("centre_um = [150.0, 0.0]", "centre_um = [1500.0, 0.0]")
        .replace("index = [1, 0]\n", "index = [1, 0]\ncolour = \"red\"\n")
        .replacen("element = [1, 0]", "element = [7, 0]", 1);
    fs::write(&path, text).unwrap();
    let error = MeasuredSet::read(folder.path(), &PillarsAt::STATED, &Silent).unwrap_err();
    assert_eq!(error.exit_code(), 2);
    let error = error.to_string();
    for fault in [
        "there is no file",
        "[48, 47], the camera says [48, 48]",
        "1 of its 2304 pixels are not finite",
        "no NPY file",
        "is outside the film's table",
        "the layout has no pillars of element [1, 0]",
        "no [[element]] has the index [7, 0]",
        "unknown key `colour`",
    ] {
        assert!(error.contains(fault), "{fault} is not in:\n{error}");
    }
}

/// A session as a colour sensor behind a relay takes it: two exposures of each measurement, the longer one saturated, one of the
/// two as a stack; only the pixels of a channel count.
#[test]
fn a_bench_with_exposures_filters_and_a_relay_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = small_set(folder.path());
    let text = fs::read_to_string(&path).unwrap();
    let mut text = text
        .replace(
            "pixel_um = 0.5",
            "sensor_pixel_um = 5.0\nmagnification = 10.0\nrelay_blur_um = 0.3\nbayer = \"rggb\"",
        )
        .replace("fwhm_nm = 6.0", "fwhm_nm = 6.0\nchannel = \"green\"");
    let (long, short) = (folder.path().join("e0_500_z0.npy"), folder.path().join("short.npy"));
    let frame =
        |peak: f32| Array2::from_shape_fn((PIXELS, PIXELS), |(y, x)| if (y, x) == (20, 21) { peak } else { 140.0 });
    write_npy(&long, &frame(4095.0));
    write_npy(&short, &frame(540.0).mapv(|v| 40.0 + 0.1 * (v - 40.0)));
    text = text.replacen("file = \"e0_500_z0.npy\"\n", "", 1).replacen(
        "scale_dn = 1.0\nframes = 64\n",
        "[[capture.exposure]]\nfile = \"e0_500_z0.npy\"\nscale_dn = 1.0\nframes = 64\n\
         [[capture.exposure]]\nfile = \"short.npy\"\nscale_dn = 0.1\nframes = 16\n",
        1,
    );
    fs::write(&path, text).unwrap();
    let set = MeasuredSet::read(folder.path(), &PillarsAt::STATED, &Silent).unwrap();
    assert_eq!((set.camera.pixel_um, set.camera.relay_blur_um), (0.5, 0.3));
    let first = &set.measurements.raw[0];
    assert_eq!((first.scale_dn, first.frames), (1.0, 64));
    // Single precision.
    assert!((first.dn[[20, 21]] - 540.0).abs() < 0.01, "{}", first.dn[[20, 21]]);
    let noise = first.noise.as_ref().unwrap();
    assert!(noise[[20, 21]].is_finite() && noise[[20, 22]].is_infinite());
    assert!(
        noise[[20, 21]] > noise[[0, 1]],
        "the peak is known by the short exposure alone"
    );
    let session = Session::new(&set, settings()).unwrap();
    for c in session.data.indices() {
        assert_eq!(session.data.points(c), PIXELS * PIXELS / 2);
        assert_eq!(set.seeing_pixels(c), PIXELS * PIXELS / 2);
    }
}

/// What surrounds a saturated peak still tells of the distance: pixels are masked, and no measurement is lost.
#[test]
fn saturated_peaks_are_masked() {
    const DEFOCUS_UM: f64 = 5.0;
    let mut set = synthetic(&[("defocus", &[DEFOCUS_UM])], 26);
    let peak = set
        .measurements
        .iter()
        .map(|c| c.dn.fold(0.0f32, |a, b| a.max(*b)))
        .fold(0.0, f32::max);
    let full = 0.8 * peak;
    set.camera.saturation_dn = f64::from(full);
    set.measurements
        .iter_mut()
        .for_each(|c| c.dn.mapv_inplace(|v| v.min(full)));
    let session = Session::new(&set, settings()).unwrap();
    assert!(session.data.indices().any(|c| session.data.points(c) < PIXELS * PIXELS));
    let d = session.diagnose(&SIMULATIONS, &Silent).unwrap().0;
    assert_eq!(d.left_out.len(), 0);
    assert_eq!(names(&d), ["defocus"], "{}", d.sentence());
    assert_eq!(d.effects[0].holds(DEFOCUS_UM), Some(true), "{}", d.sentence());
}

/// Dark current of a long exposure is not that of a short one: one dark frame of both is refused, unless the lab says that it holds.
#[test]
fn exposures_of_unlike_time_have_dark_frames_of_their_own() {
    /// Single precision.
    const ROUNDING: f32 = 1e-3;
    let folder = tempfile::tempdir().unwrap();
    let path = small_set(folder.path());
    let frame = |dn: f32| Array2::from_elem((PIXELS, PIXELS), dn);
    write_npy(&folder.path().join("dark.npy"), &frame(41.0));
    write_npy(&folder.path().join("long_dark.npy"), &frame(140.0));
    write_npy(&folder.path().join("e0_500_z0.npy"), &frame(540.0));
    let stated = fs::read_to_string(&path).unwrap();
    let read = |of_camera: &str, of_exposure: &str| {
        let text = stated
            .replace(
                "flux_sigma = 0.01",
                &format!("flux_sigma = 0.01\ndark_frame = \"dark.npy\"\ndark_frames = 16\n{of_camera}"),
            )
            .replacen("scale_dn = 1.0\n", &format!("scale_dn = 8.0\n{of_exposure}"), 1);
        fs::write(&path, text).unwrap();
        MeasuredSet::read(folder.path(), &PillarsAt::STATED, &Silent)
    };
    let error = read("", "").unwrap_err().to_string();
    for part in ["unlike time", "8 DN", "dark_frames", "dark_holds_for"] {
        assert!(error.contains(part), "{part} is not in:\n{error}");
    }
    let own = "dark_frame = \"long_dark.npy\"\ndark_frames = 16\n";
    for (of_camera, of_exposure, first) in [("", own, 440.0), ("dark_holds_for = \"any_exposure\"\n", "", 539.0)] {
        let set = read(of_camera, of_exposure).unwrap();
        let at = |measurement: usize| set.measurements.raw[measurement].dn[[20, 21]];
        assert!((at(0) - first).abs() < ROUNDING, "{}", at(0));
        // The others have that of the camera: 1 DN of dark current.
        assert!((at(1) - 39.0).abs() < ROUNDING, "{}", at(1));
    }
    // One that is named and not there is one fault.
    let error = read("", "dark_frame = \"none.npy\"\ndark_frames = 16\n")
        .unwrap_err()
        .to_string();
    assert!(error.contains("none.npy") && !error.contains("unlike time"), "{error}");
}
