//! CPU time and answer of one cell, for `scripts/rcwa_peers.py`: `cargo run --release --example cell -- 13 17`.
//!
//! The points and conventions are the script's: square pillar of silicon nitride, 700 nm high on a pitch
//! of 350 nm, from fused silica to air, along the normal. One line of JSON for each number of orders.

use std::time::Instant;

use metalith::cell::CellStack;
use metalith::rcwa::Orders;

/// Width [nm] and wavelength [um].
const POINTS: [(f64, f64); 3] = [(200.0, 0.452), (280.0, 0.452), (250.0, 0.525)];

fn main() {
    let stack = CellStack::paper(350.0, 700.0).expect("materials of the paper");
    for argument in std::env::args().skip(1) {
        let along_axis: usize = argument.parse().expect("a number of orders");
        let orders = Orders::new(along_axis).expect("an odd number of orders");
        let solve = |(width, wavelength)| stack.transmission(width, wavelength, orders).expect("a cell");
        let repeats = 20;
        solve(POINTS[0]);
        let (clock, cpu) = (Instant::now(), metalith_testing::cpu_s());
        for _ in 0..repeats {
            std::hint::black_box(POINTS.map(solve));
        }
        let total = cpu
            .zip(metalith_testing::cpu_s())
            .map_or(clock.elapsed().as_secs_f64(), |(a, b)| b - a);
        let t = POINTS.map(solve).map(|t| format!("[{:.6}, {:.6}]", t.re, t.im));
        println!(
            "{{\"orders\": {along_axis}, \"cpu_s\": {:.6}, \"t\": [{}]}}",
            total / f64::from(repeats) / POINTS.len() as f64,
            t.join(", ")
        );
    }
}
