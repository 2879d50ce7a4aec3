//! The pixels that images are judged on.

/// A square window of pixels on the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelWindow {
    /// Pixels along a side, even.
    pub pixels: usize,
    /// Pixel pitch (um).
    pub pixel_um: f64,
}

impl PixelWindow {
    /// Side of the window (um).
    pub fn side_um(&self) -> f64 {
        self.pixels as f64 * self.pixel_um
    }
}
