//! Conversion of layouts of any program: what a format can hold is kept, and what it cannot is said.

use std::path::Path;

use metalith_core::{Result, Silent};
use metalith_gds::{LayerNumber, Layout, Point, Rect, Selection, Shape, Text, Transform, Visitor};
use metalith_layout::{LayoutFormat, convert};
use metalith_testing::gds::Gds;

/// Everything of a layout, flat and sorted.
#[derive(Default, PartialEq, Debug)]
struct Flat {
    shapes: Vec<(LayerNumber, Vec<Point>)>,
    texts: Vec<(LayerNumber, Vec<u8>, Point)>,
}

impl Visitor for Flat {
    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> Result<()> {
        for t in placements {
            let mut corners = metalith_gds::simplified(&shape.outline.placed(t));
            corners.sort_unstable();
            corners.dedup();
            self.shapes.push((shape.layer, corners));
        }
        Ok(())
    }

    fn text(&mut self, text: &Text<'_>, _: &[Transform]) -> Result<()> {
        self.texts.push((text.layer, text.string.to_vec(), text.at));
        Ok(())
    }
}

fn flat(layout: &Layout) -> Flat {
    let mut flat = Flat::default();
    layout.visit(&Selection::default(), &mut flat, &Silent).unwrap();
    flat.shapes.sort_unstable();
    flat.texts.sort_unstable();
    flat
}

fn names(layout: &Layout) -> Vec<Vec<u8>> {
    (0..layout.cells().len())
        .map(|k| layout.name_bytes(k).to_vec())
        .collect()
}

/// The bytes written to `name` in a folder, and what was said of anything but the name of the library.
fn converted(layout: &Layout, folder: &Path, name: &str) -> (Layout, Vec<String>) {
    let path = folder.join(name);
    let written = convert(layout, LayoutFormat::of_name(&path), &path, &Silent).unwrap();
    assert_eq!(written.bytes, std::fs::metadata(&path).unwrap().len());
    let mut remarks = written.remarks;
    remarks.retain(|remark| !remark.starts_with("the name of the library"));
    (Layout::open(&path).unwrap(), remarks)
}

fn open(folder: &Path, bytes: &[u8]) -> Layout {
    let path = folder.join("in.gds");
    std::fs::write(&path, bytes).unwrap();
    Layout::open(&path).unwrap()
}

/// Text of any bytes: an ASCII record of them.
fn text(gds: &mut Gds, bytes: &[u8]) {
    let mut padded = bytes.to_vec();
    padded.resize(bytes.len().next_multiple_of(2), 0);
    gds.empty(0x0C).int2(0x0D, &[10]).int2(0x16, &[0]).int4(0x10, &[0, 0]);
    gds.record(0x19, 6, &padded).empty(0x11);
}

#[test]
fn bytes_of_names_and_texts_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let mut gds = Gds::library();
    gds.int2(0x05, &[0; 12]).record(0x06, 6, b"Linse_gr\xf6\xdfe\0");
    gds.square(1, 0, 0, 10).end_cell();
    gds.cell("lens(1)/a b$?[x]").square(1, 30, 0, 10).end_cell();
    gds.cell("TOP").sref("lens(1)/a b$?[x]", 0, 0);
    gds.empty(0x0A)
        .record(0x12, 6, b"Linse_gr\xf6\xdfe\0")
        .int4(0x10, &[90, 0])
        .empty(0x11);
    for bytes in [
        &b""[..],
        b"two\nlines",
        b"C:\\lens\\v2",
        b"pitch 0.35 \xb5m",
        b"\\xb5",
        b"plain text",
    ] {
        text(&mut gds, bytes);
    }
    let original = open(folder.path(), &gds.end_cell().end());
    let (same, said) = converted(&original, folder.path(), "same.gds");
    assert_eq!(
        (flat(&same), names(&same), said),
        (flat(&original), names(&original), vec![])
    );
    let (oasis, said) = converted(&original, folder.path(), "out.oas");
    assert_eq!((flat(&oasis), names(&oasis)), (flat(&original), names(&original)));
    assert_eq!(said.len(), 1, "{said:?}");
    let bytes = std::fs::read(folder.path().join("out.oas")).unwrap();
    let holds = |name: &[u8]| bytes.windows(name.len()).any(|w| w == name);
    assert!(holds(b"lens(1)/a\\x20b$?[x]") && holds(b"Linse_gr\\xf6\\xdfe"));
    let (again, said) = converted(&oasis, folder.path(), "again.oas");
    assert_eq!(
        (flat(&again), names(&again), said.len()),
        (flat(&original), names(&original), 1)
    );
    let (back, said) = converted(&oasis, folder.path(), "back.gds");
    assert_eq!(
        (flat(&back), names(&back), said),
        (flat(&original), names(&original), vec![])
    );
}

