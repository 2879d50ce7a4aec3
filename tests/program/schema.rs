//! `metalith schema`, and what refers to it.

use std::fs;

use predicates::prelude::*;

use crate::{metalith, refusal};

#[test]
fn a_new_file_of_rules_refers_to_its_schema() {
    let folder = tempfile::tempdir().unwrap();
    let layout = metalith_testing::root().join("golden/foreign/gdstk_flat.gds");
    let mut program = metalith();
    program.current_dir(folder.path()).arg("check").arg(layout);
    program.args(["--new-rules", "mine.toml"]).assert().success();
    let text = fs::read_to_string(folder.path().join("mine.toml")).unwrap();
    assert!(text.starts_with("#:schema ./rules.schema.json\n"));
    let schema = fs::read_to_string(folder.path().join("rules.schema.json")).unwrap();
    let schema: serde_json::Value = serde_json::from_str(&schema).unwrap();
    assert_eq!(
        schema["required"],
        serde_json::json!(["layers", "name", "pillar_height_nm", "schema"])
    );
    let rule = &schema["properties"]["rule"]["items"];
    assert_eq!(rule["additionalProperties"], false);
    assert_eq!(rule["properties"]["severity"]["default"], "error");
    let angle = &rule["properties"]["min_deg"];
    assert_eq!((&angle["minimum"], &angle["maximum"]), (&1.into(), &179.into()));
    assert_eq!(angle["x-unit"], "degrees");
    assert!(angle["title"].is_string());
}

#[test]
fn a_schema_replaces_schemas_alone() {
    let folder = tempfile::tempdir().unwrap();
    let schema = |kind: &str| {
        let mut program = metalith();
        program.current_dir(folder.path());
        program.args(["schema", kind, "--out", "schema.json"]).assert()
    };
    schema("waivers").success();
    schema("slurm").success();
    fs::write(folder.path().join("schema.json"), "{}").unwrap();
    schema("slurm")
        .code(2)
        .stderr(predicate::str::contains(refusal("schema/not-replaced")));
    assert_eq!(fs::read_to_string(folder.path().join("schema.json")).unwrap(), "{}");
}

#[test]
fn all_kinds_are_listed() {
    let listed = metalith().args(["schema", "--list"]).assert().success();
    let listed = String::from_utf8(listed.get_output().stdout.clone()).unwrap();
    let names: Vec<_> = metalith::schema::FileKind::ALL.iter().map(|(name, ..)| *name).collect();
    assert_eq!(listed.lines().collect::<Vec<_>>(), names);
    metalith().arg("schema").assert().code(2);
}
