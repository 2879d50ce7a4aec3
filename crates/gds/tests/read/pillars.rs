//! Tests of what is taken for a pillar, and of the places of elements.

use metalith_core::Silent;
use metalith_gds::extract::{ElementSite, Extraction, ExtractionPlan, Why, extract};
use metalith_gds::{Error, ExtractionError, Layout};
use metalith_pillars::{Lattice, LatticeKind, PillarMap, PillarShape, RotatedRectangles};
use metalith_testing::gds::Gds;

use crate::{PILLARS, foreign_files, layout};

/// The lens of `scripts/make_foreign_layouts.py`.
fn foreign_lens() -> (ElementSite, PillarMap) {
    let lattice = Lattice::new(350, 24).unwrap();
    let mut widths = PillarMap::empty(lattice);
    for ((iy, ix), w) in widths.number.indexed_iter_mut() {
        let h2 = lattice.half_radius2(ix, iy);
        if h2 <= 24 * 24 {
            *w = (100 + 2 * (7 * h2 % 101)) as u16;
        }
    }
    let site = ElementSite {
        name: "lens".into(),
        centre_nm: [5000, -3000],
        lattice,
        within_nm: None,
    };
    (site, widths)
}

/// gdstk and KLayout, flat, referenced, mirrored, magnified, in arrays, as paths, in other units: one lens.
#[test]
fn files_of_other_tools_hold_the_same_lens() {
    let (site, widths) = foreign_lens();
    for path in foreign_files() {
        let layout = Layout::open(&path).unwrap();
        for plan in [
            ExtractionPlan::given(PILLARS, vec![site.clone()]),
            ExtractionPlan::discover(PILLARS),
        ] {
            let read = extract(&layout, &plan, &Silent).unwrap();
            let name = path.display();
            assert_eq!(read.oddities.total(), 0, "{name}: {:?}", read.oddities);
            assert_eq!(read.elements.len(), 1, "{name}");
            assert_eq!(read.elements[0].site.centre_nm, site.centre_nm, "{name}");
            assert_eq!(read.elements[0].widths, widths, "{name}");
            assert_eq!((read.pillars, read.top.as_str()), (widths.pillars(), "TOP"), "{name}");
            let layers: Vec<_> = read
                .survey
                .layers
                .iter()
                .map(|l| (l.layer.layer, l.shapes, l.texts))
                .collect();
            assert_eq!(layers, [(1, widths.pillars(), 0), (2, 1, 0), (10, 0, 1)], "{name}");
            assert_eq!(read.survey.texts[0].at_nm, [5000.0, -3000.0], "{name}");
            assert_eq!(
                read.survey.layers[1].bounds_nm,
                Some([0.0, -8000.0, 10_000.0, 2000.0]),
                "{name}"
            );
        }
    }
}

/// Corners about a place as a polygon, closed.
fn polygon_about(x: i32, y: i32, corners: &[(i64, i64)]) -> Vec<(i32, i32)> {
    let closed = corners.iter().chain(corners.first());
    closed.map(|&(dx, dy)| (x + dx as i32, y + dy as i32)).collect()
}

/// The polygon of a circle about a place, closed.
fn circle_of_points(x: i32, y: i32, diameter: u32) -> Vec<(i32, i32)> {
    polygon_about(x, y, &metalith_pillars::circle_corners(diameter, 0.5))
}

