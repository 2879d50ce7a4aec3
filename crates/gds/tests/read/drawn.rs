//! Pillars as other programs draw them: corners and places rounded to the grid one by one.

use metalith_core::Silent;
use metalith_gds::Layout;
use metalith_gds::extract::{Extraction, ExtractionPlan, Why, extract};
use metalith_pillars::{LatticeKind, PillarShape, SquaresAndCircles};
use metalith_testing::gds::Gds;

use super::{PILLARS, layout};

/// Places of a lens of so many rows on either side of the middle (nm): rows of a hexagonal lattice are shifted by half a pitch.
fn places(rows: i32, pitch: f64, is_hexagonal: bool) -> Vec<[f64; 2]> {
    let (row, shift) = if is_hexagonal {
        (pitch * 0.75f64.sqrt(), pitch / 2.0)
    } else {
        (pitch, 0.0)
    };
    let all = (-rows..=rows).flat_map(|j| (-rows..=rows).map(move |i| (f64::from(i), j)));
    let at = all.map(|(i, j)| [i * pitch + f64::from(j.rem_euclid(2)) * shift, f64::from(j) * row]);
    let reach = f64::from(rows) * row + 1.0;
    at.filter(|[x, y]| x.hypot(*y) < reach).collect()
}

/// Corners of a polygon of so many, about the middle.
fn regular(corners: u32, radius: f64) -> Vec<[f64; 2]> {
    let corner = |k: u32| {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / f64::from(corners)).sin_cos();
        [radius * cos, radius * sin]
    };
    (0..corners).map(corner).collect()
}

fn rectangle(width: f64, height: f64, degrees: f64) -> Vec<[f64; 2]> {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let signs = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]];
    let corner = |[x, y]: [f64; 2]| [cos * x * width - sin * y * height, sin * x * width + cos * y * height];
    signs.map(corner).into()
}

/// A closed outline at a place, each corner rounded to units of so many nanometres.
fn put(gds: &mut Gds, corners: &[[f64; 2]], [x, y]: [f64; 2], unit_nm: f64) {
    let rounded = |v: f64| (v / unit_nm).round() as i32;
    let mut points: Vec<(i32, i32)> = corners.iter().map(|c| (rounded(x + c[0]), rounded(y + c[1]))).collect();
    points.push(points[0]);
    gds.polygon(1, &points);
}

fn drawn(unit_nm: f64, each: impl Fn(&mut Gds)) -> Extraction {
    let mut gds = Gds::library_with_unit(unit_nm * 1e-9);
    gds.cell("TOP");
    each(&mut gds);
    gds.end_cell();
    read(&layout(gds.end()))
}

fn read(file: &Layout) -> Extraction {
    extract(file, &ExtractionPlan::discover(PILLARS), &Silent).unwrap()
}

/// All are pillars, on a lattice of this pitch.
fn assert_all(read: &Extraction, count: usize, pitch_nm: f64, kind: LatticeKind) {
    assert_eq!((read.pillars, read.oddities.total()), (count as u64, 0), "{pitch_nm}");
    let lattice = read.elements[0].site.lattice;
    assert_eq!((read.elements.len(), lattice.kind()), (1, kind));
    // A part of a step at the outermost places: more where the lens is turned.
    let places = if kind == LatticeKind::Square { 2.0 } else { 4.0 };
    let off = (lattice.pitch_nm().nm() - pitch_nm).abs() * lattice.sites() as f64 / places;
    assert!(off <= 0.65, "{pitch_nm}: {}", lattice.pitch_nm());
}

/// Circles of any number of corners about places that a loop works out, on grids of 1 nm and of 0.1 nm, the middle beside the grid.
#[test]
fn hexagonal_lattices_by_a_loop_are_read() {
    for (pitch, corners, unit_nm, off) in [
        (400.0, 24, 1.0, 0.0),
        (400.0, 64, 0.1, 0.0),
        (433.3, 17, 1.0, 0.4),
        (325.0, 8, 1.0, 123.46),
        (443.0, 9, 0.5, 7.3),
    ] {
        let places = places(24, pitch, true);
        let read = drawn(unit_nm, |gds| {
            for [x, y] in &places {
                put(gds, &regular(corners, 100.0), [x + off, y - 3.0 * off], unit_nm);
            }
        });
        assert_all(&read, places.len(), pitch, LatticeKind::Hexagonal);
        let row_nm = read.elements[0].site.lattice.row_nm();
        assert!((row_nm - pitch * 0.75f64.sqrt()).abs() < 1e-9, "{row_nm}");
    }
}

