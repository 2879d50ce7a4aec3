//! Studies of rectangles.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use metalith_core::Silent;
use metalith_design::array::PillarArray;
use metalith_design::{Design, cell_models};
use metalith_gds::Layout;
use metalith_layout::write_pillars;
use metalith_optics::{AsBuiltChip, CalibratedModel, Perturbation};
use metalith_pillars::{PillarShape, UprightRectangles};
use metalith_study::{DrawRecord, PlanSettings, Work, merge, plan};
use metalith_testing::rectangles::{Small, rotated, upright};
use metalith_verify::{ReadLayout, SimulationCases, Verification};
use metalith_wave::Accuracy;

/// A study of a small lens.
fn study(folder: &Path, small: &Small, varied: &str) -> PathBuf {
    small.write(folder);
    let path = folder.join("tolerance.toml");
    let text = format!("schema = 1\ndesign = \"design.toml\"\ndraws = 1\n{varied}");
    fs::write(&path, text).unwrap();
    path
}

/// A design that is drawn so.
fn as_drawn(small: &Small, folder: &Path) -> Design {
    let mut design = Design::read(&small.write(folder)).unwrap();
    if let Some(pillars) = design.cell.shape.upright() {
        let wider = UprightRectangles {
            shortest_nm: pillars.shortest_nm.checked_add_signed(small.wider_nm() as i16).unwrap(),
            ..pillars
        };
        design.cell.shape = PillarShape::Rectangle(wider.into());
    }
    design
}

/// A design judged by the pillars that are drawn, or with a model by the chip as fabricated.
fn judged(small: &Small, model: Option<Perturbation>) -> Verification {
    judged_with(small, model, None)
}

/// Judgement with a folder in which solved cells of a chip as fabricated are cached.
fn judged_with(small: &Small, model: Option<Perturbation>, kept: Option<&Path>) -> Verification {
    let folder = tempfile::tempdir().unwrap();
    let design = as_drawn(small, folder.path());
    let array = PillarArray::build(&design, &Silent).unwrap();
    let path = folder.path().join("small.gds");
    write_pillars(&design, &array, design.layout.hierarchy, &path, &Silent).unwrap();
    let layout = ReadLayout::of(&design, &array, &Layout::open(&path).unwrap(), &Silent).unwrap();
    let models = cell_models(&design, &[design.verify.fidelity]).unwrap();
    let chip = model.map(|perturbation| {
        let model = CalibratedModel::new("set".into(), "found".into(), perturbation);
        let chip = AsBuiltChip::in_light(&design.lit_stack().unwrap(), &model).unwrap();
        chip.cached_in(kept)
    });
    let cases = match &chip {
        Some(chip) => SimulationCases::judged_by(chip),
        None => SimulationCases::of_cells(&models).unwrap(),
    };
    layout.judge(&design, &array, &cases, Accuracy::Fast, &Silent).unwrap()
}

/// Strehl ratio of the first spot.
fn strehl(found: &Verification) -> f64 {
    found.distinct[0].spots[0].judged().metrics.strehl
}

/// Draws of a study, in their order.
fn draws(small: &Small, varied: &str) -> Vec<DrawRecord> {
    let folder = tempfile::tempdir().unwrap();
    let path = study(folder.path(), small, varied);
    let plan = plan(&path, &folder.path().join("study"), PlanSettings::default(), &Silent);
    let plan = plan.unwrap();
    Work::Study(plan.clone())
        .run(&(0..plan.cut().shards()).collect::<Vec<_>>(), &Silent)
        .unwrap();
    merge(&plan, 0, &Silent).unwrap().draws
}

/// Strehl ratios of the draws of a study, in their order.
fn of_draws(small: &Small, varied: &str) -> Vec<f64> {
    let of = |figures: &BTreeMap<String, Option<f64>>| {
        let mut strehl = figures.iter().filter(|(key, _)| key.starts_with("strehl_"));
        strehl.next().and_then(|(_, value)| *value).unwrap()
    };
    draws(small, varied).iter().map(|d| of(&d.figures)).collect()
}

const VARIED: &str =
    "[[grid]]\neffect = \"cd_bias\"\nvalues = [0, 4]\n[[grid]]\neffect = \"film_height\"\nvalues = [0, 10]\n";

