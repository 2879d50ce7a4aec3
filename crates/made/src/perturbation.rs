//! What may differ from what is stated: the numbers that every effect sets, all zero for a perfect chip.

use num_complex::Complex64;
use serde::{Deserialize, Serialize};

/// How chip and bench differ from what was drawn and stated. The default differs in nothing.
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
    /// Share of the pillars that are missing, at random places.
    pub missing_pillars: f64,
    /// Amplitude of light that passes the aperture without seeing pillars, over that which arrives.
    pub zero_order: f64,
    /// Phase of that light at the top of the pillars, relative to what arrives at their foot (rad).
    pub zero_order_phase: f64,
    /// From the pillars to their aperture along x and y (um).
    pub aperture_offset_um: [f64; 2],
    /// Free terms, which are no effect: optical path over the lens (nm), by Zernike polynomial from Noll's
    /// fifth on, normalised to an rms of one over the aperture.
    pub wavefront_nm: Vec<f64>,
    /// Relative change of amplitude over the range of widths, by Legendre polynomial from the first on.
    pub transmission: Vec<f64>,
    /// Widths that stand at -1 and +1 of those polynomials (nm).
    pub transmission_range_nm: [f64; 2],
}

/// The pillar itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CellChange {
    /// Added to the height (nm).
    pub height_nm: f64,
    /// Added to the index of the film.
    pub index: f64,
    /// Lean of the walls, the width at the top kept; positive is wider at the foot (deg).
    pub taper_deg: f64,
    /// Radius of the vertical edges (nm).
    pub corner_rounding_nm: f64,
    /// Alumina left on top (nm).
    pub residual_mask_nm: f64,
}

/// The path of the light to the chip and from it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PathChange {
    /// Added to every distance of chip and sensor (um).
    pub gap_um: f64,
    /// Added to every angle of incidence along x and y (mrad).
    pub tilt_mrad: [f64; 2],
    /// One over the distance of the source (1/m); zero for collimated light.
    pub source_per_m: f64,
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
}

/// The camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CameraChange {
    /// Standard deviation of a Gaussian blur (um).
    pub pixel_blur_um: f64,
    /// Share of the light of a window that is spread evenly over it.
    pub stray_light: f64,
}

impl GeometryChange {
    /// Amplitude that passes without seeing pillars, over that which arrives.
    pub fn unstructured(&self) -> Complex64 {
        Complex64::from_polar(self.zero_order, self.zero_order_phase)
    }

    /// Width added to a pillar with this area fraction around it (nm).
    pub fn bias_nm(&self, fill: f64) -> f64 {
        self.cd_bias_nm + self.cd_bias_density_nm * fill
    }

    /// Whether the bias differs from site to site.
    pub fn follows_density(&self) -> bool {
        self.cd_bias_density_nm != 0.0
    }

    /// Factor of the amplitude of a pillar that came out this wide (nm).
    pub fn amplitude(&self, width_nm: f64) -> f64 {
        let [narrow, wide] = self.transmission_range_nm;
        let place = (2.0 * width_nm - narrow - wide) / (wide - narrow).max(1.0);
        1.0 + legendre(&self.transmission, place)
    }
}

