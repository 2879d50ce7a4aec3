//! Samples of the light: how it is propagated, on which grid, and why.

use metalith_core::{Error, Result};

use super::set::StackSet;

/// Most samples across the light that are simulated.
const MOST_SAMPLES: usize = 2048;

/// Fewest samples across the light: the rim of a round opening is cut roughly by fewer.
const FEWEST_SAMPLES: usize = 96;

/// Most points along a pixel.
const MOST_FINE: usize = 8;

/// Window that a Fourier sum repeats after, over the window of the sensor: what an average over samples takes off the rim of the
/// window is then below 7 % of the amplitude.
const PERIOD: f64 = 2.5;

/// Largest half angle of the light (rad): propagation is paraxial.
const LARGEST_ANGLE: f64 = 0.3;

/// Share by which the opening may grow beyond its stated size.
const GROWTH: f64 = 1.08;

/// Samples of a finer grid, over those of a grid.
pub(super) const FINER: f64 = 1.4;

/// Pixels around the window, so that a displaced pattern is there.
const MARGIN: usize = 6;

/// How light goes to the sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Method {
    /// One Fourier sum over the opening, with the quadratic phase of the distance.
    FourierSum,
    /// Product of the spectrum of the light with the transfer function of the distance.
    AngularSpectrum,
}

/// The grid of a set.
#[derive(Clone, Debug)]
pub(crate) struct Sampling {
    pub method: Method,
    /// Samples across the light, and their distance (um).
    pub n: usize,
    pub dx_um: f64,
    /// Points along a pixel of the sensor.
    pub fine: usize,
    /// Pixels along each axis, with their margin.
    pub padded: [usize; 2],
    /// True if masks pass evenly from sample to sample, and not in steps.
    pub smooth_masks: bool,
    pub aperture_um: f64,
    pub middle_um: f64,
    /// Defocus whose path differs by an eighth of a wave at the rim (um).
    pub depth_of_focus_um: f64,
    /// Wavelength over the angle of the opening at the sensor (um).
    pub spot_um: f64,
    /// The choice and its reason, in words.
    pub reason: String,
}

/// Smallest size not below `n` of the same parity that Fourier transforms like.
pub(super) fn fft_size(n: usize) -> usize {
    let smooth = |mut k: usize| {
        for p in [2, 3, 5] {
            while k.is_multiple_of(p) {
                k /= p;
            }
        }
        k == 1
    };
    (n..)
        .step_by(2)
        .find(|k| smooth(*k) || k % 2 == 1 && k % 3 == 0)
        .unwrap_or(n)
}

