use super::*;

#[test]
fn kinds_stand_in_the_order_of_their_numbers() {
    for (name, kind, _) in FileKind::ALL {
        assert_eq!(kind.name(), name);
        assert_eq!(FileKind::of_name(name), Some(kind));
        let schema: Value = serde_json::from_str(kind.schema()).unwrap();
        assert_eq!(schema["$id"], kind.id());
    }
}

/// `scripts/make_schemas.sh --compare` holds the others, which take longer, in `.ci/run`.
#[test]
fn schemas_are_those_of_the_readers() {
    for kind in [
        FileKind::Camera,
        FileKind::Waivers,
        FileKind::Process,
        FileKind::Study,
        FileKind::WidthSet,
    ] {
        // The order of keys depends on the features that serde_json is built with.
        let shipped: Value = serde_json::from_str(kind.schema()).unwrap();
        assert!(shipped == kind.schema_value(), "{}", kind.name());
    }
}