/// Circles of two diameters on a lattice, and one square among them.
#[test]
fn circles_are_pillars_where_most_are() {
    let mut gds = Gds::library();
    gds.cell("TOP");
    for k in 0..36 {
        let (x, y) = (175 + 350 * (k % 6) - 1050, 175 + 350 * (k / 6) - 1050);
        if k == 7 {
            gds.square(1, x, y, 200);
        } else {
            gds.polygon(1, &circle_of_points(x, y, if k % 2 == 0 { 200 } else { 120 }));
        }
    }
    gds.end_cell();
    let file = layout(gds.end());
    let read = extract(&file, &ExtractionPlan::discover(PILLARS), &Silent).unwrap();
    assert_eq!(read.shape, PillarShape::Circle);
    assert_eq!((read.elements.len(), read.pillars), (1, 35));
    let widths = &read.elements[0].widths.number;
    assert_eq!((widths[[0, 0]], widths[[0, 1]], widths[[1, 1]]), (200, 120, 0));
    assert_eq!(read.oddities.listed[0].why, Why::OtherShape);
    // Taken for squares, they are none.
    let squares = ExtractionPlan::discover(PILLARS).of_shape(PillarShape::Square);
    let read = extract(&file, &squares, &Silent).unwrap();
    assert_eq!((read.pillars, read.oddities.total()), (1, 35));
}

/// Regular polygons of other programs, the first corner on the x axis, stand on the sites of the circles that they are drawn for.
#[test]
fn circles_of_few_corners_are_on_their_sites() {
    for corners in [8, 9, 13, 18, 31] {
        let corner = |k: u32| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / f64::from(corners)).sin_cos();
            ((100.0 * cos).round() as i64, (100.0 * sin).round() as i64)
        };
        let drawn: Vec<(i64, i64)> = (0..corners).map(corner).collect();
        let mut gds = Gds::library();
        gds.cell("TOP");
        for k in 0..36 {
            let (x, y) = (175 + 350 * (k % 6) - 1050, 175 + 350 * (k / 6) - 1050);
            gds.polygon(1, &polygon_about(x, y, &drawn));
        }
        gds.end_cell();
        let read = extract(&layout(gds.end()), &ExtractionPlan::discover(PILLARS), &Silent).unwrap();
        assert_eq!(
            (read.shape, read.pillars, read.oddities.total()),
            (PillarShape::Circle, 36, 0),
            "{corners}"
        );
        let [element] = &read.elements[..] else {
            panic!("{corners}: {} elements", read.elements.len())
        };
        assert_eq!(
            (element.site.centre_nm, element.site.lattice.pitch_nm()),
            ([0, 0], 350.into())
        );
        assert!(element.widths.number.iter().all(|w| *w == 200), "{corners}");
    }
}

/// Rectangles in a cell that is drawn twice as large as it is placed.
#[test]
fn rectangles_of_a_magnified_cell_are_found_as_large_as_they_are() {
    let drawn = RotatedRectangles {
        width_nm: 180,
        length_nm: 480,
        steps: 180,
    };
    let mut gds = Gds::library();
    gds.cell("TOP").placed("LENS", 0, 0, false, 0.5, 0.0).end_cell();
    gds.cell("LENS");
    for k in 0..36 {
        let (x, y) = (2 * (175 + 350 * (k % 6) - 1050), 2 * (175 + 350 * (k / 6) - 1050));
        gds.polygon(1, &polygon_about(x, y, &drawn.on_grid(1 + 5 * k as u16)));
    }
    gds.end_cell();
    let read = extract(&layout(gds.end()), &ExtractionPlan::discover(PILLARS), &Silent).unwrap();
    let Some(found) = read.shape.rotated() else {
        panic!("{:?}", read.shape)
    };
    assert_eq!((found.width_nm, found.length_nm), (90, 240));
    assert_eq!((read.elements.len(), read.pillars), (1, 36));
}

