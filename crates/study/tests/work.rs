//! Work other than draws in the shards of a study.

mod common;

use std::fs;
use std::path::{Path, PathBuf};

use common::{SMALL_CAMERA, tolerance};
use metalith_baselines::{Comparison, ComparisonResult, ExposureTimes, Lensless, ListedDesign, MaskSpec};
use metalith_core::{FolderLock, Silent};
use metalith_design::Design;
use metalith_imaging::scene::read_far_scene;
use metalith_imaging::{DatasetManifest, DatasetOrigin, ImagingSystem, write_dataset};
use metalith_optimise::{Checkpoint, OptimiseTask, TaskCells};
use metalith_study::{PairsRequest, Work, plan_comparison, plan_pairs, plan_starts};

/// The layout of a design, written into a folder.
fn layout_of(design: &Design, folder: &Path) -> PathBuf {
    let array = metalith_design::array::PillarArray::build(design, &Silent).unwrap();
    let layout = folder.join("layout.gds");
    metalith_layout::write_pillars(design, &array, design.layout.hierarchy, &layout, &Silent).unwrap();
    layout
}

/// An image of stripes that differ with its number.
fn image(folder: &Path, k: usize) -> PathBuf {
    let stripes = ndarray::Array3::from_shape_fn((64, 64, 3), |(y, x, c)| ((y * k + x + c) % 7) as f64 / 7.0);
    let path = folder.join(format!("image_{k}.png"));
    metalith_imaging::write_picture(&path, &stripes).unwrap();
    path
}

