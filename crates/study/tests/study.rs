//! A study from its file to its result: the answer depends on nothing but the plan.

mod common;

use std::fs;
use std::path::Path;

use common::{SMALL_CAMERA, tolerance};
use metalith_core::document::Scalar;
use metalith_core::{Error, FaultKind, Result, Silent};
use metalith_imaging::scene::{BuiltIn, chart};
use metalith_imaging::{ForecastScene, ImagingSystem, scores};
use metalith_optics::{CalibratedModel, Perturbation};
use metalith_restoration::RestorationMethod;
use metalith_study::{Plan, PlanSettings, Run, Work, merge, plan, report_files, write_page};
use sha2::Digest as _;

fn run_shard(plan: &Plan, number: u64) -> metalith_core::Result<()> {
    Work::Study(plan.clone()).run(&[number], &Silent)
}

fn in_shards(tolerance: &Path, folder: &Path, draws_per_shard: u64) -> Plan {
    let settings = PlanSettings {
        draws_per_shard: Some(draws_per_shard),
        ..PlanSettings::default()
    };
    plan(tolerance, folder, settings, &Silent).unwrap()
}

#[test]
#[ignore = "second tier: CPU time, run by .ci/run"]
fn the_draws_depend_neither_on_the_cut_nor_on_the_order_nor_on_threads() {
    let folder = tempfile::tempdir().unwrap();
    let path = tolerance(folder.path(), 7);
    let one = in_shards(&path, &folder.path().join("one"), 7);
    let many = in_shards(&path, &folder.path().join("many"), 3);
    assert_eq!((one.cut().shards(), many.cut().shards()), (1, 3));
    assert_eq!(one.key, many.key);
    let single = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    single.install(|| run_shard(&one, 0)).unwrap();
    let run = Run::open(&many, &Silent).unwrap();
    run.shards(&[2, 0, 1], &Silent).unwrap();
    let (a, b) = (merge(&one, 0, &Silent).unwrap(), merge(&many, 1, &Silent).unwrap());
    assert_eq!(a.draws, b.draws);
    assert_eq!(a.yields, b.yields);
    assert_ne!(a.draws[0].figures, a.draws[1].figures);
    write_page(&b, &report_files("result.csv"), folder.path()).unwrap();
    let page = fs::read_to_string(folder.path().join("report.html")).unwrap();
    assert!(page.contains("Worst draws"));
    b.write(&folder.path().join("result.csv")).unwrap();
    let csv = fs::read_to_string(folder.path().join("result.csv")).unwrap();
    assert!(csv.starts_with("draw,cd_bias_nm,defocus_um,"), "{csv}");
    assert_eq!(csv.lines().count(), 8);
    assert!(b.write(&folder.path().join("result.xls")).is_err());
    let table = folder.path().join("result.parquet");
    let written = b.write(&table);
    if cfg!(feature = "parquet") {
        written.unwrap();
        // The four bytes that such a file begins with.
        assert!(fs::read(&table).unwrap().starts_with(b"PAR1"));
    } else {
        assert_eq!(written.unwrap_err().id(), "study/no-parquet");
        assert!(!table.exists());
    }
}

/// A draw whose bias leaves nothing of the pillars is refused when the study is planned, and not in the middle of it.
#[test]
fn a_bias_that_pillars_cannot_have_is_refused_before_any_draw() {
    let folder = tempfile::tempdir().unwrap();
    let path = tolerance(folder.path(), 1);
    let text = fs::read_to_string(&path).unwrap();
    let mut made = Perturbation::default();
    made.geometry.cd_bias_nm = -150.0;
    let model = CalibratedModel::new("chip".into(), "too thin".into(), made);
    model.write(&folder.path().join("model.toml")).unwrap();
    let other = text
        .replacen("effect = \"cd_bias\"", "effect = \"film_height\"", 1)
        .replacen("draws = 1\n", "draws = 1\nmodel = \"model.toml\"\n", 1);
    fs::write(&path, other).unwrap();
    let error = plan(&path, &folder.path().join("study"), PlanSettings::default(), &Silent).unwrap_err();
    assert_eq!(error.id(), "model/bias-out-of-range");
    // The draw is named.
    assert!(
        matches!(&error, Error::Invalid { what, .. } if what.starts_with("draw 0 ")),
        "{error}"
    );
}

