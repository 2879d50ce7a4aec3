//! Sums over squares of pixels.

use ndarray::{Array2, ArrayView1, Axis};

/// Sums over squares about each pixel, as far as they are in the plane.
pub fn box_sums(plane: &Array2<f64>, near: usize) -> Array2<f64> {
    let along = |line: ArrayView1<'_, f64>| -> Vec<f64> {
        let mut running = vec![0.0];
        line.iter().for_each(|v| running.push(running[running.len() - 1] + v));
        let n = line.len();
        (0..n)
            .map(|i| running[(i + near + 1).min(n)] - running[i.saturating_sub(near)])
            .collect()
    };
    let mut out = plane.clone();
    for axis in [1, 0] {
        for mut lane in out.lanes_mut(Axis(axis)) {
            let sums = along(lane.view());
            lane.iter_mut().zip(sums).for_each(|(to, sum)| *to = sum);
        }
    }
    out
}
