//! Mappings that a design reads from a separate file.

use metalith_cell::{MappingTable, PhaseCurve, PublishedCell};
use metalith_design::{Design, PillarRule};

#[test]
fn a_design_takes_its_mapping_from_a_table() {
    let folder = tempfile::tempdir().unwrap();
    let widths: Vec<u16> = (100..=300).step_by(2).collect();
    let curve = PhaseCurve::new(&PublishedCell::new(350), 0.452, &widths).unwrap();
    let exact = MappingTable::nearest(&curve, &[]).unwrap();
    std::fs::write(folder.path().join("mapping.csv"), exact.to_csv()).unwrap();
    let text = std::fs::read_to_string(metalith_testing::design("mini_3x3")).unwrap();
    let kept: Vec<_> = text.lines().filter(|line| !line.starts_with("coefficients")).collect();
    let text = kept
        .join("\n")
        .replace("[mapping]", "[mapping]\ntable = \"mapping.csv\"");
    let path = folder.path().join("design.toml");
    std::fs::write(&path, text).unwrap();
    let design = Design::read(&path).unwrap();
    assert_eq!(design.mapping.table.as_ref(), Some(&exact));
    // The layout has just these widths.
    let rule = PillarRule::new(&design.cell, &design.mapping);
    assert!(
        (0..1000)
            .map(|i| f64::from(i) / 1000.0)
            .all(|u| rule.width_nm(u) == exact.width_nm(u))
    );
}

/// A table of unit cells under the same key gives the mapping that its phases ask for, whatever the sign of time.
#[test]
fn a_design_takes_its_mapping_from_unit_cells() {
    let folder = tempfile::tempdir().unwrap();
    let widths: Vec<u16> = (100..=300).step_by(2).collect();
    let curve = PhaseCurve::new(&PublishedCell::new(350), 0.452, &widths).unwrap();
    let text = std::fs::read_to_string(metalith_testing::design("mini_3x3")).unwrap();
    let kept: Vec<_> = text.lines().filter(|line| !line.starts_with("coefficients")).collect();
    let read = |sign: f64, keys: &str| {
        let each = widths.iter().zip(&curve.turns);
        let rows: String = each.map(|(w, turns)| format!("{w},{}\n", sign * turns)).collect();
        std::fs::write(
            folder.path().join("cells.csv"),
            format!("width_nm,phase (waves)\n{rows}"),
        )
        .unwrap();
        let text = kept
            .join("\n")
            .replace("[mapping]", &format!("[mapping]\ntable = \"cells.csv\"\n{keys}"));
        let path = folder.path().join("design.toml");
        std::fs::write(&path, text).unwrap();
        Design::read(&path)
    };
    let exact = MappingTable::nearest(&curve, &[]).unwrap();
    for (sign, convention) in [(1.0, "exp(-iwt)"), (-1.0, "exp(+iwt)")] {
        for keys in [String::new(), format!("phase_convention = \"{convention}\"")] {
            let design = read(sign, &keys).unwrap();
            assert_eq!(design.mapping.table.as_ref(), Some(&exact));
            let cells = design.mapping.solved.unwrap().cells.unwrap();
            assert_eq!(cells.convention.name(), convention);
            assert!(cells.interpolation.is_none());
        }
    }
    let error = read(1.0, "phase_convention = \"exp(+iwt)\"").unwrap_err();
    assert_eq!(error.id(), "mapping/phase-convention");
    // A mapping has no convention.
    let path = folder.path().join("design.toml");
    std::fs::write(folder.path().join("cells.csv"), exact.to_csv()).unwrap();
    assert_eq!(Design::read(&path).unwrap_err().id(), "mapping/phase-convention");
}

/// A mapping that is solved from the cell needs no wavelength beside that of the lens, and stands beside no other.
#[test]
fn a_mapping_of_the_cell_stands_alone() {
    let path = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../designs/tio2_532.toml"));
    let text = std::fs::read_to_string(path).unwrap();
    let (before, rest) = text.split_once("[mapping]").unwrap();
    let after = &rest[rest.find("[layout]").unwrap()..];
    let with = |keys: &str| Design::parse_without_library(path, &format!("{before}[mapping]\n{keys}\n{after}"));
    let design = with("source = \"cells\"").unwrap();
    assert!(design.mapping.from_cells && design.mapping.table.is_none());
    assert_eq!(design.mapping.wavelength_um, 0.532);
    // Whoever makes the mapping needs none.
    let none = Design::parse_without_library(path, &format!("{before}{after}")).unwrap();
    assert!(none.mapping.from_cells && none.mapping.wavelength_um == 0.532);
    for keys in [
        "source = \"cells\"\ncoefficients = [0.3, 0.4]",
        "source = \"cells\"\ntable = \"mappings/tio2_532.csv\"",
        "source = \"table\"",
    ] {
        assert!(with(keys).is_err(), "{keys}");
    }
}

/// The library of upright rectangles can be solved like a mapping, and stands beside no other.
#[test]
fn a_library_of_the_cell_stands_alone() {
    let path = metalith_testing::design("birefringent_532");
    let text = std::fs::read_to_string(&path).unwrap();
    let with = |keys: &str| {
        let text = text.replace("library = \"phases/birefringent_532.csv\"", keys);
        Design::parse_without_library(&path, &text)
    };
    let design = with("source = \"cells\"").unwrap();
    assert!(design.mapping.from_cells && design.mapping.identity.is_stated);
    assert!(design.mapping.pillar_library_file.is_none());
    let both = "library = \"phases/birefringent_532.csv\"\nsource = \"cells\"";
    let error = with(both).unwrap_err();
    assert!(
        error.has_fault(metalith_core::FaultKind::Inconsistent, "mapping.library"),
        "{error}"
    );
    let rotated = metalith_testing::design("geometric_phase_532");
    let text = std::fs::read_to_string(&rotated).unwrap();
    let error = Design::parse(
        &rotated,
        &text.replace("[mapping] ", "[mapping]\nsource = \"cells\"\n#"),
    )
    .unwrap_err();
    assert!(
        error.has_fault(metalith_core::FaultKind::Inconsistent, "mapping.source"),
        "{error}"
    );
}
