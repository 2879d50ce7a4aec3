//! The light that arrives at an element, and where its chief ray goes.

use metalith_core::Wedge;

use crate::error::{Result, WaveError};

/// A plane wave of unit amplitude in the plane of the pillar tops: exp(i k (x sin_x + y sin_y)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneWave {
    /// Vacuum wavelength (um).
    pub wavelength_um: f64,
    /// Sine of the angle of incidence in the x-z plane, as seen in air.
    pub sin_x: f64,
    /// Sine of the angle of incidence in the y-z plane, as seen in air.
    pub sin_y: f64,
}

impl PlaneWave {
    /// Along the normal of the chip.
    pub fn normal(wavelength_um: f64) -> Self {
        Self {
            wavelength_um,
            sin_x: 0.0,
            sin_y: 0.0,
        }
    }

    /// Wave from the middle of the field of an element with this wedge.
    pub fn looked_at(wedge: &Wedge, wavelength_um: f64) -> Self {
        let (sin_x, sin_y) = wedge.looks_at(wavelength_um);
        Self {
            wavelength_um,
            sin_x,
            sin_y,
        }
    }

    /// Phase at a place of the aperture (turns).
    pub fn turns(&self, x_um: f64, y_um: f64) -> f64 {
        (x_um * self.sin_x + y_um * self.sin_y) / self.wavelength_um
    }
}

/// The wave that arrives at an element from `field_rad`, angles in the x-z and y-z plane counted from where
/// the element looks at this wavelength.
///
/// # Errors
/// If there is no such direction: the wedge or the field is too steep.
pub fn incident(wedge: &Wedge, wavelength_um: f64, field_rad: [f64; 2]) -> Result<PlaneWave> {
    match wedge.arriving(wavelength_um, field_rad) {
        Some([sin_x, sin_y]) => Ok(PlaneWave {
            wavelength_um,
            sin_x,
            sin_y,
        }),
        None => Err(WaveError::Incidence {
            field_rad,
            looks_at: wedge.looks_at(wavelength_um).into(),
        }),
    }
}

/// Direction sines behind the element of the light it is designed to pass: those of the wave, and what its wedge
/// adds at this wavelength.
pub fn leaving(wedge: &Wedge, wave: &PlaneWave) -> [f64; 2] {
    let (x, y) = wedge.looks_at(wave.wavelength_um);
    [wave.sin_x - x, wave.sin_y - y]
}

/// Place where the chief ray lands on a plane behind the element, from the element's centre (um).
///
/// # Errors
/// If it does not: its direction sines reach one.
pub fn landing_um(wedge: &Wedge, wave: &PlaneWave, distance_um: f64) -> Result<[f64; 2]> {
    let [x, y] = leaving(wedge, wave);
    let cosine2 = 1.0 - x * x - y * y;
    if cosine2 > 0.0 {
        return Ok([x, y].map(|s| distance_um * s / cosine2.sqrt()));
    }
    Err(WaveError::MissesSensor { sines: [x, y] })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding of sines, and of places millimetres away (um).
    const ROUNDING: f64 = 1e-15;
    const ROUNDING_UM: f64 = 1e-9;

    fn wedge() -> Wedge {
        Wedge {
            wavelength_um: 0.55,
            sin_x: 15.0_f64.to_radians().sin(),
            sin_y: 0.0,
        }
    }

    #[test]
    fn light_from_where_an_element_looks_lands_on_its_axis() {
        for l in [0.45, 0.55, 0.66] {
            let wave = incident(&wedge(), l, [0.0, 0.0]).unwrap();
            assert!(landing_um(&wedge(), &wave, 2400.0).unwrap()[0].abs() < ROUNDING_UM);
        }
        let matched = incident(&wedge(), 0.55, [0.1, -0.05]).unwrap();
        assert!((matched.sin_x - (0.1 - 15.0_f64.to_radians()).sin()).abs() < ROUNDING);
        assert!((matched.sin_y + 0.05_f64.sin()).abs() < ROUNDING);
    }

    #[test]
    fn light_along_the_normal_is_steered_to_where_the_reference_field_has_it() {
        // The reference counts from the lattice site next to the chief ray.
        const PITCH: f64 = 0.35;
        for (l, x) in [(0.452, 522.55), (0.55, 642.95), (0.66, 784.35)] {
            let landing = landing_um(&wedge(), &PlaneWave::normal(l), 2400.0).unwrap();
            assert!((landing[0] - x).abs() < PITCH);
        }
        let steep = PlaneWave {
            sin_x: 0.9,
            ..PlaneWave::normal(0.55)
        };
        assert!(landing_um(&wedge(), &steep, 2400.0).is_err());
        assert!(incident(&wedge(), 2.2, [0.0, 0.0]).is_err());
        // At -95 degrees; its sine is that of -85.
        let beyond = incident(&wedge(), 0.55, [-80.0_f64.to_radians(), 0.0]);
        assert!(matches!(beyond, Err(WaveError::Incidence { .. })), "{beyond:?}");
    }
}
