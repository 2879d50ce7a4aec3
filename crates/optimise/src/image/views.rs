//! Views that expected image errors are taken over: wavelengths, field angles, the window, the scene.

use crate::PixelWindow;
use crate::image::pupil::USED;
use crate::image::scene::Scene;
use crate::merit::focus::Lens;
use metalith_sensor::Noise;

/// Views that the merit is taken over.
#[derive(Clone, Debug, PartialEq)]
pub struct Views {
    /// Wavelengths (um), ascending.
    pub wavelengths_um: Vec<f64>,
    /// Field angles in the x-z plane (rad).
    pub angles_rad: Vec<f64>,
    /// Colour channels: the wavelengths are split evenly among them.
    pub channels: usize,
    /// The window, larger than the blur by a quarter at least.
    pub window: PixelWindow,
    /// Weight, 0 to 1, of the error if one filter must serve the blurs of all wavelengths of a channel, as in
    /// a camera it must (the regulariser of the paper); the rest is with a filter for each wavelength.
    pub shared_filter: f64,
    /// Wavelengths of each channel that a step of the optimiser draws.
    pub drawn: usize,
    /// Scene that is viewed.
    pub scene: Scene,
    /// Noise of the sensor.
    pub noise: Noise,
}

impl Default for Views {
    /// 400 to 700 nm every 10 nm; 0, 15 and 30 degrees; three channels; 160 pixels of 5.86 um.
    fn default() -> Self {
        Self {
            wavelengths_um: crate::wavelengths(400.0, 700.0, 10.0),
            angles_rad: [0.0f64, 15.0, 30.0].map(f64::to_radians).to_vec(),
            channels: 3,
            window: PixelWindow {
                pixels: 160,
                pixel_um: 5.86,
            },
            shared_filter: 0.5,
            drawn: 3,
            scene: Scene::default(),
            noise: Noise::default(),
        }
    }
}

/// Middle of the window from where the chief ray lands (um): half way between the rays from both edges of
/// the lens, if it is a perfect lens for light along its axis.
pub(crate) fn window_offset_um(lens: &Lens, angle_rad: f64, side_um: f64) -> f64 {
    let radius = 0.5e-3 * f64::from(lens.rings.diameter_nm());
    let landing = |x: f64| {
        let sine = (angle_rad.sin() - x / x.hypot(lens.distance_um)).clamp(-0.999, 0.999);
        x + lens.distance_um * sine / (1.0 - sine * sine).sqrt()
    };
    let middle = 0.5 * (landing(radius) + landing(-radius)) - lens.distance_um * angle_rad.tan();
    // No further than leaves the chief ray well within the window's part that is used.
    let most = 0.25 * USED * side_um;
    middle.clamp(-most, most)
}