/// Without anything random, a design of a grid and the same design in a separate file have the same figures to the bit.
#[test]
#[ignore = "second tier: CPU time, run by .ci/run"]
fn a_design_of_a_grid_is_the_design_of_its_own_file() {
    let folder = tempfile::tempdir().unwrap();
    let (grid, own) = (folder.path().join("grid"), folder.path().join("own"));
    let draws = |folder: &Path, keys: &str, change: &[(&str, &str)]| {
        fs::create_dir(folder).unwrap();
        let path = tolerance(folder, 1);
        let text = fs::read_to_string(&path).unwrap();
        let (head, limit) = (
            &text[..text.find("[[vary]]").unwrap()],
            &text[text.find("[[limit]]").unwrap()..],
        );
        let bias = "[[grid]]\neffect = \"cd_bias\"\nvalues = [-2.0, 3.0]\n";
        fs::write(&path, format!("{head}{bias}{keys}{limit}")).unwrap();
        let design = fs::read_to_string(folder.join("design.toml")).unwrap();
        let design = change.iter().fold(design, |text, (from, to)| {
            assert!(text.contains(from), "{from}");
            text.replace(from, to)
        });
        fs::write(folder.join("design.toml"), design).unwrap();
        let plan = in_shards(&path, &folder.join("study"), 2);
        run_shard(&plan, 0).unwrap();
        let draws = merge(&plan, 0, &Silent).unwrap().draws;
        let figures: Vec<_> = draws.into_iter().map(|d| (d.figures, d.reached)).collect();
        (figures, fs::read(plan.folder.join("layout.gds")).unwrap())
    };
    let keys = "[[grid]]\nkey = \"lens.focal_length_um\"\nvalues = [40]\n\
                [[grid]]\nkey = \"cell.pillar_height_nm\"\nvalues = [640]\n";
    let change = [
        ("focal_length_um = 48", "focal_length_um = 40"),
        ("pillar_height_nm = 700", "pillar_height_nm = 640"),
    ];
    let (of_grid, of_file) = (draws(&grid, keys, &[]), draws(&own, "", &change));
    assert_eq!(of_grid.0.len(), 2);
    assert!(of_grid == of_file);
}

/// A grid over the design beside what is drawn.
#[test]
#[ignore = "second tier: CPU time, in scripts/slow_tests.sh"]
fn designs_of_a_grid_are_each_judged_by_their_own_layout_and_tables() {
    let folder = tempfile::tempdir().unwrap();
    let path = tolerance(folder.path(), 3);
    let text = fs::read_to_string(&path).unwrap()
        + "[[grid]]\nkey = \"lens.focal_length_um\"\nvalues = [48, 40]\n\
           [[grid]]\nkey = \"cell.pillar_height_nm\"\nvalues = [700, 640]\n\
           [[grid]]\neffect = \"stray_light\"\nvalues = [0.0, 0.2]\n";
    fs::write(&path, text).unwrap();
    let one = in_shards(&path, &folder.path().join("one"), 24);
    let many = in_shards(&path, &folder.path().join("many"), 5);
    assert_eq!((one.draws, one.key == many.key), (24, true));
    // The focal length changes the layout, not the pillars: tables are of two heights.
    assert_eq!((one.layouts.len(), one.stacks), (4, 2));
    assert_eq!(one.cells[0], one.cells[1]);
    assert_ne!(one.cells[1], one.cells[2]);
    run_shard(&one, 0).unwrap();
    let run = Run::open(&many, &Silent).unwrap();
    run.shards(&[4, 1, 0, 3, 2], &Silent).unwrap();
    let (a, b) = (merge(&one, 0, &Silent).unwrap(), merge(&many, 0, &Silent).unwrap());
    assert_eq!(a.draws, b.draws);
    // Values are recorded with the draw.
    let last = &a.draws[23];
    assert_eq!(last.design["lens.focal_length_um"], Scalar::Whole(40));
    assert_eq!(last.design["cell.pillar_height_nm"], Scalar::Whole(640));
    assert_eq!(last.amounts[..3], [0.2, 40.0, 640.0]);
    let strehl = |k: usize| a.draws[k].figures["strehl_660nm_0deg"].unwrap();
    assert_ne!(strehl(0), strehl(6));
    // Figures by value: all draws of a value, and their mean.
    assert_eq!((a.grid.len(), a.combinations.len()), (6, 8));
    let short = a.grid.iter().find(|p| p.at[0].1 == Scalar::Whole(40)).unwrap();
    assert_eq!((short.at[0].0.as_str(), short.draws), ("lens.focal_length_um", 12));
    let of_it = a.draws.iter().filter(|d| d.amounts[1] == 40.0);
    let mean = of_it.map(|d| d.figures["strehl_660nm_0deg"].unwrap()).sum::<f64>() / 12.0;
    // The same twelve numbers, added in the same order.
    assert_eq!(short.figures["strehl_660nm_0deg"].mean, mean);
    write_page(&a, &report_files("result.csv"), folder.path()).unwrap();
    let page = fs::read_to_string(folder.path().join("report.html")).unwrap();
    for part in ["Over the grid", "lens.focal_length_um", "Combinations"] {
        assert!(page.contains(part), "{part}");
    }
    a.write(&folder.path().join("result.csv")).unwrap();
    let csv = fs::read_to_string(folder.path().join("result.csv")).unwrap();
    assert!(
        csv.starts_with("draw,stray_light,lens.focal_length_um,cell.pillar_height_nm,cd_bias_nm,defocus_um,"),
        "{csv}"
    );
    assert!(csv.contains("\n23,0.2,40,640,"), "{csv}");
}

