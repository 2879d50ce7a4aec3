//! The library of the cell: right between its samples, kept, reused, never trusted when changed.

use std::fs;
use std::sync::Mutex;

use metalith_cell::{CellModel, CellStack, CellTable, Origin, RigorousCell, TableSpec};
use metalith_core::{Progress, Silent};
use metalith_rcwa::Orders;

/// A library small enough to make in a second: few orders, few widths, a narrow band.
fn spec() -> TableSpec {
    TableSpec {
        stack: CellStack::paper(350.0, 700.0).unwrap(),
        band_um: (0.53, 0.57),
        widths_nm: (195, 205),
        tolerance: 0.01,
        orders: 5,
    }
}

/// Words of the library on what it does.
#[derive(Default)]
struct Notes(Mutex<Vec<String>>);

impl Progress for Notes {
    fn begin(&self, _what: &str, _steps: u64) {}
    fn advance(&self, _steps: u64) {}
    fn note(&self, text: &str) {
        self.0.lock().unwrap().push(text.to_owned());
    }
}

#[test]
fn between_its_samples_the_table_is_the_solver() {
    let spec = spec();
    let table = CellTable::compute(&spec, &Silent).unwrap();
    let orders = Orders::new(spec.orders).unwrap();
    // Two ways through the same samples: rounding of a cubic of numbers of size one.
    const ROUNDING: f64 = 1e-12;
    let mut errors = Vec::new();
    for width in [195_u16, 200, 204] {
        for i in 0..160 {
            let wavelength = 0.53013 + 0.04 * f64::from(i) / 161.0;
            let want = spec.stack.transmission(f64::from(width), wavelength, orders).unwrap();
            let got = table.transmission(f64::from(width), wavelength).unwrap();
            let all = table.transmissions(wavelength, 205).unwrap();
            assert!((got - all[usize::from(width)]).norm() < ROUNDING);
            errors.push((got - want).norm());
        }
    }
    errors.sort_by(f64::total_cmp);
    // Every interval is half of one that held in its middle; the resonance at 200:550 is among them.
    let worst = errors[errors.len() - 1];
    assert!(worst < 2.0 * spec.tolerance, "{worst}");

    // Widths between the coarse ones away from the fine range are smooth; half nanometres in it too.
    let coarse = (
        table.transmission(102.0, 0.55).unwrap(),
        spec.stack.transmission(102.0, 0.55, orders).unwrap(),
    );
    // The tolerance of a table for a whole design; that of this test is for wavelengths alone.
    const BETWEEN_WIDTHS: f64 = 0.01;
    assert!((coarse.0 - coarse.1).norm() < BETWEEN_WIDTHS, "{coarse:?}");
    assert!(table.transmission(351.0, 0.55).is_err() && table.transmissions(0.5, 200).is_err());
}

#[test]
fn a_kept_table_is_reused_only_whole_and_for_the_same_inputs() {
    let folder = tempfile::tempdir().unwrap();
    let spec = TableSpec {
        widths_nm: (200, 201),
        orders: 3,
        ..spec()
    };
    let (made, origin) = CellTable::obtain(&spec, Some(folder.path()), &Silent).unwrap();
    let Origin::Computed(Some(file)) = origin else {
        panic!("{origin:?}")
    };
    let (kept, origin) = CellTable::obtain(&spec, Some(folder.path()), &Silent).unwrap();
    assert_eq!(origin, Origin::Kept(file.clone()));
    assert_eq!(kept, made);

    // The same bytes on one thread.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(pool.install(|| CellTable::compute(&spec, &Silent)).unwrap(), made);

    // Any change of the inputs is another file.
    let mut other = spec.clone();
    other.stack.height_nm += 1.0;
    let (_, origin) = CellTable::obtain(&other, Some(folder.path()), &Silent).unwrap();
    assert!(matches!(&origin, Origin::Computed(Some(f)) if *f != file));

    // One bit, a missing end, other inputs under this name: said, and made again.
    let good = fs::read(&file).unwrap();
    let mut flipped = good.clone();
    flipped[good.len() / 2] ^= 1;
    let elsewhere = fs::read_dir(folder.path())
        .unwrap()
        .map(|e| e.unwrap().path())
        .find(|p| *p != file)
        .unwrap();
    let foreign = fs::read(elsewhere).unwrap();
    let mut said = Vec::new();
    for bytes in [&flipped[..], &good[..good.len() - 9], &good[..7], &foreign[..]] {
        fs::write(&file, bytes).unwrap();
        let notes = Notes::default();
        let (again, origin) = CellTable::obtain(&spec, Some(folder.path()), &notes).unwrap();
        assert_eq!(origin, Origin::Computed(Some(file.clone())));
        assert_eq!(again, made);
        let notes = notes.0.lock().unwrap().join(" ");
        said.push(notes.replace(&*file.to_string_lossy(), "FILE"));
        assert_eq!(fs::read(&file).unwrap(), good);
    }
    insta::assert_snapshot!(said.join("\n"), @"
        FILE is not used: its checksum does not hold
        FILE is not used: its checksum does not hold
        FILE is not used: it is cut short
        FILE is not used: it was made from other inputs
        ");
}

#[test]
fn a_rigorous_cell_blocks_where_nothing_stands() {
    let cell = RigorousCell::new(CellTable::compute(&spec(), &Silent).unwrap());
    let t = cell.transmissions(0.55, 205).unwrap();
    assert_eq!(t.len(), 206);
    assert_eq!(t[0].norm(), 0.0);
    let full = cell.full_transmission(0.55).unwrap();
    // Not one width passes more than all light.
    assert!(t.iter().all(|t| t.norm() <= full));
    assert!(cell.transmissions(0.55, 400).is_err());
}

#[test]
fn tables_that_cannot_be_are_refused() {
    let refused = |change: &dyn Fn(&mut TableSpec), id: &str| {
        let mut spec = spec();
        change(&mut spec);
        let error = CellTable::compute(&spec, &Silent).unwrap_err();
        assert_eq!(error.id(), id, "{error}");
    };
    refused(&|s| s.band_um = (0.6, 0.5), "cell/band-out-of-range");
    refused(&|s| s.band_um = (0.2, 0.5), "rcwa/material-out-of-range");
    refused(&|s| s.widths_nm = (0, 100), "cell/width-range-invalid");
    refused(&|s| s.widths_nm = (100, 400), "cell/width-range-invalid");
    refused(&|s| s.tolerance = 0.0, "cell/tolerance-out-of-range");
    refused(&|s| s.orders = 0, "rcwa/orders-out-of-range");
    refused(&|s| s.stack.height_nm = 0.0, "cell/height-out-of-range");
}
