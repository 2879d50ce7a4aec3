//! Tests of the same hand-off in the other format.

use metalith_core::Silent;
use metalith_drc::diff::{DiffPlan, diff};
use metalith_gds::{FileFormat, Layout};
use metalith_handoff::{HandoffOptions, Manifest, handoff, verify_handoff};
use metalith_layout::{LayoutFormat, OasisEncoding};

use crate::{options, shared};

/// Every layout of a hand-off in OASIS holds what that in GDSII holds, its checks say the same, and it is whole.
#[test]
fn layouts_in_oasis_are_those_in_gdsii() {
    let folder = tempfile::tempdir().unwrap();
    let made = handoff(
        &HandoffOptions {
            format: LayoutFormat::Oasis(OasisEncoding::Compact),
            ..options(&folder.path().join("out"))
        },
        &Silent,
    )
    .unwrap();
    let layouts: Vec<&String> = made
        .manifest
        .files
        .keys()
        .filter(|name| name.ends_with(".oas"))
        .collect();
    assert_eq!(layouts.len(), 7);
    assert!(!made.manifest.files.keys().any(|name| name.ends_with(".gds")));
    for name in layouts {
        let oasis = Layout::open(&made.folder.join(name)).unwrap();
        let gds = Layout::open(&shared().join(name.replace(".oas", ".gds"))).unwrap();
        assert_eq!((oasis.format(), gds.format()), (FileFormat::Oasis, FileFormat::Gds));
        assert!(
            diff(&oasis, &gds, &DiffPlan::default(), &Silent).unwrap().same_geometry,
            "{name}"
        );
    }
    assert!(verify_handoff(&made.folder, &Silent).unwrap().holds());
    let text = std::fs::read(shared().join("manifest.json")).unwrap();
    let other: Manifest = serde_json::from_slice(&text).unwrap();
    let verdicts = |m: &Manifest| serde_json::to_value(m).unwrap()["checks"].clone();
    assert_eq!(verdicts(&made.manifest), verdicts(&other));
}
