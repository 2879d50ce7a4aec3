//! How well a fit predicts captures that it has not seen.
//!
//! A colour, an element, a distance is left out in turn; the rest is fitted, and what was left out is
//! predicted, with nothing but its own placement, flux and black level to adjust.

use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::fit::normal_equations::{held, minimise, sum};
use crate::fit::problem::{Fit, Problem};

/// A number that the rest tells so much less of than the whole is not predicted from it.
const BLIND: f64 = 1e-3;

/// Draws of a bootstrap; enough for the ends of a 95 % interval.
const DRAWS: usize = 400;

/// Chi-square a pixel of each capture when it was left out; none for captures that do not count, or that
/// nothing could be learned about.
pub type HeldOutErrors = Vec<Option<f64>>;

/// Which captures belong together, in three ways.
fn families(problem: &Problem<'_>) -> [Vec<usize>; 3] {
    let captures = &problem.simulator.bench.set().captures;
    let mut distances: Vec<f64> = captures.iter().map(|c| c.distance_um).collect();
    distances.sort_by(f64::total_cmp);
    distances.dedup();
    let distance = |d: f64| distances.iter().position(|x| *x == d).unwrap_or(0);
    [
        captures.iter().map(|c| c.led).collect(),
        captures.iter().map(|c| c.element).collect(),
        captures.iter().map(|c| distance(c.distance_um)).collect(),
    ]
}

/// The error on captures left out, of a fit or of anything that has its forms.
pub fn held_out(problem: &Problem<'_>, forms: &[DMatrix<f64>], fit: &Fit) -> HeldOutErrors {
    let shared = problem.shared();
    let size = forms[0].nrows();
    let mut sums = vec![(0.0, 0u32); problem.used.len()];
    let whole = problem.total(forms, &fit.nuisances);
    for family in families(problem) {
        let groups = family.iter().max().map_or(0, |m| m + 1);
        if groups < 2 {
            continue;
        }
        for group in 0..groups {
            let out = |c: usize| problem.used[c] && family[c] == group;
            let left: Vec<usize> = (0..problem.used.len()).filter(|&c| out(c)).collect();
            if left.is_empty() {
                continue;
            }
            let test = sum(left.iter().map(|&c| &forms[c]), size) + problem.prior(&fit.nuisances, size);
            let train = &whole - sum(left.iter().map(|&c| &forms[c]), size);
            if (shared..size - 1).any(|k| train[(k, k)] < BLIND * whole[(k, k)]) {
                continue;
            }
            let at = within_range(problem, fit, &train);
            let (own, _) = minimise(&held(&test, &at), &(0..shared).collect::<Vec<_>>());
            let mut full = DVector::zeros(size);
            full[size - 1] = 1.0;
            for k in 0..shared {
                full[k] = -own[k];
            }
            for (k, v) in at {
                full[k] = -v;
            }
            for &c in &left {
                let chi2 = (&forms[c] * &full).dot(&full);
                sums[c].0 += chi2 / problem.data.pixels(c).max(1) as f64;
                sums[c].1 += 1;
            }
        }
    }
    sums.into_iter()
        .map(|(sum, n)| (n > 0).then(|| sum / f64::from(n)))
        .collect()
}

/// Where the rest puts each number, as steps from the fit, none beyond what physics allows.
fn within_range(problem: &Problem<'_>, fit: &Fit, train: &DMatrix<f64>) -> Vec<(usize, f64)> {
    let shared = problem.shared();
    let count = train.nrows() - 1;
    let mut at: Vec<(usize, f64)> = Vec::new();
    loop {
        let free: Vec<usize> = (0..count).filter(|k| !at.iter().any(|(h, _)| h == k)).collect();
        let (step, _) = minimise(&held(train, &at), &free);
        let mut more: Vec<(usize, f64)> = Vec::new();
        for (&k, &step) in free.iter().zip(step.iter()).filter(|(k, _)| **k >= shared) {
            let Some(&slot) = fit.active.get(k - shared) else {
                continue;
            };
            let (low, high) = problem.simulator.slots[slot].parameter.range;
            let wanted = fit.theta[slot] + step;
            if !(low..=high).contains(&wanted) {
                more.push((k, wanted.clamp(low, high) - fit.theta[slot]));
            }
        }
        if more.is_empty() {
            let last = free.iter().zip(step.iter()).filter(|(k, _)| **k >= shared);
            at.extend(last.map(|(k, s)| (*k, *s)));
            at.sort_by_key(|a| a.0);
            return at;
        }
        at.extend(more);
    }
}