/// Frames of shards are those that one run writes, to the byte, and another image is noticed.
#[test]
#[ignore = "second tier: CPU time, run by .ci/run"]
fn pairs_of_shards_are_those_of_one_run() {
    let folder = tempfile::tempdir().unwrap();
    tolerance(folder.path(), 1);
    let at = |name: &str| folder.path().join(name);
    fs::write(at("camera.toml"), SMALL_CAMERA).unwrap();
    let design = Design::read(&at("design.toml")).unwrap();
    let layout = layout_of(&design, folder.path());
    let images: Vec<PathBuf> = (1..6).map(|k| image(folder.path(), k)).collect();
    let request = PairsRequest {
        design: at("design.toml"),
        layout: layout.clone(),
        camera: at("camera.toml"),
        model: None,
        field_deg: 50.0,
        exposure: metalith_sensor::StatedExposure::default(),
        seed: 3,
        images: images.clone(),
    };
    let planned = plan_pairs(&request, &at("parts"), Some(2), &Silent).unwrap();
    assert_eq!(plan_pairs(&request, &at("parts"), None, &Silent).unwrap(), planned);
    let Work::Pairs(work) = Work::open(&at("parts")).unwrap() else {
        panic!("the folder holds pairs");
    };
    assert_eq!(work.cut().shards(), 3);
    let run = |shards: &[u64]| Work::Pairs(work.clone()).run(shards, &Silent);
    run(&[2, 0]).unwrap();
    assert_eq!(work.cut().status().unwrap().missing, [1]);
    let missing = work.merge(&Silent).unwrap_err();
    assert_eq!(missing.id(), "study/draws-missing");
    insta::assert_snapshot!(metalith_testing::without_folder(missing, folder.path()), @r"
    2 of 5 pairs are missing in parts/shards: 2-3
      help: make them with `metalith study run FOLDER --missing`
    ");
    // Shards make no kernels.
    fs::rename(at("parts/kernels"), at("aside")).unwrap();
    assert_eq!(run(&[1]).unwrap_err().id(), "dataset/kernels-missing");
    fs::rename(at("aside"), at("parts/kernels")).unwrap();
    let kept = fs::read(&images[3]).unwrap();
    fs::copy(&images[0], &images[3]).unwrap();
    let changed = run(&[1]).unwrap_err();
    assert_eq!(changed.id(), "study/input-changed");
    assert!(changed.to_string().contains(&*images[3].to_string_lossy()), "{changed}");
    fs::write(&images[3], kept).unwrap();
    run(&[1]).unwrap();
    // A file that is not what its shard wrote is noticed, and made again with its shard.
    let (damaged, right) = (at("parts/000000-000999/000002.truth.png"), work.merge(&Silent).unwrap());
    let cut = fs::metadata(&damaged).unwrap().len() - 100;
    fs::File::options()
        .write(true)
        .open(&damaged)
        .unwrap()
        .set_len(cut)
        .unwrap();
    let refused = work.merge(&Silent).unwrap_err();
    assert_eq!(refused.id(), "study/damaged-pairs");
    insta::assert_snapshot!(metalith_testing::without_folder(refused, folder.path()), @r"
    1 files in parts/shards cannot be used: 000001.jsonl is of files that are damaged or missing, those of 2
      help: make them again with `metalith study run FOLDER --missing`
    ");
    let status = work.cut().status().unwrap();
    assert_eq!((status.missing, status.damaged.len()), (vec![1], 1));
    run(&[1]).unwrap();
    assert_eq!(work.merge(&Silent).unwrap(), right);
    let old = fs::read_to_string(at("parts/plan.json")).unwrap();
    fs::create_dir(at("old")).unwrap();
    fs::write(at("old/plan.json"), old.replacen("\"schema\": 2", "\"schema\": 1", 1)).unwrap();
    assert_eq!(Work::open(&at("old")).err().unwrap().id(), "study/plan-damaged");
    let bad = PairsRequest {
        images: [&images[..], &[at("camera.toml")]].concat(),
        ..request.clone()
    };
    let refused = plan_pairs(&bad, &at("bad"), None, &Silent).unwrap_err();
    assert_eq!(refused.id(), "scene/images-unusable");
    assert!(
        refused.to_string().contains(&*at("camera.toml").to_string_lossy()),
        "{refused}"
    );
    assert!(!at("bad/kernels").exists());

    let scene = |path: &Path| read_far_scene(path, 50.0);
    let camera = metalith_sensor::Camera::read(&at("camera.toml")).unwrap();
    let kept = metalith_imaging::KernelCache::made(&at("alone"));
    let first = scene(&images[0]).unwrap();
    let system = ImagingSystem::open_cached(&design, &layout, &camera, None, &first, &kept, &Silent).unwrap();
    let origin = DatasetOrigin::of(&design, &layout, &camera, None).unwrap();
    let write_of = |images: &[PathBuf], seed| {
        let head = DatasetManifest::of(&system, origin.clone(), seed);
        write_dataset(
            &system,
            &system.simulation(),
            images,
            &scene,
            head,
            &FolderLock::of(&at("alone")).unwrap(),
            &Silent,
        )
        .unwrap()
    };
    let write = |seed| write_of(&images, seed);
    let alone = write(3);
    assert_eq!((alone.black_level, alone.white), (64, 65535));
    assert_eq!(alone.made_from, origin);
    let names = (0..5).flat_map(|k| ["frame", "truth"].map(|n| format!("000000-000999/{k:06}.{n}.png")));
    for name in names.chain(["manifest.json".to_owned()]) {
        let [a, b] = ["parts", "alone"].map(|f| fs::read(at(f).join(&name)).unwrap());
        assert!(a == b, "{name}");
    }

    // A pair that is there is kept if it is of this image and seed, and made anew if not.
    let (frame, other) = (
        at("alone/000000-000999/000001.frame.png"),
        at("alone/000000-000999/000002.frame.png"),
    );
    let right = fs::read(&frame).unwrap();
    fs::copy(&other, &frame).unwrap();
    let untouched = fs::metadata(&other).unwrap().modified().unwrap();
    write(3);
    assert!(fs::read(&frame).unwrap() == right);
    assert_eq!(fs::metadata(&other).unwrap().modified().unwrap(), untouched);
    write(4);
    assert!(fs::read(&frame).unwrap() != right);
    // Pairs of a larger set go, files of others stay.
    fs::write(at("alone/000000-000999/000004.truth.png"), "of somebody else").unwrap();
    write_of(&images[..2], 4);
    let mut left: Vec<_> = fs::read_dir(at("alone/000000-000999")).unwrap().collect();
    left.sort_by_key(|entry| entry.as_ref().unwrap().file_name());
    let left = left
        .into_iter()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let expected = [
        "000000.frame",
        "000000.truth",
        "000001.frame",
        "000001.truth",
        "000004.truth",
    ];
    assert_eq!(left.collect::<Vec<_>>(), expected.map(|name| format!("{name}.png")));
}

/// The best of several starts, whoever makes them.
#[test]
#[ignore = "second tier: CPU time, run by .ci/run"]
fn starts_of_the_optimiser_are_runs_with_their_seeds() {
    let folder = tempfile::tempdir().unwrap();
    tolerance(folder.path(), 1);
    let path = folder.path().join("design.toml");
    let section = "\n[optimise]\nsolver = \"exchange\"\ncell = \"published\"\nchains = 2\nhot_sweeps = 3\nblocks = 4\nseed = 5\nstart = \"random\"\n";
    let text = fs::read_to_string(&path).unwrap();
    let cut = text.find("\n[optimise]").unwrap_or(text.len());
    fs::write(&path, format!("{}{section}", &text[..cut])).unwrap();
    let planned = plan_starts(&path, 3, 2, &folder.path().join("starts"), &Silent).unwrap();
    let work = Work::open(&planned.folder).unwrap();
    work.run(&[1, 0], &Silent).unwrap();
    let result = planned.merge(&Silent).unwrap();
    assert_eq!(result.starts.iter().map(|s| s.seed).collect::<Vec<_>>(), [5, 7, 9]);
    let best = result.starts.iter().map(|s| s.merit).fold(f64::MIN, f64::max);
    assert_eq!(result.starts[result.best].merit, best);
    // The second one is the design with its seed.
    let mut task = OptimiseTask::of(&Design::read(&path).unwrap()).unwrap();
    task.spec.seed = 7;
    let design = Design::read(&path).unwrap();
    let cells = TaskCells::of(&design, false, None, &Silent).unwrap();
    let own = task.solve(&cells.all(), Checkpoint::default(), &Silent).unwrap();
    // Numbers of a line of JSON come back to rounding.
    assert!((own.merit - result.starts[1].merit).abs() <= 1e-12 * own.merit.abs());
    let phase = fs::read_to_string(&result.phase).unwrap();
    assert!(phase.contains("The best of 3 starts"), "{phase}");
    let table = fs::read_to_string(planned.folder.join("starts.csv")).unwrap();
    assert_eq!(table.lines().count(), 4);
    fs::write(&path, text).unwrap();
    assert!(work.run(&[0], &Silent).is_ok(), "what is there needs no design");
    fs::remove_file(planned.cut().path(0)).unwrap();
    assert_eq!(work.run(&[0], &Silent).unwrap_err().id(), "study/plan-differs");
}

/// Cameras of shards have the scores of one run, and the page its pictures.
#[test]
#[ignore = "second tier: CPU time, run by .ci/run"]
fn cameras_of_shards_are_those_of_one_comparison() {
    let folder = tempfile::tempdir().unwrap();
    tolerance(folder.path(), 1);
    let at = |name: &str| folder.path().join(name);
    // Cameras without a lens are compared in colours.
    let mono = "[[channel]]\nname = \"mono\"\nband_nm = [600, 680]\nefficiency = 0.6\n";
    assert!(SMALL_CAMERA.contains(mono));
    let colours = ["red", "green", "blue"].iter().zip([620, 540, 460]);
    let three = colours.map(|(name, nm)| {
        format!(
            "[[channel]]\nname = \"{name}\"\nband_nm = [{nm}, {}]\nefficiency = 0.6\n",
            nm + 20
        )
    });
    let camera = SMALL_CAMERA.replace(mono, &three.collect::<String>());
    fs::write(at("camera.toml"), camera).unwrap();
    let design = Design::read(&at("design.toml")).unwrap();
    let comparison = Comparison {
        camera: at("camera.toml"),
        designs: vec![ListedDesign {
            name: Some("small".into()),
            layout: layout_of(&design, folder.path()),
            design: at("design.toml"),
            camera: None,
            field_deg: None,
        }],
        lensless: vec![Lensless::FlatCam(MaskSpec::standard())],
        methods: vec!["tikhonov".into()],
        separate: true,
        paper: true,
        field_deg: 50.0,
        seed: 2,
        photographs: (1..4).map(|k| image(folder.path(), k)).collect(),
        pixels: None,
        learnt: Vec::new(),
        lpips: None,
        // Less light would leave all of them at the longest time.
        exposure: metalith_sensor::StatedExposure {
            lux: Some(1e7),
            ..Default::default()
        },
        curve_lux: Vec::new(),
        times: ExposureTimes::Equal,
    };
    let planned = plan_comparison(&comparison, &at("parts"), &Silent).unwrap();
    assert_eq!(planned.cut().shards(), 4);
    let work = Work::open(&at("parts")).unwrap();
    work.run(&[1, 2, 3], &Silent).unwrap();
    let missing = planned.merge(&Silent).err().unwrap();
    assert_eq!(missing.id(), "study/draws-missing");
    insta::assert_snapshot!(metalith_testing::without_folder(missing, folder.path()), @r"
    1 of 4 cameras are missing in parts/shards: 0
      help: make them with `metalith study run FOLDER --missing`
    ");
    work.run(&[0], &Silent).unwrap();
    let merged = planned.merge(&Silent).unwrap();
    let kept = metalith_imaging::KernelCache::only(&at("parts"));
    let own = comparison.open(&Silent).unwrap();
    let own_ms = (0..4).map(|k| {
        let taken = own.take_first(k, 1, &kept, &Silent).unwrap();
        taken.light.unwrap().time_ms
    });
    let [least, most] = own_ms.fold([f64::INFINITY, 0.0f64], |[a, b], ms| [a.min(ms), b.max(ms)]);
    let equal_ms = own.equal_time_ms(&kept, &Silent).unwrap().unwrap();
    assert!(most > 1.1 * least, "own times differ: {least} to {most} ms");
    assert!(
        (0.99 * least..=least).contains(&equal_ms),
        "three digits of {least} ms: {equal_ms}"
    );
    assert_eq!(merged.unequal_times, None);
    let open = own.exposed_for(Some(equal_ms)).unwrap();
    let cameras = (0..4).map(|k| open.take(k, &kept, &Silent).unwrap()).collect();
    let direct = open.comparison(cameras);
    // Numbers of a line of JSON come back to rounding.
    let scores = |c: &ComparisonResult| {
        let ways = c.cameras.iter().flat_map(|camera| &camera.ways);
        let all = ways.flat_map(|w| w.mean.iter().chain(w.photographs.iter().flatten()));
        all.map(|s| (s.zone, (s.psnr_db * 1e9).round(), (s.ssim * 1e9).round()))
            .collect::<Vec<_>>()
    };
    assert_eq!(scores(&merged), scores(&direct));
    let names = merged.cameras.iter().map(|c| c.name.as_str()).collect::<Vec<_>>();
    let expected = [
        "small",
        "small, paper's assumptions",
        "FlatCam, ours",
        "FlatCam, ours, no dispersion",
    ];
    assert_eq!(names, expected);
    assert!(merged.cameras.iter().all(|c| c.shown.is_some()));
    metalith_baselines::write_comparison(&merged, &FolderLock::of(&at("page")).unwrap()).unwrap();
    let page = fs::read_to_string(at("page/compare.html")).unwrap();
    for part in ["Pictures of small", "Pictures of FlatCam, ours"] {
        assert!(page.contains(part), "{part}");
    }
    fs::remove_file(planned.cut().path(1)).unwrap();
    fs::copy(&comparison.photographs[0], &comparison.photographs[1]).unwrap();
    assert_eq!(work.run(&[1], &Silent).unwrap_err().id(), "study/plan-differs");
}
