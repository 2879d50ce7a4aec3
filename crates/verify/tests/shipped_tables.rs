//! A first run of a shipped 3 x 3 solves no table of dissimilar neighbours: they come with the program.

use metalith_cell::{NeighbourTable, NeighbourTableSpec};
use metalith_design::{Design, mappings};
use metalith_optics::cell_direction;
use metalith_wave::propagation::incident;

/// Also those whose mapping and directions are the prototype's, and one that is verified at more wavelengths.
const DESIGNS: [&str; 6] = [
    "mini_3x3",
    "prototype_3x3",
    "broadband_3x3",
    "imaging_3x3",
    "neighbours_3x3",
    "robust_3x3",
];

#[test]
fn tables_of_the_shipped_designs_come_with_the_program() {
    for name in DESIGNS {
        let design = Design::read(&metalith_testing::design(name)).unwrap();
        let (stack, mappings) = (design.cell_stack().unwrap(), mappings(&design));
        for element in design.elements() {
            for &wavelength_um in &design.verify.wavelengths_um {
                let wave = incident(&element.wedge, wavelength_um, [0.0; 2]).unwrap();
                let spec = NeighbourTableSpec {
                    wavelength_um,
                    sines: cell_direction([wave.sin_x, wave.sin_y], design.cell.lattice),
                };
                assert!(
                    NeighbourTable::is_shipped(&spec, &stack, &mappings),
                    "{name}: {spec:?} is missing: run scripts/ship_tables.sh"
                );
            }
        }
    }
}
