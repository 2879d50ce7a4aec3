//! The pixels of a sub-image on the frame.

use ndarray::Array2;

/// The sub-image of an element: the pixels of one phase of its cells, in one channel.
pub(crate) struct SubImage {
    pub channel: usize,
    /// Pixels of the sensor.
    pub grid: PixelGrid,
    /// Row by row.
    pub light: Vec<f32>,
}

/// Every `step`-th pixel of the sensor, on it or beyond.
#[derive(Clone, Copy)]
pub(crate) struct PixelGrid {
    /// Row and column of the first.
    pub origin: [i64; 2],
    /// Pixels of the sensor from one to the next.
    pub step: usize,
    /// Rows and columns.
    pub shape: [usize; 2],
}

impl PixelGrid {
    /// Rows and columns that lie on a frame of so many, and where the first of them lies there.
    fn on(&self, axis: usize, length: usize) -> (std::ops::Range<usize>, usize) {
        let (origin, step) = (self.origin[axis], self.step as i64);
        let first = (-origin).max(0).div_euclid(step) + i64::from((-origin).max(0) % step != 0);
        let end = (length as i64 - origin + step - 1).div_euclid(step);
        let end = end.clamp(0, self.shape[axis] as i64) as usize;
        let first = (first as usize).min(end);
        (first..end, (origin + first as i64 * step).max(0) as usize)
    }

    /// Light of these pixels of a frame, row by row; none beyond the sensor.
    pub(crate) fn gather(&self, frame: &Array2<f32>) -> Vec<f32> {
        let mut light = vec![0.0; self.shape[0] * self.shape[1]];
        let (rows, row) = self.on(0, frame.nrows());
        let (columns, column) = self.on(1, frame.ncols());
        for (k, y) in rows.enumerate() {
            let line = frame.row(row + k * self.step);
            let from = line.iter().skip(column).step_by(self.step);
            let to = &mut light[y * self.shape[1]..][columns.clone()];
            to.iter_mut().zip(from).for_each(|(t, f)| *t = *f);
        }
        light
    }
}

impl SubImage {
    /// Add what lies on the sensor to its frames: the adjoint of [`PixelGrid::gather`].
    pub(crate) fn add_to(&self, frames: &mut [Array2<f32>]) {
        let frame = &mut frames[self.channel];
        let (rows, row) = self.grid.on(0, frame.nrows());
        let (columns, column) = self.grid.on(1, frame.ncols());
        for (k, y) in rows.enumerate() {
            let mut line = frame.row_mut(row + k * self.grid.step);
            let to = line.iter_mut().skip(column).step_by(self.grid.step);
            let from = &self.light[y * self.grid.shape[1]..][columns.clone()];
            to.zip(from).for_each(|(t, f)| *t += f);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_on_the_sensor_are_found_on_each_side_of_it() {
        let frame = Array2::from_shape_fn((6, 7), |(y, x)| (10 * y + x + 1) as f32);
        for origin in [[-5, -4], [-1, 0], [0, -3], [3, 5], [9, 2], [-20, 1]] {
            for step in [1, 2] {
                let grid = PixelGrid {
                    origin,
                    step,
                    shape: [4, 3],
                };
                let light = grid.gather(&frame);
                for (i, value) in light.iter().enumerate() {
                    let at = [i / 3, i % 3];
                    let place = [0, 1].map(|a| usize::try_from(origin[a] + (at[a] * step) as i64).ok());
                    let wanted = match place {
                        [Some(y), Some(x)] => frame.get([y, x]).copied().unwrap_or(0.0),
                        _ => 0.0,
                    };
                    assert_eq!(*value, wanted);
                }
                let squares: f32 = light.iter().map(|v| v * v).sum();
                let mut back = [Array2::zeros((6, 7))];
                SubImage {
                    channel: 0,
                    grid,
                    light,
                }
                .add_to(&mut back);
                assert_eq!((&back[0] * &frame).sum(), squares);
            }
        }
    }
}
