//! Complex numbers laid out for wide registers.

/// Complex numbers as two planes of reals.
#[derive(Clone, Debug, Default)]
pub struct Planes {
    pub re: Vec<f32>,
    pub im: Vec<f32>,
}

impl Planes {
    pub fn zeros(len: usize) -> Self {
        Self {
            re: vec![0.0; len],
            im: vec![0.0; len],
        }
    }

    pub fn row(&self, i: usize, len: usize) -> (&[f32], &[f32]) {
        (&self.re[i * len..(i + 1) * len], &self.im[i * len..(i + 1) * len])
    }
}