/// A text with the digest of what it says in the place of its last line.
fn sealed(text: &str) -> String {
    let body = &text[..=text.trim_end().rfind('\n').unwrap()];
    let digest = metalith_core::text::hex(&sha2::Sha256::digest(body));
    format!("{body}{{\"sha256\":\"{digest}\"}}\n")
}

/// Numbers that no plan has are refused at once, with a right digest as well.
fn manifests_are_held_to_their_digests(study: &Path) {
    let path = study.join("plan.json");
    let own = fs::read_to_string(&path).unwrap();
    let refused = |text: &str| {
        fs::write(&path, text).unwrap();
        Work::open(study).err().unwrap().id()
    };
    let many = own.replace("\"draws\": 4", "\"draws\": 18446744073709551615");
    assert_ne!(many, own);
    assert_eq!(refused(&many), "study/plan-damaged");
    let (fields, _) = many.split_once(",\n  \"sha256\"").unwrap();
    let digest = metalith_core::text::hex(&sha2::Sha256::digest(fields));
    let sealed = format!("{fields},\n  \"sha256\": \"{digest}\"\n}}\n");
    assert_eq!(refused(&sealed), "study/plan-out-of-range");
    assert_eq!(refused(&format!("{fields}\n}}\n")), "study/version-differs");
    fs::write(&path, own).unwrap();
}

