//! Share of the first order of blazed rows of pillars: truth, single cells, supercells.
//!
//! The mapping is that of `designs/prototype_3x3.toml`, the truth golden/truth/supercell.csv. Run it with
//! `cargo run --release -p metalith-design --example blazed_rows`; about 20 s on one core.

#[path = "../tests/truth_rows/mod.rs"]
mod truth_rows;

use truth_rows::{Summary, compare, read, total};

/// Pitch of the rows of the table (nm).
const PITCH_NM: f64 = 350.0;

fn main() {
    let groups = compare(&read());
    println!(
        "Mean share of the incident power in the first order, over offsets of the pillars, s and p, light along the"
    );
    println!(
        "normal and light whose first order leaves along the normal; and the difference from the truth, root mean"
    );
    println!(
        "square over these rows. Zero order and phase: difference of the supercell from the truth; the phase less its"
    );
    println!("mean, which is given beside it.");
    println!();
    println!(
        "| row | wavelength (nm) | turned by (deg) | truth | local cell, normal | local cell, oblique | supercell \
              | difference: normal | oblique | supercell | zero order | phase (rad) | mean phase (rad) |"
    );
    println!("|{}", " ---: |".repeat(13));
    for ((cells, turns, nm), summary) in &groups {
        let sine = f64::from(*turns) * f64::from(*nm) / (*cells as f64 * PITCH_NM);
        let row = match turns {
            1 => format!("{cells} pillars a turn"),
            _ => format!("{cells} pillars, {turns} turns"),
        };
        print_line(
            &row,
            &nm.to_string(),
            &format!("{:.1}", sine.asin().to_degrees()),
            summary,
        );
    }
    print_line("all", "", "", &total(groups.values()));
}

fn print_line(row: &str, nm: &str, degrees: &str, s: &Summary) {
    let cells = |values: &[f64], digits: usize| -> String {
        let each: Vec<String> = values.iter().map(|v| format!("{v:.digits$}")).collect();
        each.join(" | ")
    };
    println!(
        "| {row} | {nm} | {degrees} | {} | {} | {} |",
        cells(&s.shares, 3),
        cells(&s.first, 3),
        cells(&[s.zero, s.phase, s.phase_mean], 4)
    );
}