impl LightChange {
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

/// What a number of a model file must lie within.
struct Bound {
    name: &'static str,
    range: (f64, f64),
}

impl Perturbation {
    /// Every number that is outside of what can be simulated, in words; none for a sound perturbation. The
    /// limits are several times what any process or bench does, and keep work and memory bounded.
    pub fn faults(&self) -> Vec<String> {
        let (g, c, p, l, k) = (&self.geometry, &self.cell, &self.path, &self.light, &self.camera);
        let bound = |name, low, high| Bound {
            name,
            range: (low, high),
        };
        let one = |v: f64| vec![v];
        let checked: [(Bound, Vec<f64>); 20] = [
            (bound("geometry.cd_bias_nm", -500.0, 500.0), one(g.cd_bias_nm)),
            (
                bound("geometry.cd_bias_density_nm", -500.0, 500.0),
                one(g.cd_bias_density_nm),
            ),
            (bound("geometry.missing_pillars", 0.0, 1.0), one(g.missing_pillars)),
            (bound("geometry.zero_order", 0.0, 2.0), one(g.zero_order)),
            (
                bound("geometry.zero_order_phase", -100.0, 100.0),
                one(g.zero_order_phase),
            ),
            (
                bound("geometry.aperture_offset_um", -1e4, 1e4),
                g.aperture_offset_um.to_vec(),
            ),
            (bound("geometry.wavefront_nm", -1e5, 1e5), g.wavefront_nm.clone()),
            (bound("geometry.transmission", -10.0, 10.0), g.transmission.clone()),
            (
                bound("geometry.transmission_range_nm", 0.0, 1e5),
                g.transmission_range_nm.to_vec(),
            ),
            (bound("cell.height_nm", -1e4, 1e4), one(c.height_nm)),
            (bound("cell.index", -2.0, 2.0), one(c.index)),
            (bound("cell.taper_deg", -30.0, 30.0), one(c.taper_deg)),
            (bound("cell.corner_rounding_nm", 0.0, 1e4), one(c.corner_rounding_nm)),
            (bound("cell.residual_mask_nm", 0.0, 1e4), one(c.residual_mask_nm)),
            (bound("path.gap_um", -1e5, 1e5), one(p.gap_um)),
            (bound("path.tilt_mrad", -1000.0, 1000.0), p.tilt_mrad.to_vec()),
            (bound("path.source_per_m", -1e4, 1e4), one(p.source_per_m)),
            (bound("light.led_shift_nm", -500.0, 500.0), l.led_shift_nm.clone()),
            (bound("camera.pixel_blur_um", 0.0, 1e3), one(k.pixel_blur_um)),
            (bound("camera.stray_light", 0.0, 1.0), one(k.stray_light)),
        ];
        let mut faults: Vec<String> = checked
            .iter()
            .flat_map(|(bound, values)| values.iter().map(move |v| (bound, *v)))
            .filter(|(bound, v)| !(bound.range.0..=bound.range.1).contains(v))
            .map(|(b, v)| format!("`{}` is {v}, not within {} to {}", b.name, b.range.0, b.range.1))
            .collect();
        for (name, v) in [("light.led_width", l.led_width), ("light.source_size", l.source_size)] {
            if !(-1.0..=100.0).contains(&v) {
                faults.push(format!("`{name}` is {v}, not within -1 to 100"));
            }
        }
        if g.wavefront_nm.len() > MOST_TERMS || g.transmission.len() > MOST_TERMS {
            faults.push(format!(
                "`geometry.wavefront_nm` and `geometry.transmission` have at most {MOST_TERMS} terms"
            ));
        }
        let [narrow, wide] = g.transmission_range_nm;
        if !g.transmission.is_empty() && wide - narrow < 1.0 {
            faults.push("`geometry.transmission` has no `transmission_range_nm = [narrowest, widest]`".into());
        }
        faults
    }
}

/// Most polynomials of a free term: the radial order of Zernike's is then below 8.
const MOST_TERMS: usize = 36;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_that_cannot_be_is_named() {
        assert_eq!(Perturbation::default().faults(), Vec::<String>::new());
        let mut bad = Perturbation::default();
        bad.geometry.cd_bias_nm = f64::NAN;
        bad.geometry.transmission = vec![0.1];
        bad.path.tilt_mrad[1] = 1e9;
        bad.light.source_size = -3.0;
        let faults = bad.faults();
        for name in ["cd_bias_nm", "transmission_range_nm", "tilt_mrad", "source_size"] {
            assert!(faults.iter().any(|f| f.contains(name)), "{name} is not in {faults:?}");
        }
        assert_eq!(faults.len(), 4);
    }

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
