//! Elements with a separate diameter, lens and rotation: every pillar of them is read back from every kind of layout.

use std::path::Path;

use metalith_core::Silent;
use metalith_design::array::Symmetry;
use metalith_design::phase::{ElementPhase, LensPhase};
use metalith_design::{Design, PillarArray};
use metalith_gds::{LayerNumber, Layout, Selection, Shape, Transform, Visitor};
use metalith_layout::{extraction_plan, write_apertures};
use metalith_testing::design;
use metalith_testing::layouts::{each_layout, hologram_of, same_pillars};

/// The shared lens, a smaller and steered one of another focal length, holograms that are rotated by quarter turns and by 30
/// degrees, and a lens with a separate phase.
const ELEMENTS: &str = r#"
[[element]]
x_um = -100
y_um = 0

[[element]]
x_um = 0
y_um = 0
diameter_um = 40
focal_length_um = 90
steering_x_deg = 8

[[element]]
x_um = 100
y_um = 5
[element.phase]
source = "flat"
[[element.phase.term]]
source = "map"
file = "phases/four_spots.npy"
pitch_um = 0.35
interpolation = "nearest"

[[element]]
x_um = 100
y_um = 105
rotation_deg = 90
[element.phase]
source = "flat"
[[element.phase.term]]
source = "map"
file = "phases/four_spots.npy"
pitch_um = 0.35
interpolation = "nearest"

[[element]]
x_um = 0
y_um = 105
rotation_deg = -150
[element.phase]
source = "flat"
[[element.phase.term]]
source = "map"
file = "phases/four_spots.npy"
pitch_um = 0.35
interpolation = "nearest"

[[element]]
x_um = -100
y_um = 105
diameter_um = 50
[element.phase]
source = "even_powers"
coefficients_rad = [-200, 10]
"#;

fn text() -> String {
    hologram_of(ELEMENTS).replace("size_um = [300, 200]", "size_um = [400, 400]")
}

fn own() -> Design {
    Design::parse(&design("hologram"), &text()).unwrap()
}

#[test]
fn every_pillar_is_read_back_from_every_hierarchy_and_format() {
    let design = own();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let folder = tempfile::tempdir().unwrap();
    each_layout(folder.path(), &design, &array, |path| {
        same_pillars(path, &extraction_plan(&design), &array);
    });
}

/// Rows made one by one, as of large lenses, are those that are held.
#[test]
fn elements_that_are_not_held_are_the_same() {
    let design = own();
    let held = PillarArray::build(&design, &Silent).unwrap();
    let computed = PillarArray::build_within(&design, 0, &Silent).unwrap();
    for (a, b) in held.placed.iter().zip(&computed.placed) {
        assert_eq!(held.widths(a).into_owned(), computed.widths(b).into_owned());
    }
    assert_eq!(held.pillars(), computed.pillars());
}

#[test]
fn a_quarter_turn_of_an_element_turns_its_pillars() {
    let design = own();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let widths = |k: usize| array.widths(&array.placed[k]).into_owned();
    let quarter = Symmetry {
        mirrored: false,
        quarter_turns: 1,
    };
    assert!(widths(3) == quarter.apply(&widths(2)) && widths(3) != widths(2));
    // So it is written as a copy; what is rotated by another angle is not, and has no symmetry.
    assert_eq!(array.placed[3].class, array.placed[2].class);
    assert_eq!(array.placed[3].symmetry, quarter);
    let other = &array.placed[4];
    assert!(other.class != array.placed[2].class);
    assert_eq!(array.classes[other.class].group.members().len(), 1);
    assert_eq!(widths(4).pillars(), widths(2).pillars());
    // Its phase is that of the other at the place turned back, where the table gives the nearest.
    let lens = LensPhase::of(&design);
    let phase = |k: usize| ElementPhase::of(&lens, &array.placed[k].element);
    let at = |x: f64| (x / 0.35 + 0.5 * array.lattice.sites() as f64 - 0.5).round() as usize;
    let (sin, cos) = (-150f64).to_radians().sin_cos();
    for (x, y) in [(3.675, 8.225), (-12.425, 4.025), (0.175, -20.125)] {
        let (before_x, before_y) = (cos * x + sin * y, cos * y - sin * x);
        let (turned, was) = (phase(4).turns(at(x), at(y)), phase(2).turns(at(before_x), at(before_y)));
        assert_eq!(turned, was, "at ({x}, {y})");
    }
}

