//! Which place of the scene each pixel of a sub-image looks at.

use metalith_camera::Sensor;
use ndarray::Array2;

use crate::ElementView;
use crate::assumed::{Assumed, butterworth};
use crate::geometry::SceneSpace;
use crate::kernels::BankSpec;

/// The sub-image of one element in one channel: a rectangle of cells, squares of pixels of the sensor's grid, on or off the
/// sensor.
#[derive(Clone)]
pub struct Warp {
    /// Row and column of its first cell.
    pub origin: [i64; 2],
    /// Rows and columns of cells.
    pub shape: [usize; 2],
    /// For each cell: place in the scene's picture (row, column).
    scene: Vec<[f32; 2]>,
    /// For each cell: place among the nodes of the kernels (row, column).
    pub nodes: Vec<[f32; 2]>,
    /// For each cell: projected solid angle, zero where the scene or the field of the kernels ends.
    flux: Vec<f32>,
    /// Rows and columns of the scene.
    size: [usize; 2],
}

/// Where in each cell the scene is sampled.
#[derive(Clone, Copy)]
pub struct CellPoint {
    /// Pixels an axis of a cell.
    pub cell: usize,
    /// From the middle of the cell along x and y (pixels).
    pub shift: [f64; 2],
    /// Pixels whose light the point stands for.
    pub area: f64,
    /// What is assumed of the brightness over the field.
    pub assumed: Assumed,
}

impl Warp {
    /// For light of a wavelength (um), one point of each cell.
    pub fn new(
        element: &ElementView,
        sensor: &Sensor,
        spec: &BankSpec,
        space: &SceneSpace,
        channel_um: f64,
        point: CellPoint,
    ) -> Self {
        let CellPoint {
            cell,
            shift,
            area,
            assumed,
        } = point;
        let patch_um = assumed
            .patch_pixels
            .map_or(f64::INFINITY, |n| 0.5 * f64::from(n) * spec.pixel_um);
        let brightness = |place: [f64; 2]| match assumed.butterworth {
            true => {
                let tangent = place[0].hypot(place[1]) / element.focal_um;
                element.projected_per_um2([0.0; 2]) * butterworth(tangent)
            }
            false => element.projected_per_um2(place),
        };
        let pixel = spec.pixel_um;
        // Row and column of the element's axis.
        let axis = [
            0.5 * (f64::from(sensor.rows) - 1.0) + (element.centre_um[1] - sensor.offset_um[1]) / pixel,
            0.5 * (f64::from(sensor.columns) - 1.0) + (element.centre_um[0] - sensor.offset_um[0]) / pixel,
        ];
        let (low, high) = extent(element, spec, channel_um);
        let step = cell as f64;
        let first = [1, 0].map(|a| ((axis[1 - a] + low[a] / pixel) / step).floor() as i64);
        let last = [1, 0].map(|a| ((axis[1 - a] + high[a] / pixel) / step).ceil() as i64);
        let shape = [0, 1].map(|a| (last[a] - first[a] + 1).max(1) as usize);
        let mut warp = Self {
            origin: first,
            shape,
            scene: vec![[0.0; 2]; shape[0] * shape[1]],
            nodes: vec![[0.0; 2]; shape[0] * shape[1]],
            flux: vec![0.0; shape[0] * shape[1]],
            size: [space.view.rows, space.view.columns],
        };
        for i in 0..shape[0] * shape[1] {
            let at = [i / shape[1], i % shape[1]];
            let place = [0, 1].map(|a| {
                let middle = step * (first[1 - a] + at[1 - a] as i64) as f64 + 0.5 * (step - 1.0);
                (middle + shift[a] - axis[1 - a]) * pixel
            });
            let sines = element.sines_of_landing(place, channel_um);
            let found = element
                .landing_um(sines, element.wedge.wavelength_um)
                .zip(space.tangents(element, sines));
            let Some((landing, tangents)) = found else { continue };
            let scene = space.view.place(tangents);
            let inside = (0..2).all(|a| scene[a] >= -0.5 && scene[a] <= warp.size[a] as f64 - 0.5);
            let inside = inside && place.iter().all(|v| v.abs() <= patch_um);
            if inside && landing.iter().all(|v| v.abs() <= spec.reach_um) {
                warp.scene[i] = scene.map(|v| v as f32);
                warp.nodes[i] = [spec.place(landing[1]) as f32, spec.place(landing[0]) as f32];
                warp.flux[i] = (brightness(place) * pixel * pixel * area) as f32;
            }
        }
        warp
    }

