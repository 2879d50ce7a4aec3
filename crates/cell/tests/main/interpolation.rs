//! Tables are solved at few wavelengths: what they say between them is compared with the solver.

use metalith_cell::{CellStack, CellTable, Material, TableSpec};
use metalith_core::Silent;
use metalith_rcwa::Orders;

/// Largest distance of the transmission from the solver, absolute: less than half of the tolerance of these tables, 0.01, since
/// their functions settle at a twentieth of it.
const LARGEST: f64 = 0.004;

/// Orders of the tests: resonances as narrow as with more, and cells solved in a millisecond.
const ORDERS: usize = 9;

/// Compare a table with the solver at wavelengths between its own; the number of cells that it took.
fn compare(stack: CellStack, band_um: (f64, f64), widths_nm: (u16, u16)) -> usize {
    let spec = TableSpec {
        orders: ORDERS,
        widths_nm,
        ..TableSpec::new(stack, band_um, widths_nm)
    };
    let table = CellTable::compute(&spec, &Silent).unwrap();
    let orders = Orders::new(ORDERS).unwrap();
    let mut worst = (0.0, 0, 0.0);
    for width_nm in widths_nm.0..=widths_nm.1 {
        // Prime, so that no grid of the table is met.
        for k in 0..53 {
            let um = band_um.0 + (band_um.1 - band_um.0) * (f64::from(k) + 0.37) / 53.0;
            let error = table.transmission(f64::from(width_nm), um).unwrap()
                - spec.stack.transmission(f64::from(width_nm), um, orders).unwrap();
            if error.norm() > worst.0 {
                worst = (error.norm(), width_nm, um);
            }
        }
    }
    println!("{worst:?}, {} cells, {:?}", table.points(), table.interpolation());
    assert!(worst.0 < LARGEST, "{worst:?}");
    assert!(table.interpolation().largest < LARGEST);
    table.points()
}

fn cell(pitch_nm: f64, height_nm: f64, film: &str) -> CellStack {
    CellStack {
        film: Material::named(film).unwrap(),
        ..CellStack::paper(pitch_nm, height_nm).unwrap()
    }
}

#[test]
fn the_published_cell_is_met_about_each_of_its_wavelengths() {
    for um in [0.455, 0.53, 0.66] {
        compare(cell(350.0, 700.0, "sin_luke_2015"), (um - 0.02, um + 0.02), (198, 206));
    }
}

/// The lattice begins to diffract into the substrate at 512 nm: a branch point, beside narrow resonances of wide pillars.
#[test]
fn a_band_with_narrow_resonances_and_a_new_order_is_met() {
    let points = compare(cell(350.0, 700.0, "sin_luke_2015"), (0.4, 0.7), (256, 262));
    // Cubics take 151 wavelengths for each of 77 widths at the least.
    assert!(points < 77 * 50, "{points}");
}

#[test]
fn titanium_dioxide_with_sharp_resonances_is_met() {
    compare(cell(320.0, 600.0, "tio2_siefke_2016"), (0.5, 0.56), (228, 236));
    compare(cell(320.0, 600.0, "tio2_siefke_2016"), (0.515, 0.55), (270, 278));
}

#[test]
fn silicon_for_telecommunication_is_met() {
    compare(cell(700.0, 900.0, "a_si_pierce_1972"), (1.48, 1.62), (396, 404));
}
