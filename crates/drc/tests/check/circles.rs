//! The deck for round pillars: a clean chip, and for each rule of theirs one that breaks it.

use metalith_pillars::circle_corners;
use metalith_testing::gds::Gds;

use crate::deck_from;
use crate::on_lattice::{broken_on_lattice, site};

/// Sites an axis, their distance and the common diameter (nm).
const SITES: i32 = 12;
const PITCH: i32 = 350;
const DIAMETER: u32 = 200;

fn circle(gds: &mut Gds, (x, y): (i32, i32), diameter: u32) {
    let corners = circle_corners(diameter, 0.5);
    let closed = corners.iter().chain(corners.first());
    let points: Vec<(i32, i32)> = closed.map(|&(dx, dy)| (x + dx as i32, y + dy as i32)).collect();
    gds.polygon(1, &points);
}

fn place(column: i32, row: i32) -> (i32, i32) {
    site(PITCH, SITES, column, row)
}

/// Rules that a lattice of circles breaks whose diameters are as `diameter` says, with `more` on it.
fn found(diameter: impl Fn(i32, i32) -> Option<u32>, more: impl Fn(&mut Gds)) -> (Vec<(String, u64)>, u64) {
    broken_on_lattice(
        &deck_from("rules/circles.toml", &[]),
        SITES,
        |gds, column, row| {
            if let Some(diameter) = diameter(column, row) {
                circle(gds, place(column, row), diameter);
            }
        },
        more,
    )
}

#[test]
fn each_rule_of_circles_finds_what_it_is_for() {
    let all = |_: i32, _: i32| Some(DIAMETER);
    assert_eq!(found(all, |_| {}), (vec![], 144));

    let but_one = |column: i32, row: i32| ((column, row) != (5, 5)).then_some(DIAMETER);
    let (x, y) = place(5, 5);
    let square = found(but_one, |gds| {
        gds.square(1, x, y, DIAMETER as i32);
    });
    assert_eq!(square, (vec![("pillar.circle".into(), 1)], 143));

    // 350 - 312 nm along the axis; squares of this width would be as near along the diagonal as along the axes.
    let near = found(
        |c, r| Some(if r == 5 && (c == 5 || c == 6) { 312 } else { DIAMETER }),
        |_| {},
    );
    assert_eq!(near, (vec![("gap.min".into(), 1)], 144));
    let diagonal = found(|c, r| Some(if c == r && (c == 5 || c == 6) { 340 } else { 80 }), |_| {});
    assert_eq!(diagonal, (vec![], 144));

    let twice = found(all, |gds| circle(gds, (x, y), DIAMETER));
    assert_eq!(twice, (vec![("gap.duplicate".into(), 1)], 144));
    let wider = found(all, |gds| circle(gds, (x, y), DIAMETER + 20));
    assert_eq!(wider, (vec![("gap.overlap".into(), 1)], 144));
}

/// Circles of few corners, as other programs draw them: the box around an odd number of corners is no square.
#[test]
fn circles_of_eleven_corners_are_circles() {
    let corner = |k: u32| {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / 11.0).sin_cos();
        let radius = f64::from(DIAMETER) / 2.0;
        ((radius * cos).round() as i32, (radius * sin).round() as i32)
    };
    let widths = [(
        "id = \"pillar.circle\"",
        "id = \"pillar.width\"\ncheck = \"width_min\"\nnm = 200\n\n[[rule]]\nid = \"pillar.circle\"",
    )];
    let found = broken_on_lattice(
        &deck_from("rules/circles.toml", &widths),
        SITES,
        |gds, column, row| {
            let (x, y) = place(column, row);
            let points: Vec<(i32, i32)> = (0..11)
                .chain([0])
                .map(corner)
                .map(|(dx, dy)| (x + dx, y + dy))
                .collect();
            gds.polygon(1, &points);
        },
        |_| {},
    );
    assert_eq!(found, (vec![], 144));
}
