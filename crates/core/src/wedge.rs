//! The wedge that steers an element, and where the element looks by it.

use std::f64::consts::FRAC_PI_2;

use serde::Serialize;

/// A linear phase over an element: Eq. 3 of Chakravarthula et al. 2023.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Wedge {
    /// Wavelength lambda_w at which it steers by its angles (um).
    pub wavelength_um: f64,
    /// Sine of the steering angle along x and y.
    pub sin_x: f64,
    pub sin_y: f64,
}

impl Wedge {
    /// Direction sines of the light that this wedge brings to the axis: the middle of the element's field.
    pub fn looks_at(&self, wavelength_um: f64) -> (f64, f64) {
        let dispersion = -wavelength_um / self.wavelength_um;
        (self.sin_x * dispersion, self.sin_y * dispersion)
    }

    /// Direction sines along x and y of light from `field_rad`, angles in the x-z and y-z plane counted from where the
    /// element looks at this wavelength (um). None if light from there does not arrive at the chip.
    pub fn arriving(&self, wavelength_um: f64, field_rad: [f64; 2]) -> Option<[f64; 2]> {
        let (x, y) = self.looks_at(wavelength_um);
        let sines = [turned_sine(x, field_rad[0])?, turned_sine(y, field_rad[1])?];
        (sines[0].hypot(sines[1]) < 1.0).then_some(sines)
    }
}

/// Sine of an angle of incidence that is larger by `by_rad` than that of `sine`. None from a right angle on: no light arrives
/// from there, and the sine would be that of a smaller angle.
pub fn turned_sine(sine: f64, by_rad: f64) -> Option<f64> {
    let angle = sine.asin() + by_rad;
    (angle.abs() < FRAC_PI_2).then(|| angle.sin())
}

/// Numerical aperture in air of a lens of this radius whose focus is at this distance on its axis (the same unit).
pub fn numerical_aperture(radius: f64, distance: f64) -> f64 {
    radius / radius.hypot(distance)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_light_arrives_from_beyond_a_right_angle() {
        /// Rounding of a sine.
        const ROUNDING: f64 = 1e-15;
        let wedge = Wedge {
            wavelength_um: 0.55,
            sin_x: 15.0_f64.to_radians().sin(),
            sin_y: 0.0,
        };
        // It looks at -15 degrees.
        for (field_deg, arrives) in [(-80.0, false), (-74.0, true), (0.0, true), (89.0, true), (106.0, false)] {
            let found = wedge.arriving(0.55, [f64::to_radians(field_deg), 0.0]);
            assert_eq!(found.is_some(), arrives, "{field_deg}");
            if let Some([x, y]) = found {
                assert!((x - f64::to_radians(field_deg - 15.0).sin()).abs() < ROUNDING && y == 0.0);
            }
        }
        // Along both axes at once, each of them less than a right angle; and a wedge that bends light by more than one.
        assert!(wedge.arriving(0.55, [-0.7, 0.9]).is_none());
        assert!(wedge.arriving(2.2, [0.0; 2]).is_none());
        assert_eq!(turned_sine(0.5, 1.2), None);
    }
}