/// Upright rectangles of several sizes: found though a mark stands at an angle, and though most are squares; odd edges, which no grid of
/// 1 nm centres, and what is more than 64 lengths are not taken for such.
#[test]
fn upright_rectangles_are_found_among_squares_and_marks() {
    let found = |edges: &dyn Fn(i32) -> [i32; 2], tilted: bool| {
        let mut gds = Gds::library();
        gds.cell("TOP");
        for k in 0..400 {
            let (x, y) = (175 + 350 * (k % 20) - 3500, 175 + 350 * (k / 20) - 3500);
            let [a, b] = edges(k);
            gds.rect(1, x - a / 2, y - b / 2, x - a / 2 + a, y - b / 2 + b);
        }
        if tilted {
            gds.polygon(1, &[(9000, 0), (9300, 300), (9100, 500), (8800, 200), (9000, 0)]);
        }
        gds.end_cell();
        extract(&layout(gds.end()), &ExtractionPlan::discover(PILLARS), &Silent)
    };
    let several = |k: i32| [100 + 20 * (k % 7), 100 + 20 * (k * 3 % 8)];
    let read = found(&several, false).unwrap();
    let pillars = read.shape.upright().unwrap();
    assert_eq!((pillars.shortest_nm, pillars.step_nm, pillars.lengths), (100, 20, 8));
    assert_eq!((read.pillars, read.oddities.total()), (400, 0));
    let map = &read.elements[0].widths;
    for k in 0..400_usize {
        let edges = pillars.edges_nm(map.number[[k / 20, k % 20]]).map(i32::from);
        assert_eq!(edges, several(k as i32), "{k}");
    }
    let read = found(&several, true).unwrap();
    assert_eq!(
        (read.shape.upright(), read.pillars, read.oddities.total()),
        (Some(pillars), 400, 1)
    );
    // Three squares for one that is none, of a width that no other has.
    let squares = |k: i32| if k % 4 == 0 { several(k / 4 + 1) } else { [260, 260] };
    let read = found(&squares, false).unwrap();
    assert!(
        read.shape.upright().is_some_and(|p| p.number([260, 260]).is_some()),
        "{:?}",
        read.shape
    );
    assert_eq!((read.pillars, read.oddities.total()), (400, 0));
    for edges in [
        &(|k: i32| [101 + 20 * (k % 7), 101]) as &dyn Fn(i32) -> [i32; 2],
        &|k: i32| [80 + 2 * (k % 100), 90],
    ] {
        // The squares among them may be on a separate lattice; the others are counted.
        let few = |read: Extraction| read.oddities.total() > 5 * read.pillars;
        assert!(found(edges, false).map_or(true, few));
    }
}

/// Shapes that are not pillars, one of each kind, each for the right reason, at the right place.
#[test]
fn everything_that_is_not_a_pillar_is_listed() {
    let mut gds = Gds::library();
    gds.cell("TOP");
    gds.square(1, 175, 175, 100).square(1, 175, 175, 120); // doubled
    gds.square(1, 526, 175, 100); // off lattice
    gds.rect(1, -225, 125, -125, 227); // sides unequal
    gds.polygon(1, &[(0, 600), (100, 600), (50, 700), (0, 600)]); // odd
    gds.square(1, 9000, 0, 100); // outside
    gds.square(1, -175, -175, 360); // too wide
    let circle = circle_of_points(-525, 175, 100);
    gds.polygon(1, &circle); // a circle among squares
    gds.square(2, 0, 0, 100); // on another layer
    // A square with two vertices more than it needs is one.
    gds.polygon(
        1,
        &[
            (-225, 475),
            (-175, 475),
            (-125, 475),
            (-125, 575),
            (-200, 575),
            (-225, 575),
            (-225, 475),
        ],
    );
    gds.end_cell();
    let site = ElementSite {
        name: "e".into(),
        centre_nm: [0, 0],
        lattice: Lattice::new(350, 4).unwrap(),
        within_nm: None,
    };
    let read = extract(&layout(gds.end()), &ExtractionPlan::given(PILLARS, vec![site]), &Silent).unwrap();
    assert_eq!(
        Why::ALL.map(|why| read.oddities.by_why[why]),
        [1, 1, 1, 1, 1, 1, 1, 0, 0]
    );
    let whys: Vec<_> = read.oddities.listed.iter().map(|o| o.why).collect();
    assert_eq!(
        whys,
        [
            Why::DuplicateSite,
            Why::OffLattice,
            Why::UnequalSides,
            Why::OddShape,
            Why::OutsideElements,
            Why::TooWide,
            Why::OtherShape
        ]
    );
    assert_eq!(read.oddities.listed[1].centre_nm, [526.0, 175.0]);
    assert_eq!(read.oddities.listed[2].size_nm, [100.0, 102.0]);
    assert_eq!(read.pillars, 2);
    assert_eq!(read.elements[0].widths.number[[2, 2]], 100);
    assert_eq!(read.elements[0].widths.number[[3, 1]], 100);
}