/// Pitches that no design has, in lenses so wide that their decimals count: all places are found, whatever the size.
#[test]
fn lenses_of_any_pitch_and_size_are_read() {
    for (pitch, rows, is_hexagonal) in [
        (333.333, 84, false),
        (1000.0 / 3.0, 84, false),
        (1000.0 / 3.0, 150, false),
        (285.7142857, 20, false),
        (250.0 * 3.0f64.sqrt(), 40, false),
        (314.159265, 60, true),
        (250.0 * 3.0f64.sqrt(), 80, true),
    ] {
        let places = places(rows, pitch, is_hexagonal);
        let outline = if is_hexagonal {
            regular(16, 80.0)
        } else {
            rectangle(151.0, 151.0, 0.0)
        };
        let read = drawn(1.0, |gds| {
            places
                .iter()
                .for_each(|[x, y]| put(gds, &outline, [x + 1e5, y - 77.3], 1.0));
        });
        let kind = if is_hexagonal {
            LatticeKind::Hexagonal
        } else {
            LatticeKind::Square
        };
        assert_all(&read, places.len(), pitch, kind);
    }
}

/// Squares of any width at pitches that are no multiples of the grid: each as wide as it was before rounding, to the rounding of
/// two corners. What is more than that off is another shape.
#[test]
fn squares_are_read_to_half_a_step_a_corner() {
    for (pitch, off) in [(333.3, 0.0), (351.0, 0.37), (350.0, 0.4567), (433.3, 0.0)] {
        let places = places(12, pitch, false);
        let width = |k: usize| 120.0 + 3.0 * (k % 30) as f64 + 0.3;
        let read = drawn(1.0, |gds| {
            for (k, [x, y]) in places.iter().enumerate() {
                put(gds, &rectangle(width(k), width(k), 0.0), [x + off, y + off], 1.0);
            }
        });
        assert_all(&read, places.len(), pitch, LatticeKind::Square);
        let numbers = read.elements[0].widths.number.iter().filter(|n| **n > 0);
        for (k, number) in numbers.enumerate() {
            assert!(
                (f64::from(*number) - width(k)).abs() <= 1.0,
                "{number} for {}",
                width(k)
            );
        }
    }
    // On the sites of an exact lattice: 150 x 151, 122 x 120 about the middle of 121 x 121, and more than that.
    let places = places(6, 350.0, false);
    for (width, height, want) in [(150, 151, Some(151)), (122, 120, Some(121)), (150, 153, None)] {
        let read = drawn(1.0, |gds| {
            for (k, [x, y]) in places.iter().enumerate() {
                let (w, h) = if k == 60 { (width, height) } else { (140, 140) };
                let (x, y) = (*x as i32 - w / 2, *y as i32 - h / 2);
                gds.rect(1, x, y, x + w, y + h);
            }
        });
        let unequal = read.oddities.by_why[Why::UnequalSides];
        assert_eq!(unequal, u64::from(want.is_none()), "{width} x {height}");
        let other = read.elements[0].widths.number.iter().find(|n| ![0, 140].contains(*n));
        assert_eq!(other.copied(), want, "{width} x {height}");
    }
}

/// Rectangles of one size at any angle, to what their corners tell.
#[test]
fn rectangles_at_any_angle_are_read() {
    let places = places(10, 400.0, false);
    let degrees = |k: usize| 0.1125 * k as f64 * 3.0;
    let read = drawn(1.0, |gds| {
        for (k, place) in places.iter().enumerate() {
            put(gds, &rectangle(100.0, 300.0, degrees(k)), *place, 1.0);
        }
    });
    assert_all(&read, places.len(), 400.0, LatticeKind::Square);
    let pillars = read.shape.rotated().unwrap();
    let numbers = read.elements[0].widths.number.iter().filter(|n| **n > 0);
    for (k, number) in numbers.enumerate() {
        let off = pillars.rotation(*number).to_degrees() - degrees(k);
        let off = off - 180.0 * (off / 180.0).round();
        // Two corners that give way by half a step turn the longer edge by 0.19 degrees; a step of numbers is 0.1.
        assert!(off.abs() < 0.3, "{k}: {off}");
    }
}