/// Mean over captures.
pub fn mean(held_out: &HeldOutErrors) -> f64 {
    let known: Vec<f64> = held_out.iter().flatten().copied().collect();
    known.iter().sum::<f64>() / known.len().max(1) as f64
}

/// How much lower one error is than another, with a 95 % interval over captures that share element,
/// direction and colour: pixels are no independent witnesses, nor are distances of one beam.
pub fn gain(problem: &Problem<'_>, before: &HeldOutErrors, after: &HeldOutErrors) -> (f64, [f64; 2]) {
    let groups = groups(problem);
    let differences: Vec<(f64, f64)> = groups
        .iter()
        .map(|g| {
            let own: Vec<f64> = g.iter().filter_map(|&c| Some(before[c]? - after[c]?)).collect();
            (own.iter().sum(), own.len() as f64)
        })
        .filter(|(_, n): &(f64, f64)| *n > 0.0)
        .collect();
    let mean = |picked: &mut dyn Iterator<Item = (f64, f64)>| {
        let (sum, n) = picked.fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
        if n > 0.0 { sum / n } else { 0.0 }
    };
    let value = mean(&mut differences.iter().copied());
    if differences.is_empty() {
        return (0.0, [0.0, 0.0]);
    }
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut draws: Vec<f64> = (0..DRAWS)
        .map(|_| mean(&mut (0..differences.len()).map(|_| differences[rng.random_range(0..differences.len())])))
        .collect();
    (value, ends(&mut draws))
}

/// The captures of each element, direction and colour that count.
pub fn groups(problem: &Problem<'_>) -> Vec<Vec<usize>> {
    let captures = &problem.simulator.bench.set().captures;
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (c, capture) in captures.iter().enumerate().filter(|(c, _)| problem.used[*c]) {
        let same = |g: &&mut Vec<usize>| {
            let o = &captures[g[0]];
            (o.element, o.led, o.aoi_rad) == (capture.element, capture.led, capture.aoi_rad)
        };
        match groups.iter_mut().find(same) {
            Some(group) => group.push(c),
            None => groups.push(vec![c]),
        }
    }
    groups
}

/// How far each number of a fit moves when groups of captures are drawn anew: 95 % half-widths, never less
/// than what the noise alone gives.
pub fn half_widths(problem: &Problem<'_>, fit: &Fit) -> Vec<f64> {
    let shared = problem.shared();
    let size = fit.forms[0].nrows();
    let all: Vec<usize> = (0..size - 1).collect();
    let groups = groups(problem);
    let of_group: Vec<DMatrix<f64>> = groups
        .iter()
        .map(|g| sum(g.iter().map(|&c| &fit.forms[c]), size))
        .collect();
    let rest = problem.prior(&fit.nuisances, size) + &fit.forms[problem.used.len()];
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut draws: Vec<Vec<f64>> = vec![Vec::new(); fit.active.len()];
    for _ in 0..DRAWS {
        let mut form = rest.clone();
        for _ in 0..of_group.len() {
            form += &of_group[rng.random_range(0..of_group.len())];
        }
        let (step, _) = minimise(&form, &all);
        for (k, d) in draws.iter_mut().enumerate() {
            d.push(step[shared + k]);
        }
    }
    let whole = problem.total(&fit.forms, &fit.nuisances);
    let covariance = crate::fit::normal_equations::covariance(&whole, &all);
    let excess = (fit.chi2 / problem.pixels()).max(1.0);
    draws
        .iter_mut()
        .enumerate()
        .map(|(k, d)| {
            let [low, high] = ends(d);
            let noise = 2.0 * (covariance[(shared + k, shared + k)] * excess).sqrt();
            (0.5 * (high - low)).max(low.abs()).max(high.abs()).max(noise)
        })
        .collect()
}

fn ends(draws: &mut [f64]) -> [f64; 2] {
    draws.sort_by(f64::total_cmp);
    let at = |share: f64| draws[((draws.len() - 1) as f64 * share).round() as usize];
    [at(0.025), at(0.975)]
}

/// Draws are the same in every run.
pub const SEED: u64 = 0x6d65_7461;