/// A hexagonal lattice as people draw one: an array of every other row, then an array of the rows between. The same rows without
/// those between are no hexagonal lattice, and as many shapes are found as are drawn.
#[test]
fn two_arrays_are_one_hexagonal_lattice() {
    let rows = |between: bool| {
        let mut gds = Gds::library();
        gds.cell("P").square(1, 0, 0, 300).end_cell();
        let place = |gds: &mut Gds, x: i32, y: i32, columns: i16, rows: i16| {
            let ends = [x + 700 * i32::from(columns), y, x, y + 1212 * i32::from(rows)];
            gds.array("P", columns, rows, [x, y, ends[0], ends[1], ends[2], ends[3]]);
        };
        gds.cell("TOP");
        place(&mut gds, -28_000, -29_088, 81, 49);
        if between {
            place(&mut gds, -28_350, -28_482, 82, 48);
        }
        gds.end_cell();
        extract(&layout(gds.end()), &ExtractionPlan::discover(PILLARS), &Silent)
    };
    let found = rows(true).unwrap();
    let [element] = &found.elements[..] else {
        panic!("{} elements", found.elements.len())
    };
    assert_eq!(element.site.lattice.kind(), LatticeKind::Hexagonal);
    assert_eq!(
        (element.site.lattice.pitch_nm(), element.site.centre_nm),
        (700.into(), [0, 0])
    );
    assert_eq!(element.widths.pillars(), 81 * 49 + 82 * 48);
    if let Ok(other) = rows(false) {
        let sites: Vec<_> = other.elements.iter().map(|e| &e.site).collect();
        assert!(sites.iter().all(|site| site.lattice.is_square()), "{sites:?}");
    }
}

/// Pillars for long waves, as wide as designs may have them, on either lattice; pads beside a lens of close pillars are none.
#[test]
fn wide_pillars_are_found_and_pads_are_not() {
    let found = |gds: &mut Gds| {
        extract(
            &layout(gds.end_cell().end()),
            &ExtractionPlan::discover(PILLARS),
            &Silent,
        )
    };
    for (pitch, least, step) in [(7_000, 5_900, 20), (12_000, 3_000, 200), (20_000, 2_000, 400)] {
        let mut gds = Gds::library();
        gds.cell("TOP");
        for k in 0..36 {
            let [x, y] = [k % 6, k / 6].map(|i| pitch * i - 5 * pitch / 2);
            gds.square(1, x, y, least + step * k);
        }
        let read = found(&mut gds).unwrap();
        let [element] = &read.elements[..] else {
            panic!("{pitch}: {} elements", read.elements.len())
        };
        let lattice = element.site.lattice;
        assert_eq!(
            (lattice.pitch_nm(), element.site.centre_nm),
            ((pitch as u32).into(), [0, 0])
        );
        assert_eq!((read.pillars, read.oddities.total()), (36, 0), "{pitch}");
        assert_eq!(element.widths.number[[1, 2]], (least + 8 * step) as u16);
    }
    // Rows of a hexagonal lattice of 12 um are 10.392 um apart.
    let mut gds = Gds::library();
    gds.cell("TOP");
    for row in -4..=4 {
        for column in -4..=4 {
            let x = 12_000 * column + if row % 2 == 0 { 0 } else { 6_000 };
            gds.polygon(1, &circle_of_points(x, 10_392 * row, 9_000));
        }
    }
    let read = found(&mut gds).unwrap();
    let lattice = read.elements[0].site.lattice;
    assert_eq!(
        (lattice.kind(), lattice.pitch_nm()),
        (LatticeKind::Hexagonal, 12_000.into())
    );
    assert_eq!(
        (read.elements.len(), read.pillars, read.shape),
        (1, 81, PillarShape::Circle)
    );

    let mut gds = Gds::library();
    gds.cell("TOP");
    for k in 0..400 {
        let [x, y] = [k % 20, k / 20].map(|i| 350 * i - 3_325);
        gds.square(1, x, y, 200);
        gds.square(1, 15_000 * (k % 20) + 20_000, 15_000 * (k / 20), 10_000);
    }
    let read = found(&mut gds).unwrap();
    assert_eq!(
        (read.elements.len(), read.pillars, read.oddities.total()),
        (1, 400, 400)
    );
    assert_eq!(read.elements[0].site.lattice.pitch_nm(), 350.into());
}

