//! Tests of what the decks of dose matrix and test structures ask and the deck of the chip does not.

use metalith_core::Silent;
use metalith_drc::{DrcReport, Status};
use metalith_gds::Layout;

use crate::{broken, deck_from, input, layout};
use metalith_testing::gds::Gds;
use metalith_testing::lens::PITCH;

/// Sites an axis of the pads here.
const SITES: i32 = 40;

/// A pad of pillars of one width, its lower left site at a place.
fn pad(gds: &mut Gds, layer: i16, (x, y): (i32, i32), width: i32) {
    for k in 0..SITES * SITES {
        gds.square(layer, x + PITCH * (k % SITES), y + PITCH * (k / SITES), width);
    }
}

fn judge(deck: &str, changes: &[(&str, &str)], gds: &mut Gds) -> DrcReport {
    let layout: Layout = layout(gds.end_cell().end());
    metalith_drc::check(&layout, &deck_from(deck, changes), &input(), &Silent).unwrap()
}

/// Shapes on the layer of another dose count as near, doubled and known, as on the same layer.
#[test]
fn doses_are_exposed_on_one_wafer() {
    const LAYERS: &[(&str, &str)] = &[(
        "[\"20/1\", \"20/2\", \"20/3\", \"20/4\", \"20/5\", \"20/6\", \"20/7\", \"20/8\", \"20/9\"]",
        "[\"20/0\", \"21/0\"]",
    )];
    let two = || {
        let mut gds = Gds::library();
        gds.cell("DOSES");
        pad(&mut gds, 20, (0, 0), 200);
        pad(&mut gds, 21, (100_000, 0), 120);
        gds
    };
    let clean = judge("rules/dose_matrix.toml", LAYERS, &mut two());
    assert_eq!((broken(&clean), clean.exit_code()), (vec![], 0));
    assert_eq!(
        (clean.elements, clean.pillars_on_lattices),
        (2, 2 * (SITES * SITES) as u64)
    );
    // Beside the first pad: 40 nm from it, and over a pillar of it, both in the other dose.
    let mut near = two();
    near.square(21, -100 - 40 - 60, 0, 120).square(21, PITCH, PITCH, 120);
    let report = judge("rules/dose_matrix.toml", LAYERS, &mut near);
    let found = broken(&report);
    assert!(
        found.contains(&("gap.min", 1)) && found.contains(&("gap.overlap", 1)),
        "{found:?}"
    );
    assert!(!found.iter().any(|f| f.0 == "layer.known"), "{found:?}");
    // Another layer is no dose.
    let mut strange = two();
    strange.rect(22, 0, -50_000, 200, -49_800);
    let report = judge("rules/dose_matrix.toml", LAYERS, &mut strange);
    assert_eq!(broken(&report), [("layer.known", 1)]);
}

/// The frame of the test structures is what is drawn on its layer; without one the rule does not run.
#[test]
fn structures_stay_in_their_frame() {
    let with_frame = |frame: bool, outside: bool| {
        let mut gds = Gds::library();
        gds.cell("TESTS");
        pad(&mut gds, 1, (40_000, 40_000), 200);
        if frame {
            gds.rect(10, 0, 0, 200_000, 200_000);
        }
        if outside {
            gds.rect(3, 199_000, 100_000, 201_000, 102_000);
        }
        judge("rules/test_structures.toml", &[], &mut gds)
    };
    assert_eq!(with_frame(true, false).exit_code(), 0);
    let report = with_frame(true, true);
    assert_eq!((broken(&report), report.exit_code()), (vec![("layer.frame", 1)], 1));
    let report = with_frame(false, false);
    let frame = report.rules.iter().find(|r| r.id == "layer.frame").unwrap();
    assert!(matches!(frame.status, Status::Skipped(_)));
    assert_eq!(report.exit_code(), 3);
}
