//! Differences from what is stated: the numbers that every effect sets, all zero for a perfect chip.

use num_complex::Complex64;
use serde::{Deserialize, Serialize};

use super::declared::{CompiledTerm, DeclaredQuantity, DeclaredTerm, compiled};
use super::stitching::Stitching;
use super::{density, zernike};

/// Differences of chip and bench from what was drawn and stated. The default differs in nothing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Perturbation {
    pub geometry: GeometryChange,
    pub cell: CellChange,
    pub path: PathChange,
    pub light: LightChange,
    pub camera: CameraChange,
}

/// Pillars and apertures.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GeometryChange {
    /// Added to every width (nm).
    pub cd_bias_nm: f64,
    /// Added to a width for each unit of area fraction around it (nm).
    pub cd_bias_density_nm: f64,
    /// Range of the Gaussian exp(-r^2 / range^2) that the area fraction is averaged with (um); [`super::RANGE_UM`] if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cd_bias_density_range_um: Option<f64>,
    /// Share of the pillars that are missing, at random places.
    pub missing_pillars: f64,
    /// Amplitude of light that passes the aperture without seeing pillars, over that which arrives.
    pub zero_order: f64,
    /// Phase of that light at the top of the pillars, relative to what arrives at their foot (rad).
    pub zero_order_phase: f64,
    /// Offset from the pillars to their aperture along x and y (um).
    pub aperture_offset_um: [f64; 2],
    /// Optical path over the lens (nm), by Zernike polynomial from Noll's fifth on, normalised to an rms of one over
    /// the aperture: aberrations, and the free terms that are no effect.
    pub wavefront_nm: Vec<f64>,
    /// A free term: relative change of amplitude over the range of widths, by Legendre polynomial from the first on.
    pub transmission: Vec<f64>,
    /// Coefficients of the phase of the transmission (rad).
    pub transmission_phase_rad: Vec<f64>,
    /// Widths that stand at -1 and +1 of those polynomials (nm).
    pub transmission_range_nm: [f64; 2],
    /// Boundaries of write fields beyond which pillars are displaced.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stitching: Vec<Stitching>,
    /// Terms declared by expressions: widths, and what sites do to light.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub declared: Vec<DeclaredTerm>,
}

/// The pillar itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CellChange {
    /// Added to the height (nm).
    pub height_nm: f64,
    /// Added to the height at the rim of a lens over that in its middle, with the square of the radius between (nm).
    /// Pillars stand on a flat substrate; their tops differ.
    #[serde(skip_serializing_if = "is_zero")]
    pub rim_height_nm: f64,
    /// Added to the index of the film.
    pub index: f64,
    /// Lean of the walls, the width at the top kept; positive is wider at the foot (deg).
    pub taper_deg: f64,
    /// Radius of the vertical edges (nm).
    pub corner_rounding_nm: f64,
    /// Alumina left on top (nm).
    pub residual_mask_nm: f64,
}

/// Models that say nothing of the rim are written as they always were.
fn is_zero(v: &f64) -> bool {
    *v == 0.0
}

impl CellChange {
    /// Change of the pillars in the middle of a lens.
    #[must_use]
    pub fn in_the_middle(&self) -> Self {
        Self {
            rim_height_nm: 0.0,
            ..*self
        }
    }

    /// Change of the pillars at its rim; `None` where it is equal to the change in the middle.
    pub fn at_the_rim(&self) -> Option<Self> {
        (self.rim_height_nm != 0.0).then(|| Self {
            height_nm: self.height_nm + self.rim_height_nm,
            ..self.in_the_middle()
        })
    }
}

/// The path of the light to the chip and from it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PathChange {
    /// Added to every distance of chip and sensor (um).
    pub defocus_um: f64,
    /// Added to every angle of incidence along x and y (mrad).
    pub tilt_mrad: [f64; 2],
    /// One over the distance of the source (1/m); zero for collimated light.
    pub source_per_m: f64,
    /// Tilt of the sensor against the chip along x and y (mrad): an element is farther from the sensor by this times
    /// its place from the pivot.
    pub sensor_tilt_mrad: [f64; 2],
    /// Place on the chip about which the sensor is tilted (um).
    pub sensor_pivot_um: [f64; 2],
    /// Terms declared by expressions: distances.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub declared: Vec<DeclaredTerm>,
}

impl PathChange {
    /// Distance that is added between chip and sensor at an element whose centre is at this place on the chip (um).
    pub fn added_distance_um(&self, centre_um: [f64; 2]) -> f64 {
        let lean = |axis: usize| 1e-3 * self.sensor_tilt_mrad[axis] * (centre_um[axis] - self.sensor_pivot_um[axis]);
        let declared = compiled(&self.declared, |_| true);
        let declared: f64 = declared.iter().map(|t| t.value(&centre_um)).sum();
        self.defocus_um + lean(0) + lean(1) + declared
    }
}

/// The lamps.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LightChange {
    /// Added to the centre of each LED, by its place in the set (nm); missing ones are zero.
    pub led_shift_nm: Vec<f64>,
    /// Width of all spectra over what is stated, less one.
    pub led_width: f64,
    /// Diameter of the source over what is stated, less one.
    pub source_size: f64,
    /// Terms declared by expressions: spectra.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub declared: Vec<DeclaredTerm>,
}

/// The camera.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CameraChange {
    /// Standard deviation of a Gaussian blur (um).
    pub pixel_blur_um: f64,
    /// Share of the light of a window that is spread evenly over it.
    pub stray_light: f64,
    /// Terms declared by expressions: images.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub declared: Vec<DeclaredTerm>,
}

