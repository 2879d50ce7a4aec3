//! What may differ from what is stated: the numbers that every effect turns, all zero for a perfect chip.

use num_complex::Complex64;
use serde::{Deserialize, Serialize};

/// How chip and bench depart from what was written and stated. The default departs in nothing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Departure {
    pub geometry: Geometry,
    pub cell: CellChange,
    pub path: PathChange,
    pub light: LightChange,
    pub camera: CameraChange,
}

/// Pillars and apertures.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Geometry {
    /// Added to every width [nm].
    pub cd_bias_nm: f64,
    /// Added to a width for each unit of area fraction around it [nm].
    pub cd_bias_density_nm: f64,
    /// Share of the pillars that are not there, anywhere.
    pub missing_pillars: f64,
    /// Amplitude of light that passes the aperture without seeing pillars, of that which arrives.
    pub zero_order: f64,
    /// Phase of that light at the top of the pillars, relative to what arrives at their foot [rad].
    pub zero_order_phase: f64,
    /// From the pillars to their aperture along x and y [um].
    pub aperture_offset_um: [f64; 2],
    /// Free terms, which are no effect: optical path over the lens [nm], by Zernike polynomial from Noll's
    /// fifth on.
    pub wavefront_nm: Vec<f64>,
    /// Relative change of amplitude over the range of widths, by Legendre polynomial from the first on.
    pub transmission: Vec<f64>,
}

/// The pillar itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CellChange {
    /// Added to the height [nm].
    pub height_nm: f64,
    /// Added to the index of the film.
    pub index: f64,
    /// Lean of the walls, the top kept; positive is wider at the foot [deg].
    pub taper_deg: f64,
    /// Radius of the vertical edges [nm].
    pub corner_rounding_nm: f64,
    /// Alumina left on top [nm].
    pub residual_mask_nm: f64,
}

/// The way of the light to the chip and from it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PathChange {
    /// Added to every distance [um].
    pub gap_um: f64,
    /// Added to every angle of incidence along x and y [mrad].
    pub tilt_mrad: [f64; 2],
    /// One over the distance of the source [1 / m]; zero for collimated light.
    pub source_per_m: f64,
}

/// The lamps.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LightChange {
    /// Added to the centre of each LED, by its place in the set [nm]; missing ones are zero.
    pub led_shift_nm: Vec<f64>,
    /// Width of all spectra over what is stated, less one.
    pub led_width: f64,
    /// Diameter of the source over what is stated, less one.
    pub source_size: f64,
}

/// The camera.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CameraChange {
    /// Standard deviation of a blur [um].
    pub pixel_blur_um: f64,
    /// Share of the light of a window that is spread evenly over it.
    pub stray_light: f64,
}

impl Geometry {
    /// Light that passes without seeing pillars, over that which arrives.
    pub fn unstructured(&self) -> Complex64 {
        Complex64::from_polar(self.zero_order, self.zero_order_phase)
    }
}

impl LightChange {
    /// Shift of one LED [nm].
    pub fn shift_nm(&self, led: usize) -> f64 {
        self.led_shift_nm.get(led).copied().unwrap_or(0.0)
    }

    /// The shift of one LED, to be set.
    pub fn shift_mut(&mut self, led: usize) -> &mut f64 {
        if self.led_shift_nm.len() <= led {
            self.led_shift_nm.resize(led + 1, 0.0);
        }
        &mut self.led_shift_nm[led]
    }
}
