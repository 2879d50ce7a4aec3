//! The stray light: all light that lands outside of the kernels' windows, laid over the sensor coarsely.
//!
//! Where light of a direction lands follows from the local spectra of the element, by rays
//! ([`metalith_wave::propagation::LocalAngularSpectrum`]). What the kernel of that direction holds is taken out of it, so that image
//! and stray light together are all the light that travels to the sensor.
//!
//! | question | file |
//! | --- | --- |
//! | from pixels to squares and back | `coarse_grid` |
//! | where the light of one square of the scene goes | `ray_trace` |
//! | how much light goes where in all | `light_shares` |

mod coarse_grid;
mod light_shares;
mod ray_trace;

use metalith_core::{Error, Result};
use metalith_sensor::Sensor;
use metalith_wave::kernels::sum_of_products;
use pulp::Arch;

use crate::kernels::MOST_BYTES;

pub(crate) use coarse_grid::{gather, lay, lift, spread};
pub use light_shares::LightShares;

/// Squares an axis into which the light of a scene is gathered.
pub(crate) const SCENE_CELLS: usize = 20;
/// Pixels an axis of a square of the sensor.
pub(crate) const CELL_PIXELS: usize = 16;

/// Stray light: where a channel's light of a scene's squares goes that no kernel holds.
#[derive(Clone, Debug)]
pub struct StrayLight {
    /// Rows and columns of squares of the sensor.
    pub cells: [usize; 2],
    /// Channels and spectra of the scene.
    pub channels: usize,
    pub bases: usize,
    /// Channel, spectrum, square of the scene, square of the sensor: light on it, of what a lens receives from a white
    /// surface of that square.
    pub values: Vec<f32>,
    /// Shares of the light that arrives, by channel and spectrum.
    pub budget: Vec<LightShares>,
}

/// Squares that cover a sensor.
pub(crate) fn sensor_cells(sensor: &Sensor) -> [usize; 2] {
    [sensor.rows, sensor.columns].map(|n| (n as usize).div_ceil(CELL_PIXELS))
}

impl StrayLight {
    /// Checks that the stray light of a sensor can be held.
    ///
    /// # Errors
    /// If it has too many pixels.
    pub fn check_size(sensor: &Sensor, channels: usize, bases: usize) -> Result<()> {
        let [rows, columns] = sensor_cells(sensor).map(|n| n as u64);
        let values = (channels * bases * SCENE_CELLS * SCENE_CELLS) as u64 * rows * columns;
        let bytes = values * size_of::<f32>() as u64;
        // That of a sensor of some 70 million pixels in three colours.
        if bytes <= MOST_BYTES {
            return Ok(());
        }
        Err(Error::refused(
            "camera/too-much-memory",
            format!(
                "a sensor of {} x {} pixels: light beside the images would take {} MB",
                sensor.columns,
                sensor.rows,
                bytes >> 20
            ),
            "give the part of the sensor that the array lights: `columns`, `rows` and `offset_um` of the camera",
        ))
    }

    /// No stray light, for tests and for those who leave it out.
    pub fn none(sensor: &Sensor, channels: usize, bases: usize) -> Self {
        let cells = sensor_cells(sensor);
        Self {
            cells,
            channels,
            bases,
            values: vec![0.0; channels * bases * SCENE_CELLS * SCENE_CELLS * cells[0] * cells[1]],
            budget: vec![LightShares::default(); channels * bases],
        }
    }

    /// Light on the squares of the sensor, for each square of the scene.
    fn block(&self, channel: usize, basis: usize) -> impl Iterator<Item = &[f32]> {
        let (rows, columns) = (SCENE_CELLS * SCENE_CELLS, self.cells[0] * self.cells[1]);
        let from = (channel * self.bases + basis) * rows * columns;
        self.values[from..from + rows * columns].chunks_exact(columns)
    }

    /// Light on the squares of the sensor, from that of the scene's squares.
    pub fn apply(&self, channel: usize, basis: usize, scene: &[f64]) -> Vec<f64> {
        let mut cells = vec![0.0; self.cells[0] * self.cells[1]];
        for (light, row) in scene.iter().zip(self.block(channel, basis)) {
            Arch::new().dispatch(|| {
                cells.iter_mut().zip(row).for_each(|(c, v)| *c += light * f64::from(*v));
            });
        }
        cells
    }

    /// The adjoint of [`StrayLight::apply`].
    pub fn adjoint(&self, channel: usize, basis: usize, cells: &[f64]) -> Vec<f64> {
        self.block(channel, basis)
            .map(|row| sum_of_products(row, cells))
            .collect()
    }

    /// The stray light of a surface whose spectrum is the sum of some of the basis, in each channel.
    #[must_use]
    pub fn grey(&self, spectra: std::ops::Range<usize>) -> Self {
        let size = SCENE_CELLS * SCENE_CELLS * self.cells[0] * self.cells[1];
        let mut values = vec![0.0f32; self.channels * size];
        for (channel, to) in values.chunks_exact_mut(size).enumerate() {
            for basis in spectra.clone() {
                let from = &self.values[(channel * self.bases + basis) * size..][..size];
                to.iter_mut().zip(from).for_each(|(a, b)| *a += b);
            }
        }
        Self {
            values,
            bases: 1,
            budget: Vec::new(),
            ..*self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_sensor::Camera;

    #[test]
    fn a_sensor_whose_stray_light_cannot_be_held_is_refused() {
        let mut sensor = Camera::three_bands(5.86).sensor;
        assert!(StrayLight::check_size(&sensor, 3, 6).is_ok());
        (sensor.rows, sensor.columns) = (100_000, 100_000);
        let error = StrayLight::check_size(&sensor, 3, 3).unwrap_err().to_string();
        assert!(error.contains("100000 x 100000"), "{error}");
    }
}
