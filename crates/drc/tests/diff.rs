//! Telling layouts apart: the same geometry in any hierarchy is the same, and one nanometre is a difference.

use std::path::{Path, PathBuf};

use metalith_core::Silent;
use metalith_design::{Design, Hierarchy, PillarArray};
use metalith_drc::diff::{DiffPlan, LayoutDiff, diff, page, text};
use metalith_gds::Layout;
use metalith_layout::{LayoutFormat, OasisEncoding, write_pillars, write_pillars_as};
use metalith_testing::gds::Gds;
use metalith_testing::lens::Chip;

/// Rounding of a root of a quotient of order 0.1 in double precision.
const ROUNDING: f64 = 1e-12;

fn write(folder: &Path, name: &str, bytes: Vec<u8>) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

fn compare(a: &Path, b: &Path) -> LayoutDiff {
    let open = |path| Layout::open(path).unwrap();
    diff(&open(a), &open(b), &DiffPlan::default(), &Silent).unwrap()
}

fn of_chips(a: &Chip, b: &Chip) -> LayoutDiff {
    let folder = tempfile::tempdir().unwrap();
    let a = write(folder.path(), "a.gds", a.bytes());
    let b = write(folder.path(), "b.gds", b.bytes());
    compare(&a, &b)
}

/// The layout of a design in a hierarchy, in a file of a folder.
fn written((design, array): (&Design, &PillarArray), hierarchy: Hierarchy, folder: &Path, name: &str) -> PathBuf {
    let path = folder.join(name);
    write_pillars(design, array, hierarchy, &path, &Silent).unwrap();
    path
}

/// Lenses of 14 mm, of so many places that these are taken together: found, and compared with brute force, by an eighth of each.
#[test]
fn large_lenses_are_compared_by_an_eighth() {
    let path = metalith_testing::root().join("designs/lens_10mm.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let lens = |focal_length_um: &str| {
        let changes = [
            ("pitch_nm = 350", "pitch_nm = 5800"),
            // Places and widths are compared, no light.
            (
                "basis = \"all_powers\"",
                "basis = \"all_powers\"\naccept = \"another cell\"",
            ),
            ("width_min_nm = 100", "width_min_nm = 1440"),
            ("width_max_nm = 300", "width_max_nm = 4900"),
            ("width_step_nm = 2 ", "width_step_nm = 20 "),
            ("diameter_um = 10000", "diameter_um = 14000"),
            ("spacing_um = 10100", "spacing_um = 14100"),
            ("focal_length_um = 24000", focal_length_um),
            ("size_um = [12000, 12000]", "size_um = [20000, 20000]"),
            ("-5500, 5500, -5500, 5500", "-9000, 9000, -9000, 9000"),
            ("-5500, -5500, 5500, 5500", "-9000, -9000, 9000, 9000"),
        ];
        let text = changes.iter().fold(text.clone(), |text, (from, to)| {
            assert!(text.contains(from), "{from}");
            text.replace(from, to)
        });
        let design = Design::parse(&path, &text).unwrap();
        let array = PillarArray::build(&design, &Silent).unwrap();
        (design, array)
    };
    let folder = tempfile::tempdir().unwrap();
    let file = |(design, array): &(Design, PillarArray), encoding, name: &str| {
        let path = folder.path().join(name);
        let format = LayoutFormat::Oasis(encoding);
        write_pillars_as(design, array, Hierarchy::Folded, format, &path, &Silent).unwrap();
        path
    };
    let (own, other) = (lens("focal_length_um = 34000"), lens("focal_length_um = 34000.001"));
    let a = file(&own, OasisEncoding::Compact, "a.oas");
    let copy = file(&own, OasisEncoding::Smallest, "copy.oas");
    let b = file(&other, OasisEncoding::Compact, "b.oas");
    let rows = |array: &PillarArray| array.widths(&array.placed[0]).into_owned().number;
    let [from, to] = [rows(&own.1), rows(&other.1)];
    let apart = from.iter().zip(&to).filter(|(from, to)| from != to).count();
    assert!(apart > 1000 && apart < from.len() / 100, "{apart}");
    for (file, changed) in [(&copy, 0), (&b, apart as u64)] {
        let found = compare(&a, file);
        let [element] = &found.elements[..] else {
            panic!("{} elements", found.elements.len())
        };
        let pillars = from.iter().filter(|number| **number != 0).count() as u64;
        assert_eq!((element.sites, element.pillars), (from.nrows(), [pillars; 2]));
        assert_eq!((element.widened + element.narrowed, found.changes), (changed, changed));
    }
}

