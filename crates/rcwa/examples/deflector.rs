//! Eight pillars that deflect light, and the power of every diffraction order:
//! `cargo run --release -p metalith-rcwa --example deflector`
//!
//! Light of 452 nm comes along the normal from fused silica through pillars of silicon nitride into air. The phase of each width
//! is that of a lattice of equal pillars. Eight widths with phases an eighth of a wave apart are one period of a blazed grating.
//! The phase rises along +x: with the time factor exp(-i w t) the light then goes towards +x, into the order [1, 0].

use std::f64::consts::TAU;

use metalith_rcwa::{
    CellLattice, Error, Incidence, Layer, LayerStack, Material, Orders, Outline, Side, SiteLattice, Supercell,
    SupercellOrder, solve_supercell, transmit_each,
};

const WAVELENGTH_UM: f64 = 0.452;
const PITCH_NM: f64 = 350.0;
const SITES: usize = 8;

fn main() -> Result<(), Error> {
    let index = |name: &str| Material::named(name)?.index(WAVELENGTH_UM);
    let (silica, nitride, air) = (
        index("fused_silica_malitson_1965")?,
        index("sin_luke_2015")?,
        index("air")?,
    );
    let cell = |width_nm: f64| LayerStack {
        pitch_nm: PITCH_NM,
        lattice: CellLattice::Square,
        below: silica,
        layers: vec![Layer {
            height_nm: 700.0,
            outline: Outline::square(width_nm),
            inside: nitride,
            outside: air,
        }],
        above: air,
    };

    // The phase of each width, and for each site the width whose phase is nearest to that of the grating.
    let widths_nm: Vec<f64> = (0..=36).map(|step| 100.0 + 5.0 * f64::from(step)).collect();
    let cells: Vec<LayerStack> = widths_nm.iter().map(|&width_nm| cell(width_nm)).collect();
    let answers = transmit_each(&cells, WAVELENGTH_UM, Side::Below, Orders::new(9)?)?;
    let phases: Vec<f64> = answers.iter().map(|t| t.arg()).collect();
    let nearest = |wanted: f64| {
        let away = |number: usize| ((phases[number] - wanted) / TAU + 0.5).rem_euclid(1.0) - 0.5;
        (0..phases.len()).min_by(|&a, &b| away(a).abs().total_cmp(&away(b).abs()))
    };
    let of_site = |site: usize| nearest(phases[0] + TAU * site as f64 / SITES as f64);
    let chosen: Vec<usize> = (0..SITES).filter_map(of_site).collect();
    for &number in &chosen {
        let (power, phase) = (answers[number].norm_sqr() / silica.re, phases[number] / TAU);
        println!(
            "width {} nm: {power:.3} of the power, {phase:+.3} waves",
            widths_nm[number]
        );
    }

    // All eight together, with orders -3..=3 of a single cell along each axis.
    let row: Vec<LayerStack> = chosen.iter().map(|&number| cells[number].clone()).collect();
    let grating = Supercell::of_cells(SiteLattice::row(SITES)?, &row)?;
    let response = solve_supercell(&grating, &Incidence::normal(WAVELENGTH_UM, Side::Below), 3)?;
    println!("\n  order    angle in air   power of s   power of p");
    for order in &response.orders {
        let [sine_x, sine_y] = order.sines;
        // The other orders propagate in the substrate alone: light comes back in them.
        if sine_x.hypot(sine_y) < 1.0 {
            let [s, p] = order.power;
            let (number, angle) = (format!("{:?}", order.wave), sine_x.asin().to_degrees());
            println!("{number:>7} {angle:+11.2} deg {s:12.4} {p:12.4}");
        }
    }
    let sum = |of: fn(&SupercellOrder) -> [f64; 2]| {
        [0, 1].map(|polarisation| response.orders.iter().map(|order| of(order)[polarisation]).sum::<f64>())
    };
    let ([s, p], [s_back, p_back]) = (sum(|order| order.power), sum(|order| order.reflected));
    println!("transmitted in all {s:17.4} {p:12.4}\nreflected in all   {s_back:17.4} {p_back:12.4}");
    // Nothing absorbs: both together are the incident power.
    let [s, p] = response.total_power();
    println!("sum                {s:17.4} {p:12.4}");
    Ok(())
}
