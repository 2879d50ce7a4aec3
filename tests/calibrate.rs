//! Measured sets: what cannot be read is named in one go, what differs is found, what does not is not.

use std::fs;
use std::path::{Path, PathBuf};

use metalith::calibrate::{MeasuredSet, Session, SetVerdict, Settings, Twins};
use metalith::calibrate::{OffList, Sampling};
use metalith::{Design, Hierarchy, PillarArray, Silent, write_pillars};
use ndarray::Array2;
use npyz::WriterBuilder;

/// Edge of a capture of the small set [pixels].
const PIXELS: usize = 48;

/// Elements of the small set, with the light that they steer to their axis.
const BEAMS: [([i64; 2], f64); 2] = [([0, 0], 0.0), ([1, 0], -15.0)];

fn write_npy(path: &Path, values: &Array2<f32>) {
    let mut bytes = Vec::new();
    let shape = [values.nrows() as u64, values.ncols() as u64];
    let mut writer = npyz::WriteOptions::new()
        .default_dtype()
        .shape(&shape)
        .writer(&mut bytes)
        .begin_nd()
        .unwrap();
    writer.extend(values.iter().copied()).unwrap();
    writer.finish().unwrap();
    fs::write(path, bytes).unwrap();
}

/// A bench session with lenses of 60 um: two elements, two colours, two distances.
fn small_set(folder: &Path) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let design = Design::read(&root.join("designs/mini_3x3.toml")).unwrap();
    let array = PillarArray::build(&design, &Silent).unwrap();
    write_pillars(&design, &array, Hierarchy::Sref, &folder.join("layout.gds"), &Silent).unwrap();
    fs::copy(root.join("golden/measured/film_nk.csv"), folder.join("film_nk.csv")).unwrap();
    let mut text = format!(
        r#"schema = 1
title = "small chip"
layout = "layout.gds"

[layout_layers]
pillars = [1, 0]
apertures = [2, 0]

[stack]
pitch_nm = 350
pillar_height_nm = 700
pillar_index = "film_nk.csv"
substrate = "fused_silica_malitson_1965"
ambient_index = 1.0
incidence = "substrate"
lens_diameter_um = 60.0
focal_length_um = 144.0

[source]
kind = "collimated"
divergence_mrad = 2.35
divergence_axes = "uniform disc"

[camera]
pixel_um = 0.5
rows = {PIXELS}
cols = {PIXELS}
black_level_dn = 40.0
gain_e_per_dn = 5.0
read_noise_dn = 2.0
saturation_dn = 4095
registration_sigma_px = 0.5
flux_sigma = 0.01

[[led]]
centre_nm = 500
fwhm_nm = 6.0

[[led]]
centre_nm = 560
fwhm_nm = 6.0
"#
    );
    for (index, _) in BEAMS {
        text.push_str(&format!(
            "\n[[element]]\nindex = [{0}, 0]\ncentre_um = [{1}.0, 0.0]\naperture_diameter_um = 60.0\n",
            index[0],
            150 * index[0]
        ));
    }
    for (index, aoi) in BEAMS {
        for led in [500, 560] {
            // Where the wedge of 550 nm sends this colour.
            let sine = 0.258_819 * f64::from(led) / 550.0 + aoi.to_radians().sin();
            let x = if index[0] == 0 {
                0.0
            } else {
                144.0 * sine / (1.0 - sine * sine).sqrt()
            };
            for (z, distance) in [139.0, 146.0].into_iter().enumerate() {
                let name = format!("e{}_{led}_z{z}", index[0]);
                write_npy(
                    &folder.join(format!("{name}.npy")),
                    &Array2::from_elem((PIXELS, PIXELS), 40.0),
                );
                text.push_str(&format!(
                    "\n[[capture]]\nfile = \"{name}.npy\"\nelement = [{}, 0]\nled_nm = {led}\naoi_deg = [{aoi:.1}, 0.0]\ndistance_um = {distance:.1}\nwindow_centre_um = [{x:.3}, 0.0]\nscale_dn = 1.0\nframes = 64\n",
                    index[0]
                ));
            }
        }
    }
    let path = folder.join("measurement.toml");
    fs::write(&path, text).unwrap();
    path
}

#[test]
fn every_fault_of_a_set_is_named_in_one_go() {
    let folder = tempfile::tempdir().unwrap();
    let path = small_set(folder.path());
    assert!(MeasuredSet::read(folder.path(), &Silent).is_ok());
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
    let error = MeasuredSet::read(folder.path(), &Silent).unwrap_err();
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

fn settings() -> Settings {
    Settings {
        sampling: Sampling {
            spectrum: 0.34,
            ..Sampling::default()
        },
        // Those whose cells need not be solved again.
        only: ["cd_bias", "gap", "tilt", "led_width", "zero_order", "pixel_blur"]
            .map(String::from)
            .to_vec(),
        ladder: false,
        exact: true,
        ..Settings::default()
    }
}

#[test]
fn effects_are_found_and_nothing_is_found_where_nothing_is() {
    let folder = tempfile::tempdir().unwrap();
    small_set(folder.path());
    let like = MeasuredSet::read(folder.path(), &Silent).unwrap();
    let session = Session::new(&like, settings()).unwrap();
    let atlas = session.atlas(&Silent).unwrap();
    let twins = Twins::new(&like, &settings()).unwrap();
    let diagnose = |set: &MeasuredSet| {
        let mut session = Session::new(set, settings()).unwrap();
        session.diagnose(&atlas, &Silent).unwrap().0
    };
    let nothing = twins.with_effect("", &[], &Silent).unwrap();
    for seed in 1..=3 {
        let d = diagnose(&twins.draw(&nothing, seed));
        assert_eq!(d.verdict, SetVerdict::NoResidual, "{}: {:?}", d.sentence(), d.error);
        assert!(d.effects.is_empty());
    }
    for (name, number) in [("cd_bias", -8.0), ("gap", 5.0)] {
        let exposed = twins.with_effect(name, &[number], &Silent).unwrap();
        let d = diagnose(&twins.draw(&exposed, 11));
        let found = d.effects.iter().find(|e| e.name == name);
        let found = found.unwrap_or_else(|| panic!("{name}: {} {:?}", d.sentence(), d.error));
        let ends: Vec<f64> = serde_json::from_value(found.interval.clone()).unwrap();
        assert!((ends[0]..=ends[1]).contains(&number), "{name}: {ends:?}");
        assert!(d.error.after.held_out < 1.3 && d.error.before.held_out > d.error.after.held_out);
    }
    // In no list: whatever is said, it is not said that a known effect explains it.
    let exposed = twins.off_list(OffList::Ghost(0.1, [4.0, -3.0]), &Silent).unwrap();
    let d = diagnose(&twins.draw(&exposed, 12));
    assert!(
        matches!(d.verdict, SetVerdict::Unexplained | SetVerdict::Partly),
        "{}",
        d.sentence()
    );
    // Frames that were lost: the set is mostly unfit, and says which.
    let mut dark = twins.draw(&nothing, 13);
    for capture in dark.captures.iter_mut().take(5) {
        capture.dn.fill(40.0);
    }
    let d = diagnose(&dark);
    assert_eq!(d.verdict, SetVerdict::DataUnfit);
    assert!(d.left_out.len() >= 5);
}
