//! The standard deck for openings: for each rule a layout that breaks it once and only it.

use metalith_core::Silent;
use metalith_drc::CheckInput;

use crate::{broken, deck_from, input, layout};
use metalith_testing::gds::Gds;
use metalith_testing::lens::{Chip, cross_on};

/// Layer of the openings, and of their marks.
const OPEN: i16 = 2;
const MARKS: i16 = 4;

/// Parts of a file that can be drawn otherwise.
struct Draw {
    /// Half the edge of the opening over the lens (nm), and how far it is off along x.
    half: i32,
    off: i32,
    /// Arms of the marks; the last one is left out if false.
    all_marks: bool,
    /// More in the top cell, and cells before it.
    extra: fn(&mut Gds),
    before: fn(&mut Gds),
    after: fn(&mut Gds),
}

const CLEAN: Draw = Draw {
    half: 23_000,
    off: 0,
    all_marks: true,
    extra: |_| (),
    before: |_| (),
    after: |_| (),
};

/// A file, judged over the pillars of the clean chip: ids with their violations.
fn judge(draw: &Draw) -> Vec<(String, u64)> {
    let mut gds = Gds::library();
    (draw.before)(&mut gds);
    gds.cell("OPEN");
    square(&mut gds, draw.off, 0, draw.half);
    let corners = [(-1, -1), (1, -1), (-1, 1), (1, 1)];
    for (length, at) in [(1_000_000, 4_300_000), (200_000, 3_400_000)] {
        for (k, (sx, sy)) in corners.into_iter().enumerate() {
            if draw.all_marks || length > 200_000 || k < 3 {
                cross_on(&mut gds, MARKS, sx * at, sy * at, length, length / 100);
            }
        }
    }
    (draw.extra)(&mut gds);
    gds.end_cell();
    (draw.after)(&mut gds);
    let pillars = layout(Chip::clean().bytes());
    let with = CheckInput {
        with: vec![&pillars],
        ..input()
    };
    let deck = deck_from("rules/sin_apertures.toml", &[]);
    let report = metalith_drc::check(&layout(gds.end()), &deck, &with, &Silent).unwrap();
    assert_eq!(report.not_run(), 0);
    broken(&report).iter().map(|(id, n)| ((*id).to_owned(), *n)).collect()
}

fn square(gds: &mut Gds, x: i32, y: i32, half: i32) {
    gds.rect(OPEN, x - half, y - half, x + half, y + half);
}

/// A polygon on the layer of the marks, far from everything (um).
fn mark(gds: &mut Gds, points: &[(i32, i32)]) {
    let nm: Vec<_> = points.iter().map(|&(x, y)| (2_000_000 + 1000 * x, 1000 * y)).collect();
    gds.polygon(MARKS, &nm);
}

/// A rule and what is drawn otherwise. The lens of the clean chip reaches 21 um less half a gap. A mark of
/// another length is one that is not counted; `mark.complete` says nothing of those.
const CASES: &[(&str, Draw)] = &[
    (
        "opening.margin",
        Draw {
            half: 22_400,
            off: 1_000,
            ..CLEAN
        },
    ),
    ("opening.metal_on_pillars", Draw { off: 3_000, ..CLEAN }),
    (
        "opening.each",
        Draw {
            extra: |g| square(g, 1_000_000, 0, 23_000),
            ..CLEAN
        },
    ),
    (
        "layer.known",
        Draw {
            extra: |g| {
                g.rect(77, 0, 100_000, 1000, 101_000);
            },
            ..CLEAN
        },
    ),
    (
        "layer.text",
        Draw {
            extra: |g| {
                g.text(OPEN, "exposed?", 0, 100_000);
            },
            ..CLEAN
        },
    ),
    (
        "mark.complete",
        Draw {
            all_marks: false,
            ..CLEAN
        },
    ),
    (
        "cell.dangling",
        Draw {
            extra: |g| {
                g.sref("NOWHERE", 0, 0);
            },
            ..CLEAN
        },
    ),
    (
        "cell.one_top",
        Draw {
            after: |g| {
                g.cell("LOST").rect(10, 0, 0, 1000, 1000).end_cell();
            },
            ..CLEAN
        },
    ),
    (
        "cell.references",
        Draw {
            before: |g| {
                g.cell("W").rect(10, 0, 0, 1000, 1000).end_cell();
            },
            extra: |g| {
                (0..8193).for_each(|k| {
                    g.sref("W", 0, 100_000 + 10 * k);
                });
            },
            ..CLEAN
        },
    ),
];

