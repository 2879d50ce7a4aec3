//! What the next chip will do: layouts judged by a calibrated model, compensated for it, and lit at an angle.

use std::fs;
use std::path::PathBuf;

use assert_cmd::Command;
use metalith::cell::CellStack;
use metalith::compensate::compensate;
use metalith::optics::{CalibratedModel, Perturbation};
use metalith::{
    Accuracy, Design, Extraction, ExtractionPlan, Fidelity, Layout, PillarArray, Silent, SimulationCases, cell_models,
    extract, verify, write_pillars,
};
use metalith_testing::root;
use serde_json::Value;

use super::metalith;

/// Relative error, or nm: rounding of tables of some hundred widths.
const ROUNDING: f64 = 1e-9;

/// A relative change that nobody would call rounding: each premise of a test exceeds it.
const FELT: f64 = 0.05;

/// Transmissions of size one by two ways through the same solver, or by a closed form.
const SOLVED: f64 = 1e-12;

fn mini() -> Design {
    let mut design = Design::read(&root().join("designs/mini_3x3.toml")).unwrap();
    design.verify.wavelengths_um = vec![0.53];
    design
}

fn model(change: impl FnOnce(&mut Perturbation)) -> CalibratedModel {
    let mut perturbation = Perturbation::default();
    change(&mut perturbation);
    CalibratedModel::new("twin".into(), "as made".into(), perturbation)
}

fn json(path: PathBuf) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

#[test]
fn a_bias_of_whole_steps_is_drawn_the_other_way() {
    let design = mini();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let narrow = model(|d| d.geometry.cd_bias_nm = -10.0);
    let summary = compensate(&design, &array, &narrow, &Silent).unwrap().summary;
    // Every width plus ten is a width that may be drawn: nothing is left but the rounding of the tables.
    let [before, after] = summary.error;
    assert!(before > FELT && after < ROUNDING, "{before} {after}");
    assert!(
        (summary.moved_rms_nm - 10.0).abs() < ROUNDING,
        "{}",
        summary.moved_rms_nm
    );
}

#[test]
#[ignore = "second tier: CPU time, in scripts/slow_tests.sh"]
fn what_cannot_be_undone_is_made_less() {
    let design = mini();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let nothing = compensate(&design, &array, &model(|_| ()), &Silent).unwrap();
    assert!(nothing.summary.error[1] < ROUNDING && nothing.summary.moved_rms_nm == 0.0);
    // A film 25 nm too high waves resonances and phases together: widths mend the phases alone.
    const MENDED: f64 = 0.9;
    let high = compensate(&design, &array, &model(|d| d.cell.height_nm = 25.0), &Silent).unwrap();
    let [before, after] = high.summary.error;
    assert!(after < MENDED * before, "{before} {after}");
    // Bias by density differs from site to site: the drawn change follows it, up to the steps of the widths.
    const FOLLOWED: f64 = 0.5;
    let dense = compensate(
        &design,
        &array,
        &model(|d| d.geometry.cd_bias_density_nm = 40.0),
        &Silent,
    )
    .unwrap();
    let [before, after] = dense.summary.error;
    assert!(after < FOLLOWED * before, "{before} {after}");
}

#[test]
fn heights_that_differ_over_the_lens_are_not_compensated() {
    let design = mini();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let error = compensate(&design, &array, &model(|d| d.cell.rim_height_nm = 10.0), &Silent)
        .err()
        .unwrap();
    assert_eq!(error.exit_code(), 2);
    assert_eq!(error.id(), "compensate/height-varies");
}

