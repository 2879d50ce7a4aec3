//! A scene in larger pixels: of one whose pixels are finer than points of a grid, each point would take one for all that lie about it.

use ndarray::{Array2, Axis};

use super::SceneImage;
use super::pixel_count::SCORED_SIDES;
use crate::geometry::SceneView;

/// Tolerance of a number of pixels that fit: a view is no finer than its own pixels.
const ROUNDING: f64 = 1e-9;

impl SceneView {
    /// This view in as many pixels as are at least so wide (tangent); itself if its own are, or if its shorter side
    /// would have fewer than the 33 that pictures of it must have to be scored. Rows that are no whole pixel are left
    /// out, half of them on each side.
    #[must_use]
    pub fn no_finer(&self, tangent: f64) -> Self {
        let shorter = self.rows.min(self.columns).max(1);
        let fitting = (self.columns as f64 * self.pixel() / tangent + ROUNDING).floor() as usize;
        let columns = fitting.max((SCORED_SIDES.start() * self.columns).div_ceil(shorter));
        if columns < self.columns {
            Self {
                rows: self.rows * columns / self.columns,
                columns,
                ..*self
            }
        } else {
            *self
        }
    }
}

impl SceneImage {
    /// This scene in the larger pixels of a view that [`SceneView::no_finer`] made from the view of the scene: means of linear light,
    /// and of one over the distance.
    #[must_use]
    pub fn averaged(&self, view: &SceneView) -> Self {
        let nearness = |depth: &Array2<f32>| averaged(&depth.mapv(f32::recip), view).mapv(f32::recip);
        Self {
            name: self.name.clone(),
            view: *view,
            basis: self.basis.clone(),
            planes: self.planes.iter().map(|plane| averaged(plane, view)).collect(),
            left_out: self.left_out,
            depth_um: self.depth_um.as_ref().map(nearness),
        }
    }
}

/// Means of a plane over the pixels of a view that has larger ones, by the area that each has in them.
pub fn averaged(plane: &Array2<f32>, view: &SceneView) -> Array2<f32> {
    let (rows, columns) = plane.dim();
    let side = columns as f64 / view.columns as f64;
    let down = along(&plane.mapv(f64::from), Axis(0), &boxes(rows, view.rows, side));
    along(&down, Axis(1), &boxes(columns, view.columns, side)).mapv(|v| v as f32)
}

/// Boxes of one length, so many next to one another, in the middle of `n` values: the first value of each, and the
/// shares of the box of that value and of those after it.
fn boxes(n: usize, count: usize, length: f64) -> Vec<(usize, Vec<f64>)> {
    let begin = 0.5 * (n as f64 - count as f64 * length);
    let one = |k: usize| {
        let [from, to] = [k, k + 1].map(|i| (begin + i as f64 * length).clamp(0.0, n as f64));
        let first = (from as usize).min(n - 1);
        let last = (to.ceil() as usize).clamp(first + 1, n);
        let inside = |i: usize| (to.min(i as f64 + 1.0) - from.max(i as f64)).max(0.0);
        let all: f64 = (first..last).map(inside).sum();
        (first, (first..last).map(|i| inside(i) / all).collect())
    };
    (0..count).map(one).collect()
}

/// Sums over boxes along an axis.
fn along(plane: &Array2<f64>, axis: Axis, boxes: &[(usize, Vec<f64>)]) -> Array2<f64> {
    let mut shape = plane.raw_dim();
    shape[axis.0] = boxes.len();
    let mut out = Array2::zeros(shape);
    for (mut to, (first, shares)) in out.axis_iter_mut(axis).zip(boxes) {
        for (i, share) in shares.iter().enumerate() {
            to.scaled_add(*share, &plane.index_axis(axis, first + i));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array3;

    fn view(rows: usize, columns: usize) -> SceneView {
        SceneView {
            rows,
            columns,
            field_deg: 90.0,
            distance_um: f64::INFINITY,
        }
    }

    #[test]
    fn only_what_is_too_fine_gets_larger_pixels() {
        // Two tangents from edge to edge.
        let fine = view(300, 400);
        assert_eq!(fine.no_finer(0.005), fine);
        assert_eq!(fine.no_finer(0.0049), fine);
        let coarser = fine.no_finer(0.006);
        assert_eq!((coarser.rows, coarser.columns), (249, 333));
        assert!(coarser.pixel() >= 0.006 && coarser.no_finer(0.006) == coarser);
        // No fewer than pictures are scored with, and scenes that have fewer stay.
        let least = fine.no_finer(1.0);
        assert_eq!((least.rows, least.columns), (33, 44));
        assert_eq!(view(20, 400).no_finer(1.0), view(20, 400));
    }

    #[test]
    fn light_is_averaged_by_area_and_distances_by_nearness() {
        /// Values of single precision.
        const SINGLE: f32 = 1e-6;
        let light = |y: usize, x: usize| ((y * 7 + x * 3) % 5) as f32;
        let rgb = Array3::from_shape_fn((70, 140, 3), |(y, x, _)| f64::from(light(y, x)));
        let mut scene = SceneImage::of_rgb("", &rgb, 90.0, f64::INFINITY);
        let plane = scene.planes[0].clone();
        // The left half is far, of the right one every second column infinitely so.
        let far = |x: usize| if x >= 70 && x % 2 == 1 { f32::INFINITY } else { 1e6 };
        scene.depth_um = Some(Array2::from_shape_fn((70, 140), |(_, x)| far(x)));
        let even = scene.averaged(&view(35, 70));
        for ((y, x), v) in even.planes[0].indexed_iter() {
            let sum = plane[[2 * y, 2 * x]]
                + plane[[2 * y + 1, 2 * x]]
                + plane[[2 * y, 2 * x + 1]]
                + plane[[2 * y + 1, 2 * x + 1]];
            assert!((v - 0.25 * sum).abs() < SINGLE, "{y} {x}");
        }
        let depth = even.depth_um.unwrap();
        assert!((depth[[3, 3]] / 1e6 - 1.0).abs() < SINGLE && (depth[[3, 60]] / 2e6 - 1.0).abs() < SINGLE);
        // Three pixels in two: the one in the middle counts half in both.
        let uneven = averaged(&Array2::from_shape_fn((3, 3), |(_, x)| x as f32), &view(2, 2));
        assert!((uneven[[0, 0]] - 1.0 / 3.0).abs() < SINGLE && (uneven[[1, 1]] - 5.0 / 3.0).abs() < SINGLE);
        // All light of a square scene stays.
        let odd = scene_mean(&averaged(&plane, &view(57, 114)));
        assert!((odd - scene_mean(&plane)).abs() < 10.0 * SINGLE, "{odd}");
    }

    fn scene_mean(plane: &Array2<f32>) -> f32 {
        (plane.iter().map(|v| f64::from(*v)).sum::<f64>() / plane.len() as f64) as f32
    }
}