/// A bias is that of both edges, and a height that of the film: such chips are those drawn so. Half of unpolarised light is focused.
#[test]
#[ignore = "second tier: two minutes of CPU time, in scripts/slow_tests.sh"]
fn made_rectangles_are_those_that_are_drawn_so() {
    /// Tolerance of 17 orders an axis for 25 or 41, and of corners that round to the grid otherwise: 3e-4 at 532 nm.
    const AS_DRAWN: f64 = 2e-3;
    let small = rotated().in_light("\"unpolarised\"");
    let found = of_draws(&small, VARIED);
    let wanted = [(0, 0), (0, 10), (4, 0), (4, 10)];
    assert_eq!(found.len(), wanted.len());
    for (found, (wider, higher)) in found.iter().zip(wanted) {
        let wanted = strehl(&judged(&small.changed(wider, higher), None));
        assert!(
            (found / wanted - 1.0).abs() < AS_DRAWN,
            "{wider} {higher}: {found} {wanted}"
        );
        assert!((0.4..0.51).contains(&wanted), "{wanted}");
    }
}

/// Figures of upright rectangles in a study are those that `metalith run` has by the same model, in light along either axis, which is judged by its own
/// phase and held to the limits of the design.
#[test]
#[ignore = "second tier: two minutes of CPU time, in scripts/slow_tests.sh"]
fn draws_of_upright_rectangles_have_the_figures_of_their_models() {
    /// Tolerance of rational functions between 5 nm of the edges, and between nodes of the height: a thousandth of a
    /// transmission (rms).
    const OF_TABLES: f64 = 2e-3;
    // 4 nm and 5 nm are no nodes of the tables.
    let varied = "[[grid]]\neffect = \"cd_bias\"\nvalues = [-2, 4, 5]\n[[grid]]\neffect = \"film_height\"\nvalues = [0, 5, 10]\n";
    for light in ["\"x\"", "\"y\"", "\"unpolarised\""] {
        let small = upright().in_light(light);
        let found = draws(&small, varied);
        assert_eq!(found.len(), 9);
        for (k, (bias_nm, height_nm)) in [(0, (-2.0, 0.0)), (4, (4.0, 5.0)), (8, (5.0, 10.0))] {
            let (draw, wanted) = (&found[k], judged(&small, made(bias_nm, height_nm)));
            let reached: Vec<Option<f64>> = wanted.checks.iter().map(|c| Some(c.reached)).collect();
            println!("{light} {bias_nm} {height_nm}: {:?} {reached:?}", draw.reached);
            assert_eq!(draw.reached.len(), reached.len());
            for (a, b) in draw.reached.iter().zip(&reached) {
                assert!((a.unwrap() - b.unwrap()).abs() < OF_TABLES, "{draw:?} {reached:?}");
            }
            assert_eq!(draw.passed, wanted.passed(), "{draw:?}");
        }
    }
}

#[test]
fn what_rectangles_have_no_meaning_for_is_told() {
    let camera = metalith_testing::design("../cameras/gt1930");
    let picture = format!(
        "[[grid]]\neffect = \"defocus\"\nvalues = [0]\n[picture]\ncamera = \"{}\"\nscene = \"star\"\n",
        camera.display()
    );
    let corners = "[[grid]]\neffect = \"corner_rounding\"\nvalues = [0, 10]\n";
    let each = [
        (corners, "study/rounded-rectangles"),
        (&picture, "study/pictures-with-rectangles"),
    ];
    for (small, (varied, id)) in [rotated(), upright()].iter().flat_map(|s| each.map(|e| (s, e))) {
        let folder = tempfile::tempdir().unwrap();
        let path = study(folder.path(), small, varied);
        let refused = plan(&path, &folder.path().join("study"), PlanSettings::default(), &Silent);
        assert_eq!(refused.err().unwrap().id(), id);
    }
}

/// Tolerance of Strehl ratios: transmissions are of one solver, classes of a chip as fabricated in single precision,
/// and fields of fast propagation.
const ROUNDING: f64 = 1e-5;

/// Tolerance of Strehl ratios of a steeper lens of rotated rectangles, 2e-5 by fast propagation; where they have other
/// edges, corners are rounded to the grid otherwise.
const OF_GRID: f64 = 2e-4;

