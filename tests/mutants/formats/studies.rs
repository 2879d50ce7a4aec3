//! Folders of work that is cut into shards: manifests and shards of each kind of work.

use std::fs;
use std::path::{Path, PathBuf};

use metalith::Silent;
use metalith::study::{Work, merge};
use metalith_testing::design;
use serde_json::{Value, json};

use super::{Format, Kind};
use crate::damage::{Ending, PLAN_ENDING, SHARD_ENDING};

/// Identities of refusals that say that a plan is of other files: these examples have none.
const OF_OTHER_FILES: [&str; 3] = ["study/plan-differs", "study/damaged-pairs", "file/operation-failed"];

/// Parts of each plan: two shards.
const PARTS: u64 = 4;

/// A manifest and the parts of one kind of work.
struct Example {
    names: [&'static str; 2],
    plan: Value,
    part: fn(u64) -> Value,
    per_shard: u64,
}

fn key() -> String {
    "5e".repeat(32)
}

/// All kinds of work.
fn examples(folder: &Path) -> Vec<Example> {
    let file = |name: &str| folder.join(name);
    let lens = fs::read_to_string(design("mini_3x3")).unwrap();
    fs::write(file("lens.toml"), lens.clone() + "\n[optimise.merit]\nsum = 1\n").unwrap();
    let study = json!({ "schema": 2, "key": key(), "tolerance": file("tolerance.toml"), "layouts": [{ "written": "layout.gds" }],
        "cells": ["cells.bank"], "quantities": [["defocus", "um"], ["cd_bias", "nm"]],
        "limits": [{ "key": "strehl", "limit": 0.5, "at_least": true }], "draws": PARTS, "draws_per_shard": 2,
        "seconds_per_draw": 0.118610293, "stacks": 1 });
    let origin =
        json!({ "design_sha256": key(), "layout_sha256": key(), "camera_sha256": key(), "model_sha256": null });
    let pairs = json!({ "schema": 2, "work": "dataset", "key": key(),
        "request": { "design": file("lens.toml"), "layout": file("layout.gds"), "camera": file("camera.toml"), "model": null,
            "field_deg": 20.0, "seed": 1, "images": (0..PARTS).map(|k| file(&format!("{k}.png"))).collect::<Vec<_>>() },
        "digests": vec![key(); PARTS as usize], "images_per_shard": 2, "seconds_per_image": 2.119576922,
        "head": { "design": "lens", "camera": "tiny", "made_from": origin, "seed": 1, "field_deg": 20.0, "black_level": 94,
            "white": 65535, "gain": [554.877655241861], "pairs": [] } });
    let starts = json!({ "schema": 1, "work": "starts", "key": key(), "design": file("lens.toml"), "starts": PARTS,
        "starts_per_shard": 2, "cells": ["table.bin"] });
    let compare = json!({ "schema": 1, "work": "compare", "key": key(), "comparison": { "camera": file("camera.toml"),
        "designs": (0..PARTS).map(|k| json!({ "name": format!("chip {k}"), "design": file("lens.toml"), "layout": file("layout.gds"),
            "camera": null, "field_deg": null })).collect::<Vec<_>>(),
        "lensless": [], "methods": ["tikhonov"], "separate": false, "paper": false, "field_deg": 60.0, "seed": 1,
        "photographs": [file("0.png")], "pixels": 256, "learnt": [], "lpips": null } });
    vec![
        Example {
            names: ["plan of a study", "draws"],
            plan: study,
            part: |k| {
                json!({ "draw": k, "amounts": [3.3233873098294744, -0.25], "figures": { "strehl": 0.7155385411474294, "mtf": null },
                    "reached": [0.7155385411474294], "passed": true })
            },
            per_shard: 2,
        },
        Example {
            names: ["plan of pairs", "pairs"],
            plan: pairs,
            part: |k| {
                json!({ "image": "scene.png", "image_sha256": key(), "frame": format!("000000-000999/{k:06}.frame.png"),
                    "frame_sha256": key(), "truth": format!("000000-000999/{k:06}.truth.png"), "truth_sha256": key() })
            },
            per_shard: 2,
        },
        Example {
            names: ["plan of starts", "starts"],
            plan: starts,
            part: |k| json!({ "start": k, "seed": 7, "from": "hyperbola", "merit": 0.61, "waves": vec![0.25; 86] }),
            per_shard: 2,
        },
        Example {
            names: ["plan of cameras", "cameras"],
            plan: compare,
            part: |k| json!({ "name": format!("chip {k}"), "words": "an array", "field_deg": 60.0, "ways": [], "frame_cpu_s": 0.5 }),
            per_shard: 1,
        },
    ]
}

/// A shard of an example, without the line of its digest.
fn shard(example: &Example, number: u64) -> String {
    let (first, end) = (number * example.per_shard, (number + 1) * example.per_shard);
    let header = json!({ "plan": key(), "shard": number, "first": first, "end": end, "instructions": "x86_64 avx2" });
    let lines = [header].into_iter().chain((first..end).map(example.part));
    lines.map(|line| format!("{line}\n")).collect()
}

/// State and all parts of the work of a folder, as `metalith study status` and `metalith study merge` read them.
fn read(folder: &Path) -> metalith::Result<()> {
    let work = Work::open(folder)?;
    let cut = work.cut();
    cut.status()?;
    cut.shard(0)?;
    let merged = match &work {
        Work::Study(plan) => merge(plan, 0, &Silent).map(drop),
        Work::Pairs(plan) => plan.merge(&Silent).map(drop),
        Work::Comparison(plan) => plan.merge(&Silent).map(drop),
        Work::Starts(plan) => plan.merge(&Silent).map(drop),
    };
    merged.or_else(|error| {
        if OF_OTHER_FILES.contains(&error.id()) {
            Ok(())
        } else {
            Err(error)
        }
    })
}

pub(super) fn all(folder: &Path) -> Vec<Format> {
    let mut all = Vec::new();
    for example in examples(folder) {
        let own = folder.join(example.names[1]);
        fs::create_dir_all(own.join("shards")).unwrap();
        let plan = format!("{:#}\n", example.plan);
        let shards: Vec<String> = (0..PARTS / example.per_shard).map(|n| shard(&example, n)).collect();
        let at = |n: usize| own.join("shards").join(format!("{n:06}.jsonl"));
        let mut files = vec![PLAN_ENDING.sealed(plan.as_bytes())];
        files.extend(shards.iter().map(|shard| SHARD_ENDING.sealed(shard.as_bytes())));
        fs::write(own.join("plan.json"), &files[0]).unwrap();
        for (n, shard) in files[1..].iter().enumerate() {
            fs::write(at(n), shard).unwrap();
        }
        let kind = |ending: &'static Ending| Kind::Ended(ending);
        let reads = |folder: PathBuf| move |_: &Path| read(&folder);
        let shards = files.split_off(1);
        all.push(Format::new(
            example.names[0],
            own.join("plan.json"),
            kind(&PLAN_ENDING),
            files,
            reads(own.clone()),
        ));
        // A format for one shard: the others stay whole.
        all.push(Format::new(
            example.names[1],
            at(0),
            kind(&SHARD_ENDING),
            vec![shards[0].clone()],
            reads(own.clone()),
        ));
    }
    all
}
