//! Elements that a file folds by symmetry are held as an eighth, and are the same pillars as if they were not.

use metalith_core::Silent;
use metalith_gds::extract::{ElementSite, ExtractionPlan, StoredPillars, UnrecognisedShapes, extract, extract_folded};
use metalith_gds::{Layout, Transform};
use metalith_pillars::{Lattice, PillarRows};
use metalith_testing::gds::Gds;

use super::{PILLARS, layout};

const CENTRE: (i32, i32) = (20_000, -14_000);

/// Mirror and angle of all symmetries of the square.
const ALL: [(bool, f64); 8] = [
    (false, 0.0),
    (false, 90.0),
    (false, 180.0),
    (false, 270.0),
    (true, 0.0),
    (true, 90.0),
    (true, 180.0),
    (true, 270.0),
];

fn site(sites: usize) -> ElementSite {
    ElementSite {
        name: "e".into(),
        centre_nm: [CENTRE.0, CENTRE.1].map(i64::from),
        lattice: Lattice::new(350, sites).unwrap(),
        within_nm: None,
    }
}

/// Cells with squares (half pitches from the middle, width), each placed by some symmetries.
type Cells<'a> = [(&'a [(i32, i32, i32)], &'a [(bool, f64)])];

/// The cells placed about the middle of the element, or every square of them drawn where it stands.
fn file(cells: &Cells<'_>, folded: bool) -> Layout {
    let mut gds = Gds::library();
    for (k, (squares, _)) in cells.iter().enumerate().filter(|_| folded) {
        gds.cell(&format!("PART_{k}"));
        // Cells of up to 64 shapes are placed shape by shape.
        for far in 0..70 {
            gds.square(7, far * 1000, 0, 100);
        }
        squares.iter().for_each(|&(x, y, w)| {
            gds.square(1, 175 * x, 175 * y, w);
        });
        gds.end_cell();
    }
    gds.cell("TOP");
    for (k, (squares, placed)) in cells.iter().enumerate() {
        for &(mirror, angle) in *placed {
            if folded {
                gds.placed(&format!("PART_{k}"), CENTRE.0, CENTRE.1, mirror, 1.0, angle);
                continue;
            }
            for &(x, y, w) in *squares {
                let y = if mirror { -y } else { y };
                let (x, y) = [(x, y), (-y, x), (-x, -y), (y, -x)][(angle / 90.0) as usize];
                gds.square(1, CENTRE.0 + 175 * x, CENTRE.1 + 175 * y, w);
            }
        }
    }
    gds.end_cell();
    layout(gds.end())
}

/// Checks that both ways of reading both files agree; returns how the folded one was held and what in it was not
/// recognised.
fn held(sites: usize, cells: &Cells<'_>) -> (StoredPillars, UnrecognisedShapes) {
    let plan = ExtractionPlan::given(PILLARS, vec![site(sites)]);
    let flat = extract(&file(cells, false), &plan, &Silent).unwrap();
    let folded = file(cells, true);
    let whole = extract(&folded, &plan, &Silent).unwrap();
    let mut eighth = extract_folded(&folded, &plan, &Silent).unwrap();
    assert_eq!(whole.elements[0].widths, flat.elements[0].widths);
    assert_eq!(eighth.elements[0].widths.whole(), flat.elements[0].widths);
    assert_eq!(
        [whole.pillars, eighth.pillars, eighth.elements[0].widths.pillars()],
        [flat.pillars; 3]
    );
    assert_eq!(eighth.oddities.by_why, flat.oddities.by_why);
    (eighth.elements.remove(0).widths, eighth.oddities)
}

#[test]
fn what_is_folded_by_all_symmetries_is_held_as_an_eighth() {
    let rotations = &ALL[..4];
    let octant: &[_] = &[(1, 3, 120), (3, 5, 130), (-1, 7, 140)];
    let (even, oddities) = held(8, &[(octant, &ALL), (&[(3, 3, 110), (-5, 5, 112)], rotations)]);
    assert!(matches!(even, StoredPillars::Eighth(_)));
    assert_eq!(oddities.total(), 0);
    // Odd lattices have sites on the axes, each on one mirror, and one in the middle, which four copies meet.
    let odd: &Cells<'_> = &[(&[(2, 4, 120)], &ALL), (&[(0, 4, 110), (6, 6, 114)], rotations)];
    assert!(matches!(held(7, odd).0, StoredPillars::Eighth(_)));
    assert!(matches!(
        held(7, &[(&[(0, 0, 90)], &ALL[..1])]).0,
        StoredPillars::Whole(_)
    ));
}

#[test]
fn what_breaks_the_symmetry_is_read_as_it_stands() {
    let octant: &[_] = &[(1, 3, 120), (3, 5, 130)];
    // One more pillar in the top cell; a diagonal that eight copies meet twice; four copies of two sites; a width twice.
    let cases: [(&Cells<'_>, u64); 5] = [
        (&[(octant, &ALL), (&[(7, -7, 100)], &ALL[..1])], 0),
        (&[(&[(1, 3, 120), (3, 3, 130)], &ALL)], 4),
        (
            &[(octant, &ALL), (&[(5, 5, 110)], &[ALL[0], ALL[2], ALL[4], ALL[6]])],
            0,
        ),
        (&[(&[(5, 5, 110)], &[ALL[0], ALL[2], ALL[5], ALL[7]])], 2),
        (&[(octant, &ALL), (&[(3, 1, 122)], &ALL)], 8),
    ];
    for (cells, odd) in cases {
        let (_, oddities) = held(8, cells);
        assert_eq!(oddities.total(), odd, "{cells:?}");
    }
    assert!(matches!(held(8, cases[0].0).0, StoredPillars::Whole(_)));
    // Off the lattice, and turned by less than a quarter.
    assert_eq!(held(8, &[(octant, &ALL), (&[(2, 3, 100)], &ALL)]).1.total(), 8);
    assert!(Transform::IDENTITY.is_square());
}

/// A lens of more sites than are held is read as an eighth, and refused with a remedy if it cannot be.
#[test]
fn a_lens_too_large_to_be_held_is_held_folded() {
    // As of 16.4 mm: only what is touched of the eighth is memory.
    let sites = 46_858;
    let plan = ExtractionPlan::given(PILLARS, vec![site(sites)]);
    let octant: &[_] = &[(1, 3, 120), (3, 46_857, 130)];
    let found = extract_folded(&file(&[(octant, &ALL)], true), &plan, &Silent).unwrap();
    assert_eq!(found.pillars, 16);
    assert_eq!(found.elements[0].widths.number(sites / 2 + 1, sites - 1), 130);
    let alone = file(&[(octant, &ALL), (&[(7, 9, 100)], &ALL[..1])], true);
    let error = metalith_core::Error::from(extract_folded(&alone, &plan, &Silent).unwrap_err());
    assert_eq!(error.id(), "extract/too-many-sites");
    insta::assert_snapshot!(error, @"
        test.gds: 1 elements with 2195672164 lattice sites together
          help: up to 2147483648 sites are held at a time, an eighth of an element that is folded by all eight symmetries: a smaller lens, or fewer elements in one layout
        ");
    assert!(extract(&alone, &plan, &Silent).is_err());
}
