//! The deck for rotated rectangles: a clean chip, and for each rule of theirs one that breaks it.

use metalith_core::Silent;
use metalith_drc::CheckInput;
use metalith_pillars::{RotatedRectangles, UprightRectangles};
use metalith_testing::gds::Gds;

use crate::on_lattice::{broken_on_lattice, site};
use crate::{broken, deck_from, input, layout};

/// Sites an axis and their distance (nm).
const SITES: i32 = 12;
const PITCH: i32 = 354;
const PILLARS: RotatedRectangles = RotatedRectangles {
    width_nm: 100,
    length_nm: 250,
    steps: 180,
};

fn pillar(gds: &mut Gds, (x, y): (i32, i32), number: u16) {
    let corners = PILLARS.on_grid(number);
    let closed = corners.iter().chain(corners.first());
    let points: Vec<(i32, i32)> = closed.map(|&(dx, dy)| (x + dx as i32, y + dy as i32)).collect();
    gds.polygon(1, &points);
}

fn place(column: i32, row: i32) -> (i32, i32) {
    site(PITCH, SITES, column, row)
}

/// Rules that a lattice of rectangles breaks whose rotations are as `number` says, with `more` on it; `rules` are added.
fn found(
    rules: &[(&str, &str)],
    number: impl Fn(i32, i32) -> Option<u16>,
    more: impl Fn(&mut Gds),
) -> (Vec<(String, u64)>, u64) {
    broken_on_lattice(
        &deck_from("rules/rectangles.toml", rules),
        SITES,
        |gds, column, row| {
            if let Some(number) = number(column, row) {
                pillar(gds, place(column, row), number);
            }
        },
        more,
    )
}

/// Rotations from 13 to 167 degrees: none is upright.
fn all(column: i32, row: i32) -> Option<u16> {
    Some(13 + ((column * 17 + row * 31) % 155) as u16)
}

#[test]
fn each_rule_of_rectangles_finds_what_it_is_for() {
    assert_eq!(found(&[], all, |_| {}), (vec![], 144));

    let but_one = |column: i32, row: i32| {
        if (column, row) == (5, 5) {
            None
        } else {
            all(column, row)
        }
    };
    let (x, y) = place(5, 5);
    let trapezoid = found(&[], but_one, |gds| {
        let points = [(-100, -50), (100, -50), (60, 50), (-60, 50), (-100, -50)];
        gds.polygon(1, &points.map(|(dx, dy)| (x + dx, y + dy)));
    });
    assert_eq!(trapezoid, (vec![("pillar.rectangle".into(), 1)], 143));

    // Two with their long edges in one line are 354 - 250 nm apart; two that are rotated by 45 degrees 150 nm.
    let wide_gap = [("nm = 40", "nm = 104.5")];
    let upright = |column: i32, row: i32| column == 5 && (row == 5 || row == 6);
    let near = found(&wide_gap, |c, r| Some(if upright(c, r) { 180 } else { 45 }), |_| {});
    assert_eq!(near, (vec![("gap.min".into(), 1)], 144));

    let twice = found(&[], all, |gds| pillar(gds, (x, y), all(5, 5).unwrap()));
    assert_eq!(twice, (vec![("gap.duplicate".into(), 1)], 144));
    let other = found(&[], all, |gds| pillar(gds, (x, y), 30 + all(5, 5).unwrap()));
    assert_eq!(other, (vec![("gap.overlap".into(), 1)], 144));
}

