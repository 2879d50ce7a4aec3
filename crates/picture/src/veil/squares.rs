//! From the pixels of scene and sensor to squares, and back: straight lines between the middles of squares.

use ndarray::{Array2, ArrayView2};

use super::{CELL_PIXELS, SCENE_CELLS};
use crate::SceneView;

/// Gather the light of a plane of the scene into squares: hats about their middles, times projected solid angle.
pub fn gather(view: &SceneView, plane: ArrayView2<'_, f32>) -> Vec<f64> {
    let mut cells = vec![0.0; SCENE_CELLS * SCENE_CELLS];
    for_scene(view, |y, x, weight, cell| {
        cells[cell] += weight * f64::from(plane[[y, x]])
    });
    cells
}

/// The adjoint of [`gather`]: adds to a plane.
pub fn spread(view: &SceneView, cells: &[f64], plane: &mut Array2<f32>) {
    for_scene(view, |y, x, weight, cell| {
        plane[[y, x]] += (weight * cells[cell]) as f32
    });
}

/// From squares to the pixels of the sensor: straight lines between the middles of squares.
pub fn lay(cells: &[f64], shape: [usize; 2], frame: &mut Array2<f32>) {
    for_sensor(frame.dim().into(), shape, |y, x, weight, cell| {
        frame[[y, x]] += (weight * cells[cell]) as f32
    });
}

/// The adjoint of [`lay`].
pub fn lift(frame: &Array2<f32>, shape: [usize; 2]) -> Vec<f64> {
    let mut cells = vec![0.0; shape[0] * shape[1]];
    for_sensor(frame.dim().into(), shape, |y, x, weight, cell| {
        cells[cell] += weight * f64::from(frame[[y, x]])
    });
    cells
}

/// Projected solid angle of a pixel of the scene.
pub fn solid_angle(view: &SceneView, row: f64, column: f64) -> f64 {
    let [tx, ty] = view.tangents(row, column);
    (view.pixel() / (1.0 + tx * tx + ty * ty)).powi(2)
}

fn for_scene(view: &SceneView, mut act: impl FnMut(usize, usize, f64, usize)) {
    let axis = |n: usize| hats(n, n as f64 / SCENE_CELLS as f64, SCENE_CELLS);
    for_hats(
        &axis(view.rows),
        &axis(view.columns),
        SCENE_CELLS,
        |y, x, weight, cell| {
            act(y, x, weight * solid_angle(view, y as f64, x as f64), cell);
        },
    );
}

fn for_sensor(frame: [usize; 2], shape: [usize; 2], mut act: impl FnMut(usize, usize, f64, usize)) {
    let scale = 1.0 / (CELL_PIXELS * CELL_PIXELS) as f64;
    let axis = |a: usize| hats(frame[a], CELL_PIXELS as f64, shape[a]);
    for_hats(&axis(0), &axis(1), shape[1], |y, x, weight, cell| {
        act(y, x, scale * weight, cell)
    });
}

/// For each of `n` pixels the squares on both sides, `pixels` wide, with their weights.
fn hats(n: usize, pixels: f64, cells: usize) -> Vec<[(usize, f64); 2]> {
    let one = |i: usize| {
        let place = ((i as f64 + 0.5) / pixels - 0.5).clamp(0.0, (cells - 1) as f64);
        let low = (place as usize).min(cells.saturating_sub(2));
        let share = place - low as f64;
        [(low, 1.0 - share), ((low + 1).min(cells - 1), share)]
    };
    (0..n).map(one).collect()
}

/// Row, column, weight and square, for all pixels and the four squares about each.
fn for_hats(
    rows: &[[(usize, f64); 2]],
    columns: &[[(usize, f64); 2]],
    stride: usize,
    mut act: impl FnMut(usize, usize, f64, usize),
) {
    for (y, row) in rows.iter().enumerate() {
        for (x, column) in columns.iter().enumerate() {
            for (cy, wy) in row {
                for (cx, wx) in column {
                    act(y, x, wy * wx, cy * stride + cx);
                }
            }
        }
    }
}
