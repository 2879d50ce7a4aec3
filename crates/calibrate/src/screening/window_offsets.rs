//! Windows that were moved: the distance of each from the shift that an effect of the light gives all of them.
//!
//! Light that is tilted moves all images alike, and a sensor that is nearer or farther under an element moves its images in
//! proportion to the slope of their chief rays. What is left of a shift is of the window alone.

use nalgebra::{DMatrix, DVector};

use crate::data::Nuisances;
use crate::set::MeasuredSet;

/// Rounds of weights by what the last one left: the sum of what windows are off becomes least, which those that were moved do not
/// decide.
const ROUNDS: usize = 30;

/// Differences are alike below this (um).
const LEAST_UM: f64 = 0.02;

/// Error of the stated place of the sensor under an element, one standard deviation (um).
const DISTANCE_UM: f64 = 30.0;

/// Place where an image was found, and the origin of its light.
struct Placed {
    element: usize,
    /// Apparent place of the window, from its stated place (um).
    shift_um: [f64; 2],
    /// Slopes of the chief ray: how far the image moves as the sensor does.
    slopes: [f64; 2],
}

/// Error of the place of each window alone, along the worse axis (pixels).
pub(super) fn window_offsets(set: &MeasuredSet, nuisances: &Nuisances) -> Vec<f64> {
    let measurements = set.measurements.iter().zip(&nuisances.shift_um);
    let placed: Vec<Placed> = measurements
        .map(|(c, shift)| Placed {
            element: c.element.into(),
            shift_um: *shift,
            slopes: c.window_centre_um.map(|at| at / c.distance_um),
        })
        .collect();
    let off = off_um(&placed, set.elements.len());
    off.into_iter().map(|um| um / set.camera.pixel_um).collect()
}

/// Part that no shift of all and no distance of an element explains, along the worse axis (um).
fn off_um(placed: &[Placed], elements: usize) -> Vec<f64> {
    // Shifts of all along x and y, then a distance for each element.
    let size = 2 + elements;
    let mut best = DVector::<f64>::zeros(size);
    let left = |best: &DVector<f64>, p: &Placed, axis: usize| {
        p.shift_um[axis] - best[axis] - best[2 + p.element] * p.slopes[axis]
    };
    for _ in 0..ROUNDS {
        let mut normal = DMatrix::<f64>::zeros(size, size);
        let mut rhs = DVector::<f64>::zeros(size);
        for p in placed {
            for axis in [0, 1] {
                let weight = left(&best, p, axis).abs().max(LEAST_UM).recip();
                let parts = [(axis, 1.0), (2 + p.element, p.slopes[axis])];
                for (i, a) in parts {
                    rhs[i] += weight * a * p.shift_um[axis];
                    for (j, b) in parts {
                        normal[(i, j)] += weight * a * b;
                    }
                }
            }
        }
        for e in 0..elements {
            normal[(2 + e, 2 + e)] += DISTANCE_UM.powi(-2);
        }
        match normal.cholesky() {
            Some(solved) => best = solved.solve(&rhs),
            None => break,
        }
    }
    let worse = |p: &Placed| left(&best, p, 0).abs().max(left(&best, p, 1).abs());
    placed.iter().map(worse).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Absolute (um): weights end where differences are alike.
    const SMALL_UM: f64 = 0.1;

    /// Three elements, three colours each at three distances, two of them steered: images move by the slope of the chief ray times
    /// what the sensor is off under the element, all by a tilt, and one window by itself.
    #[test]
    fn a_tilted_sensor_moves_images_and_not_windows() {
        let (tilted_um, off_by_um) = ([1.0, -0.6], [-2.4, 9.6, 2.4]);
        let colours = [-0.04, 0.0, 0.06];
        let mut placed = Vec::new();
        for element in 0..3 {
            for colour in colours {
                for _ in 0..3 {
                    let steered = [[0.0; 2], [0.27, 0.0], [0.27, 0.27]][element];
                    let slopes = steered.map(|s: f64| if s == 0.0 { 0.0 } else { s + colour });
                    placed.push(Placed {
                        element,
                        shift_um: [0, 1].map(|a| tilted_um[a] + off_by_um[element] * slopes[a]),
                        slopes,
                    });
                }
            }
        }
        let moved = 13;
        placed[moved].shift_um[1] += 4.0;
        let off = off_um(&placed, 3);
        for (k, off) in off.iter().enumerate() {
            let expected = if k == moved { 4.0 } else { 0.0 };
            assert!((off - expected).abs() < SMALL_UM, "{k}: {off}");
        }
    }
}