#[test]
fn the_name_of_the_library_is_kept_or_its_loss_stated() {
    let folder = tempfile::tempdir().unwrap();
    let original = open(
        folder.path(),
        &Gds::library().cell("TOP").square(1, 0, 0, 10).end_cell().end(),
    );
    let (same, _) = converted(&original, folder.path(), "same.gds");
    assert_eq!((original.library(), same.library()), ("TEST", "TEST"));
    let path = folder.path().join("out.oas");
    let written = convert(&original, LayoutFormat::of_name(&path), &path, &Silent).unwrap();
    let stated = "the name of the library, TEST, is not written: OASIS has no place for it";
    assert_eq!(written.remarks, [stated]);
    // From OASIS, the name is the usual one.
    let (back, said) = converted(&Layout::open(&path).unwrap(), folder.path(), "back.gds");
    assert_eq!((back.library(), said.len()), ("LIB", 0));
}

#[test]
fn notes_of_klayout_are_kept_in_gdsii() {
    let folder = tempfile::tempdir().unwrap();
    let notes = |gds: &mut Gds, cells: &[&str]| {
        gds.int2(0x05, &[2026, 1, 1, 0, 0, 0, 2026, 1, 1, 0, 0, 0]);
        gds.ascii(0x06, "$$$CONTEXT_INFO$$$");
        gds.empty(0x08).int2(0x0D, &[0]).int2(0x0E, &[0]).int4(0x10, &[0; 10]);
        gds.int2(0x2B, &[0]).ascii(0x2C, "META('a')='1'").empty(0x11);
        for cell in cells {
            gds.empty(0x0A).ascii(0x12, cell).int4(0x10, &[0, 0]);
            gds.int2(0x2B, &[0]).ascii(0x2C, "META('ports')='{}'").empty(0x11);
        }
        gds.end_cell();
    };
    let mut gds = Gds::library();
    notes(&mut gds, &["SUB", "TOP", "OTHER"]);
    gds.cell("SUB").square(1, 0, 0, 10).end_cell();
    gds.cell("TOP").sref("SUB", 50, 0).end_cell();
    gds.cell("OTHER").end_cell();
    let original = open(folder.path(), &gds.end());
    let (same, said) = converted(&original, folder.path(), "same.gds");
    assert!(same.has_notes() && said.is_empty());
    let held = |cells: &[&str]| {
        let mut wanted = Gds::default();
        notes(&mut wanted, cells);
        let bytes = std::fs::read(folder.path().join("same.gds")).unwrap();
        bytes.windows(wanted.0.len()).any(|w| w == wanted.0)
    };
    assert!(held(&["SUB", "TOP", "OTHER"]));
    // Notes on cells that are not written are left out.
    let below = original.below("TOP").unwrap();
    let (one, _) = converted(&below, folder.path(), "same.gds");
    assert_eq!(flat(&one), flat(&below));
    assert!(held(&["SUB", "TOP"]));
    let (oasis, said) = converted(&below, folder.path(), "out.oas");
    assert!(!oasis.has_notes() && said.len() == 1, "{said:?}");
}

