use super::*;
use crate::RealisedCells;
use metalith_cell::BAND_ORDERS;
use metalith_core::Silent;

/// Rms error over widths and pillars: what cubics leave of the resonances, of transmissions of modulus one.
const RMS: f64 = 0.01;

fn bank() -> CellBank {
    let stated = CellStack::paper(350.0, 700.0).unwrap();
    let least = change_of([-6.0, 0.0, 0.0, 0.0, 0.0]);
    let most = change_of([6.0, 0.0, 0.0, 0.0, 0.0]);
    let range = BankRange {
        widths_nm: [150.0, 200.0],
        numbers: Vec::new(),
        changes: [least, most],
        colours: vec![(0.53, BAND_ORDERS)],
    };
    CellBank::solve(&stated, range, &Silent).unwrap()
}

#[test]
fn pillars_between_the_nodes_are_those_solved_exactly_and_none_beyond_them_is_there() {
    let bank = bank();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cells.bank");
    bank.write(&path).unwrap();
    let back = CellBank::read(&path, bank.stated(), bank.range.clone()).unwrap();
    assert_eq!(back.colours, bank.colours);
    let change = change_of([1.3, 0.0, 0.0, 0.0, 0.0]);
    let widths: Vec<f64> = (0..24).map(|k| 150.4 + 2.0 * f64::from(k)).collect();
    let table = bank.transmissions(&change, BAND_ORDERS, &widths, 0.53).unwrap();
    let exact = RealisedCells::new(perturbed(bank.stated(), &change), 0.4);
    let exact = exact.solve_in_band(&widths, 0.53, [0.0; 2], &Silent).unwrap();
    let pairs = table.pillars[0].iter().zip(&exact.pillars[0]);
    let rms = (pairs.map(|(a, b)| (a - b).norm_sqr()).sum::<f64>() / widths.len() as f64).sqrt();
    assert!(rms < RMS, "rms {rms}");
    let higher = change_of([7.0, 0.0, 0.0, 0.0, 0.0]);
    assert!(bank.transmissions(&higher, BAND_ORDERS, &widths, 0.53).is_err());
    assert!(bank.transmissions(&change, BAND_ORDERS, &[260.0], 0.53).is_err());
    assert!(bank.transmissions(&change, BAND_ORDERS, &widths, 0.6).is_err());
}
