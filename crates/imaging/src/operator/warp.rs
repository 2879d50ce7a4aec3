//! Place of the scene that each pixel of a sub-image views.

use metalith_sensor::Sensor;
use ndarray::Array2;

use super::kernel_interpolation::BetweenNodes;
use super::sub_image::PixelGrid;
use crate::approximation_set::{ApproximationSet, butterworth};
use crate::geometry::ElementView;
use crate::geometry::SceneSpace;
use crate::kernels::BankSpec;

/// The sub-image of one element in one channel: a rectangle of cells, squares of pixels of the sensor's grid, on or off the
/// sensor.
#[derive(Clone)]
pub(crate) struct Warp {
    /// Row and column of its first cell.
    pub origin: [i64; 2],
    /// Rows and columns of cells.
    pub shape: [usize; 2],
    /// Places in the scene's picture that the lit cells view.
    looks: Vec<Look>,
    /// Place of each cell among the nodes of the kernels (row, column).
    pub nodes: Vec<[f32; 2]>,
    /// Projected solid angle of each cell, zero where the scene or the field of the kernels ends.
    flux: Vec<f32>,
    /// Rows and columns of the scene.
    size: [usize; 2],
}

/// Planes whose light is taken from the scene, or put back, in one pass over the cells.
const COLOURS: usize = 3;

/// Place in the scene's picture that a cell views.
#[derive(Clone, Copy)]
struct Look {
    cell: u32,
    /// The upper left of the four pixels about the place.
    pixel: u32,
    /// Shares of the next row and the next column.
    share: [f32; 2],
}

/// Point of each cell at which the scene is sampled.
#[derive(Clone, Copy)]
pub(crate) struct CellPoint {
    /// Pixels an axis of a cell.
    pub cell: usize,
    /// Shift from the middle of the cell along x and y (pixels).
    pub shift: [f64; 2],
    /// Cells beside the sensor that count: light farther off never reaches it.
    pub reach: usize,
    /// Pixels whose light the point stands for.
    pub area: f64,
    /// Assumptions on the brightness over the field.
    pub assumed: ApproximationSet,
}

