//! Planes of features with the zeros around them that a convolution reads.

use ndarray::ArrayView2;

/// Positions that a convolution takes at a time, whatever the width of a register; a plane is a multiple of it.
pub(crate) const BLOCK: usize = 16;

/// Planes `[channel][row][column]` of single precision.
///
/// Behind each row stands one zero, which is also what the next row has before it; a row of zeros stands above and one
/// below. So a neighbour of a pixel is at a fixed distance from it, and a whole plane can be taken as one line.
#[derive(Clone, Debug)]
pub struct Features {
    pub channels: usize,
    pub rows: usize,
    pub columns: usize,
    pub values: Vec<f32>,
}

impl Features {
    /// All zero.
    pub fn zero(channels: usize, rows: usize, columns: usize) -> Self {
        let mut features = Self {
            channels,
            rows,
            columns,
            values: Vec::new(),
        };
        features.values = vec![0.0; channels * features.plane_len()];
        features
    }

    /// Distance of a pixel from the one above it.
    pub fn stride(&self) -> usize {
        self.columns + 1
    }

    /// Index of the first pixel of a plane.
    pub fn origin(&self) -> usize {
        self.stride() + 1
    }

    /// Positions from the first pixel to the last, zeros between rows among them, in whole blocks.
    pub fn span(&self) -> usize {
        (self.rows * self.stride()).next_multiple_of(BLOCK)
    }

    /// Entries of one plane with its zeros.
    pub fn plane_len(&self) -> usize {
        self.origin() + self.span() + self.stride() + 1
    }

    /// One plane with its zeros.
    pub fn plane(&self, channel: usize) -> &[f32] {
        let n = self.plane_len();
        &self.values[channel * n..(channel + 1) * n]
    }

    /// One row of one plane.
    pub fn row(&self, channel: usize, row: usize) -> &[f32] {
        let at = channel * self.plane_len() + self.origin() + row * self.stride();
        &self.values[at..at + self.columns]
    }

    /// One row of one plane.
    pub fn row_mut(&mut self, channel: usize, row: usize) -> &mut [f32] {
        let at = channel * self.plane_len() + self.origin() + row * self.stride();
        &mut self.values[at..at + self.columns]
    }

    /// Put zeros where no pixels are: a convolution writes there too.
    pub fn clear_borders(&mut self) {
        let (rows, columns, stride, origin, n) =
            (self.rows, self.columns, self.stride(), self.origin(), self.plane_len());
        for plane in self.values.chunks_exact_mut(n) {
            for row in 0..rows {
                plane[origin + row * stride + columns] = 0.0;
            }
            plane[origin + rows * stride..].fill(0.0);
        }
    }

    /// Add other features of the same shape.
    pub fn add(&mut self, other: &Self) {
        self.values.iter_mut().zip(&other.values).for_each(|(a, b)| *a += b);
    }

    /// Fill a channel from a plane.
    pub fn set(&mut self, channel: usize, plane: ArrayView2<'_, f32>) {
        for (y, from) in plane.rows().into_iter().enumerate() {
            self.row_mut(channel, y)
                .iter_mut()
                .zip(from)
                .for_each(|(to, v)| *to = *v);
        }
    }

    /// Each square of 2 x 2 pixels as four channels of one: half as many rows and columns. Both must be even.
    #[must_use]
    pub fn unshuffled(&self) -> Self {
        let mut out = Self::zero(4 * self.channels, self.rows / 2, self.columns / 2);
        for c in 0..self.channels {
            for y in 0..self.rows {
                for dx in 0..2 {
                    let to = out.row_mut(4 * c + 2 * (y % 2) + dx, y / 2);
                    let from = self.row(c, y)[dx..].iter().step_by(2);
                    to.iter_mut().zip(from).for_each(|(to, v)| *to = *v);
                }
            }
        }
        out
    }

    /// The inverse of [`Features::unshuffled`].
    #[must_use]
    pub fn shuffled(&self) -> Self {
        let mut out = Self::zero(self.channels / 4, 2 * self.rows, 2 * self.columns);
        for c in 0..out.channels {
            for y in 0..out.rows {
                for dx in 0..2 {
                    let from = self.row(4 * c + 2 * (y % 2) + dx, y / 2);
                    let to = out.row_mut(c, y)[dx..].iter_mut().step_by(2);
                    to.zip(from).for_each(|(to, v)| *to = *v);
                }
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shuffling_undoes_unshuffling_and_leaves_borders_zero() {
        let mut features = Features::zero(3, 6, 4);
        for c in 0..3 {
            for y in 0..6 {
                for (x, v) in features.row_mut(c, y).iter_mut().enumerate() {
                    *v = (c * 100 + y * 10 + x + 1) as f32;
                }
            }
        }
        let small = features.unshuffled();
        assert_eq!((small.channels, small.rows, small.columns), (12, 3, 2));
        assert_eq!(small.row(4 + 3, 1), [132.0, 134.0]);
        assert_eq!(small.shuffled().values, features.values);
        let mut cleared = small.clone();
        cleared.clear_borders();
        assert_eq!(cleared.values, small.values);
    }
}
