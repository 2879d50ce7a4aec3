//! Minima by L-BFGS (Nocedal and Wright, Numerical Optimization, 2nd ed., algorithms 7.4 and 3.1).

/// Pairs of steps and changes of the gradient that are remembered.
const MEMORY: usize = 12;
/// Share of the decrease by the slope that a step must have.
const ARMIJO: f64 = 1e-4;
/// Halvings of a step.
const HALVINGS: usize = 8;

/// Best place of a search, and the value there.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Minimum {
    pub place: Vec<f64>,
    pub value: f64,
    pub steps: usize,
}

/// Descent from a place by at most so many steps; it ends where a step gains less than `least_gain`. `function` gives the value and
/// writes its gradient; an error of it ends the descent.
///
/// # Errors
/// Errors of the function.
pub(super) fn minimise<E>(
    start: Vec<f64>,
    steps: usize,
    least_gain: f64,
    first_step: f64,
    mut function: impl FnMut(&[f64], &mut [f64]) -> Result<f64, E>,
) -> Result<Minimum, E> {
    let mut place = start;
    let mut gradient = vec![0.0; place.len()];
    let mut value = function(&place, &mut gradient)?;
    let mut pairs: Vec<(Vec<f64>, Vec<f64>, f64)> = Vec::new();
    for step in 0..steps {
        let mut way = direction(&gradient, &pairs);
        let mut slope = dot(&way, &gradient);
        if slope >= 0.0 {
            pairs.clear();
            way = gradient.iter().map(|g| -g).collect();
            slope = -dot(&gradient, &gradient);
        }
        let size = dot(&way, &way).sqrt();
        if size == 0.0 {
            return Ok(Minimum {
                place,
                value,
                steps: step,
            });
        }
        let mut length = if pairs.is_empty() { first_step / size } else { 1.0 };
        let mut found = None;
        for _ in 0..HALVINGS {
            let next: Vec<f64> = place.iter().zip(&way).map(|(p, w)| p + length * w).collect();
            let mut there = vec![0.0; place.len()];
            let lower = function(&next, &mut there)?;
            if lower <= value + ARMIJO * length * slope {
                found = Some((next, there, lower));
                break;
            }
            length *= 0.4;
        }
        let Some((next, there, lower)) = found else {
            if pairs.is_empty() {
                return Ok(Minimum {
                    place,
                    value,
                    steps: step,
                });
            }
            pairs.clear();
            continue;
        };
        let s: Vec<f64> = next.iter().zip(&place).map(|(a, b)| a - b).collect();
        let y: Vec<f64> = there.iter().zip(&gradient).map(|(a, b)| a - b).collect();
        let curvature = dot(&s, &y);
        if curvature > 1e-12 * dot(&y, &y).sqrt() * dot(&s, &s).sqrt() {
            if pairs.len() == MEMORY {
                pairs.remove(0);
            }
            pairs.push((s, y, 1.0 / curvature));
        }
        let gain = value - lower;
        (place, gradient, value) = (next, there, lower);
        if gain < least_gain {
            return Ok(Minimum {
                place,
                value,
                steps: step + 1,
            });
        }
    }
    Ok(Minimum { place, value, steps })
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Minus the gradient times the inverse Hessian that the pairs stand for.
fn direction(gradient: &[f64], pairs: &[(Vec<f64>, Vec<f64>, f64)]) -> Vec<f64> {
    let mut way: Vec<f64> = gradient.iter().map(|g| -g).collect();
    let mut alphas = Vec::with_capacity(pairs.len());
    for (s, y, rho) in pairs.iter().rev() {
        let alpha = rho * dot(s, &way);
        way.iter_mut().zip(y).for_each(|(w, y)| *w -= alpha * y);
        alphas.push(alpha);
    }
    if let Some((s, y, _)) = pairs.last() {
        let scale = dot(s, y) / dot(y, y);
        way.iter_mut().for_each(|w| *w *= scale);
    }
    for ((s, y, rho), alpha) in pairs.iter().zip(alphas.into_iter().rev()) {
        let beta = rho * dot(y, &way);
        way.iter_mut().zip(s).for_each(|(w, s)| *w += (alpha - beta) * s);
    }
    way
}