impl Warp {
    /// Warp for light of a wavelength (um), one point of each cell.
    pub(crate) fn new(
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
            reach,
            area,
            assumed,
        } = point;
        let patch_um = assumed
            .patch_pixels
            .map_or(f64::INFINITY, |n| 0.5 * f64::from(n) * spec.pixel_um);
        let brightness = |place: [f64; 2]| {
            if assumed.butterworth {
                let tangent = place[0].hypot(place[1]) / element.sensor_um;
                element.flux_per_um2([0.0; 2]) * butterworth(tangent)
            } else {
                element.flux_per_um2(place)
            }
        };
        let pixel = spec.pixel_um;
        // Row and column of the element's axis.
        let axis = sensor.pixel_at(element.centre_um);
        let (low, high) = extent(element, spec, channel_um);
        let step = cell as f64;
        // Of what a point stands for: in pixels of the scene in the middle of the field, and on the sensor (um).
        let side = area.sqrt() * pixel;
        let sides = [side / (element.sensor_um * space.view.pixel()), side];
        // Cells of the field, as far as their light reaches the sensor.
        let sizes = [sensor.rows, sensor.columns].map(|n| i64::from(n.div_ceil(cell as u32)));
        let ends = [0, 1].map(|k| {
            let place = |um: f64| (axis[k] + um / pixel) / step;
            let first = place(low[1 - k]).floor() as i64;
            let last = place(high[1 - k]).ceil() as i64;
            [first.max(-(reach as i64)), last.min(sizes[k] - 1 + reach as i64)]
        });
        let beside = ends.iter().any(|[first, last]| first > last);
        let first = ends.map(|[first, _]| first);
        let shape = if beside {
            // One dark cell stands for a field that is beside the sensor.
            [1, 1]
        } else {
            ends.map(|[first, last]| (last - first + 1) as usize)
        };
        let mut warp = Self {
            origin: first,
            shape,
            looks: Vec::new(),
            nodes: vec![[0.0; 2]; shape[0] * shape[1]],
            flux: vec![0.0; shape[0] * shape[1]],
            size: [space.view.rows, space.view.columns],
        };
        if beside {
            return warp;
        }
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
            // How much of what the point stands for is in the scene, in the field of the kernels and in the patch.
            let left = (0..2).map(|a| {
                let [scene_side, side] = sides;
                let share = |room: f64, side: f64| (room / side + 0.5).clamp(0.0, 1.0);
                share((scene[a] + 0.5).min(warp.size[a] as f64 - 0.5 - scene[a]), scene_side)
                    * share(spec.reach_um - landing[a].abs(), side)
                    * share(patch_um - place[a].abs(), side)
            });
            let left: f64 = left.product();
            if left > 0.0 {
                let last = (spec.nodes - 1) as f64;
                warp.looks.push(Look::new(i, scene, warp.size));
                warp.nodes[i] = [landing[1], landing[0]].map(|um| spec.place(um).clamp(0.0, last) as f32);
                warp.flux[i] = (left * brightness(place) * pixel * pixel * area) as f32;
            }
        }
        warp
    }

    /// The values of the frame, `step` an axis of a cell, that are one phase of its cells, and of `beyond` more cells on each
    /// side.
    pub(crate) fn pixels(&self, step: usize, phase: [usize; 2], beyond: usize) -> PixelGrid {
        PixelGrid {
            origin: [0, 1].map(|a| (self.origin[a] - beyond as i64) * step as i64 + phase[a] as i64),
            step,
            shape: self.shape.map(|n| n + 2 * beyond),
        }
    }

    /// Light of planes of the scene on each cell.
    pub(crate) fn sample(&self, planes: &[&Array2<f32>]) -> Vec<Vec<f32>> {
        let from: Vec<_> = planes.iter().map(|p| p.as_standard_layout()).collect();
        let from: Vec<&[f32]> = from.iter().map(|p| p.as_slice().expect("rows are whole")).collect();
        let mut out = vec![vec![0.0; self.flux.len()]; planes.len()];
        for (from, to) in from.chunks(COLOURS).zip(out.chunks_mut(COLOURS)) {
            if let ([a, b, c], [d, e, f]) = (from, &mut *to) {
                self.sample_together([a, b, c], [d, e, f]);
            } else {
                from.iter().zip(to).for_each(|(p, to)| self.sample_together([p], [to]));
            }
        }
        out
    }

    fn sample_together<const N: usize>(&self, planes: [&[f32]; N], to: [&mut Vec<f32>; N]) {
        for Look { cell, pixel, share } in &self.looks {
            let (at, flux) = (*pixel as usize, self.flux[*cell as usize]);
            for n in 0..N {
                let (above, below) = (&planes[n][at..at + 2], &planes[n][at + self.size[1]..][..2]);
                let above = above[0] + share[1] * (above[1] - above[0]);
                let below = below[0] + share[1] * (below[1] - below[0]);
                to[n][*cell as usize] = flux * (above + share[0] * (below - above));
            }
        }
    }

    /// The adjoint of [`Warp::sample`]: adds to planes of the scene, whose rows are whole.
    pub(crate) fn scatter(&self, light: &[&[f32]], planes: &mut [Array2<f32>]) {
        let mut planes: Vec<&mut [f32]> = planes
            .iter_mut()
            .map(|p| p.as_slice_mut().expect("rows are whole"))
            .collect();
        for (light, to) in light.chunks(COLOURS).zip(planes.chunks_mut(COLOURS)) {
            if let ([a, b, c], [d, e, f]) = (light, &mut *to) {
                self.scatter_together([a, b, c], [d, e, f]);
            } else {
                light
                    .iter()
                    .zip(to)
                    .for_each(|(l, to)| self.scatter_together([l], [to]));
            }
        }
    }

    fn scatter_together<const N: usize>(&self, light: [&[f32]; N], planes: [&mut [f32]; N]) {
        for Look { cell, pixel, share } in &self.looks {
            let (at, flux) = (*pixel as usize, self.flux[*cell as usize]);
            for n in 0..N {
                let value = light[n][*cell as usize] * flux;
                let below = share[0] * value;
                let above = value - below;
                let to = &mut planes[n][at..at + 2];
                to[0] += above - share[1] * above;
                to[1] += share[1] * above;
                let to = &mut planes[n][at + self.size[1]..][..2];
                to[0] += below - share[1] * below;
                to[1] += share[1] * below;
            }
        }
    }

    /// Supports of `n` by `n` nodes, row by row: the rectangle of the sub-image in which the weights of the node are
    /// not zero, as first row and column, rows and columns.
    pub(crate) fn supports(&self, between: BetweenNodes, n: usize) -> Vec<Option<([usize; 2], [usize; 2])>> {
        let mut ends = vec![([usize::MAX; 2], [0; 2]); n * n];
        for (i, place) in self.nodes.iter().enumerate().filter(|(i, _)| self.flux[*i] > 0.0) {
            let at = [i / self.shape[1], i % self.shape[1]];
            let [rows, columns] = place.map(|p| between.nodes_about(p, n));
            for node in rows.flat_map(|row| columns.clone().map(move |column| [row, column])) {
                if between.weight(*place, node, n) != 0.0 {
                    let (low, high) = &mut ends[node[0] * n + node[1]];
                    for a in 0..2 {
                        low[a] = low[a].min(at[a]);
                        high[a] = high[a].max(at[a]);
                    }
                }
            }
        }
        let rectangle = |(low, high): &([usize; 2], [usize; 2])| {
            (low[0] != usize::MAX).then(|| (*low, [high[0] - low[0] + 1, high[1] - low[1] + 1]))
        };
        ends.iter().map(rectangle).collect()
    }
}

