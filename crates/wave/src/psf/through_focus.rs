//! PSFs in planes along z, and the focal length that they show.

use metalith_core::numerical_aperture;
use serde::Serialize;

use super::{FocusMetrics, IdealPsf, Psf};
use crate::error::Result;
use crate::propagation::{Aperture, FoldedPropagator, PlaneWave, Scratch};

/// Planes of a through-focus series where no number is asked for: each half a depth of focus from the next.
pub const FOCUS_PLANES: usize = 9;

/// Range on each side of the sensor where none is asked for, in depths of focus: the first zeros on the axis of an ideal lens.
const FOCUS_RANGE: f64 = 2.0;

/// Most of the distance to the sensor that the usual range takes on each side.
const MOST_OF_DISTANCE: f64 = 0.5;

/// Least Strehl ratio of a focus: without one, small lenses have interference of up to 0.03 somewhere in a window, and a focus that is
/// so weak sends most of its light elsewhere.
pub const LEAST_STREHL: f64 = 0.1;

/// Depth of focus of an ideal lens of this radius at this distance (um): the wavelength over the square of the numerical
/// aperture. Half of it off focus the peak is 81 % of the peak in focus.
pub fn depth_of_focus_um(wavelength_um: f64, radius_um: f64, distance_um: f64) -> f64 {
    let aperture = numerical_aperture(radius_um, distance_um);
    wavelength_um / (aperture * aperture)
}

/// Planes of a through-focus series about the plane of the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FocusPlanes {
    /// Distance of the first and of the last plane from the sensor (um).
    pub range_um: f64,
    pub planes: usize,
}

impl FocusPlanes {
    /// The usual planes: [`FOCUS_PLANES`] from two depths of focus before the sensor to two behind it, but at most from half of
    /// its distance.
    pub fn usual(wavelength_um: f64, radius_um: f64, distance_um: f64) -> Self {
        let depth_um = depth_of_focus_um(wavelength_um, radius_um, distance_um);
        Self {
            range_um: (FOCUS_RANGE * depth_um).min(MOST_OF_DISTANCE * distance_um),
            planes: FOCUS_PLANES,
        }
    }

    /// Distance of neighbouring planes (um).
    pub fn spacing_um(&self) -> f64 {
        2.0 * self.range_um / (self.planes.max(2) - 1) as f64
    }

    /// Distances of the planes from the pillar tops (um), about the distance of the sensor.
    pub fn distances_um(&self, sensor_um: f64) -> Vec<f64> {
        let middle = 0.5 * (self.planes.max(2) - 1) as f64;
        (0..self.planes.max(2))
            .map(|i| sensor_um + (i as f64 - middle) * self.spacing_um())
            .collect()
    }
}

/// Metrics of the PSF in one plane.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FocusPlane {
    /// Distance of the plane from the pillar tops (um).
    pub distance_um: f64,
    /// Largest sample, |E|^2 over |E|^2 of the incident wave.
    pub peak: f64,
    #[serde(flatten)]
    pub focus: FocusMetrics,
}

/// A through-focus series: metrics of PSFs in planes along z.
#[derive(Clone, Debug, Serialize)]
pub struct ThroughFocus {
    pub wavelength_um: f64,
    /// Wavelength over the square of the numerical aperture (um).
    pub depth_of_focus_um: f64,
    /// Distance of the sensor from the pillar tops (um): the focal length of the design.
    pub sensor_um: f64,
    /// Distance of neighbouring planes (um).
    pub plane_spacing_um: f64,
    /// Focal length found through focus (um): the distance at which the Strehl ratio is greatest, by a parabola through the
    /// greatest and its neighbours. It lies within half a spacing of the plane of the greatest. None if that is the first or the
    /// last plane, or if the Strehl ratio there is below [`LEAST_STREHL`].
    pub focal_length_um: Option<f64>,
    pub planes: Vec<FocusPlane>,
    /// PSFs in the planes.
    #[serde(skip)]
    pub psfs: Vec<Psf>,
}