#[test]
fn hierarchies_of_one_design_are_the_same_geometry() {
    let root = metalith_testing::root();
    let design = Design::read(&root.join("designs/mini_3x3.toml")).unwrap();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, hierarchy| written((&design, &array), hierarchy, folder.path(), name);
    let folded = file("folded.gds", Hierarchy::Folded);
    for other in [file("sref.gds", Hierarchy::Sref), file("flat.gds", Hierarchy::Flat)] {
        let found = compare(&folded, &other);
        assert!(found.same_geometry && !found.same_bytes && !found.tree.same);
        assert_eq!((found.changes, found.elements.len()), (0, 9));
    }
    let again = compare(&folded, &file("again.gds", Hierarchy::Folded));
    assert!(again.same_bytes && again.tree.same && again.same_geometry);
}

/// Strips side by side, nearer than they are long: each is found as an element of its own, in any order of the file.
#[test]
fn strips_side_by_side_are_compared_each() {
    let path = metalith_testing::design("array_2x4");
    let text = std::fs::read_to_string(&path).unwrap();
    let text = text
        .replacen(
            "diameter_um = 60",
            "aperture = \"rectangle\"\naperture_um = [100, 20]",
            1,
        )
        .replacen("elements = [2, 4]", "elements = [1, 4]", 1)
        .replacen("[150, 120]", "[150, 40]", 1);
    let design = Design::parse(&path, &text).unwrap();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, hierarchy| written((&design, &array), hierarchy, folder.path(), name);
    let found = compare(
        &file("folded.gds", Hierarchy::Folded),
        &file("flat.gds", Hierarchy::Flat),
    );
    assert!(found.same_geometry);
    let pillars: Vec<_> = array.placed.iter().map(|p| array.widths(p).pillars()).collect();
    let compared: Vec<_> = found.elements.iter().map(|e| e.pillars).collect();
    assert_eq!(compared, pillars.iter().map(|&n| [n, n]).collect::<Vec<_>>());
    let centres: Vec<_> = found.elements.iter().map(|e| e.centre_nm).collect();
    assert_eq!(centres, design.sites().iter().map(|s| s.centre_nm).collect::<Vec<_>>());
}

/// Rotated rectangles: in any hierarchy the same; one rotation, one nanometre of one corner and one pillar more are differences.
#[test]
fn rotated_rectangles_are_compared_by_rotation_and_to_the_nanometre() {
    let pillars = metalith_pillars::RotatedRectangles {
        width_nm: 100,
        length_nm: 250,
        steps: 180,
    };
    // The rotations of a lattice, and the pillar of which a corner is a nanometre off.
    let bytes = |number: &dyn Fn(usize) -> u16, bent: Option<usize>| {
        let mut gds = Gds::library();
        gds.cell("TOP");
        for site in 0..100_usize {
            let (x, y) = (354 * (site % 10) as i32 - 1593, 354 * (site / 10) as i32 - 1593);
            let corners = pillars.on_grid(number(site));
            let mut corners = corners.map(|(dx, dy)| (x + dx as i32, y + dy as i32)).to_vec();
            corners[1].0 += i32::from(bent == Some(site));
            corners.push(corners[0]);
            gds.polygon(1, &corners);
        }
        gds.end_cell();
        gds.end()
    };
    let number = |site: usize| 20 + (site * 37 % 120) as u16;
    let folder = tempfile::tempdir().unwrap();
    let file = |name, bytes| write(folder.path(), name, bytes);
    let plain = file("plain.gds", bytes(&number, None));
    let rotated = file("rotated.gds", bytes(&|site| number(site) + u16::from(site == 42), None));
    let found = compare(&plain, &rotated);
    assert_eq!(
        (found.elements[0].pillars, found.elements[0].rotated),
        ([100, 100], 1),
        "{}",
        text(&found)
    );
    assert!(text(&found).contains("1 rotated"));
    let moved = file("moved.gds", bytes(&number, Some(42)));
    let found = compare(&plain, &moved);
    assert_eq!(found.elements[0].pillars, [100, 99], "{}", text(&found));
    assert!(!found.same_geometry);
}

