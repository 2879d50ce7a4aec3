//! Complex numbers laid out for wide registers.

use num_complex::Complex64;

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

    pub fn row_mut(&mut self, i: usize, len: usize) -> (&mut [f32], &mut [f32]) {
        let at = i * len..(i + 1) * len;
        (&mut self.re[at.clone()], &mut self.im[at])
    }

    pub fn set(&mut self, i: usize, value: Complex64) {
        (self.re[i], self.im[i]) = (value.re as f32, value.im as f32);
    }

    pub fn row(&self, i: usize, len: usize) -> (&[f32], &[f32]) {
        (&self.re[i * len..(i + 1) * len], &self.im[i * len..(i + 1) * len])
    }
}