fn made(bias_nm: f64, height_nm: f64) -> Option<Perturbation> {
    let mut model = Perturbation::default();
    model.geometry.cd_bias_nm = bias_nm;
    model.cell.height_nm = height_nm;
    Some(model)
}

fn alike(as_made: &Verification, drawn: &Verification, within: f64) {
    let (of_made, of_drawn) = (strehl(as_made), strehl(drawn));
    println!("{of_made} {of_drawn}");
    assert!((of_made / of_drawn - 1.0).abs() < within, "{of_made} {of_drawn}");
    let orders = |found: &Verification| found.distinct[0].orders[0].first;
    assert!(
        (orders(as_made) - orders(drawn)).abs() < within,
        "{} {}",
        orders(as_made),
        orders(drawn)
    );
    let mapping = |found: &Verification| found.distinct[0].phase.mapping.rms_rad;
    assert!(
        (mapping(as_made) - mapping(drawn)).abs() < within.sqrt(),
        "{} {}",
        mapping(as_made),
        mapping(drawn)
    );
}

/// A chip that is made as drawn is judged as by the cell, in light of either polarisation, of both, and behind an analyser.
#[test]
#[ignore = "second tier: two minutes of CPU time, in scripts/slow_tests.sh"]
fn a_chip_without_faults_is_that_of_the_cell() {
    for light in [
        "\"x\"",
        "\"y\"",
        "30",
        "\"unpolarised\"",
        "\"unpolarised\"\nanalyser = \"y\"",
    ] {
        let small = upright().in_light(light);
        alike(&judged(&small, made(0.0, 0.0)), &judged(&small, None), ROUNDING);
    }
    let small = rotated().in_light("\"unpolarised\"");
    alike(&judged(&small, made(0.0, 0.0)), &judged(&small, None), OF_GRID);
}

/// One that is wider, narrower, higher or lower is that of a design that is drawn so.
#[test]
#[ignore = "second tier: two minutes of CPU time, in scripts/slow_tests.sh"]
fn a_chip_that_is_wider_or_lower_is_that_which_is_drawn_so() {
    for light in ["\"x\"", "\"y\""] {
        for (bias, higher) in [(4, 0), (-4, 10), (0, -10)] {
            let small = upright().in_light(light);
            let found = judged(&small, made(f64::from(bias), f64::from(higher)));
            let drawn = judged(&small.changed(bias, higher), None);
            alike(&found, &drawn, ROUNDING);
        }
    }
    let small = rotated().in_light("\"left\"");
    let found = judged(&small, made(4.0, 10.0));
    let drawn = judged(&small.changed(4, 10), None);
    alike(&found, &drawn, OF_GRID);
}

/// Cache of a run by a model: the second run takes from the folder what the first has solved; its report has the same
/// bytes.
#[test]
fn a_second_run_by_a_model_solves_nothing_and_says_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let kept = || -> BTreeMap<PathBuf, Vec<u8>> {
        let files = fs::read_dir(folder.path()).unwrap().map(|file| file.unwrap().path());
        files.map(|path| (path.clone(), fs::read(path).unwrap())).collect()
    };
    let run = |bias_nm: f64| {
        let found = judged_with(&upright(), made(bias_nm, 3.0), Some(folder.path()));
        serde_json::to_vec(&found).unwrap()
    };
    let first = run(1.5);
    let files = kept();
    assert!(!files.is_empty());
    assert_eq!((run(1.5), kept()), (first.clone(), files.clone()));
    // Another model has separate files.
    assert_ne!(run(1.6), first);
    assert!(kept().len() > files.len());
}

/// Light that passes no pillar and missing pillars of a model count along both axes.
#[test]
#[ignore = "second tier: two minutes of CPU time, in scripts/slow_tests.sh"]
fn light_that_sees_no_pillar_and_missing_ones_lower_what_is_focused() {
    let small = upright().in_light("\"unpolarised\"");
    let perfect = strehl(&judged(&small, made(0.0, 0.0)));
    let mut model = Perturbation::default();
    model.geometry.missing_pillars = 0.1;
    let missing = strehl(&judged(&small, Some(model)));
    // A tenth of the field is gone, and the rest scatters evenly.
    const SCATTERED: f64 = 0.02;
    assert!((missing / perfect - 0.81).abs() < SCATTERED, "{missing} {perfect}");
}