    /// The pixels of the scene on both sides, and the shares of the latter.
    fn between(&self, i: usize) -> ([usize; 2], [usize; 2], [f32; 2]) {
        let at = self.scene[i];
        let axis = |a: usize| {
            let place = at[a].clamp(0.0, self.size[a] as f32 - 1.0);
            let low = place as usize;
            (low, (low + 1).min(self.size[a] - 1), place - low as f32)
        };
        let (y, x) = (axis(0), axis(1));
        ([y.0, x.0], [y.1, x.1], [y.2, x.2])
    }

    /// Light of a plane of the scene on each cell.
    pub fn sample(&self, plane: &Array2<f32>, out: &mut [f32]) {
        for (i, (to, flux)) in out.iter_mut().zip(&self.flux).enumerate() {
            if *flux == 0.0 {
                *to = 0.0;
                continue;
            }
            let (low, high, share) = self.between(i);
            let above = plane[[low[0], low[1]]] * (1.0 - share[1]) + plane[[low[0], high[1]]] * share[1];
            let below = plane[[high[0], low[1]]] * (1.0 - share[1]) + plane[[high[0], high[1]]] * share[1];
            *to = flux * (above * (1.0 - share[0]) + below * share[0]);
        }
    }

    /// The adjoint of [`Warp::sample`]: adds to a plane of the scene.
    pub fn scatter(&self, light: &[f32], plane: &mut Array2<f32>) {
        for (i, (value, flux)) in light.iter().zip(&self.flux).enumerate() {
            if *flux == 0.0 || *value == 0.0 {
                continue;
            }
            let (low, high, share) = self.between(i);
            let value = value * flux;
            let [above, below] = [value * (1.0 - share[0]), value * share[0]];
            plane[[low[0], low[1]]] += above * (1.0 - share[1]);
            plane[[low[0], high[1]]] += above * share[1];
            plane[[high[0], low[1]]] += below * (1.0 - share[1]);
            plane[[high[0], high[1]]] += below * share[1];
        }
    }

    /// The rectangle of the sub-image in which the hat of a node is not zero: first row and column, rows and columns.
    pub fn support(&self, node: [usize; 2]) -> Option<([usize; 2], [usize; 2])> {
        let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
        for (i, place) in self.nodes.iter().enumerate() {
            if self.flux[i] > 0.0 && (0..2).all(|a| (place[a] - node[a] as f32).abs() < 1.0) {
                let at = [i / self.shape[1], i % self.shape[1]];
                for a in 0..2 {
                    low[a] = low[a].min(at[a]);
                    high[a] = high[a].max(at[a]);
                }
            }
        }
        (low[0] != usize::MAX).then(|| (low, [high[0] - low[0] + 1, high[1] - low[1] + 1]))
    }
}

/// Weight of a node at a place among the nodes: one at its own, zero at the next.
pub fn hat(place: [f32; 2], node: [usize; 2]) -> f32 {
    let axis = |a: usize| (1.0 - (place[a] - node[a] as f32).abs()).max(0.0);
    axis(0) * axis(1)
}

/// Least and greatest place on the sensor, from the element's axis (um), of the field of the kernels in a channel's light.
fn extent(element: &ElementView, spec: &BankSpec, channel_um: f64) -> ([f64; 2], [f64; 2]) {
    const POINTS: usize = 16;
    let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
    let at = |k: usize| spec.reach_um * (2.0 * k as f64 / POINTS as f64 - 1.0);
    for k in 0..=POINTS {
        for place in [
            [at(k), -spec.reach_um],
            [at(k), spec.reach_um],
            [-spec.reach_um, at(k)],
            [spec.reach_um, at(k)],
        ] {
            let sines = element.sines_of_landing(place, element.wedge.wavelength_um);
            if let Some(landing) = element.landing_um(sines, channel_um) {
                for a in 0..2 {
                    // Nothing is seen farther off than under 80 degrees.
                    let within = landing[a].clamp(-6.0 * element.focal_um, 6.0 * element.focal_um);
                    low[a] = low[a].min(within);
                    high[a] = high[a].max(within);
                }
            }
        }
    }
    if low[0] > high[0] {
        ([0.0; 2], [0.0; 2])
    } else {
        (low, high)
    }
}