#[test]
#[ignore = "second tier: CPU time, run by .ci/run"]
fn shards_are_whole_are_of_one_plan_and_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let path = tolerance(folder.path(), 4);
    let study = folder.path().join("study");
    let made = in_shards(&path, &study, 2);
    assert_eq!(
        in_shards(&path, &study, 4),
        made,
        "a study that is planned keeps its cut"
    );
    let refusal = |result: Result<_>| result.err().unwrap();
    let missing = refusal(merge(&made, 0, &Silent).map(|_| ()));
    assert_eq!(missing.id(), "study/draws-missing");
    insta::assert_snapshot!(metalith_testing::without_folder(missing, folder.path()), @r"
    4 of 4 draws are missing in study/shards: 0-3
      help: make them with `metalith study run FOLDER --missing`
    ");
    run_shard(&made, 0).unwrap();
    // A shard that is there is left as it is, without reading anything else.
    let bank = study.join("cells.bank");
    let kept = fs::read(&bank).unwrap();
    fs::remove_file(&bank).unwrap();
    run_shard(&made, 0).unwrap();
    let refused = refusal(run_shard(&made, 1));
    assert!(
        matches!(&refused, Error::Io { path, .. } if *path == bank),
        "a shard makes no tables: {refused:?}"
    );
    fs::write(&bank, &kept[..kept.len() - 1]).unwrap();
    assert_eq!(refusal(run_shard(&made, 1)).id(), "study/tables-unreadable");
    fs::write(&bank, &kept).unwrap();
    run_shard(&made, 1).unwrap();
    assert_eq!(made.cut().status().unwrap().finished, 2);
    // The same draws twice.
    let twice = made.cut().path(7);
    fs::copy(made.cut().path(0), &twice).unwrap();
    let double = refusal(merge(&made, 0, &Silent).map(|_| ()));
    assert_eq!(double.id(), "study/shard-range-differs");
    fs::remove_file(&twice).unwrap();
    // A part of another plan.
    let own = fs::read_to_string(made.cut().path(1)).unwrap();
    fs::write(made.cut().path(1), sealed(&own.replace(&made.key, &"0".repeat(64)))).unwrap();
    let foreign = refusal(run_shard(&made, 1));
    assert_eq!(foreign.id(), "study/shard-of-another-plan");
    assert!(merge(&made, 0, &Silent).is_err());
    assert_eq!(made.cut().status().unwrap().unusable.len(), 1);
    // Draws that somebody changed, with the digest of what is there now.
    let number = |from: &str| {
        let at = own.find(from).unwrap() + from.len();
        let end = at + own[at..].find([',', ']']).unwrap();
        own[..at].to_owned() + "0.5" + &own[end..]
    };
    let (before, after) = own.split_once("\"reached\":[").unwrap();
    let cut = format!("{before}\"reached\":[{}", &after[after.find(']').unwrap()..]);
    // Each of these draws misses a limit.
    let verdict = own.replacen("\"passed\":false", "\"passed\":true", 1);
    assert_ne!(verdict, own);
    for (text, id) in [
        (&cut, "study/damaged-draw"),
        (&number("\"amounts\":["), "study/draws-differ"),
        (&verdict, "study/draws-differ"),
    ] {
        fs::write(made.cut().path(1), sealed(text)).unwrap();
        assert_eq!(refusal(merge(&made, 0, &Silent).map(|_| ())).id(), id);
    }
    // One that is damaged and one that was cut are named, and made again to the byte.
    fs::write(made.cut().path(1), own.replacen("\"reached\":[", "\"reached\":[1", 1)).unwrap();
    let first = fs::read_to_string(made.cut().path(0)).unwrap();
    fs::write(made.cut().path(0), &first[..first.len() - 200]).unwrap();
    let damaged = refusal(merge(&made, 0, &Silent).map(|_| ()));
    assert_eq!(damaged.id(), "study/shards-damaged");
    let words = damaged.to_string();
    for part in ["000000.jsonl ends before its digest", "000001.jsonl is damaged"] {
        assert!(words.contains(part), "{words}");
    }
    assert_eq!(made.cut().status().unwrap().missing, [0, 1]);
    Work::Study(made.clone()).run(&[0, 1], &Silent).unwrap();
    assert_eq!(fs::read_to_string(made.cut().path(1)).unwrap(), own);
    merge(&made, 0, &Silent).unwrap();
    manifests_are_held_to_their_digests(&study);
    // A design that has changed since.
    let design = folder.path().join("design.toml");
    let text = fs::read_to_string(&design).unwrap();
    fs::write(&design, text.replace("window_samples = 32", "window_samples = 34")).unwrap();
    let changed = refusal(Run::open(&made, &Silent).map(|_| ()));
    assert_eq!(changed.id(), "study/plan-differs");
    assert!(plan(&path, &study, PlanSettings::default(), &Silent).is_err());
}

#[test]
#[ignore = "second tier: CPU time, run by .ci/run"]
fn a_limit_on_no_figure_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = tolerance(folder.path(), 1);
    let text = fs::read_to_string(&path)
        .unwrap()
        .replace("strehl_660nm_0deg", "strehl_670nm_0deg");
    fs::write(&path, text).unwrap();
    let error = plan(&path, &folder.path().join("s"), PlanSettings::default(), &Silent).unwrap_err();
    assert_eq!(error.id(), "study/unknown-figure");
    // What there is is named.
    let text = error.to_string();
    let [unknown, known] = ["strehl_670nm_0deg", "strehl_660nm_0deg"].map(|figure| text.contains(figure));
    assert!(unknown && known, "{text}");
}

/// Tables of draws are interpolated: what this does to a picture that `metalith picture` restores (dB).
const INTERPOLATED_DB: f64 = 0.05;

