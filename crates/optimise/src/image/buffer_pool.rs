//! Buffers of propagations, which one view hands on to the next.

use std::sync::{Mutex, PoisonError};

use num_complex::Complex32;

use super::imaging::Imaging;

/// The large buffers of one view: memory fresh from the system costs a sixth of its time.
#[derive(Default)]
pub(crate) struct Scratch {
    /// Rows of cells after the transform along x: `[cell y][x]`.
    pub rows: Vec<Complex32>,
    /// Field on the sensor for y >= 0: `[x][y]`, y from 0 to size / 2.
    pub field: Vec<Complex32>,
}

/// The buffers that no view uses at present.
#[derive(Default)]
pub(crate) struct BufferPool(Mutex<Vec<Scratch>>);

impl BufferPool {
    /// Buffers of a view that has ended, or new ones.
    pub(crate) fn take(&self) -> Scratch {
        let mut pool = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        pool.pop().unwrap_or_default()
    }

    /// Put the buffers of a view back.
    pub(crate) fn put_back(&self, imaging: Imaging<'_>) {
        let mut pool = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        pool.push(imaging.buffers);
    }
}