#[test]
#[ignore = "second tier: CPU time, in scripts/slow_tests.sh"]
fn the_program_predicts_and_compensates() {
    let folder = tempfile::tempdir().unwrap();
    let narrow = folder.path().join("narrow.toml");
    model(|d| d.geometry.cd_bias_nm = -10.0).write(&narrow).unwrap();
    let path = folder.path().join("model.toml");
    model(|d| {
        d.geometry.cd_bias_nm = -10.0;
        d.path.defocus_um = 2.0;
    })
    .write(&path)
    .unwrap();
    let design = "designs/mini_3x3.toml";
    let out = |name: &str| folder.path().join(name);
    // The bias undone: the compensated layout as made is the intended one.
    metalith()
        .args(["layout", design, "--compensate"])
        .arg(&narrow)
        .arg("--out")
        .arg(out("made"))
        .assert()
        .success()
        .stdout(predicates::str::contains("widths moved by"));
    let page = fs::read_to_string(out("made/compensation.html")).unwrap();
    assert!(page.contains("made, uncorrected"));
    let report = json(out("made/compensation.json"));
    let cases = report["cases"].as_array().unwrap();
    let strehl = |pillars: &str| -> Vec<f64> {
        let of = cases.iter().filter(|c| c["pillars"] == pillars);
        of.map(|c| c["spot"]["strehl"].as_f64().unwrap()).collect()
    };
    let (intended, plain, corrected) = (
        strehl("intended"),
        strehl("made, uncorrected"),
        strehl("made, corrected"),
    );
    assert_eq!((intended.len(), plain.len()), (9, 9));
    // Interpolation between solved widths may leave a fifth of the change, and a thousandth where there is none.
    const LEFT: f64 = 0.2;
    const NO_CHANGE: f64 = 1e-3;
    for ((a, b), c) in intended.iter().zip(&plain).zip(&corrected) {
        assert!(
            (c / a - 1.0).abs() < LEFT * (b / a - 1.0).abs() + NO_CHANGE,
            "{a} {b} {c}"
        );
    }
    // Such a layout is held to the design as compensated: all pillars are right, and as made it is what was asked for.
    let pillars = out("made/mini_3x3_compensated_pillars.gds");
    for (compensated, code) in [(true, 0), (false, 1)] {
        let with = |command: &mut Command| {
            if compensated {
                command.arg("--compensated").arg(&narrow);
            }
        };
        let mut verify = metalith();
        verify
            .args(["verify", design])
            .arg(&pillars)
            .arg("--fast")
            .arg("--out")
            .arg(out("verified"));
        with(&mut verify);
        verify.assert().code(code);
        let mut check = metalith();
        check.arg("check").arg(&pillars).args(["--design", design]);
        with(&mut check);
        check.assert().code(code);
    }
    metalith()
        .args(["handoff", design, "--fast", "--compensate"])
        .arg(&narrow)
        .arg("--out")
        .arg(out("kit"))
        .assert()
        .success()
        .stdout(predicates::str::contains("as made by the calibrated model"));
    assert!(out("kit/inputs/model_narrow.toml").exists());
    assert!(out("kit/layout/mini_3x3_compensated_pillars.gds").exists());
    // Judged by the same model, the layout as it was is another lens than by its own cell.
    let run = metalith()
        .args(["run", design, "--fast", "--json", "--model"])
        .arg(&path)
        .arg("--out")
        .arg(out("run"))
        .output()
        .unwrap();
    let found: Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(found["fidelity"], "calibrated");
    let elements = found["distinct"].as_array().unwrap();
    let spots = elements.iter().flat_map(|e| e["spots"].as_array().unwrap());
    let changes = spots.map(|spot| {
        let by = |k: usize, name: &str| {
            assert_eq!(spot["extracted"][k][0], name);
            spot["extracted"][k][1]["strehl"].as_f64().unwrap()
        };
        (by(0, "calibrated") / by(1, "rigorous") - 1.0).abs()
    });
    assert!(changes.fold(0.0, f64::max) > FELT);
    // And without a design.
    metalith()
        .arg("psf")
        .arg(out("run/mini_3x3_pillars.gds"))
        .args(["--distance-um", "144", "--wavelength-nm", "530", "--fast", "--model"])
        .arg(&path)
        .assert()
        .success();
    metalith()
        .args(["run", design, "--model", design])
        .assert()
        .code(2)
        .stderr(predicates::str::contains("model.toml"));
}

#[test]
fn oblique_light_sees_another_cell_and_the_normal_is_its_limit() {
    let stack = CellStack::paper(350.0, 700.0).unwrap();
    let orders = metalith::rcwa::Orders::new(9).unwrap();
    let along = stack.transmission(180.0, 0.53, orders).unwrap();
    let [[ss, sp], [ps, pp]] = stack.oblique(180.0, 0.53, [0.0, 0.0], orders).unwrap();
    assert!((ss - along).norm() < SOLVED && (pp - along).norm() < SOLVED);
    assert!(sp.norm() < SOLVED && ps.norm() < SOLVED);
    let tilted = stack.oblique(180.0, 0.53, [0.25, 0.0], orders).unwrap();
    // Fourteen degrees in the substrate are felt, far above what the solver errs by.
    const TILTED: f64 = 0.02;
    assert!((tilted[0][0] - along).norm() > TILTED);
    // Bare glass: the share of power that Fresnel's coefficients pass, s and p.
    let n = stack.full_transmission(0.53).unwrap().powi(2);
    let (sine, air) = (0.5_f64, 0.75_f64.sqrt());
    let glass = (1.0 - (sine / n).powi(2)).sqrt();
    let bare = stack.oblique(0.0, 0.53, [sine, 0.0], orders).unwrap();
    let reflected = [
        (n * glass - air) / (n * glass + air),
        (glass - n * air) / (glass + n * air),
    ];
    for (t, r) in [bare[0][0], bare[1][1]].iter().zip(reflected) {
        assert!((t.norm_sqr() / n - (1.0 - r * r)).abs() < SOLVED);
    }
    assert!(stack.oblique(180.0, 0.53, [1.0, 0.0], orders).is_err());
    // In no plane of symmetry some light is turned from s to p; the power of the zero order counts it.
    let (x, y) = (0.25, 0.1);
    let turned = stack.oblique(180.0, 0.455, [x, y], orders).unwrap();
    let incidence = metalith::rcwa::Incidence::of_sines(0.455, metalith::rcwa::Side::Below, [x, y]);
    let solved = metalith::rcwa::solve(&stack.layers(180.0, 0.455).unwrap(), &incidence, orders).unwrap();
    let n = stack.full_transmission(0.455).unwrap().powi(2);
    // Far above what rounding leaves of what symmetry forbids.
    const TURNED: f64 = 1e-9;
    for (out, power) in turned.iter().zip(solved.zero_order()) {
        assert!((out.iter().map(|t| t.norm_sqr()).sum::<f64>() / n - power).abs() < SOLVED);
    }
    let powers = [turned[0][1], turned[1][0]].map(|t| t.norm_sqr());
    assert!(powers.iter().all(|p| *p > TURNED), "{powers:?}");
}

