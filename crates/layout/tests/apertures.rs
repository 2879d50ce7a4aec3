//! Apertures that are polygons: pillars stand in them and nowhere else, openings keep their margin, and all is read back.

use metalith_core::Silent;
use metalith_design::{Design, PillarArray};
use metalith_gds::{Layout, Selection, Shape, Transform, Visitor};
use metalith_layout::{extraction_plan, write_apertures};
use metalith_testing::layouts::{each_layout, hologram_of, same_pillars};
use metalith_testing::{design, replaced};

/// A circle, a rectangle that is turned by a quarter, a hexagon, and an L.
const ELEMENTS: &str = r#"
[[element]]
x_um = -70
y_um = -70

[[element]]
x_um = 70
y_um = -70
aperture = "rectangle"
aperture_um = [50, 20]
rotation_deg = 90
steering_x_deg = 4

[[element]]
x_um = 70
y_um = 70
aperture = "regular"
aperture_sides = 6
diameter_um = 48

[[element]]
x_um = -70
y_um = 70
aperture = "polygon"
corners_x_um = [-10, 25, 25, 10, 10, -10]
corners_y_um = [-15, -15, 5, 5, 24, 24]
"#;

const MARGIN_NM: i64 = 2_000;
/// Corners of openings are whole nanometres.
const ROUNDED_NM: f64 = 1.0;

fn text(elements: &str) -> String {
    hologram_of(elements).replace("size_um = [300, 200]", "size_um = [300, 300]")
}

fn of(elements: &str) -> metalith_core::Result<Design> {
    Design::parse(&design("hologram"), &text(elements))
}

/// Place of a point relative to the aperture of an element, from its middle and by the shapes, not by polygons (nm):
/// true inside; a place within a nanometre of the rim of the hexagon, whose corners are on no grid, may be either.
fn inside(element: usize, x: i64, y: i64) -> Option<bool> {
    let within = |a: i64, b: i64, c: i64, d: i64| (a..=b).contains(&x) && (c..=d).contains(&y);
    match element {
        0 => Some(x * x + y * y <= 30_000 * 30_000),
        1 => Some(within(-10_000, 10_000, -25_000, 25_000)),
        2 => {
            let apothem = 24_000.0 * 3f64.sqrt() / 2.0;
            let farthest = (0..6).map(|k| {
                let (sin, cos) = (std::f64::consts::TAU * (f64::from(k) + 0.5) / 6.0).sin_cos();
                x as f64 * cos + y as f64 * sin
            });
            let beyond = farthest.fold(f64::NEG_INFINITY, f64::max) - apothem;
            (beyond.abs() > ROUNDED_NM).then_some(beyond < 0.0)
        }
        _ => Some(within(-10_000, 25_000, -15_000, 5_000) || within(-10_000, 10_000, -15_000, 24_000)),
    }
}

#[test]
fn pillars_stand_in_the_aperture_and_nowhere_else() {
    let design = of(ELEMENTS).unwrap();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let lattice = array.lattice;
    for (k, placed) in array.placed.iter().enumerate() {
        let widths = array.widths(placed);
        for ((iy, ix), &w) in widths.number.indexed_iter() {
            let (x, y) = (lattice.whole_nm(0, ix), lattice.whole_nm(0, iy));
            assert!(inside(k, x, y).is_none_or(|held| held == (w != 0)), "{k} at ({x}, {y})");
        }
    }
    let computed = PillarArray::build_within(&design, 0, &Silent).unwrap();
    for (a, b) in array.placed.iter().zip(&computed.placed) {
        assert_eq!(array.widths(a).into_owned(), computed.widths(b).into_owned());
    }
    // The symmetries are those of what stands there: of a hexagon two mirrors and half a turn.
    let members = |k: usize| array.classes[array.placed[k].class].group.members().len();
    assert_eq!([0, 1, 2, 3].map(members), [8, 2, 4, 1]);
}

#[test]
fn they_are_read_back_from_every_hierarchy_and_format() {
    let design = of(ELEMENTS).unwrap();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let folder = tempfile::tempdir().unwrap();
    each_layout(folder.path(), &design, &array, |path| {
        same_pillars(path, &extraction_plan(&design), &array);
    });
}

#[derive(Default)]
struct Openings(Vec<Vec<(i64, i64)>>);

impl Visitor for Openings {
    fn shape(&mut self, shape: &Shape<'_>, _placements: &[Transform]) -> metalith_core::Result<()> {
        self.0.push(shape.outline.points().map(|p| (p.x, p.y)).collect());
        Ok(())
    }
}

