//! The sensor.

use serde::Serialize;

use crate::{AngularResponse, ColourFilter, Noise, Walls};

/// The sensor and where it stands.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sensor {
    /// Edge of a pixel (um).
    pub pixel_um: f64,
    pub columns: u32,
    pub rows: u32,
    /// Middle of the sensor from the middle of the chip, x and y (um).
    pub offset_um: [f64; 2],
    /// Distance from the pillar tops to the sensor below the middle of the chip (um), if the camera says it: else the
    /// focal length that the lenses of a design share.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distance_um: Option<f64>,
    /// Tilt of the sensor against the chip about the y and the x axis: the distance grows with x and with y (rad).
    pub tilt_rad: [f64; 2],
    pub filter: ColourFilter,
    /// Response of pixels to light at an angle.
    #[serde(skip_serializing_if = "AngularResponse::is_unstated")]
    pub angular_response: AngularResponse,
    /// Walls between the elements of an array before the sensor.
    #[serde(skip_serializing_if = "Walls::are_none")]
    pub walls: Walls,
    /// Bits of a pixel value.
    pub bits: u32,
    /// Electrons of one step of the pixel value.
    pub gain_e: f64,
    pub noise: SensorNoise,
}

/// Sources of noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SensorNoise {
    /// Noise by the numbers of a data sheet.
    Electrons {
        /// Electrons that fill a pixel; full scale.
        full_well_e: f64,
        /// Standard deviation of reading (electrons).
        read_noise_e: f64,
        /// Electrons a second without light.
        dark_current_e_s: f64,
    },
    /// Noise by the two numbers of a paper, in units of full scale.
    FullScale {
        /// Signal of one photon, a_p.
        photon: f64,
        /// Standard deviation of reading, sigma_g.
        read: f64,
    },
}

impl Sensor {
    /// Electrons of full scale: what fills a pixel, or what noise of photons says; all steps of a sensor of which neither is known.
    pub fn full_scale_e(&self) -> f64 {
        let steps = f64::from(self.bits).exp2();
        self.noise.full_scale_e().unwrap_or(self.gain_e * steps)
    }

    /// True if every pixel counts all light of every element: no response by angle is stated, and no walls stand between elements.
    pub fn counts_all_light(&self) -> bool {
        self.angular_response == AngularResponse::Unstated && self.walls == Walls::None
    }

    /// One step of the pixel value, of full scale.
    pub fn step(&self) -> f64 {
        self.gain_e / self.full_scale_e()
    }

    /// Row and column of a place of the chip (um), in pixels from the middle of the first; rows run along y.
    pub fn pixel_at(&self, place_um: [f64; 2]) -> [f64; 2] {
        [(self.rows, 1), (self.columns, 0)]
            .map(|(n, axis)| 0.5 * (f64::from(n) - 1.0) + (place_um[axis] - self.offset_um[axis]) / self.pixel_um)
    }

    /// The place of the chip (um) before the middle of a pixel: [`Sensor::pixel_at`] backwards.
    pub fn place_um(&self, [row, column]: [usize; 2]) -> [f64; 2] {
        [(column, self.columns, 0), (row, self.rows, 1)]
            .map(|(i, n, axis)| (i as f64 - 0.5 * (f64::from(n) - 1.0)) * self.pixel_um + self.offset_um[axis])
    }

    /// Largest signal that is recorded, of full scale: where the pixel values end, or the well if that is filled before.
    pub fn largest_signal(&self) -> f64 {
        (self.step() * (f64::from(self.bits).exp2() - 1.0)).min(1.0)
    }
}

impl SensorNoise {
    /// Electrons of full scale; nothing if photons make no noise, by which they could be counted.
    pub fn full_scale_e(&self) -> Option<f64> {
        match *self {
            Self::Electrons { full_well_e, .. } => Some(full_well_e),
            Self::FullScale { photon, .. } => (photon > 0.0).then(|| 1.0 / photon),
        }
    }

    /// Noise of images between zero and full scale, exposed for so long (s). Electrons that come without light vary by
    /// the root of their number, which is taken for part of reading; their mean is subtracted by every camera.
    pub fn of_exposure(&self, time_s: f64) -> Noise {
        match *self {
            Self::Electrons {
                full_well_e,
                read_noise_e,
                dark_current_e_s,
            } => Noise::of_electrons(full_well_e, (read_noise_e.powi(2) + dark_current_e_s * time_s).sqrt()),
            Self::FullScale { photon, read } => Noise { photon, read },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_of_a_data_sheet_is_that_of_its_electrons() {
        let sheet = SensorNoise::Electrons {
            full_well_e: 10_000.0,
            read_noise_e: 6.0,
            dark_current_e_s: 64.0,
        };
        let noise = sheet.of_exposure(1.0);
        // Half of full scale: 5000 photons, 36 of reading and 64 of the dark.
        let electrons2 = noise.variance(0.5) * 1e8;
        assert!((electrons2 - 5100.0).abs() < 1e-6, "{electrons2}");
        let paper = SensorNoise::FullScale {
            photon: 4e-5,
            read: 1e-5,
        };
        assert_eq!(paper.of_exposure(7.0), Noise::default());
    }

    #[test]
    fn signals_end_with_the_steps_or_with_the_well() {
        let mut sensor = crate::Camera::three_bands(5.86).sensor;
        sensor.bits = 8;
        sensor.noise = SensorNoise::Electrons {
            full_well_e: 10_000.0,
            read_noise_e: 6.0,
            dark_current_e_s: 0.0,
        };
        // Rounding of one quotient.
        const ROUNDING: f64 = 1e-12;
        for (gain_e, largest) in [(10.0, 0.255), (10_000.0 / 256.0, 255.0 / 256.0), (60.0, 1.0)] {
            sensor.gain_e = gain_e;
            assert!((sensor.largest_signal() - largest).abs() < ROUNDING, "{gain_e}");
        }
        sensor.noise = SensorNoise::FullScale {
            photon: 0.0,
            read: 1e-3,
        };
        assert_eq!(sensor.full_scale_e(), 60.0 * 256.0);
        assert!((sensor.step() - 1.0 / 256.0).abs() < ROUNDING);
    }
}
