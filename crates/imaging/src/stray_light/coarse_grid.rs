//! Conversion from the pixels of scene and sensor to squares, and back: straight lines between the middles of squares.

use ndarray::{Array2, ArrayView2};

use super::{CELL_PIXELS, SCENE_CELLS};
use crate::geometry::SceneView;

/// Gather the light of a plane of the scene into squares: hats about their middles, times projected solid angle.
pub(crate) fn gather(view: &SceneView, plane: ArrayView2<'_, f32>) -> Vec<f64> {
    let [down, across] = scene_hats(view);
    let mut cells = vec![0.0; SCENE_CELLS * SCENE_CELLS];
    for ((y, row), hat) in plane.rows().into_iter().enumerate().zip(&down) {
        let angles = solid_angles(view, y);
        let light = row.iter().zip(angles).map(|(v, angle)| angle * f64::from(*v));
        gather_row(light, &across, hat, SCENE_CELLS, &mut cells);
    }
    cells
}

/// The adjoint of [`gather`]: adds to a plane.
pub(crate) fn spread(view: &SceneView, cells: &[f64], plane: &mut Array2<f32>) {
    let [down, across] = scene_hats(view);
    for ((y, mut row), hat) in plane.rows_mut().into_iter().enumerate().zip(&down) {
        let line = line_of(cells, hat, SCENE_CELLS);
        let values = row.iter_mut().zip(&across).zip(solid_angles(view, y));
        values.for_each(|((to, hat), angle)| *to += (angle * between(&line, hat)) as f32);
    }
}

/// Spreads squares over the values of a frame, each the mean of so many pixels an axis: straight lines between the middles of
/// squares.
pub(crate) fn lay(cells: &[f64], shape: [usize; 2], value: usize, frame: &mut Array2<f32>) {
    let [down, across] = sensor_hats(frame.dim().into(), shape, value);
    for (mut row, hat) in frame.rows_mut().into_iter().zip(&down) {
        let line = line_of(cells, hat, shape[1]);
        let values = row.iter_mut().zip(&across);
        values.for_each(|(to, hat)| *to += (PIXEL_SHARE * between(&line, hat)) as f32);
    }
}

/// The adjoint of [`lay`].
pub(crate) fn lift(frame: &Array2<f32>, shape: [usize; 2], value: usize) -> Vec<f64> {
    let [down, across] = sensor_hats(frame.dim().into(), shape, value);
    let mut cells = vec![0.0; shape[0] * shape[1]];
    for (row, hat) in frame.rows().into_iter().zip(&down) {
        let light = row.iter().map(|v| PIXEL_SHARE * f64::from(*v));
        gather_row(light, &across, hat, shape[1], &mut cells);
    }
    cells
}

/// Projected solid angle of a pixel of the scene.
pub(crate) fn solid_angle(view: &SceneView, row: f64, column: f64) -> f64 {
    let [tx, ty] = view.tangents(row, column);
    (view.pixel() / (1.0 + tx * tx + ty * ty)).powi(2)
}

/// Solid angles of the pixels of a row.
fn solid_angles(view: &SceneView, row: usize) -> impl Iterator<Item = f64> {
    let pixel = view.pixel();
    let [first, ty] = view.tangents(row as f64, 0.0);
    (0..view.columns).map(move |x| {
        let tx = first + x as f64 * pixel;
        (pixel / (1.0 + tx * tx + ty * ty)).powi(2)
    })
}

/// Share of a pixel in the light of its square.
const PIXEL_SHARE: f64 = 1.0 / (CELL_PIXELS * CELL_PIXELS) as f64;

/// The two squares on both sides of a pixel along an axis, with its weights in them.
type Hat = [(usize, f64); 2];

fn scene_hats(view: &SceneView) -> [Vec<Hat>; 2] {
    [view.rows, view.columns].map(|n| hats(n, n as f64 / SCENE_CELLS as f64, SCENE_CELLS))
}

fn sensor_hats(frame: [usize; 2], shape: [usize; 2], value: usize) -> [Vec<Hat>; 2] {
    [0, 1].map(|a| hats(frame[a], CELL_PIXELS as f64 / value as f64, shape[a]))
}

/// Squares on both sides of each of `n` pixels, `pixels` wide, with their weights.
fn hats(n: usize, pixels: f64, cells: usize) -> Vec<Hat> {
    let one = |i: usize| {
        let place = ((i as f64 + 0.5) / pixels - 0.5).clamp(0.0, (cells - 1) as f64);
        let low = (place as usize).min(cells.saturating_sub(2));
        let share = place - low as f64;
        [(low, 1.0 - share), ((low + 1).min(cells - 1), share)]
    };
    (0..n).map(one).collect()
}

/// The values between two rows of squares.
fn line_of(cells: &[f64], [(low, a), (high, b)]: &Hat, columns: usize) -> Vec<f64> {
    let row = |y: usize| &cells[y * columns..][..columns];
    row(*low).iter().zip(row(*high)).map(|(v, w)| a * v + b * w).collect()
}

fn between(line: &[f64], [(low, a), (high, b)]: &Hat) -> f64 {
    a * line[*low] + b * line[*high]
}

/// Add a row of light to the squares on both of its sides.
fn gather_row(
    light: impl Iterator<Item = f64>,
    across: &[Hat],
    [(low, a), (high, b)]: &Hat,
    columns: usize,
    cells: &mut [f64],
) {
    let mut line = vec![0.0; columns];
    for (value, hat) in light.zip(across) {
        hat.iter().for_each(|(cell, weight)| line[*cell] += weight * value);
    }
    for (row, weight) in [(low, a), (high, b)] {
        let to = &mut cells[row * columns..][..columns];
        to.iter_mut().zip(&line).for_each(|(t, v)| *t += weight * v);
    }
}
