//! Captures that nothing can be learned from.

use crate::fit::nuisances::Nuisances;
use crate::fit::problem::Problem;

/// Captures that cannot be used, with the reason.
pub fn unusable_captures(problem: &Problem<'_>, nuisances: &Nuisances) -> Vec<(usize, String)> {
    let set = problem.simulator.bench.set();
    let mut out = Vec::new();
    let registration = set.camera.registration_sigma_px;
    let shifts: Vec<[f64; 2]> = nuisances
        .shift_um
        .iter()
        .map(|s| s.map(|v| v / set.camera.pixel_um))
        .collect();
    // What is common to all windows is the light's doing.
    let common = [0, 1].map(|axis| {
        let mut all: Vec<f64> = shifts.iter().map(|s| s[axis]).collect();
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    });
    for (c, capture) in set.captures.iter().enumerate() {
        let pixels = capture.dn.len();
        let lost = pixels - problem.data.pixels(c);
        let model = problem.grid(&problem.atlas.about, c).pixels([0.0; 2]);
        let expected = f64::from(model.iter().sum::<f32>()) * capture.scale_dn;
        let seen = f64::from(problem.data.signal[c].iter().sum::<f32>());
        let beyond = [0, 1].map(|a| (shifts[c][a] - common[a]).abs());
        let beyond = beyond[0].max(beyond[1]);
        if lost as f64 > MOST_SATURATED * pixels as f64 {
            out.push((c, format!("{lost} of its {pixels} pixels are saturated")));
        } else if seen < LEAST_LIGHT * expected {
            out.push((
                c,
                format!("it holds {:.1} % of the light it should", 100.0 * seen / expected),
            ));
        } else if beyond > MOST_SIGMAS * registration {
            out.push((
                c,
                format!("its window is {beyond:.1} pixels off, stated to within {registration}"),
            ));
        }
    }
    out
}

/// Share of saturated pixels past which a capture has lost what matters: its peak.
const MOST_SATURATED: f64 = 2e-4;

/// Share of the expected light below which a shutter was shut or a lamp off.
const LEAST_LIGHT: f64 = 0.1;

/// A window this many standard deviations away was moved.
const MOST_SIGMAS: f64 = 8.0;