impl Look {
    /// Look at a place (row, column) in a picture of so many rows and columns, at least two each; nothing is beyond the
    /// middles of its outermost pixels.
    fn new(cell: usize, place: [f64; 2], size: [usize; 2]) -> Self {
        let place = [0, 1].map(|a| place[a].clamp(0.0, (size[a] - 1) as f64));
        let low = [0, 1].map(|a| (place[a] as usize).min(size[a] - 2));
        Self {
            cell: cell as u32,
            pixel: (low[0] * size[1] + low[1]) as u32,
            share: [0, 1].map(|a| (place[a] - low[a] as f64) as f32),
        }
    }
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
                    let within = landing[a].clamp(-6.0 * element.sensor_um, 6.0 * element.sensor_um);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::SceneView;
    use metalith_sensor::Camera;

    /// The field of an element is cut where its light does not reach the sensor, and what is left looks where it did.
    #[test]
    fn what_never_reaches_the_sensor_is_left_out() {
        const REACH: usize = 5;
        let view = SceneView {
            rows: 40,
            columns: 40,
            field_deg: 60.0,
            distance_um: f64::INFINITY,
        };
        let space = SceneSpace::flat(&view);
        let spec = BankSpec {
            pixel_um: 2.0,
            window: 8,
            nodes: 5,
            reach_um: 50.0,
            accurate: false,
        };
        let warp = |centre_um: [f64; 2], side: u32, cell: usize, reach: usize| {
            let mut sensor = Camera::three_bands(2.0).sensor;
            (sensor.columns, sensor.rows) = (side, side);
            let element = ElementView::ahead(centre_um, 100.0);
            let point = CellPoint {
                cell,
                shift: [0.0; 2],
                reach,
                area: 1.0,
                assumed: ApproximationSet::default(),
            };
            Warp::new(&element, &sensor, &spec, &space, 0.55, point)
        };
        for (cell, size) in [(1, 51i64), (2, 26)] {
            // Half of the field is to the right of a sensor of 51 pixels; rows are on it.
            let [whole, cut] = [1000, REACH].map(|reach| warp([50.0, 0.0], 51, cell, reach));
            assert_eq!(cut.origin[1], whole.origin[1]);
            assert_eq!(cut.origin[1] + cut.shape[1] as i64, size + REACH as i64);
            assert!(cut.shape[1] < whole.shape[1] && cut.shape[0] == whole.shape[0]);
            for row in 0..cut.shape[0] {
                let [a, b] = [&cut, &whole].map(|w| &w.flux[row * w.shape[1]..][..cut.shape[1]]);
                assert_eq!(a, b);
                let [a, b] = [&cut, &whole].map(|w| &w.nodes[row * w.shape[1]..][..cut.shape[1]]);
                assert_eq!(a, b);
            }
            // Nodes that lie beyond have nothing to do.
            let supports = |warp: &Warp| warp.supports(BetweenNodes::Linear, 5);
            assert!(supports(&whole)[14].is_some() && supports(&cut)[14].is_none());
            let beside = warp([50.0, -900.0], 51, cell, REACH);
            assert_eq!(beside.shape, [1, 1]);
            assert!(supports(&beside).iter().all(Option::is_none));
        }
    }
}
