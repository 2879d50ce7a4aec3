//! Errors of the local periodic approximation and of the coupled model on rows of real pillars of
//! `designs/prototype_3x3.toml`, whose optimised phase jumps from ring to ring.
//!
//! Rows of 20 consecutive pillars along x and of 12 along y or the diagonal, at four radii, without the three at either end; of the centre element in light
//! along the normal, and of an element that is steered by the angle asked for in light from where it looks. Prints the
//! share of the light that each model puts elsewhere than the supercell of the row does, and of all rows together the first
//! order by equal neighbours, neighbours and supercells. `cargo run --release -p metalith-design --example
//! real_rows -- 0 15 15,15`; some minutes on one core.

#[allow(dead_code, reason = "tests compare blazed rows by it")]
#[path = "../tests/prototype_rows/mod.rs"]
mod prototype_rows;

use prototype_rows::{Prototype, RADII_UM};

fn main() {
    let prototype = Prototype::new();
    println!(
        "| element | nm | equal neighbours along the normal | oblique | neighbours | of supercells left out | neighbours by \
         radius, {RADII_UM:?} um | worst row: oblique, neighbours | first order: oblique, neighbours, supercells |"
    );
    println!("| --- |{}", " ---: |".repeat(8));
    let asked = std::env::args().skip(1).map(|angles| {
        let mut angles = angles
            .split(',')
            .map(|a| a.parse().expect("angles in degrees, such as 15,0"));
        [angles.next().unwrap_or(0.0), angles.next().unwrap_or(0.0)]
    });
    for steered_deg in asked {
        for nm in [455.0, 530.0, 660.0] {
            let found = prototype.misfits(nm, steered_deg);
            let [normal, oblique, neighbours] = found.means();
            let by_radius = RADII_UM.map(|radius| {
                let own = found.rows.iter().filter(|r| r.radius_um == radius);
                format!(
                    "{:.3}",
                    own.clone().map(|r| r.neighbours).sum::<f64>() / own.count() as f64
                )
            });
            let gain = |r: &&prototype_rows::RowMisfit| r.neighbours / r.oblique;
            let worst = found
                .rows
                .iter()
                .max_by(|a, b| gain(a).total_cmp(&gain(b)))
                .expect("rows");
            println!(
                "| {steered_deg:?} deg | {nm} | {normal:.3} | {oblique:.3} | {neighbours:.3} | {:.3} | {} | {:?} at {} um: \
                 {:.3}, {:.3} | {} |",
                found.left_out,
                by_radius.join(" "),
                worst.direction,
                worst.radius_um,
                worst.oblique,
                worst.neighbours,
                found.first.map(|share| format!("{share:.3}")).join(" "),
            );
        }
    }
}