#[test]
fn each_rule_is_broken_alone() {
    assert_eq!(judge(&CLEAN), []);
    let wrong: Vec<_> = CASES
        .iter()
        .map(|(id, draw)| (id, judge(draw)))
        .filter(|(id, found)| *found != [((**id).to_owned(), 1)])
        .collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// Rules of which one cannot be broken without another: all that are broken, and no more.
#[test]
fn rules_that_are_broken_together() {
    let judged = |extra: fn(&mut Gds)| -> Vec<String> {
        let found = judge(&Draw { extra, ..CLEAN });
        found.into_iter().map(|(id, _)| id).collect()
    };
    // A second opening needs a second lens, or it is one too many.
    assert_eq!(
        judged(|g| square(g, 50_000, 0, 10_000)),
        ["opening.each", "opening.gap"]
    );
    assert_eq!(
        judged(|g| square(g, 0, 0, 23_000)),
        ["opening.each", "opening.duplicate"]
    );
    assert_eq!(
        judged(|g| square(g, 30_000, 0, 10_000)),
        ["opening.each", "opening.overlap"]
    );
    assert_eq!(
        judged(|g| square(g, 3_400_000 + 112_000, 3_400_000, 200)),
        ["opening.each", "mark.keep_out"]
    );
}

/// A rule, and what is drawn to break it.
type Outline = (&'static str, fn(&mut Gds));

/// Outlines on the layer of the marks that no one asked for: each breaks its own rule, and the rule that the marks are
/// the marks of the deck.
const OUTLINES: &[Outline] = &[
    ("outline.doubled_vertex", |g| {
        mark(g, &[(0, 0), (0, 0), (40, 0), (40, 30), (0, 30), (0, 0)]);
    }),
    ("outline.self_crossing", |g| {
        mark(g, &[(0, 0), (30, 0), (30, 40), (40, 40), (40, 5), (0, 5), (0, 0)]);
    }),
    ("outline.acute", |g| mark(g, &[(0, 0), (40, 0), (0, 40), (0, 0)])),
    ("outline.vertices", |g| {
        let teeth = (0..60).flat_map(|k| [(2 * k, 0), (2 * k, 20), (2 * k + 1, 20), (2 * k + 1, 0)]);
        let back = [(119, -40), (0, -40), (0, 0)];
        mark(g, &teeth.chain(back).collect::<Vec<_>>());
    }),
    ("outline.zero_area", |g| mark(g, &[(0, 0), (40, 0), (40, 0), (0, 0)])),
];

#[test]
fn outlines_are_judged() {
    for (id, extra) in OUTLINES {
        let found = judge(&Draw { extra: *extra, ..CLEAN });
        assert!(found.iter().any(|f| f.0 == *id && f.1 == 1), "{id}: {found:?}");
        let others = found.iter().filter(|f| f.0 != *id && f.0 != "mark.complete").count();
        assert!(others == 0 || *id == "outline.zero_area", "{id}: {found:?}");
    }
}

/// Every rule of the deck is in one of the lists above.
#[test]
fn no_rule_is_left_out() {
    const TOGETHER: [&str; 4] = ["opening.gap", "opening.overlap", "opening.duplicate", "mark.keep_out"];
    let deck = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../rules/sin_apertures.toml")).unwrap();
    let ids = deck
        .lines()
        .filter_map(|l| l.strip_prefix("id = \""))
        .map(|l| l.split('"').next().unwrap());
    let mut count = 0;
    for id in ids {
        count += 1;
        let known = TOGETHER.contains(&id) || CASES.iter().any(|c| c.0 == id) || OUTLINES.iter().any(|c| c.0 == id);
        assert!(known, "{id}");
    }
    assert_eq!(count, CASES.len() + TOGETHER.len() + OUTLINES.len());
}