/// Several lenses, found without being told, one of them a mirrored and magnified copy.
#[test]
fn elements_are_discovered() {
    let read = extract(
        &layout(metalith_testing::gds::everything()),
        &ExtractionPlan::discover(PILLARS),
        &Silent,
    )
    .unwrap();
    let found: Vec<_> = read
        .elements
        .iter()
        .map(|e| (e.site.centre_nm, e.site.lattice.pitch_nm().nm(), e.widths.pillars()))
        .collect();
    assert_eq!(
        found,
        [
            ([196_500, -3500], 700.0, 100),
            ([1750, 1750], 350.0, 100),
            // Five columns, four rows: the lattice is square, its row to spare on top.
            ([100_700, 100_700], 350.0, 20),
            ([1750, 301_750], 350.0, 100),
            ([71_750, 301_750], 350.0, 100),
        ]
    );
}

/// A layout of another design is refused before all of it is read; a million shapes less are counted.
#[test]
fn a_layout_of_another_design_is_refused_early() {
    let read = |rows: i16| {
        let mut gds = Gds::library();
        gds.cell("PILLAR").square(1, 0, 0, 100).end_cell();
        let (columns, pitch) = (4000, 500);
        let [across, up] = [columns, rows].map(|n| i32::from(n) * pitch);
        gds.cell("TOP")
            .array("PILLAR", columns, rows, [0, 0, across, 0, 0, up])
            .end_cell();
        let site = ElementSite {
            name: "lens".into(),
            centre_nm: [-1_000_000, 0],
            lattice: Lattice::new(350, 24).unwrap(),
            within_nm: None,
        };
        let plan = ExtractionPlan::given(PILLARS, vec![site]);
        extract(&layout(gds.end()), &plan, &Silent)
    };
    let fewer = read(2250).unwrap();
    assert_eq!((fewer.pillars, fewer.oddities.total()), (0, 9_000_000));
    let refused = metalith_core::Error::from(read(2501).unwrap_err());
    let text = refused.to_string();
    assert!(text.contains("10,000,000 outside every element"), "{text}");
}

/// A file of another layer is named by what it holds, also where a design gives the elements.
#[test]
fn a_layout_without_shapes_on_the_layer_is_refused() {
    let (site, _) = foreign_lens();
    let mut gds = Gds::library();
    gds.cell("TOP").square(2, 0, 0, 100).end_cell();
    let plan = ExtractionPlan::given(PILLARS, vec![site]);
    let refused = extract(&layout(gds.end()), &plan, &Silent);
    let Err(Error::Extraction { cause, .. }) = refused else {
        panic!("{refused:?}")
    };
    let expected = ExtractionError::NoElements {
        layers: "1/0".into(),
        contents: Some("2/0: 1 square".into()),
    };
    assert_eq!(cause, expected);
}
