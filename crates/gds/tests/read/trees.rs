//! Random trees of cells: read as gds21 reads them, every reference followed.

use metalith_core::Silent;
use metalith_gds::extract::{ElementSite, Extraction, ExtractionPlan, extract};
use metalith_pillars::{Lattice, PillarMap};
use proptest::prelude::*;
use rand::SeedableRng;

use crate::{PILLARS, boxes, layout};
use metalith_testing::gds::Gds;

/// Contents of a library of gds21, every reference followed by the plainest code possible.
fn flattened(library: &gds21::GdsLibrary, name: &str, at: &dyn Fn(i64, i64) -> (i64, i64), out: &mut Vec<[i64; 4]>) {
    use gds21::GdsElement as E;
    let cell = library.structs.iter().find(|s| s.name == name).unwrap();
    let placed = |s: &Option<gds21::GdsStrans>, x: i64, y: i64| {
        let strans = s.clone().unwrap_or_default();
        let y = if strans.reflected { -y } else { y };
        (0..(strans.angle.unwrap_or(0.0) / 90.0) as i32).fold((x, y), |(x, y), _| (-y, x))
    };
    for element in &cell.elems {
        match element {
            E::GdsBoundary(b) => {
                let points: Vec<_> = b.xy.iter().map(|p| at(i64::from(p.x), i64::from(p.y))).collect();
                let (xs, ys) = (points.iter().map(|p| p.0), points.iter().map(|p| p.1));
                out.push([
                    xs.clone().min().unwrap(),
                    ys.clone().min().unwrap(),
                    xs.max().unwrap(),
                    ys.max().unwrap(),
                ]);
            }
            E::GdsStructRef(r) => {
                let inner = |x, y| {
                    let (x, y) = placed(&r.strans, x, y);
                    at(x + i64::from(r.xy.x), y + i64::from(r.xy.y))
                };
                flattened(library, &r.name, &inner, out);
            }
            E::GdsArrayRef(r) => {
                let [p, q, s] = r.xy.clone().map(|p| (i64::from(p.x), i64::from(p.y)));
                let (columns, rows) = (i64::from(r.cols), i64::from(r.rows));
                for (i, j) in (0..columns).flat_map(|i| (0..rows).map(move |j| (i, j))) {
                    let inner = |x, y| {
                        let (x, y) = placed(&r.strans, x, y);
                        let dx = (q.0 - p.0) / columns * i + (s.0 - p.0) / rows * j;
                        let dy = (q.1 - p.1) / columns * i + (s.1 - p.1) / rows * j;
                        at(x + p.0 + dx, y + p.1 + dy)
                    };
                    flattened(library, &r.name, &inner, out);
                }
            }
            _ => {}
        }
    }
}

/// A reference in a random tree: to which lower cell, where, how.
#[derive(Clone, Debug)]
struct Placed {
    to: usize,
    at: (i32, i32),
    mirror: bool,
    quarters: u8,
    copies: (i16, i16),
}

fn placed() -> impl Strategy<Value = Placed> {
    (
        0usize..8,
        (-5000i32..5000, -5000i32..5000),
        any::<bool>(),
        0u8..4,
        (1i16..4, 1i16..4),
    )
        .prop_map(|(to, at, mirror, quarters, copies)| Placed {
            to,
            at,
            mirror,
            quarters,
            copies,
        })
}

/// Rectangles of a cell (corner and size) and its references.
type Drawn = (Vec<(i32, i32, i32, i32)>, Vec<Placed>);

