//! Mistakes that a layout does not show: a mapping of another cell, a phase over the plane in the section of the lens, an aperture
//! beyond the chip.

use std::path::Path;

use metalith_core::{Error, FaultKind, Result};
use metalith_design::Design;
use metalith_design::phase::{ElementPhase, LensPhase};
use metalith_testing::{accepting, changed as text, design};

fn parse(name: &str, text: &str) -> Result<Design> {
    Design::parse(&design(name), text)
}

fn ids(design: &Design) -> Vec<&'static str> {
    design.mapping_warnings().iter().map(|w| w.id).collect()
}

#[test]
fn a_mapping_of_another_cell_is_refused_with_both_values() {
    let taller = text("asi_940", &[("pillar_height_nm = 550", "pillar_height_nm = 300")]);
    let error = parse("asi_940", &taller).unwrap_err();
    assert!(error.has_fault(FaultKind::Inconsistent, "mapping.cell.pillar_height_nm"));
    let said = error.to_string();
    assert!(
        said.contains("`pillar_height_nm = 550`") && said.contains("`pillar_height_nm = 300`"),
        "{said}"
    );
    // The published coefficients are of the published cell, whoever writes them.
    let taller = text("mini_3x3", &[("pillar_height_nm = 700", "pillar_height_nm = 300")]);
    let error = parse("mini_3x3", &taller).unwrap_err();
    assert!(
        error.has_fault(FaultKind::Inconsistent, "mapping.coefficients"),
        "{error}"
    );
    // A key that is itself a mistake is one mistake.
    let wrong = text("asi_940", &[("pillar_height_nm = 550", "pillar_height_nm = 3")]);
    match parse("asi_940", &wrong).unwrap_err() {
        Error::Text(faults) => assert_eq!(faults.count(), 1, "{faults}"),
        other => panic!("{other}"),
    }
}

#[test]
fn a_table_of_another_wavelength_is_refused_with_its_line() {
    let other = text(
        "tio2_532",
        &[
            ("[mapping] ", "[mapping]\n#"),
            ("\nwavelength_nm = 532\ntable", "\nwavelength_nm = 540\ntable"),
        ],
    );
    let error = parse("tio2_532", &other).unwrap_err();
    assert_eq!(error.id(), "mapping/cell-differs");
    let said = error.to_string();
    assert!(
        said.contains("tio2_532.csv, line 7") && said.contains("= 532`") && said.contains("= 540`"),
        "{said}"
    );
    let accepted = parse("tio2_532", &accepting(&other)).unwrap();
    assert_eq!(ids(&accepted), ["mapping/difference-accepted"]);
    // Who makes a mapping needs none of this cell.
    let made = Design::parse_without_library(&design("tio2_532"), &other).unwrap();
    assert_eq!(ids(&made), ["mapping/cell-differs"]);
}

#[test]
fn a_mapping_that_states_no_cell_is_a_warning() {
    let all = text("asi_940", &[]);
    let (head, rest) = all.split_once("[mapping.cell]").unwrap();
    let (_, tail) = rest.split_once("[layout]").unwrap();
    let old = parse("asi_940", &format!("{head}[layout]{tail}")).unwrap();
    assert_eq!(ids(&old), ["mapping/cell-not-stated"]);
    // What the warning says to write is what the design has.
    assert!(old.mapping_warnings()[0].hint.contains("pillar_height_nm = 550; "));
    // The layout is the same.
    assert_eq!(old.digest(), parse("asi_940", &all).unwrap().digest());
    for name in ["mini_3x3", "geometric_phase_532", "birefringent_532"] {
        assert_eq!(ids(&Design::read(&design(name)).unwrap()), Vec::<&str>::new(), "{name}");
    }
}

/// A map of 2 x 2 places or more as NPY, of an entry for each place.
fn write_npy(path: &Path, descr: &str, columns_first: bool, side: usize, entry: impl Fn(usize, usize) -> Vec<f64>) {
    let order = if columns_first { "True" } else { "False" };
    let header = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': ({side}, {side}), }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    for slow in 0..side {
        for fast in 0..side {
            let (row, column) = if columns_first { (fast, slow) } else { (slow, fast) };
            entry(row, column).iter().for_each(|v| bytes.extend(v.to_le_bytes()));
        }
    }
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn a_map_is_a_phase_of_the_lens_in_every_form() {
    /// Rounding of angles and of printed numbers.
    const ROUNDING: f64 = 1e-9;
    const SIDE: usize = 224;
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let phase = |row: usize, column: usize| 0.01 * row as f64 - 0.02 * column as f64;
    write_npy(&file("plain.npy"), "<f8", false, SIDE, |r, c| vec![phase(r, c)]);
    write_npy(&file("columns.npy"), "<f8", true, SIDE, |r, c| vec![phase(r, c)]);
    write_npy(&file("field.npy"), "<c16", false, SIDE, |r, c| {
        vec![phase(r, c).cos(), phase(r, c).sin()]
    });
    let rows = (0..SIDE).map(|r| {
        (0..SIDE)
            .map(|c| format!("{}", phase(r, c)))
            .collect::<Vec<_>>()
            .join(",")
    });
    std::fs::write(file("plain.csv"), rows.collect::<Vec<_>>().join("\n")).unwrap();
    let of = |source: &str, name: &str| {
        let lines = format!(
            "{source}\nfile = {:?}\npitch_um = 0.45",
            file(name).display().to_string()
        );
        let text = text("asi_940", &[("source = \"hyperbola\"\nwavelength_nm = 940", &lines)]);
        let design = parse("asi_940", &text).unwrap();
        let lens = LensPhase::of(&design);
        let element = ElementPhase::of(&lens, &design.elements()[0]);
        [(100, 100), (40, 120), (150, 80)].map(|(ix, iy)| element.wrapped(ix, iy).unwrap())
    };
    let term = of("source = \"flat\"\n[[phase.term]]\nsource = \"map\"", "plain.npy");
    for name in ["plain.npy", "columns.npy", "field.npy", "plain.csv"] {
        let own = of("source = \"map\"", name);
        let apart = own.iter().zip(&term).map(|(a, b)| (a - b - (a - b).round()).abs());
        assert!(apart.fold(0.0, f64::max) < ROUNDING, "{name}: {own:?} {term:?}");
    }
}

#[test]
fn an_aperture_beyond_the_chip_is_refused_with_both_sizes() {
    // The margin is 2 um.
    let chip = |um: &str| {
        text(
            "asi_940",
            &[("size_um = [200, 200]", &format!("size_um = [{um}, {um}]"))],
        )
    };
    assert!(parse("asi_940", &chip("104")).is_ok());
    let error = parse("asi_940", &chip("103.9")).unwrap_err();
    assert!(error.has_fault(FaultKind::Inconsistent, "chip.size_um"));
    let said = error.to_string();
    assert!(
        said.contains("104 by 104 um") && said.contains("103.9 by 103.9 um"),
        "{said}"
    );
}
