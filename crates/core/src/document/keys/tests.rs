use super::*;
use crate::document::{Limits, Section};

/// A reader whose keys depend on values.
fn read(root: &Section<'_, '_>) {
    root.integer("schema", 1..=1, "");
    let round = root.choice("shape", &[("square", false), ("circle", true)], Some(false));
    if round {
        root.float("diameter_um", Limits::new(5.0..=100.0, "um"));
    }
    root.float_or("pitch_nm", Limits::new(1.0..=f64::MAX, "nm"), 350.0);
    if let Some(limits) = root.optional_section("limits") {
        let kind = limits.text("kind");
        if limits.sound(&["limits.kind"]) && kind == "a" {
            limits.optional_integer("most", 0..=9, "");
        }
        limits.finish();
    }
    for item in root.sections("item") {
        item.array::<2>("offset_um", Limits::new(-1.0..=1.0, "um"));
        item.finish();
    }
    let layers = root.section_or_none("layers");
    for name in layers.keys() {
        layers.text(&name);
    }
    layers.finish();
    root.refuse("old", "an old key", "leave it out");
}

#[test]
fn keys_of_all_branches_are_found() {
    let table = explore(&[], |root, _| read(root));
    let names = |table: &KeyTable| table.keys().map(|(name, _)| name.to_owned()).collect::<Vec<_>>();
    assert_eq!(
        names(&table),
        ["diameter_um", "item", "layers", "limits", "pitch_nm", "schema", "shape"]
    );
    let required: Vec<_> = table
        .keys()
        .filter(|(name, _)| table.requires(name))
        .map(|(name, _)| name)
        .collect();
    assert_eq!(required, ["schema"]);
    let limits = &table.key("limits").unwrap().table;
    assert_eq!(names(limits), ["kind", "most"]);
    assert!(limits.requires("kind") && !limits.requires("most"));
    let layers = &table.key("layers").unwrap().table;
    assert_eq!(layers.others(), OtherKeys::Named);
    assert!(names(layers).is_empty() && layers.key(KeyTable::OF_THE_USER).unwrap().forms.text);
}

#[test]
fn forms_have_limits_units_and_defaults() {
    let table = explore(&[], |root, _| read(root));
    let pitch = table.key("pitch_nm").unwrap();
    assert_eq!(pitch.forms.number, Some([1.0, f64::MAX]));
    assert_eq!(pitch.forms.units, ["nm"]);
    assert_eq!(pitch.default(), Some(&Scalar::Number(350.0)));
    let shape = table.key("shape").unwrap();
    assert_eq!(shape.forms.words, ["square", "circle"]);
    assert_eq!(shape.default(), Some(&Scalar::Text("square".into())));
    let item = table.key("item").unwrap();
    assert!(item.forms.sections && item.table.requires("offset_um"));
    assert_eq!(
        item.table.key("offset_um").unwrap().forms.list.as_ref().unwrap().length,
        Some(2)
    );
}
