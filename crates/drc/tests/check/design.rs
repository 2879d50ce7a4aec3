//! A layout against the design it should hold.

use std::path::PathBuf;

use metalith_core::Silent;
use metalith_design::{Design, Hierarchy, PillarArray};
use metalith_drc::{CheckInput, Deck, DrcReport};
use metalith_gds::Layout;
use metalith_layout::write_pillars;

use crate::{broken, input};

/// A design of the size of the shipped small one, its text changed, and its flat layout.
struct Case {
    _folder: tempfile::TempDir,
    design: Design,
    file: PathBuf,
}

impl Case {
    fn new(changes: &[(&str, &str)]) -> Self {
        let shipped = metalith_testing::root().join("designs/mini_3x3.toml");
        let mut text = std::fs::read_to_string(shipped).unwrap();
        for (from, to) in changes {
            assert!(text.contains(from), "{from}");
            text = text.replace(from, to);
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mini.toml");
        std::fs::write(&path, text).unwrap();
        let design = Design::read(&path).unwrap();
        let file = folder.path().join("mini.gds");
        let array = PillarArray::build(&design, &Silent).unwrap();
        write_pillars(&design, &array, Hierarchy::Flat, &file, &Silent).unwrap();
        Self {
            _folder: folder,
            design,
            file,
        }
    }

    fn judge(&self) -> DrcReport {
        let with = CheckInput {
            design: Some(&self.design),
            ..input()
        };
        metalith_drc::check(&Layout::open(&self.file).unwrap(), &Deck::standard(), &with, &Silent).unwrap()
    }

    /// Change the bytes of the file, from the first record of the first pillar on.
    fn alter(&self, change: impl FnOnce(&mut Vec<u8>, usize)) {
        let mut bytes = std::fs::read(&self.file).unwrap();
        let head = [0, 4, 8, 0, 0, 6, 13, 2, 0, 1, 0, 6, 14, 2, 0, 0, 0, 44, 16, 3];
        let at = bytes.windows(head.len()).position(|w| w == head).unwrap();
        change(&mut bytes, at);
        std::fs::write(&self.file, bytes).unwrap();
    }
}

/// True of every lattice of 350 nm: below 511 nm it diffracts into the glass.
const NOTE: (&str, u64) = ("design.lattice_orders", 1);

#[test]
fn the_shipped_small_design_holds() {
    let report = Case::new(&[]).judge();
    assert_eq!(broken(&report), [NOTE]);
    assert_eq!(report.exit_code(), 0);
}

#[test]
fn a_pillar_of_another_width_is_found() {
    let case = Case::new(&[]);
    // The first square one nanometre wider on all sides.
    case.alter(|bytes, at| {
        let place = |k: usize| at + 20 + 4 * k..at + 24 + 4 * k;
        let value = |bytes: &[u8], k| i32::from_be_bytes(bytes[place(k)].try_into().unwrap());
        let corners: Vec<i32> = (0..10).map(|k| value(bytes, k)).collect();
        for (k, &c) in corners.iter().enumerate() {
            let low = c == *corners.iter().skip(k % 2).step_by(2).min().unwrap();
            bytes[place(k)].copy_from_slice(&(c + if low { -1 } else { 1 }).to_be_bytes());
        }
    });
    assert_eq!(broken(&case.judge()), [("design.width_map", 1), NOTE]);
}

#[test]
fn a_missing_pillar_is_found() {
    const RECORDS: usize = 64;
    let case = Case::new(&[]);
    case.alter(|bytes, at| drop(bytes.drain(at..at + RECORDS)));
    assert_eq!(broken(&case.judge()), [("design.pillar_count", 1), NOTE]);
}

#[test]
fn a_phase_too_steep_for_the_lattice_is_found() {
    // The same lenses with a quarter of the focal length: numerical aperture 0.64 and wedges besides.
    let case = Case::new(&[("focal_length_um = 144", "focal_length_um = 36")]);
    let report = case.judge();
    assert_eq!(report.exit_code(), 1);
    let found = broken(&report);
    assert!(found.iter().all(|f| f.0.starts_with("design.")), "{found:?}");
    let steep = found.iter().find(|f| f.0 == "design.phase_step").unwrap();
    // Of nine elements the steered ones.
    assert!(steep.1 >= 4, "{found:?}");
}

#[test]
fn the_active_area_is_that_of_the_chip() {
    // The shipped chip is smaller than the deck's area; its marks reach to 5 um from the edge of this one.
    let case = Case::new(&[]);
    let (width, _) = case.design.layout.chip.size_nm;
    let text = std::fs::read_to_string(case.file.with_file_name("mini.toml")).unwrap();
    let size = format!("size_um = [{0}, {0}]", width / 1000);
    assert!(text.contains(&size), "{size}");
    let reach = case
        .design
        .layout
        .marks
        .iter()
        .flat_map(|m| m.centres_nm.iter().map(|c| c.0 + m.length_nm / 2));
    let tight = 2 * (reach.max().unwrap() / 1000 + 5);
    let case = Case::new(&[(&size, &format!("size_um = [{tight}, {tight}]"))]);
    assert!(broken(&case.judge()).iter().any(|f| f.0 == "layer.active_area"));
}
