//! A wavefront that every lens has: the free path over the lens, as optical path and as a phase.

use std::f64::consts::TAU;

use crate::effects::{DeclaredEffect, DeclaredParameter};
use crate::set::MeasuredSet;
use crate::smooth_residual::SmoothResidual;
use metalith_optics::DeclaredQuantity;

/// A polynomial counts if its coefficient is this many standard deviations.
const SURE: f64 = 4.0;

/// And this part of the largest: a linear fit of a strong one leaves some of its neighbours behind.
const PART: f64 = 0.1;

/// Most polynomials of a proposal, the largest first: all are fitted at once.
const MOST: usize = 4;

/// Range of a coefficient, as a multiple of what was found by a linear fit, and at least (nm).
const ROOM: f64 = 6.0;
const LEAST_RANGE_NM: f64 = 200.0;

/// Declarations of one wavefront, two of them: a path is more of a wave in blue than in red, a phase is not. The search
/// takes the one that all colours agree with.
pub(super) fn declared(smooth: &SmoothResidual, set: &MeasuredSet) -> Vec<DeclaredEffect> {
    let largest = smooth
        .coefficients_nm
        .iter()
        .fold(0.0, |most: f64, (_, c, _)| most.max(c.abs()));
    let counts = |c: f64, sigma: f64| c.abs() > (SURE * sigma).max(PART * largest);
    let sure = smooth.coefficients_nm.iter().filter(|(_, c, sigma)| counts(*c, *sigma));
    let mut terms: Vec<(u32, f64)> = sure.map(|(j, c, _)| (*j, *c)).collect();
    terms.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    terms.truncate(MOST);
    terms.sort_by_key(|t| t.0);
    if terms.is_empty() {
        return Vec::new();
    }
    let mean_nm = set.leds.iter().map(|l| l.centre_nm).sum::<f64>() / set.leds.len() as f64;
    let one = |name: &str, quantity, unit: &str, scale: f64| DeclaredEffect {
        name: name.into(),
        unit: unit.into(),
        quantity,
        expression: terms
            .iter()
            .map(|(j, _)| format!("a{j} * zernike({j}, x / R, y / R)"))
            .collect::<Vec<_>>()
            .join(" + "),
        parameters: terms
            .iter()
            .map(|(j, nm)| {
                let most = (ROOM * nm.abs()).max(LEAST_RANGE_NM) * scale;
                DeclaredParameter {
                    name: format!("a{j}"),
                    range: (-most, most),
                    prior: nm.abs() * scale,
                    start: 0.0,
                }
            })
            .collect(),
    };
    vec![
        one("wavefront_path", DeclaredQuantity::OpdNm, "nm", 1.0),
        one("wavefront_phase", DeclaredQuantity::PhaseRad, "rad", TAU / mean_nm),
    ]
}