#[test]
fn openings_are_the_apertures_with_their_margin() {
    let design = of(ELEMENTS).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("apertures.gds");
    write_apertures(&design, &path).unwrap();
    let mut found = Openings::default();
    let selection = Selection {
        layers: Some(vec![design.layout.layers.apertures.number()]),
        ..Default::default()
    };
    Layout::open(&path)
        .unwrap()
        .visit(&selection, &mut found, &Silent)
        .unwrap();
    let area = |k: usize| {
        let twice: i64 = found.0[k].windows(2).map(|w| w[0].0 * w[1].1 - w[1].0 * w[0].1).sum();
        twice as f64 / 2.0
    };
    let m = MARGIN_NM;
    let (w, h) = ((20_000 + 2 * m) as f64, (50_000 + 2 * m) as f64);
    let apothem = 24_000.0 * 3f64.sqrt() / 2.0 + m as f64;
    let hexagon = 2.0 * 3f64.sqrt() * apothem * apothem;
    let l = (35_000 + 2 * m) * (20_000 + 2 * m) + (20_000 + 2 * m) * 19_000;
    for (k, corners, wanted, around) in [
        (1, 4, w * h, 2.0 * (w + h)),
        (2, 6, hexagon, 12.0 * apothem / 3f64.sqrt()),
        (3, 6, l as f64, 200_000.0),
    ] {
        assert_eq!(found.0[k].len(), corners + 1);
        assert!(
            (area(k) - wanted).abs() <= around * ROUNDED_NM,
            "{k}: {} {wanted}",
            area(k)
        );
        let middle = design.elements()[k].centre_nm;
        assert!(
            found.0[k]
                .iter()
                .all(|&(x, y)| (x - middle.0).abs().max((y - middle.1).abs()) < 30_000)
        );
    }
}

/// Words of the elements and those in their place, and the mistakes that are made.
const MISTAKES: &str = r#"
corners_x_um = [-10, 25, 25, 10, 10, -10] | corners_x_um = [-10, 25, 25, 10, 10] | element#3.x_um/inconsistent element#3.corners_x_um/inconsistent apertures.chord_error_nm/inconsistent
corners_x_um = [-10, 25, 25, 10, 10, -10] | corners_x_um = [-10, 25, -10, 10, 10, 25] | element#3.corners_x_um/inconsistent apertures.margin_um/inconsistent
corners_x_um = [-10, 25, 25, 10, 10, -10] | corners_x_um = [15, 50, 50, 35, 35, 15] | element#3.corners_x_um/inconsistent
aperture_um = [50, 20] | aperture_um = [50, 20]\ndiameter_um = 60 | element#1.diameter_um/inconsistent
aperture_sides = 6 | aperture_sides = 2 | element#2.aperture_sides/out-of-range
aperture = "regular" | aperture = "hexagon" | element#2.aperture/unknown-choice element#2.aperture_sides/unknown
"#;

#[test]
fn apertures_that_cannot_be_are_refused() {
    let cases = metalith_testing::rows::<3>(MISTAKES);
    let errors: Vec<_> = cases
        .iter()
        .map(|[from, to, _]| of(&replaced(ELEMENTS, &[(from.as_str(), to)])).unwrap_err())
        .collect();
    let words = |error| metalith_testing::without_folder(error, metalith_testing::design("hologram").parent().unwrap());
    insta::assert_snapshot!(errors.iter().map(words).collect::<Vec<_>>().join("\n"), @r#"
        hologram.toml:46:8: this lens overlaps that of element (1, 0), or the upright boxes about their pillars do
          help: place them at least 530.25 um apart along x, or 530.25 um along y: the boxes and a pitch between them
        hologram.toml:49:16: 5 places along x and 6 along y
          help: give x and y of each corner, 3 to 1000 of them
        hologram.toml:70:18: this takes 505 vertices, `max_vertices` is 200
          help: allow at least 67.2 nm, or more vertices (readers of old take 200, the format 8191)
        hologram.toml:49:16: the outline crosses or touches itself
          help: list its corners as one goes around it, each once
        hologram.toml:69:13: the opening about an aperture meets itself: a notch of the aperture is narrower than two margins
          help: use a smaller margin or a wider notch
        hologram.toml:49:16: the middle of the element is outside the outline
          help: count corners from the middle of the element
        hologram.toml:35:15: a diameter beside an aperture that says its own size
          help: leave it out: it is that of the circle about the aperture
        hologram.toml:42:18: `aperture_sides` cannot be 2
          help: it must be a number from 3 to 64 sides
        hologram.toml:41:12: `aperture` cannot be "hexagon"
          help: use one of: circle, rectangle, regular, polygon
        hologram.toml:42:1: unknown key `aperture_sides` in [element]
          help: known here: aperture, diameter_um, focal_length_um, phase, rotation_deg, steering_x_deg, steering_y_deg, x_um, y_um
        "#);
    for (error, [.., ids]) in errors.iter().zip(&cases) {
        assert_eq!(error.ids().join(" "), *ids);
    }
}

/// The aperture of all elements of a grid.
#[test]
fn the_shared_lens_may_have_one() {
    let text = std::fs::read_to_string(design("array_2x4")).unwrap();
    let diameter = text.lines().find(|line| line.starts_with("diameter_um")).unwrap();
    let square = text.replace(diameter, "aperture = \"rectangle\"\naperture_um = [20, 20]");
    let design = Design::parse(&design("array_2x4"), &square).unwrap();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let pitch = f64::from(design.cell.pitch_nm) * 1e-3;
    let across = 2 * (10.0 / pitch + 0.5).floor() as u64;
    assert_eq!(array.pillars(), 8 * across * across);
}
