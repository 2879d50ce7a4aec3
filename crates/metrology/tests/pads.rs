//! A set of pads of pillars that an independent maker wrote: direct solutions with other numbers of orders and slices, and noise.

use std::fmt::Write;
use std::path::Path;

use metalith_core::Silent;
use metalith_metrology::{SetKind, SetVerdict, calibrate, kind_of};
use metalith_rcwa::{CellLattice, Incidence, Layer, LayerStack, Material, Orders, Outline, Side, solve};
use num_complex::Complex64;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What is made otherwise than stated.
struct Truth {
    bias_nm: f64,
    height_nm: f64,
    taper_deg: f64,
    gain: f64,
}

const HEIGHT_NM: f64 = 700.0;
const INDEX: f64 = 2.04;

/// Reflectance of unpolarised light along the normal.
fn reflectance(width_nm: f64, nm: f64, truth: &Truth) -> f64 {
    let (orders, slices) = (13, 14);
    let height_nm = HEIGHT_NM + truth.height_nm;
    let lean = 2.0 * height_nm * truth.taper_deg.to_radians().tan();
    let layer = |k: usize| Layer {
        height_nm: height_nm / f64::from(slices),
        outline: Outline::square(width_nm + truth.bias_nm + lean * (0.5 - (k as f64 + 0.5) / f64::from(slices))),
        inside: Complex64::from(INDEX),
        outside: Complex64::ONE,
    };
    let stack = LayerStack {
        pitch_nm: 350.0,
        lattice: CellLattice::Square,
        below: Material::named("fused_silica_malitson_1965")
            .unwrap()
            .index(nm * 1e-3)
            .unwrap(),
        layers: (0..slices as usize).map(layer).collect(),
        above: Complex64::ONE,
    };
    let light = Incidence::normal(nm * 1e-3, Side::Above);
    let found = solve(&stack, &light, Orders::new(orders).unwrap()).unwrap();
    found.reflection[0][0].norm_sqr()
}

fn write_set(folder: &Path, truth: &Truth, seed: u64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
    let wavelengths = || (0..=80).map(|k| 450.0 + 5.0 * f64::from(k));
    let captures = folder.join("captures");
    std::fs::create_dir_all(&captures).unwrap();
    let mirror: String = [400.0, 900.0].iter().fold(String::new(), |mut all, nm| {
        writeln!(all, "{nm},90.0").unwrap();
        all
    });
    std::fs::write(folder.join("reference_mirror.csv"), mirror).unwrap();
    for width in [90, 120, 150, 180, 210, 240] {
        let exact: Vec<f64> = wavelengths()
            .map(|nm| reflectance(f64::from(width), nm, truth))
            .collect();
        for repeat in 0..2 {
            let mut text = String::from("# SIMULATED, not measured\n");
            for (nm, power) in wavelengths().zip(&exact) {
                let shown = power * (1.0 + truth.gain) + 0.001 * normal();
                writeln!(text, "{nm},{:.3}", 100.0 * shown / 0.9).unwrap();
            }
            std::fs::write(captures.join(format!("{width}_{repeat}.csv")), text).unwrap();
        }
    }
}

/// The set of `examples/measured/pads.toml`, made again.
#[test]
#[ignore = "second tier: CPU time, in scripts/slow_tests.sh"]
fn what_an_independent_maker_put_in_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let truth = Truth {
        bias_nm: -8.0,
        height_nm: 12.0,
        taper_deg: 0.6,
        gain: 0.02,
    };
    write_set(folder.path(), &truth, 7);
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/measured/pads.toml");
    let text = std::fs::read_to_string(example)
        .unwrap()
        .replace("folder = \"pads\"", "");
    std::fs::write(folder.path().join("measurement.toml"), text).unwrap();
    assert_eq!(kind_of(folder.path()), Some(SetKind::Spectra));
    let out = folder.path().join("out");
    let found = calibrate(folder.path(), SetKind::Spectra, &out, (&[], None), &Silent)
        .unwrap()
        .diagnosis;
    println!(
        "{}\n{:?}\n{}",
        found.sentence(),
        found.error,
        found.ladder_lines().join("\n")
    );
    assert!(
        matches!(found.verdict, SetVerdict::Explained | SetVerdict::ExplainedButFor),
        "{}",
        found.sentence()
    );
    // The reference errs too little to be found. Five slices of a wall do not make the interval of its taper wider.
    let put_in = [
        ("cd_bias", truth.bias_nm, 1.5, true),
        ("film_height", truth.height_nm, 3.0, true),
        ("sidewall_taper", truth.taper_deg, 0.15, false),
    ];
    for (name, value, within, in_interval) in put_in {
        let own = found.effects.iter().find(|e| e.name == name);
        let own = own.unwrap_or_else(|| panic!("{name} was not found"));
        let got = own.value.as_f64().unwrap();
        assert!((got - value).abs() < within, "{name}: {got}, {value} was put in");
        let [low, high]: [f64; 2] = serde_json::from_value(own.interval.clone()).unwrap();
        assert!(!in_interval || (low..=high).contains(&value), "{name}: {low} to {high}");
    }
    // The model's own error is stated, and is that of its orders, slices and interpolation.
    assert!(
        found.error.model_error.is_some_and(|error| error < 0.004),
        "{:?}",
        found.error
    );
}
