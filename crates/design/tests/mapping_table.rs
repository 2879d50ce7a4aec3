//! Mappings that a design reads from a file of its own.

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