#[test]
fn references_to_other_files_and_high_layers_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let mut gds = Gds::library();
    gds.cell("TOP")
        .sref("PCELL_LIB_x", 7, 9)
        .square(-1, 0, 0, 10)
        .end_cell();
    let original = open(folder.path(), &gds.end());
    for name in ["same.gds", "out.oas"] {
        let (layout, said) = converted(&original, folder.path(), name);
        let (top, missing) = (&layout.cells()[0], layout.dangling());
        assert_eq!(
            (missing.len(), missing[0].name.as_str(), said.len()),
            (1, "PCELL_LIB_x", 1)
        );
        assert_eq!(top.layers[0].0, LayerNumber::new(65535, 0));
        let (back, _) = converted(&layout, folder.path(), "back.gds");
        assert_eq!(
            back.dangling(),
            open(folder.path(), &std::fs::read(folder.path().join("back.gds")).unwrap()).dangling()
        );
        assert_eq!(back.dangling()[0].name, "PCELL_LIB_x");
        assert_eq!(back.cells()[0].layers[0].0, LayerNumber::new(65535, 0));
    }
}

#[test]
fn long_outlines_are_cut_and_large_arrays_divided() {
    let folder = tempfile::tempdir().unwrap();
    let mut gds = Gds::library();
    // A circle in two XY records, as some programs write what the format has not.
    let corner = |k: i32| {
        let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / 9000.0).sin_cos();
        [(1e8 * cos).round() as i32, (1e8 * sin).round() as i32]
    };
    let circle: Vec<i32> = (0..=9000).flat_map(|k| corner(k % 9000)).collect();
    gds.cell("TOP").empty(0x08).int2(0x0D, &[2]).int2(0x0E, &[0]);
    gds.int4(0x10, &circle[..8000]).int4(0x10, &circle[8000..]).empty(0x11);
    gds.array("SUB", 40_000u16 as i16, 2, [0, 0, 800_000, 0, 0, 700])
        .end_cell();
    gds.cell("SUB").square(1, 0, 0, 10).end_cell();
    let original = open(folder.path(), &gds.end());
    let (oasis, _) = converted(&original, folder.path(), "out.oas");
    assert_eq!(flat(&oasis), flat(&original));
    let (cut, said) = converted(&oasis, folder.path(), "back.gds");
    assert!(
        said.iter()
            .any(|s| s.contains("9001 points cut along lines into 2 parts")),
        "{said:?}"
    );
    let of_layer = |layout: &Layout, layer: u16| {
        let mut shapes = flat(layout).shapes;
        shapes.retain(|(l, _)| l.layer == layer);
        shapes
    };
    assert_eq!(of_layer(&cut, 1), of_layer(&original, 1));
    let parts = of_layer(&cut, 2);
    let around = |shapes: &[(LayerNumber, Vec<Point>)]| {
        shapes.iter().fold(Rect::EMPTY, |mut all, (_, points)| {
            points.iter().for_each(|&p| all.include(p));
            all
        })
    };
    assert_eq!(parts.len(), 2);
    assert_eq!(around(&parts), around(&of_layer(&original, 2)));
}

/// Boxes wider than 31 bits are refused in OASIS, and kept in GDSII.
#[test]
fn boxes_to_the_ends_of_the_plane() {
    let folder = tempfile::tempdir().unwrap();
    let mut gds = Gds::library();
    gds.cell("TOP")
        .rect(1, i32::MIN, i32::MIN, i32::MAX, i32::MAX)
        .end_cell();
    let original = open(folder.path(), &gds.end());
    let (same, _) = converted(&original, folder.path(), "same.gds");
    assert_eq!(flat(&same), flat(&original));
    let path = folder.path().join("out.oas");
    assert!(convert(&original, LayoutFormat::of_name(&path), &path, &Silent).is_err());
    assert!(!path.exists());
}

#[test]
fn names_that_end_in_gz_are_compressed() {
    let folder = tempfile::tempdir().unwrap();
    let original = open(folder.path(), &metalith_testing::gds::everything());
    for name in ["out.gds.gz", "out.oas.gz"] {
        let (packed, _) = converted(&original, folder.path(), name);
        assert_eq!(std::fs::read(folder.path().join(name)).unwrap()[..2], [0x1F, 0x8B]);
        let plain = name.trim_end_matches(".gz");
        let (plain, _) = converted(&original, folder.path(), plain);
        assert_eq!((packed.format(), flat(&packed)), (plain.format(), flat(&plain)));
    }
}