/// Upright rectangles: other edges are wider, narrower, or, of one area, rotated by a quarter turn; in nanometres of an edge.
#[test]
fn upright_rectangles_are_compared_by_their_edges() {
    let pillars = metalith_pillars::UprightRectangles {
        shortest_nm: 100,
        step_nm: 10,
        lengths: 18,
    };
    let bytes = |edges: &dyn Fn(usize) -> [u16; 2]| {
        let mut gds = Gds::library();
        gds.cell("TOP");
        for site in 0..100_usize {
            let (x, y) = (354 * (site % 10) as i32 - 1593, 354 * (site / 10) as i32 - 1593);
            let number = pillars.number(edges(site)).unwrap();
            let mut corners = pillars
                .on_grid(number)
                .map(|(dx, dy)| (x + dx as i32, y + dy as i32))
                .to_vec();
            corners.push(corners[0]);
            gds.polygon(1, &corners);
        }
        gds.end_cell();
        gds.end()
    };
    let edges = |site: usize| [100 + 10 * (site % 16) as u16, 110 + 10 * (site * 7 % 15) as u16];
    let changed = |site: usize| match (site, edges(site)) {
        (12, [x, y]) => [y, x],
        (34, [x, _]) => [x, 250],
        (56, [x, _]) => [x, 100],
        (_, same) => same,
    };
    let folder = tempfile::tempdir().unwrap();
    let file = |edges: &dyn Fn(usize) -> [u16; 2], name: &str| write(folder.path(), name, bytes(edges));
    let found = compare(&file(&edges, "a.gds"), &file(&changed, "b.gds"));
    let one = &found.elements[0];
    assert_eq!(
        (one.pillars, one.rotated, one.widened, one.narrowed),
        ([100, 100], 1, 1, 1),
        "{}",
        text(&found)
    );
    let most = [12, 34, 56].map(|site| {
        let (a, b) = (edges(site), changed(site));
        a[0].abs_diff(b[0]).max(a[1].abs_diff(b[1]))
    });
    assert_eq!(
        one.largest_change_nm,
        most.into_iter().max().unwrap(),
        "{}",
        text(&found)
    );
    assert!(!found.same_geometry);
    // Edges that one file alone has, either way.
    let longer = |site: usize| edges(site).map(|nm| if nm == 250 { 270 } else { nm });
    let count = (0..100).filter(|site| longer(*site) != edges(*site)).count() as u64;
    let (a, b) = (file(&edges, "a.gds"), file(&longer, "longer.gds"));
    for (from, to, wanted) in [(&a, &b, [count, 0]), (&b, &a, [0, count])] {
        let found = compare(from, to);
        let one = &found.elements[0];
        let counted = [one.widened, one.narrowed];
        assert_eq!(
            (one.pillars, one.added, one.removed),
            ([100, 100], 0, 0),
            "{}",
            text(&found)
        );
        assert_eq!(counted, wanted, "{}", text(&found));
    }
}

#[test]
fn files_of_other_tools_are_the_same_geometry() {
    let folder = metalith_testing::root().join("golden/foreign");
    let flat = folder.join("klayout_flat.gds");
    for other in [
        "gdstk_octants.gds",
        "gdstk_magnified.gds",
        "klayout_paths.gds",
        "gdstk_half_nm.gds",
        "klayout_lists.oas",
        "gdstk_octants.oas",
        "klayout_quarter_nm.oas",
    ] {
        let found = compare(&flat, &folder.join(other));
        assert!(found.same_geometry, "{other}: {}", text(&found));
    }
}

#[test]
fn pillars_added_removed_widened_narrowed() {
    let a = Chip::clean();
    let mut b = Chip::clean();
    b.at(3, 4).4 += 6;
    b.at(5, 6).4 -= 8;
    b.at(7, 8).4 -= 2;
    b.pillars.retain(|p| (p.0, p.1) != (60, 60));
    b.pillars.push((125, 60, 0, 0, 200));
    let found = of_chips(&a, &b);
    assert!(!found.same_geometry);
    let e = &found.elements[0];
    assert_eq!((e.added, e.removed, e.widened, e.narrowed), (1, 1, 1, 2));
    assert_eq!(e.largest_change_nm, 8);
    let squares = f64::from(6 * 6 + 8 * 8 + 2 * 2);
    assert!((e.rms_change_nm - (squares / 14_399.0).sqrt()).abs() < ROUNDING);
    assert_eq!((found.changes, found.listed.len()), (5, 5));
    assert_eq!(found.map.counts.iter().sum::<u64>(), 5);
    let html = page(&found).html();
    assert!(html.contains("The geometry differs") && html.contains("<svg"));
    assert!(text(&found).contains("1 added, 1 removed, 1 widened, 2 narrowed"));
    // The other way round, what was added is removed.
    let back = of_chips(&b, &a);
    assert_eq!((back.elements[0].added, back.elements[0].widened), (1, 2));
}