/// The picture of a chip without faults is that of `metalith picture`; a chip that is 30 % out of focus loses more if its
/// restoration does not know it.
#[test]
#[ignore = "second tier: CPU time, in scripts/slow_tests.sh"]
fn pictures_are_figures_of_a_draw() {
    let folder = tempfile::tempdir().unwrap();
    let path = tolerance(folder.path(), 1);
    fs::write(folder.path().join("camera.toml"), SMALL_CAMERA).unwrap();
    let text = fs::read_to_string(&path).unwrap();
    let head = &text[..text.find("[[vary]]").unwrap()];
    let psnr = |kernels: &str| {
        let grid = "[[grid]]\neffect = \"defocus\"\nvalues = [0.0, 14.0]\n";
        let picture = format!(
            "[picture]\ncamera = \"camera.toml\"\nscene = \"star\"\npixels = 64\nfield_deg = 50\nnodes = 5\nkernels = \"{kernels}\"\n"
        );
        let limit = "[[limit]]\nfigure = \"picture_psnr_db_centre\"\nat_least = 1.0\n";
        fs::write(&path, format!("{head}{grid}{picture}{limit}")).unwrap();
        let plan = in_shards(&path, &folder.path().join(kernels), 2);
        run_shard(&plan, 0).unwrap();
        let merged = merge(&plan, 1, &Silent).unwrap();
        assert_eq!(merged.shown[0].record.draw, merged.worst[0]);
        assert!(merged.shown[0].picture.is_some());
        write_page(&merged, &report_files("result.csv"), &plan.folder).unwrap();
        let page = fs::read_to_string(plan.folder.join("report.html")).unwrap();
        assert!(page.contains("frame as recorded"));
        let figures = merged.draws.iter().map(|d| d.figures.clone());
        figures.collect::<Vec<_>>()
    };
    let (own, designed) = (psnr("draw"), psnr("design"));
    let of = |figures: &std::collections::BTreeMap<String, Option<f64>>, key: &str| figures[key].unwrap();

    let design = metalith_design::Design::read(&folder.path().join("design.toml")).unwrap();
    let camera = metalith_sensor::Camera::read(&folder.path().join("camera.toml")).unwrap();
    let scene = chart(BuiltIn::Star, 64, 50.0, f64::INFINITY);
    let layout = folder.path().join("draw/layout.gds");
    let pillars = metalith_layout::read_pillars(&design, &layout, &Silent).unwrap();
    let cells = metalith_design::cell_models(&design, &[metalith_cell::Fidelity::Rigorous]).unwrap();
    let case = metalith_optics::SimulationCase::from(cells[0].as_ref());
    let system = ImagingSystem::of_pillars(&design, &pillars, case, &camera, &scene, Some(5), &Silent).unwrap();
    let frame = system.record(&system.simulation(), &scene, 1).unwrap();
    let operator = system.restoration();
    let error = ForecastScene::new(&system, &operator).operator_error;
    let method = RestorationMethod::Tikhonov;
    let picture = system
        .restore(&operator, &error, &frame, method, true, &Silent)
        .unwrap();
    let direct = scores(&picture, &system.truth(&scene)).unwrap();
    for (score, key) in direct.iter().zip(["picture_psnr_db", "picture_psnr_db_centre"]) {
        let drawn = of(&own[0], key);
        assert!(
            (drawn - score.psnr_db).abs() < INTERPOLATED_DB,
            "{key}: {drawn} for {}",
            score.psnr_db
        );
    }
    // Without a fault the chip that is known is the chip itself.
    assert_eq!(own[0], designed[0]);
    let lost = |figures: &[_]| of(&figures[0], "picture_psnr_db_centre") - of(&figures[1], "picture_psnr_db_centre");
    assert!(lost(&own) > 0.0, "{}", lost(&own));
    assert!(lost(&designed) > lost(&own), "{} for {}", lost(&designed), lost(&own));
    assert!(own[0].contains_key("forecast_psnr_linear_db_corner"));
}

#[test]
fn mistakes_of_a_picture_are_told_with_their_place() {
    let folder = tempfile::tempdir().unwrap();
    let path = tolerance(folder.path(), 1);
    let text = fs::read_to_string(&path).unwrap();
    let bad = "[picture]\ncamera = \"no.toml\"\nscene = \"none.png\"\npixels = 64\nnodes = 4\nmethod = \"magic\"\n";
    fs::write(&path, format!("{text}{bad}")).unwrap();
    let error = metalith_study::Tolerance::read(&path).unwrap_err();
    for (kind, key) in [
        (FaultKind::Inconsistent, "picture.pixels"),
        (FaultKind::Inconsistent, "picture.nodes"),
        (FaultKind::UnknownChoice, "picture.method"),
    ] {
        assert!(error.has_fault(kind, key), "{kind:?} {key}: {error}");
    }
}