impl ThroughFocus {
    /// Series of PSFs in planes at equal spacings, nearest first. All Strehl ratios are against the ideal PSF in the plane of the
    /// sensor, so that they are proportional to the peaks. Focusing efficiencies of all planes are in one circle: three widths of the
    /// PSF with the greatest peak. `radius_um`: of the lens.
    pub fn of(psfs: Vec<Psf>, matched: &IdealPsf, wavelength_um: f64, [radius_um, sensor_um]: [f64; 2]) -> Self {
        let in_focus = psfs.iter().max_by(|a, b| a.peak().0.total_cmp(&b.peak().0));
        let in_focus_um = in_focus.map_or([None; 2], Psf::fwhm_um);
        let plane = |psf: &Psf| FocusPlane {
            distance_um: psf.window.distance_um,
            peak: psf.peak().0,
            focus: psf.focus_in(in_focus_um, matched),
        };
        let planes: Vec<FocusPlane> = psfs.iter().map(plane).collect();
        let spacing_um = match planes.as_slice() {
            [first, second, ..] => second.distance_um - first.distance_um,
            _ => 0.0,
        };
        Self {
            wavelength_um,
            depth_of_focus_um: depth_of_focus_um(wavelength_um, radius_um, sensor_um),
            sensor_um,
            plane_spacing_um: spacing_um,
            focal_length_um: greatest(&planes, spacing_um).filter(|_| greatest_strehl(&planes) >= LEAST_STREHL),
            planes,
            psfs,
        }
    }

    /// Length of so many wavelengths over the numerical aperture (um).
    pub fn shown_um(&self, widths: f64) -> f64 {
        widths * (self.wavelength_um * self.depth_of_focus_um).sqrt()
    }

    /// The greatest Strehl ratio of the planes.
    pub fn greatest_strehl(&self) -> f64 {
        greatest_strehl(&self.planes)
    }

    /// Distances of the first and of the last plane (um).
    pub fn ends_um(&self) -> [f64; 2] {
        let ends = [self.planes.first(), self.planes.last()];
        ends.map(|plane| plane.map_or(f64::NAN, |plane| plane.distance_um))
    }
}

/// The greatest Strehl ratio of some planes.
fn greatest_strehl(planes: &[FocusPlane]) -> f64 {
    planes.iter().map(|plane| plane.focus.strehl).fold(0.0, f64::max)
}

/// The place of the greatest peak by a parabola through it and its neighbours (um).
fn greatest(planes: &[FocusPlane], spacing_um: f64) -> Option<f64> {
    let (at, _) = planes.iter().enumerate().max_by(|a, b| a.1.peak.total_cmp(&b.1.peak))?;
    let around = planes.get(at.checked_sub(1)?..at + 2)?;
    let [before, most, after] = [0, 1, 2].map(|i| around[i].peak);
    let bend = before - 2.0 * most + after;
    // Three equal peaks have no bend; their middle is the place.
    let off = if bend < 0.0 { 0.5 * (before - after) / bend } else { 0.0 };
    Some(planes[at].distance_um + off * spacing_um)
}

impl Psf {
    /// PSFs of an element in a unit wave in planes along z; see [`FoldedPropagator::fields_at`].
    ///
    /// # Errors
    /// As [`FoldedPropagator::fields_at`].
    pub fn formed_at(
        propagator: &FoldedPropagator,
        aperture: &dyn Aperture,
        wave: &PlaneWave,
        distances_um: &[f64],
        scratch: &mut Scratch,
    ) -> Result<Vec<Self>> {
        let fields = propagator.fields_at(aperture, wave, distances_um, scratch)?;
        Ok(fields.iter().map(Self::of).collect())
    }
}

#[cfg(test)]
mod tests {
    use metalith_pillars::Lattice;

    use super::*;
    use crate::{Accuracy, PhaseFunction, Window};

    const WAVELENGTH_UM: f64 = 0.55;
    const RADIUS_UM: f64 = 60.0;
    const SENSOR_UM: f64 = 160.0;