/// Upright ones of several sizes: gaps of their own edges, and what is no whole step of a beam.
#[test]
fn rules_see_the_edges_of_upright_rectangles() {
    const SIZES: UprightRectangles = UprightRectangles {
        shortest_nm: 100,
        step_nm: 20,
        lengths: 9,
    };
    let upright = |gds: &mut Gds, (x, y): (i32, i32), edges: [u16; 2]| {
        let corners = SIZES.on_grid(SIZES.number(edges).unwrap());
        let points: Vec<(i32, i32)> = corners.map(|(dx, dy)| (x + dx as i32, y + dy as i32)).to_vec();
        gds.polygon(1, &[&points[..], &points[..1]].concat());
    };
    let edges = |column: i32, row: i32| match (column, row) {
        (5 | 6, 5) => [260, 100],
        _ => [100 + 20 * (column * 5 % 7) as u16, 120 + 20 * (row * 3 % 6) as u16],
    };
    let found = |rules: &[(&str, &str)]| {
        let deck = deck_from("rules/rectangles.toml", rules);
        let draw = |gds: &mut Gds, column: i32, row: i32| upright(gds, place(column, row), edges(column, row));
        broken_on_lattice(&deck, SITES, draw, |_| {})
    };
    assert_eq!(found(&[]), (vec![], 144));
    // Those two are 354 - 260 nm apart, all others farther.
    assert_eq!(found(&[("nm = 40", "nm = 94.5")]), (vec![("gap.min".into(), 1)], 144));
    assert_eq!(found(&[("nm = 40", "nm = 93.5")]), (vec![], 144));
    let beam = |step: u32| {
        let rule = format!(
            "[[rule]]\nid = \"beam\"\ncheck = \"exposure_grid\"\nbeam_step_nm = {step}\n\n[[rule]]\nid = \"gap.min\""
        );
        found(&[("[[rule]]\nid = \"gap.min\"", &rule)])
    };
    let (broken, _) = beam(2);
    assert!(broken.is_empty(), "{broken:?}");
    // Every pillar with an edge along x or along y that is no multiple, beside the pitch, which is none.
    let off = |nm: u16| !nm.is_multiple_of(40);
    let sites = (0..SITES).flat_map(|row| (0..SITES).map(move |column| edges(column, row)));
    let [either, along_x] =
        [1, 0].map(|last| sites.clone().filter(|e| e[..=last].iter().any(|nm| off(*nm))).count() as u64);
    let [(rule, count)] = &beam(40).0[..] else {
        panic!("{:?}", beam(40))
    };
    assert_eq!((rule.as_str(), *count), ("beam", either + 1));
    assert!(either > along_x);
}

/// Corners on the grid are up to 0.7 nm off, edges 1.4 nm: they are judged by the best that they can be.
#[test]
fn edges_of_rotated_rectangles_have_their_widths() {
    let rule = |nm: f64, check: &str| {
        format!("[[rule]]\nid = \"width\"\ncheck = \"{check}\"\nnm = {nm}\n\n[[rule]]\nid = \"gap.min\"")
    };
    for (check, nm, holds) in [
        ("width_min", 100.0, true),
        ("width_min", 101.0, false),
        ("width_max", 250.0, true),
        ("width_max", 249.0, false),
    ] {
        let added = rule(nm, check);
        let (broken, _) = found(&[("[[rule]]\nid = \"gap.min\"", &added)], all, |_| {});
        assert_eq!(broken.is_empty(), holds, "{check} {nm}: {broken:?}");
    }
}

/// Small cells are identified by their place in their own file: what a further file has at the place of a sound pillar
/// is looked at.
#[test]
fn cells_of_a_further_file_are_not_those_of_the_first() {
    let file = |outline: &[(i32, i32)], rows: std::ops::Range<i32>| {
        let mut gds = Gds::library();
        let closed = [outline, &outline[..1]].concat();
        gds.cell("P").polygon(1, &closed).end_cell();
        gds.cell("TOP");
        for (column, row) in rows.flat_map(|row| (0..SITES).map(move |column| (column, row))) {
            let (x, y) = place(column, row);
            gds.sref("P", x, y);
        }
        gds.end_cell();
        layout(gds.end())
    };
    let pillar = PILLARS.on_grid(30).map(|(x, y)| (x as i32, y as i32));
    let trapezoid = [(-100, -50), (100, -50), (60, 50), (-60, 50)];
    let deck = deck_from("rules/rectangles.toml", &[]);
    let found = |further: &[(i32, i32)]| {
        let further = file(further, SITES / 2..SITES);
        let with = CheckInput {
            with: vec![&further],
            ..input()
        };
        let report = metalith_drc::check(&file(&pillar, 0..SITES / 2), &deck, &with, &Silent).unwrap();
        let of = |id: &str| broken(&report).iter().find(|(rule, _)| *rule == id).map(|(_, n)| *n);
        of("pillar.rectangle")
    };
    assert_eq!(found(&pillar), None);
    assert!(found(&trapezoid).is_some());
}
