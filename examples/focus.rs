//! The focus of one 1 mm lens, and what it cost: `cargo run --release --example focus -- accurate 20`.
//!
//! The lens of `golden/truth/diffraction_rs.csv` at 452 nm, its phase formed as it is asked for, and the steered
//! element of `golden/truth/diffraction_steered.csv` at 550 nm from pillar widths and a table, the widths formed
//! as they are asked for and once more stored, as they come from a layout. All on windows of 256 x 256 samples
//! and on one thread. Prints one line of JSON a lens; the peak of memory is that of the process so far.

use std::f64::consts::TAU;
use std::time::Instant;

use metalith::wave::{
    Aperture, FoldedPropagator, PhaseFunction, PillarFunction, Pillars, PlaneWave, Propagator, Scratch, Window,
};
use metalith::{Accuracy, Lattice, PillarMap};
use num_complex::Complex64;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let accuracy = match arguments.next().as_deref() {
        Some("fast") => Accuracy::Fast,
        _ => Accuracy::Accurate,
    };
    let repeats = arguments.next().and_then(|n| n.parse().ok()).unwrap_or(1);

    let l = 0.452;
    let lens = PhaseFunction {
        lattice: Lattice::new(350, 2857).expect("a lattice"),
        radius_um: 500.0,
        amplitude: 1.0,
        phase_rad: |x: f64, y: f64| -TAU / l * ((x * x + y * y + 4e6).sqrt() - 2000.0),
    };
    let truth = Complex64::new(-829.0100386993555, -151.4940109776217);
    report("round", &lens, &PlaneWave::normal(l), 2000.0, accuracy, repeats, truth);

    let table: Vec<Complex64> = (0..=300)
        .map(|w| Complex64::cis(TAU * turns(550.0, f64::from(w) / 350.0)))
        .collect();
    let wave = PlaneWave {
        sin_x: -15.0_f64.to_radians().sin(),
        ..PlaneWave::normal(0.55)
    };
    let truth = Complex64::new(-507.07098591348256, -223.40288642904898);
    let lattice = Lattice::new(350, 2858).expect("a lattice");
    let formed = PillarFunction::new(lattice, 500.0, &table, steered_nm);
    report("steered, formed", &formed, &wave, 2400.0, accuracy, repeats, truth);

    let mut widths = PillarMap::empty(lattice);
    for ((iy, ix), width) in widths.number.indexed_iter_mut() {
        let [x, y] = [ix, iy].map(|i| lattice.coordinate_um(i));
        if x * x + y * y <= 250_000.0 {
            *width = steered_nm(x, y);
        }
    }
    let stored = Pillars::new(&widths, &table).expect("widths up to 300 nm");
    report("steered, stored", &stored, &wave, 2400.0, accuracy, repeats, truth);
}

/// Forms the field `repeats` times and prints the mean cost and the error at the focus.
fn report(
    name: &str,
    aperture: &dyn Aperture,
    wave: &PlaneWave,
    distance_um: f64,
    accuracy: Accuracy,
    repeats: u32,
    truth: Complex64,
) {
    let window = Window::about([0.0, 0.0], 0.35, 256, distance_um);
    let (clock, cpu) = (Instant::now(), metalith_testing::cpu_s());
    let mut value = Complex64::ZERO;
    for _ in 0..repeats {
        // Planning and memory are part of the cost of one PSF.
        let radius = aperture.radius_um();
        let fold =
            FoldedPropagator::plan(aperture.lattice(), radius, wave.wavelength_um, window, accuracy).expect("a plan");
        let field = fold.field(aperture, wave, &mut Scratch::default()).expect("a field");
        let v = field.values[[128, 128]];
        value = Complex64::new(v.re.into(), v.im.into());
    }
    let cpu_s = cpu
        .zip(metalith_testing::cpu_s())
        .map_or(clock.elapsed().as_secs_f64(), |(a, b)| b - a)
        / f64::from(repeats);
    println!(
        "{{\"lens\": \"{name}\", \"mode\": \"{accuracy:?}\", \"cpu_s\": {cpu_s:.4}, \"centre\": {:.1}, \
         \"error\": {:.2e}, \"peak_mb\": {}}}",
        value.norm_sqr(),
        (value - truth).norm() / truth.norm(),
        peak_mb().map_or("null".into(), |mb| format!("{mb:.1}")),
    );
}

/// Most memory that this process has had, where the system tells.
fn peak_mb() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find(|line| line.starts_with("VmHWM"))?;
    Some(line.split_whitespace().nth(1)?.parse::<f64>().ok()? / 1024.0)
}

fn turns(l: f64, d: f64) -> f64 {
    6.051 - 0.02033 * l + 2.26 * d + 1.371e-5 * l * l - 0.002947 * l * d + 0.797 * d * d
}

/// Width of the pillar at x, y [um]: a hyperbola and a wedge of 15 degrees, for 550 nm.
fn steered_nm(x: f64, y: f64) -> u16 {
    let path = 15.0_f64.to_radians().sin() * x - ((x * x + y * y + 5.76e6).sqrt() - 2400.0);
    let turns = path / 0.55;
    let u = turns - turns.floor();
    2 * (175.0 * (0.2923 + 0.6809 * u - 0.1484 * u * u)).round() as u16
}