    /// Series of an ideal lens of this focal length about the sensor.
    fn series(focal_length_um: f64, planes: FocusPlanes) -> ThroughFocus {
        let lattice = Lattice::new(600, 201).unwrap();
        let lens = PhaseFunction {
            lattice,
            radius_um: RADIUS_UM,
            amplitude: 1.0,
            phase_rad: move |x: f64, y: f64| {
                let k = std::f64::consts::TAU / WAVELENGTH_UM;
                -k * ((x * x + y * y + focal_length_um * focal_length_um).sqrt() - focal_length_um)
            },
        };
        let wave = PlaneWave {
            wavelength_um: WAVELENGTH_UM,
            sin_x: 0.0,
            sin_y: 0.0,
        };
        let window = Window::about([0.0; 2], 0.3, 48, SENSOR_UM);
        let fold = FoldedPropagator::plan(lattice, RADIUS_UM, WAVELENGTH_UM, window, Accuracy::Accurate).unwrap();
        let distances = planes.distances_um(SENSOR_UM);
        let psfs = Psf::formed_at(&fold, &lens, &wave, &distances, &mut Scratch::default()).unwrap();
        if focal_length_um == SENSOR_UM {
            // The plane of the sensor has the PSF that is formed alone.
            let alone = Psf::formed(&fold, &lens, &wave, &[], &mut Scratch::default()).unwrap();
            assert_eq!(psfs[distances.len() / 2].values, alone.values);
        }
        let ideal = IdealPsf::of(&lens, [0.0, 0.0, SENSOR_UM], WAVELENGTH_UM, 1.0);
        ThroughFocus::of(psfs, &ideal, WAVELENGTH_UM, [RADIUS_UM, SENSOR_UM])
    }

    /// On the axis of an ideal lens at the distance z: (f / z)^2 sin^2(x) / x^2, with x half the phase of the rim against the
    /// axis, so sinc^2(dz / (2 depths of focus)) for small apertures and many Fresnel zones (Li and Wolf, Opt. Commun. 39, 211
    /// (1981)). The numerical aperture of 0.35, at which the phase is no parabola over the aperture, makes the rest.
    #[test]
    fn an_ideal_lens_follows_the_closed_form() {
        const TOLERANCE: f64 = 0.02;
        let found = series(SENSOR_UM, FocusPlanes::usual(WAVELENGTH_UM, RADIUS_UM, SENSOR_UM));
        assert_eq!(found.planes.len(), FOCUS_PLANES);
        let rim_um = |z: f64| RADIUS_UM.hypot(z) - z;
        for plane in &found.planes {
            let ratio = SENSOR_UM / plane.distance_um;
            let x = std::f64::consts::PI / WAVELENGTH_UM * (rim_um(plane.distance_um) - rim_um(SENSOR_UM));
            let on_axis = ratio * ratio * if x == 0.0 { 1.0 } else { (x.sin() / x).powi(2) };
            // Near the zeros of the axis the brightest place is a ring.
            if x.abs() < 2.0 {
                assert!((plane.focus.strehl - on_axis).abs() < TOLERANCE, "{plane:?} {on_axis}");
            }
        }
        assert!((found.planes[4].focus.strehl - 1.0).abs() < 1e-4);
    }

    /// Share of the spacing of planes by which the focal length may be off: the parabola, where the peak lies between planes, and
    /// the shift of the peak towards a lens of 41 Fresnel zones.
    const OF_SPACING: f64 = 0.12;

    #[test]
    fn the_focal_length_of_an_ideal_lens_with_defocus_is_found() {
        let planes = FocusPlanes::usual(WAVELENGTH_UM, RADIUS_UM, SENSOR_UM);
        for defocus_um in [1.2, -3.0] {
            let found = series(SENSOR_UM + defocus_um, planes);
            let off = found.focal_length_um.unwrap() - (SENSOR_UM + defocus_um);
            assert!(off.abs() < OF_SPACING * planes.spacing_um(), "{defocus_um}: {off}");
        }
        // Beyond the last plane no maximum is seen.
        let found = series(SENSOR_UM + 1.5 * planes.range_um, planes);
        assert_eq!(found.focal_length_um, None);
    }

    #[test]
    fn planes_are_about_the_sensor() {
        let planes = FocusPlanes {
            range_um: 6.0,
            planes: 4,
        };
        assert_eq!(planes.distances_um(100.0), [94.0, 98.0, 102.0, 106.0]);
        // A lens with few Fresnel zones has a focus as deep as its distance.
        let usual = FocusPlanes::usual(0.5, 5.0, 400.0);
        assert_eq!(usual.range_um, 200.0);
    }
}