/// A cell that is placed at an angle, and its shapes turned one by one: the lens in its own rows.
#[test]
fn lenses_at_an_angle_are_read() {
    for (is_hexagonal, degrees, pitch) in [
        (false, 30.0, 350.0),
        (false, 45.0, 350.0),
        (true, 17.0, 400.0),
        (true, 30.0, 400.0),
    ] {
        let places = places(16, pitch, is_hexagonal);
        let outline = if is_hexagonal {
            regular(32, 90.0)
        } else {
            rectangle(160.0, 160.0, 0.0)
        };
        let mut gds = Gds::library();
        gds.cell("LENS");
        places.iter().for_each(|place| put(&mut gds, &outline, *place, 1.0));
        gds.end_cell();
        gds.cell("TOP")
            .placed("LENS", 40_000, -70_000, false, 1.0, degrees)
            .end_cell();
        let (sin, cos) = f64::to_radians(degrees).sin_cos();
        let turn = |[x, y]: [f64; 2]| [cos * x - sin * y, sin * x + cos * y];
        let turned: Vec<[f64; 2]> = outline.iter().map(|c| turn(*c)).collect();
        let flat = drawn(1.0, |gds| places.iter().for_each(|p| put(gds, &turned, turn(*p), 1.0)));
        let kind = if is_hexagonal {
            LatticeKind::Hexagonal
        } else {
            LatticeKind::Square
        };
        for read in [read(&layout(gds.end())), flat] {
            assert_all(&read, places.len(), pitch, kind);
            let turned = read.turned_deg.unwrap();
            let fold = if is_hexagonal { 60.0 } else { 90.0 };
            let off = turned - degrees - fold * ((turned - degrees) / fold).round();
            assert!(off.abs() < 0.01, "{turned} for {degrees}");
        }
    }
}

/// Lenses whose shapes are turned one by one at any angle, each corner rounded: squares and circles, on square and on hexagonal
/// lattices.
#[test]
fn lenses_flattened_at_an_angle_are_read() {
    let mut degrees: Vec<f64> = (1..45).step_by(2).map(f64::from).collect();
    degrees.extend([0.3, 12.0, 45.0, 89.5]);
    for (k, degrees) in degrees.into_iter().enumerate() {
        let (sin, cos) = f64::to_radians(degrees).sin_cos();
        let turn = |[x, y]: [f64; 2]| [cos * x - sin * y, sin * x + cos * y];
        for (is_hexagonal, outline) in [
            (false, rectangle(161.3, 161.3, 0.0)),
            (false, regular(24, 77.7)),
            (true, regular(32, 90.0)),
            (true, rectangle(120.0, 120.0, 0.0)),
        ] {
            let pitch = [350.0, 420.0, 433.012_7][k % 3];
            let places = places(18, pitch, is_hexagonal);
            let turned: Vec<[f64; 2]> = outline.iter().map(|c| turn(*c)).collect();
            let flat = drawn(1.0, |gds| {
                for place in &places {
                    let [x, y] = turn(*place);
                    put(gds, &turned, [x + 1234.56, y - 789.01], 1.0);
                }
            });
            let kind = if is_hexagonal {
                LatticeKind::Hexagonal
            } else {
                LatticeKind::Square
            };
            assert_all(&flat, places.len(), pitch, kind);
        }
    }
}

/// Upright rectangles of one size or of several in a lens at an angle: placed so, and drawn so with each corner rounded.
#[test]
fn rectangles_in_lenses_at_an_angle_are_read() {
    let places = places(16, 400.0, false);
    for sizes in [
        &[[100.0, 240.0]][..],
        &[[100.0, 240.0], [140.0, 200.0], [180.0, 180.0], [220.0, 120.0]],
    ] {
        for degrees in [0.4, 12.0, 30.0, 45.0, 77.0] {
            let (sin, cos) = f64::to_radians(degrees).sin_cos();
            let turn = |[x, y]: [f64; 2]| [cos * x - sin * y, sin * x + cos * y];
            let outline = |k: usize| {
                let [w, h] = sizes[k % sizes.len()];
                rectangle(w, h, 0.0)
            };
            let mut gds = Gds::library();
            gds.cell("LENS");
            (places.iter().enumerate()).for_each(|(k, place)| put(&mut gds, &outline(k), *place, 1.0));
            gds.end_cell();
            gds.cell("TOP")
                .placed("LENS", 40_000, -70_000, false, 1.0, degrees)
                .end_cell();
            let placed = read(&layout(gds.end()));
            let flat = drawn(1.0, |gds| {
                for (k, place) in places.iter().enumerate() {
                    let corners: Vec<[f64; 2]> = outline(k).iter().map(|c| turn(*c)).collect();
                    put(gds, &corners, turn(*place), 1.0);
                }
            });
            for read in [placed, flat] {
                assert_all(&read, places.len(), 400.0, LatticeKind::Square);
                assert_eq!(read.shape.upright().is_some(), sizes.len() > 1);
            }
        }
    }
}