#[test]
fn a_design_may_ask_for_cells_as_they_are_lit() {
    let folder = tempfile::tempdir().unwrap();
    let text = fs::read_to_string(root().join("designs/mini_3x3.toml")).unwrap();
    let spec = "[verify]\nincidence = \"oblique\"\n";
    let text = text
        .replace("[verify]\n", spec)
        .replace("width_step_nm = 2", "width_step_nm = 20");
    assert!(text.contains(spec) && text.contains("= 20"));
    let path = folder.path().join("lit.toml");
    fs::write(&path, text).unwrap();
    let mut design = Design::read(&path).unwrap();
    design.verify.wavelengths_um = vec![0.53];
    let array = PillarArray::build(&design, &Silent).unwrap();
    let file = folder.path().join("lit.gds");
    write_pillars(&design, &array, design.layout.hierarchy, &file, &Silent).unwrap();
    let cells = cell_models(&design, &[Fidelity::Rigorous]).unwrap();
    let cases = SimulationCases::of_cells(&cells).unwrap();
    let strehls = |design: &Design| -> Vec<(f64, f64)> {
        let found = verify(design, &array, &file, &cases, Accuracy::Fast, &Silent).unwrap();
        let spots = found.distinct.iter().flat_map(|d| &d.spots);
        spots
            .map(|s| (s.incidence_sin[0].hypot(s.incidence_sin[1]), s.judged().metrics.strehl))
            .collect()
    };
    let lit = strehls(&design);
    design.verify.incidence = metalith::design::CellIncidence::Normal;
    for ((sine, a), (_, b)) in lit.iter().zip(strehls(&design)) {
        // Light along the normal sees what it did; what comes from 33 degrees, at the corner of a corner element's
        // field, finds cells that were not made for it, but still makes an image.
        const NO_IMAGE: f64 = 0.7;
        // Half a degree from the normal, where some look from the side of their field, is not felt.
        const FELT_FROM: f64 = 0.05;
        let change = 1.0 - a / b;
        assert!(
            match *sine {
                0.0 => change == 0.0,
                sine if sine < FELT_FROM => change.abs() < NO_IMAGE,
                _ => change > FELT && change < NO_IMAGE,
            },
            "{sine}: {a} {b}"
        );
    }
}

#[test]
fn a_compensated_layout_reads_back_as_compensated() {
    let design = mini();
    let folder = tempfile::tempdir().unwrap();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let done = compensate(&design, &array, &model(|d| d.geometry.cd_bias_nm = 8.0), &Silent).unwrap();
    let file = folder.path().join("compensated.gds");
    write_pillars(&design, &done.array, design.layout.hierarchy, &file, &Silent).unwrap();
    let plan = ExtractionPlan::discover(design.layout.layers.pillars.number());
    let found: Extraction = extract(&Layout::open(&file).unwrap(), &plan, &Silent).unwrap();
    assert_eq!(found.pillars, array.pillars());
    let narrowest = |widths: &metalith::PillarMap| widths.number.iter().copied().filter(|w| *w > 0).min();
    let drawn = found.elements.iter().filter_map(|e| narrowest(&e.widths)).min();
    let meant = done
        .array
        .classes
        .iter()
        .filter_map(|c| narrowest(&c.widths.map()))
        .min();
    assert_eq!(drawn, meant);
}