impl GeometryChange {
    /// Set the optical path over the lens (nm) by Noll's polynomial `j`, from the fifth on.
    pub fn set_wavefront(&mut self, j: u32, nm: f64) {
        let at = (j - zernike::FIRST) as usize;
        if nm != 0.0 && self.wavefront_nm.len() <= at {
            self.wavefront_nm.resize(at + 1, 0.0);
        }
        if let Some(to) = self.wavefront_nm.get_mut(at) {
            *to = nm;
        }
    }

    /// Add to the optical path over the lens (nm) by Noll's polynomial `j`, from the fifth on. Zero adds nothing.
    pub fn add_wavefront(&mut self, j: u32, nm: f64) {
        let before = self.wavefront_nm.get((j - zernike::FIRST) as usize).copied();
        self.set_wavefront(j, before.unwrap_or(0.0) + nm);
    }

    /// Amplitude that passes without seeing pillars, over that which arrives.
    pub fn unstructured(&self) -> Complex64 {
        Complex64::from_polar(self.zero_order, self.zero_order_phase)
    }

    /// Width added to a pillar with this area fraction around it (nm).
    pub fn bias_nm(&self, fill: f64) -> f64 {
        self.cd_bias_nm + self.cd_bias_density_nm * fill
    }

    /// Range of the Gaussian that the area fraction is averaged with (um).
    pub fn density_range_um(&self) -> f64 {
        self.cd_bias_density_range_um.unwrap_or(density::RANGE_UM)
    }

    /// True if the bias differs from site to site.
    pub fn varies_by_site(&self) -> bool {
        self.cd_bias_density_nm != 0.0 || self.declared.iter().any(|t| t.quantity == DeclaredQuantity::WidthNm)
    }

    /// Declared widths that depend on more than the pillar, the fill around it and its distance from the middle: what
    /// symmetric copies of an element do not share.
    pub fn directed_widths(&self) -> Vec<&str> {
        let directed = |t: &&DeclaredTerm| {
            let turned = |c: &CompiledTerm| ["x", "y", "theta", "X", "Y"].iter().any(|v| c.uses(v));
            t.quantity == DeclaredQuantity::WidthNm && t.compiled().is_ok_and(|c| turned(&c))
        };
        self.declared.iter().filter(directed).map(|t| t.name.as_str()).collect()
    }

    /// Factor of the transmission of a pillar that came out this wide (nm). Polynomials keep the values at their ends
    /// beyond them.
    pub fn transmission_factor(&self, width_nm: f64) -> Complex64 {
        if self.transmission.is_empty() && self.transmission_phase_rad.is_empty() {
            return Complex64::ONE;
        }
        let [narrow, wide] = self.transmission_range_nm;
        let place = ((2.0 * width_nm - narrow - wide) / (wide - narrow).max(1.0)).clamp(-1.0, 1.0);
        let amplitude = 1.0 + legendre(&self.transmission, place);
        Complex64::from_polar(amplitude, legendre(&self.transmission_phase_rad, place))
    }
}

impl LightChange {
    /// Factor by which declared terms change the spectrum of a lamp at a wavelength; never negative.
    pub fn spectral_factor(&self, wavelength_nm: f64, centre_nm: f64) -> f64 {
        let terms = compiled(&self.declared, |_| true);
        let factors = terms.iter().map(|t| t.value(&[wavelength_nm, centre_nm]).max(0.0));
        factors.product()
    }

    /// Shift of one LED (nm).
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

/// Sum of Legendre polynomials at `x`, coefficients from the first polynomial on.
pub fn legendre(coefficients: &[f64], x: f64) -> f64 {
    let (mut before, mut now, mut sum) = (1.0, x, 0.0);
    for (k, c) in coefficients.iter().enumerate() {
        sum += c * now;
        let n = k as f64 + 1.0;
        (before, now) = (now, ((2.0 * n + 1.0) * x * now - n * before) / (n + 1.0));
    }
    sum
}

impl Perturbation {
    /// True if the result for an element depends on its place on the chip, or, by boundaries of write fields and
    /// declared terms, on its orientation.
    pub fn depends_on_place(&self) -> bool {
        let tilted = self.path.sensor_tilt_mrad != [0.0; 2];
        tilted || !self.geometry.stitching.is_empty() || self.declared().next().is_some()
    }

    /// True if the result for an element depends on no direction and no place: elements that are equal by a symmetry
    /// are fabricated equal by it.
    pub fn keeps_symmetry(&self) -> bool {
        let (geometry, path) = (&self.geometry, &self.path);
        geometry.aperture_offset_um == [0.0; 2]
            && geometry.wavefront_nm.is_empty()
            && path.tilt_mrad == [0.0; 2]
            && !self.depends_on_place()
    }

    /// Add a term to the part that it acts on.
    pub fn declare(&mut self, term: DeclaredTerm) {
        match term.quantity {
            DeclaredQuantity::DistanceUm => self.path.declared.push(term),
            DeclaredQuantity::Spectrum => self.light.declared.push(term),
            DeclaredQuantity::Kernel | DeclaredQuantity::Transfer => self.camera.declared.push(term),
            _ => self.geometry.declared.push(term),
        }
    }

    /// All declared terms.
    pub fn declared(&self) -> impl Iterator<Item = &DeclaredTerm> {
        let (geometry, path) = (&self.geometry.declared, &self.path.declared);
        let (light, camera) = (&self.light.declared, &self.camera.declared);
        [geometry, path, light, camera].into_iter().flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn legendre_polynomials_are_those_of_the_closed_form() {
        let x = 0.3_f64;
        let third = 0.5 * (5.0 * x.powi(3) - 3.0 * x);
        // A few products of numbers of size one.
        const ROUNDING: f64 = 1e-15;
        assert!((legendre(&[0.0, 0.0, 1.0], x) - third).abs() < ROUNDING);
        assert!((legendre(&[2.0], x) - 0.6).abs() < ROUNDING);
    }
}