impl Sampling {
    /// The grid of a set.
    ///
    /// # Errors
    /// If no way of propagation samples the geometry.
    pub(super) fn new(set: &StackSet) -> Result<Self> {
        let b = &set.bench;
        let (rows, cols) = set.planes[0].frame.dim();
        let padded = [rows, cols].map(|n| fft_size(n + 2 * MARGIN));
        let window_um = padded[0].max(padded[1]) as f64 * b.pixel_um;
        let at_lens = b.lens.is_some_and(|l| l.distance_um > 0.0);
        let light_um = b.lens.filter(|_| at_lens).map_or(b.aperture_um, |l| l.diameter_um);
        let least_um = b.wavelengths.iter().map(|w| w[0]).fold(f64::MAX, f64::min);
        let middle_um: f64 = b.wavelengths.iter().map(|[um, w]| um * w).sum();
        let refused = |what: String, hint: &str| Err(Error::refused("stacks/not-sampled", what, hint));
        let distances: Vec<f64> = set.planes.iter().map(|p| b.sensor_um + p.position_um).collect();
        let nearest = distances.iter().copied().fold(f64::MAX, f64::min);
        let farthest = distances.iter().copied().fold(f64::MIN, f64::max);
        if nearest <= 0.0 {
            let what = format!("a plane is {nearest} um from the object or lens");
            return refused(
                what,
                "positions count from the distance of [sensor], larger farther from the lens",
            );
        }
        let angle = 0.5 * light_um / nearest;
        if angle > LARGEST_ANGLE {
            let what =
                format!("light comes to the sensor at up to {angle:.2} rad, {LARGEST_ANGLE} is simulated (paraxial)");
            return refused(what, "check diameters and distances, and their units");
        }
        let source = b.source_um.map_or(0.0, |s| 1.0 / s);
        let power = b.lens.map_or(0.0, |l| 1.0 / l.focal_um);
        let curvature = |z: f64| 1.0 / z + source - power;
        let sum_dx = distances
            .iter()
            .map(|&z| least_um * z / (PERIOD * window_um + light_um * curvature(z).abs() * z));
        let sum_dx = sum_dx.fold(f64::MAX, f64::min);
        let mut n = (GROWTH * light_um / sum_dx).ceil() as usize;
        let mut dx_um = sum_dx;
        if at_lens {
            // The light between object and lens is on the same grid, without coming round.
            let between = b.lens.map_or(0.0, |l| l.distance_um);
            n = n.max(((b.aperture_um + light_um + least_um * between / dx_um) / dx_um).ceil() as usize);
        }
        let sum_n = n;
        let mut method = Method::FourierSum;
        if n > MOST_SAMPLES && !at_lens {
            let pitches = set
                .objects
                .iter()
                .filter_map(|o| Some(o.transmission.as_ref()?.sample_um));
            dx_um = pitches.fold(b.aperture_um / 256.0, f64::min);
            if power + source > 0.0 {
                dx_um = dx_um.min(0.5 * least_um / ((power - source).abs().max(1e-12) * light_um));
            }
            let whole = (GROWTH * light_um).max(window_um) + least_um.max(middle_um) * farthest / dx_um;
            n = (whole / dx_um).ceil() as usize;
            method = Method::AngularSpectrum;
        }
        if n > MOST_SAMPLES {
            let what = format!(
                "a Fourier sum needs {sum_n} samples across the light, the angular spectrum {n}; {MOST_SAMPLES} are simulated"
            );
            return refused(
                what,
                "cut the window (window_px), or check diameters, distances and pixels",
            );
        }
        let spot_um = middle_um * nearest / light_um;
        let fine = (2.0 * b.pixel_um / (least_um * nearest / light_um)).ceil().max(1.0) as usize;
        if fine > MOST_FINE {
            let what = format!(
                "a pixel of {} um is {:.1} spots wide (wavelength over angle {spot_um:.2} um)",
                b.pixel_um,
                b.pixel_um / spot_um
            );
            return refused(
                what,
                "a pixel up to 4 spots wide is simulated: use a smaller pixel, or bin less",
            );
        }
        n = fft_size(n.max(FEWEST_SAMPLES).next_multiple_of(2));
        if method == Method::FourierSum && !at_lens {
            dx_um = GROWTH * light_um / n as f64;
        }
        let middle = 0.5 * (nearest + farthest);
        let mut out = Self {
            method,
            n,
            dx_um,
            fine,
            padded,
            smooth_masks: false,
            aperture_um: b.aperture_um,
            middle_um,
            depth_of_focus_um: middle_um * (middle / light_um).powi(2),
            spot_um,
            reason: String::new(),
        };
        let steepest = distances.iter().map(|&z| curvature(z).abs()).fold(0.0, f64::max);
        out.reason = out.words(light_um, steepest);
        Ok(out)
    }

    /// A finer grid of the same light; none if it is larger than what is simulated.
    pub(super) fn finer(&self) -> Option<Self> {
        let n = fft_size(((self.n as f64 * FINER) as usize).next_multiple_of(2));
        let finer = Self {
            n,
            dx_um: self.dx_um * self.n as f64 / n as f64,
            ..self.clone()
        };
        // The angular spectrum would come round.
        (n <= MOST_SAMPLES && self.method == Method::FourierSum).then_some(finer)
    }

    fn words(&self, light_um: f64, steepest: f64) -> String {
        // Path at the rim of the opening that the distance adds to a flat wave.
        let waves = steepest * light_um * light_um / 8.0 / self.middle_um;
        let grid = format!(
            "{} samples of {:.3} um across the light, {} points along a pixel",
            self.n, self.dx_um, self.fine
        );
        match self.method {
            Method::AngularSpectrum => format!(
                "propagation: Fresnel by the angular spectrum, because the quadratic path of {waves:.0} waves at the rim needs too many samples in one Fourier sum; {grid}"
            ),
            Method::FourierSum if waves < 1.0 / 16.0 => format!(
                "propagation: Fraunhofer, because the quadratic path at the rim is {waves:.3} waves, below 1/16, in all planes; {grid}"
            ),
            Method::FourierSum => format!(
                "propagation: Fresnel by one Fourier sum, because the quadratic path at the rim is up to {waves:.2} waves; {grid}"
            ),
        }
    }
}