#[test]
fn one_nanometre_and_one_letter_are_differences() {
    let a = Chip::clean();
    let shifted = |dx| {
        let mut b = Chip::clean();
        b.at(60, 60).2 = dx;
        b
    };
    let found = of_chips(&a, &shifted(1));
    let e = &found.elements[0];
    assert_eq!((e.removed, e.moved, found.changes), (0, 1, 1));
    assert_eq!((e.largest_move_nm, e.largest_change_nm), (1.0, 0));
    assert!(text(&found).contains("moved by (1, 0) nm"), "{}", text(&found));
    assert!(metalith_drc::diff::page(&found).html().contains("moved by (1, 0) nm"));
    let with_text = |string: &str| {
        let mut b = Chip::clean();
        b.extra.text(11, string, 0, 0);
        b
    };
    let found = of_chips(&with_text("rev A"), &with_text("rev B"));
    assert!(!found.same_geometry && found.changes == 0);
    assert_eq!(found.texts_only_in_b[0].string, "rev B");
    // Twice exposed is not once exposed.
    let mut doubled = Chip::clean();
    doubled.extra.square(
        1,
        metalith_testing::lens::site(3),
        metalith_testing::lens::site(3),
        metalith_testing::lens::width(3, 3),
    );
    assert!(!of_chips(&a, &doubled).same_geometry);
}

#[test]
fn areas_cut_up_differently_are_the_same() {
    let chip = |draw: &dyn Fn(&mut Gds)| {
        let mut c = Chip::clean();
        draw(&mut c.extra);
        c
    };
    let whole = chip(&|g| {
        g.rect(10, 0, 100_000, 1000, 101_000);
    });
    let halves = chip(&|g| {
        g.rect(10, 0, 100_000, 400, 101_000)
            .rect(10, 400, 100_000, 1000, 101_000);
    });
    let found = of_chips(&whole, &halves);
    assert!(found.same_geometry, "{}", text(&found));
    assert_eq!((found.changes, found.layers.len()), (0, 3));
    let gap = chip(&|g| {
        g.rect(10, 0, 100_000, 400, 101_000)
            .rect(10, 401, 100_000, 1000, 101_000);
    });
    assert!(!of_chips(&whole, &gap).same_geometry);
}

/// Cells of other files are compared by name and place; what stands beside them is compared as ever.
#[test]
fn references_to_missing_cells_are_compared_by_name_and_place() {
    let folder = tempfile::tempdir().unwrap();
    let chip = |missing: &[(&str, i32)], width: i32| {
        let mut gds = Gds::library();
        gds.cell("UNDER").square(2, 0, 0, width);
        for &(name, x) in missing {
            gds.sref(name, x, 0);
        }
        gds.end_cell()
            .cell("TOP")
            .sref("UNDER", 0, 0)
            .placed("UNDER", 5000, 0, false, 1.0, 90.0);
        gds.end_cell().end()
    };
    let file = |name: &str, bytes| write(folder.path(), name, bytes);
    let a = file("a.gds", chip(&[("ELSEWHERE", 300)], 100));
    let same = compare(&a, &file("b.gds", chip(&[("ELSEWHERE", 300)], 100)));
    assert!(same.same_geometry, "{}", text(&same));
    assert_eq!((same.missing.in_both, same.missing.apart), (2, [0, 0]));
    let moved = compare(&a, &file("c.gds", chip(&[("ELSEWHERE", 301)], 100)));
    assert!(!moved.same_geometry);
    assert_eq!((moved.missing.in_both, moved.missing.apart), (0, [2, 2]));
    let turned = moved.missing.only_in_b.iter().find(|m| m.at_nm == [5000.0, 301.0]);
    assert_eq!(turned.map(|m| m.cell.as_str()), Some("ELSEWHERE"));
    let without = compare(&a, &file("d.gds", chip(&[], 120)));
    // A width that changed is one change, in neither file alone.
    assert_eq!((without.missing.apart, without.layers[0].only_in_b), ([2, 0], 0));
    assert!(!without.same_geometry);
    let html = page(&without).html();
    assert!(html.contains("reference to ELSEWHERE, which the file does not have"));
    assert!(text(&without).contains("only in a: a reference to ELSEWHERE"));
}

/// No row passes where the pillars of its layer differ, and places far from the first change are drawn.
#[test]
fn the_page_agrees_with_itself_and_draws_what_is_far_apart() {
    let a = Chip::clean();
    let mut b = Chip::clean();
    b.at(3, 4).4 += 6;
    b.at(110, 100).4 -= 8;
    let found = of_chips(&a, &b);
    let html = page(&found).html();
    assert!(html.contains("1: changes near") && html.contains("2: changes near"));
    assert!(!html.contains("3: changes near"));
    let layers = html.split("Layers").last().unwrap();
    let row = layers.split("<tr").find(|row| row.contains("1/0")).unwrap();
    assert!(row.to_lowercase().contains("fail"), "{row}");
}