/// Squares and circles in one lens, and crosses and rings among them, which are counted by their names.
#[test]
fn squares_and_circles_stand_in_one_lens() {
    let places = places(10, 400.0, false);
    let cross =
        [(-20, -60), (20, -60), (20, -20), (60, -20), (60, 20), (20, 20)].map(|(x, y)| [f64::from(x), f64::from(y)]);
    let cross: Vec<[f64; 2]> = cross.into_iter().chain(cross.map(|[x, y]| [-x, -y])).collect();
    let outer = regular(24, 90.0);
    let inner: Vec<[f64; 2]> = regular(24, 40.0).into_iter().rev().collect();
    let ring: Vec<[f64; 2]> = (outer.iter().chain(&outer[..1]).chain(&inner[23..]).chain(&inner))
        .copied()
        .collect();
    let read = drawn(1.0, |gds| {
        for (k, place) in places.iter().enumerate() {
            match k {
                100..103 => put(gds, &cross, *place, 1.0),
                200..202 => put(gds, &ring, *place, 1.0),
                _ if k % 2 == 0 => put(gds, &regular(24, 75.0), *place, 1.0),
                _ => put(gds, &rectangle(140.0, 140.0, 0.0), *place, 1.0),
            }
        }
    });
    assert_eq!(read.shape, PillarShape::Mixed);
    assert_eq!(read.pillars, places.len() as u64 - 5);
    assert_eq!(read.oddities.by_why[Why::Cross], 3);
    assert_eq!(read.oddities.by_why[Why::Ring], 2);
    assert_eq!(read.oddities.in_elements, 5);
    let numbers = read.elements[0].widths.number.iter().filter(|n| **n > 0);
    let circle = SquaresAndCircles::number(true, 150).unwrap().0;
    assert!(numbers.copied().all(|n| n == 140 || n == circle));
}

/// Thin rectangles at any angle, as they are and in a lens that is drawn at an angle: rounding turns a short edge by more than it
/// turns a long one.
#[test]
fn thin_rectangles_at_any_angle_are_read() {
    for (turn, pitch) in [(0.0, 350.0), (0.0, 1000.0 / 3.0), (12.0, 350.0)] {
        let places = places(20, pitch, false);
        let (sin, cos) = f64::to_radians(turn).sin_cos();
        let read = drawn(1.0, |gds| {
            for (k, [x, y]) in places.iter().enumerate() {
                let at = [cos * x - sin * y, sin * x + cos * y];
                put(gds, &rectangle(80.0, 230.0, 0.777 * k as f64 + turn), at, 1.0);
            }
        });
        assert_all(&read, places.len(), pitch, LatticeKind::Square);
    }
}

/// Arrays of lenses nearer than tiles show, whose distance is no multiple of the pitch: each lens is an element about its own middle,
/// and a single row of them too.
#[test]
fn near_lenses_off_step_are_elements_of_their_own() {
    for (pitch, apart, rows, is_hexagonal) in [
        (350.0, 14_700.0 + 113.0, 2, false),
        (350.0, 22_000.0, 3, false),
        (1000.0 / 3.0, 15_100.0, 2, false),
        (400.0, 17_111.0, 2, true),
    ] {
        let places = places(20, pitch, is_hexagonal);
        for columns in [1, rows] {
            let middles: Vec<[f64; 2]> = (0..rows * columns)
                .map(|k| [f64::from(k % columns) * apart, f64::from(k / columns) * apart])
                .collect();
            let read = drawn(1.0, |gds| {
                for [x, y] in &middles {
                    let square = rectangle(200.0, 200.0, 0.0);
                    (places.iter()).for_each(|place| put(gds, &square, [x + place[0], y + place[1]], 1.0));
                }
            });
            let count = places.len() * middles.len();
            let what = format!("{pitch} {apart} {columns}");
            assert_eq!((read.pillars, read.oddities.total()), (count as u64, 0), "{what}");
            assert_eq!(read.elements.len(), middles.len(), "{what}");
            for (element, middle) in read.elements.iter().zip(&middles) {
                let off = [0, 1].map(|axis| (element.site.centre_nm[axis] as f64 - middle[axis]).abs());
                // Of hexagonal lattices the middle is a site near it.
                let near = if is_hexagonal { pitch } else { 1.0 };
                assert!(off[0].max(off[1]) <= near, "{what}: {off:?}");
            }
        }
    }
}