fn library(cells: &[Drawn]) -> gds21::GdsLibrary {
    use gds21::*;
    let mut library = GdsLibrary::new("RANDOM");
    for (k, (rects, references)) in cells.iter().enumerate() {
        let mut cell = GdsStruct::new(format!("CELL_{k}"));
        for &(x, y, w, h) in rects {
            let xy = [(x, y), (x + w, y), (x + w, y + h), (x, y + h), (x, y)];
            cell.elems.push(GdsElement::GdsBoundary(GdsBoundary {
                layer: 1,
                datatype: 0,
                xy: xy.iter().map(|&(x, y)| GdsPoint::new(x, y)).collect(),
                ..Default::default()
            }));
        }
        for r in references.iter().filter(|_| k > 0) {
            let strans = (r.mirror || r.quarters > 0).then(|| GdsStrans {
                reflected: r.mirror,
                angle: (r.quarters > 0).then(|| f64::from(r.quarters) * 90.0),
                ..Default::default()
            });
            let name = format!("CELL_{}", r.to % k);
            let ((x, y), (columns, rows)) = (r.at, r.copies);
            cell.elems.push(if (columns, rows) == (1, 1) {
                GdsElement::GdsStructRef(GdsStructRef {
                    name,
                    xy: GdsPoint::new(x, y),
                    strans,
                    ..Default::default()
                })
            } else {
                let (along, up) = (x + 700 * i32::from(columns), y + 900 * i32::from(rows));
                GdsElement::GdsArrayRef(GdsArrayRef {
                    name,
                    xy: [GdsPoint::new(x, y), GdsPoint::new(along, y), GdsPoint::new(x, up)],
                    cols: columns,
                    rows,
                    strans,
                    ..Default::default()
                })
            });
        }
        library.structs.push(cell);
    }
    library
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Random trees, written by gds21, read by us, against the plainest expansion.
    #[test]
    fn random_trees_are_placed_as_gds21_says(
        mut cells in proptest::collection::vec(
            (
                proptest::collection::vec((-900i32..900, -900i32..900, 1i32..300, 1i32..300), 0..80),
                proptest::collection::vec(placed(), 0..4),
            ),
            1..6,
        )
    ) {
        // Cells large enough not to be placed shape by shape occur too, and every cell is below the last.
        let last = cells.len() - 1;
        for k in 0..last {
            cells[last].1.push(Placed { to: k, at: (k as i32, 0), mirror: false, quarters: 1, copies: (1, 1) });
        }
        let mut expected = Vec::new();
        let mut library = library(&cells);
        if let Some(cell) = library.structs.last_mut() {
            // The modulus of `library` would fold these onto other cells.
            for (k, element) in cell.elems.iter_mut().rev().take(last).rev().enumerate() {
                if let gds21::GdsElement::GdsStructRef(r) = element {
                    r.name = format!("CELL_{k}");
                }
            }
        }
        flattened(&library, &format!("CELL_{last}"), &|x, y| (x, y), &mut expected);
        prop_assume!(expected.len() < 200_000);
        expected.sort_unstable();
        let mut bytes = std::io::Cursor::new(Vec::new());
        library.write(&mut bytes).unwrap();
        prop_assert_eq!(boxes(&layout(bytes.into_inner())), expected);
    }

    /// Random widths on a random lattice come back as they are, given or discovered.
    #[test]
    fn random_lenses_come_back(
        half in 6usize..20, pitch in 150u32..300, x in -50_000i64..50_000, y in -50_000i64..50_000, seed in any::<u64>(),
    ) {
        let lattice = Lattice::new(2 * pitch, 2 * half).unwrap();
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut widths = PillarMap::empty(lattice);
        let mut gds = Gds::library();
        gds.cell("TOP");
        for iy in 0..2 * half {
            for ix in 0..2 * half {
                let w = 2 * rand::RngExt::random_range(&mut rng, 20..pitch as u16);
                if lattice.half_radius2(ix, iy) <= (2 * half as i64).pow(2) {
                    widths.number[[iy, ix]] = w;
                    let (px, py) = (x + lattice.whole_nm(0, ix), y + lattice.whole_nm(0, iy));
                    gds.square(1, px as i32, py as i32, i32::from(w));
                }
            }
        }
        gds.end_cell();
        let layout = layout(gds.end());
        let site = ElementSite { name: "element 1".into(), centre_nm: [x, y], lattice, within_nm: None };
        let given = extract(&layout, &ExtractionPlan::given(PILLARS, vec![site.clone()]), &Silent).unwrap();
        let found = extract(&layout, &ExtractionPlan::discover(PILLARS), &Silent).unwrap();
        let same = |e: &Extraction| e.elements[0].widths == widths && e.oddities.total() == 0;
        prop_assert!(same(&given) && same(&found));
        prop_assert_eq!(&found.elements[0].site, &site);
    }
}