#[test]
fn a_smaller_lens_of_another_focal_length_has_the_pillars_of_a_design_of_it() {
    let design = own();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let (head, _) = text()
        .split_once("[[element]]")
        .map(|(h, t)| (h.to_owned(), t.to_owned()))
        .unwrap();
    let (_, tail) = text()
        .split_once("[mapping]")
        .map(|(h, t)| (h.to_owned(), t.to_owned()))
        .unwrap();
    let alone = format!(
        "{}\n[[element]]\nx_um = 0\ny_um = 0\nsteering_x_deg = 8\n[mapping]{tail}",
        head.replace("diameter_um = 60", "diameter_um = 40")
            .replace("focal_length_um = 144", "focal_length_um = 90")
    );
    let alone = Design::parse(&metalith_testing::design("hologram"), &alone).unwrap();
    let small = PillarArray::build(&alone, &Silent).unwrap();
    let (small, own) = (
        small.widths(&small.placed[0]).into_owned(),
        array.widths(&array.placed[1]).into_owned(),
    );
    assert_eq!(own.pillars(), small.pillars());
    let (n, beside) = (small.lattice.sites(), (own.lattice.sites() - small.lattice.sites()) / 2);
    for (iy, ix) in (0..n * n).map(|k| (k / n, k % n)) {
        assert_eq!(own.number[[iy + beside, ix + beside]], small.number[[iy, ix]]);
    }
}

#[derive(Default)]
struct Openings(Vec<(i64, i64, i64)>);

impl Visitor for Openings {
    fn shape(&mut self, shape: &Shape<'_>, _placements: &[Transform]) -> metalith_core::Result<()> {
        let around = shape.outline.around();
        self.0
            .push(((around.x0 + around.x1) / 2, (around.y0 + around.y1) / 2, around.width()));
        Ok(())
    }
}

fn openings(path: &Path, layer: LayerNumber) -> Vec<(i64, i64, i64)> {
    let mut found = Openings::default();
    let selection = Selection {
        layers: Some(vec![layer]),
        ..Default::default()
    };
    Layout::open(path)
        .unwrap()
        .visit(&selection, &mut found, &Silent)
        .unwrap();
    found.0
}

#[test]
fn openings_are_as_large_as_their_lenses() {
    let design = own();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("apertures.gds");
    write_apertures(&design, &path).unwrap();
    let found = openings(&path, design.layout.layers.apertures.number());
    // Margins of 2 um; polygons enclose their circles by at most 10 nm, and a grid unit.
    let wanted = [
        (-100, 0, 64),
        (0, 0, 44),
        (100, 5, 64),
        (100, 105, 64),
        (0, 105, 64),
        (-100, 105, 54),
    ];
    assert_eq!(found.len(), wanted.len());
    for ((x, y, across), (cx, cy, diameter)) in found.into_iter().zip(wanted) {
        assert_eq!((x, y), (cx * 1000, cy * 1000));
        assert!((0..=22).contains(&(across - diameter * 1000)), "{across}");
    }
}

/// A smaller lens leaves more room: 60 um beside 40 um is 50.4 um with the lattices, beside another of 60 um 60.2 um.
#[test]
fn elements_whose_boxes_overlap_are_refused() {
    let near = text().replace("x_um = 0\ny_um = 105", "x_um = 50\ny_um = 55");
    let path = design("hologram");
    let error = Design::parse(&path, &near).unwrap_err();
    insta::assert_snapshot!(metalith_testing::without_folder(&error, path.parent().unwrap()), @"
        hologram.toml:61:8: this lens overlaps that of element (3, 0), or the upright boxes about their pillars do
          help: place them at least 60.2 um apart along x, or 60.2 um along y: the boxes and a pitch between them
        ");
    assert_eq!(error.ids(), ["element#4.x_um/inconsistent"]);
}
