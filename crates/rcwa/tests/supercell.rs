//! The solver of supercells against the truth of blazed rows, at the orders that the truth was made with.

use std::f64::consts::TAU;

use metalith_rcwa::{
    CellLattice, Incidence, Layer, LayerStack, Material, Outline, Side, SiteLattice, Supercell, SupercellResponse,
    solve_supercell,
};
use num_complex::Complex64;

/// Both solvers keep the same orders and follow the same rules of factorisation, so they differ by the rounding of
/// the table, six digits after the point, and a little of their own.
const PRINTED: f64 = 2e-6;

/// Tolerance of the power where nothing absorbs: the rounding of eigenvectors.
const ROUNDING: f64 = 1e-10;

/// Rows to compare: cells, wavelength (nm), incidence. Each is solved at the first offset of the pillars and for both
/// polarisations; the whole table would take minutes.
const SAMPLE: [(&str, &str, &str); 7] = [
    ("3", "660", "looks"),
    ("5", "455", "looks"),
    ("5", "530", "looks"),
    ("5", "660", "normal"),
    ("6", "530", "normal"),
    ("9", "530", "looks"),
    ("18", "455", "looks"),
];

#[test]
fn blazed_rows_agree_with_an_independent_solver() {
    let path = metalith_testing::root().join("golden/truth/supercell.csv");
    let text = std::fs::read_to_string(path).unwrap();
    let (mut share, mut amplitude): (f64, f64) = (0.0, 0.0);
    for (cells, nm, incidence) in SAMPLE {
        let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
        let mut wanted = rows.iter().filter(|f| f[0] == cells && f[2] == nm && f[4] == incidence);
        let first = wanted.next().unwrap();
        let response = solve(first);
        for power in response.total_power() {
            assert!((power - 1.0).abs() < ROUNDING, "{cells} {nm} {incidence}: {power}");
        }
        let other = wanted.find(|f| f[5] != first[5] && f[6] == first[6]).unwrap();
        for row in [first, other] {
            let (by_share, by_amplitude) = differences(row, &response);
            println!("{cells} {nm} {incidence} {}: {by_share:.1e} {by_amplitude:.1e}", row[5]);
            share = share.max(by_share);
            amplitude = amplitude.max(by_amplitude);
        }
    }
    assert!(share < PRINTED && amplitude < PRINTED, "{share} {amplitude}");
}

fn number(row: &[&str], column: usize) -> f64 {
    row[column].parse().unwrap()
}

/// The row of pillars of a line of the table.
fn solve(row: &[&str]) -> SupercellResponse {
    let (sites, turns, wavelength_um) = (number(row, 0) as usize, number(row, 1), number(row, 2) * 1e-3);
    let index = |name: &str| Material::named(name).unwrap().index(wavelength_um).unwrap();
    let cells: Vec<LayerStack> = (0..sites)
        .map(|j| {
            let u = (turns * (j as f64 + number(row, 6)) / sites as f64).rem_euclid(1.0);
            let duty = [0.3501, 0.4786, -0.4873, 0.9647, 0.2686, -0.7189];
            let duty = duty.iter().rev().fold(0.0, |sum, c| sum * u + c);
            LayerStack {
                pitch_nm: 350.0,
                lattice: CellLattice::Square,
                below: index("fused_silica_malitson_1965"),
                layers: vec![Layer {
                    height_nm: 700.0,
                    outline: Outline::square((2.0 * (175.0 * duty + 0.5).floor()).clamp(100.0, 300.0)),
                    inside: index("sin_luke_2015"),
                    outside: Complex64::ONE,
                }],
                above: Complex64::ONE,
            }
        })
        .collect();
    let supercell = Supercell::of_cells(SiteLattice::row(sites).unwrap(), &cells).unwrap();
    let sine = match row[4] {
        "looks" => -turns * wavelength_um / (sites as f64 * 0.35),
        _ => 0.0,
    };
    let incidence = Incidence::of_sines(wavelength_um, Side::Below, [sine, 0.0]);
    solve_supercell(&supercell, &incidence, row[3].parse().unwrap()).unwrap()
}

/// Largest difference of a share, and that of the amplitude of the first order.
fn differences(row: &[&str], response: &SupercellResponse) -> (f64, f64) {
    let polarisation = usize::from(row[5] == "p");
    let turns = number(row, 1) as i32;
    let share = |m: i32| response.order([m * turns, 0]).map_or(0.0, |o| o.power[polarisation]);
    let by_share = [0, 1, 2, -1]
        .iter()
        .zip(10..)
        .map(|(&m, column)| (share(m) - number(row, column)).abs())
        .fold(0.0, f64::max);
    let wedge = TAU * f64::from(turns) * number(row, 6) / number(row, 0);
    let first = response.order([turns, 0]).unwrap().amplitude(polarisation) * Complex64::cis(-wedge);
    (
        by_share,
        (first - Complex64::new(number(row, 14), number(row, 15))).norm(),
    )
}
