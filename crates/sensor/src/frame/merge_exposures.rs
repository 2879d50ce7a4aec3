//! Exposures of one measurement as one frame, with the noise of each pixel.

use std::sync::Arc;

use ndarray::Array2;

use super::{DarkPixels, SensorPixels, expected, saturated};
use crate::{ColourPixels, RelayCamera};

/// A mean frame of one exposure.
pub struct ExposedFrame {
    /// Values as recorded, black level included (DN).
    pub dn: Array2<f32>,
    /// DN for |E|^2 / |E_inc|^2 = 1.
    pub scale_dn: f64,
    /// Frames that it is the mean of.
    pub frames: u32,
    /// Variance that it was rounded with (DN^2).
    pub rounding_dn2: f64,
    /// The sensor without light for as long, where it is not that of all exposures. One frame of several exposures is one object.
    pub dark: Option<Arc<DarkPixels>>,
}

/// A measurement as it is used.
pub struct Joined {
    /// DN of the longest exposure, black level included.
    pub dn: Array2<f32>,
    /// Variance of each pixel (DN^2), infinite where it tells nothing; none where frames, gain and read noise say it.
    pub noise: Option<Array2<f32>>,
    /// Scale of the longest exposure (DN).
    pub scale_dn: f64,
    pub frames: u32,
}

/// Join exposures of one scene: the mean of what they say of the light, each weighted by one over its variance; an
/// exposure in which a pixel is saturated, or beside one that is, says nothing of it. Variances follow from a first mean of
/// all exposures, not from each by itself, which would favour those that came out too dark; of few electrons from that of the
/// neighbours. The noise of dark and flat frames
/// is common to exposures: it has no part in the weights, and is added to the variance of the mean. With `filter`, pixels
/// under other filters are masked.
///
/// # Panics
/// If there is no exposure.
pub fn joined(
    mut exposures: Vec<ExposedFrame>,
    sensor: Option<&SensorPixels>,
    camera: &RelayCamera,
    filter: Option<ColourPixels>,
) -> Joined {
    let longest = exposures.iter().max_by(|a, b| a.scale_dn.total_cmp(&b.scale_dn));
    let (scale_dn, frames) = longest.map(|e| (e.scale_dn, e.frames)).expect("at least one exposure");
    if let ([only], None, None) = (exposures.as_slice(), sensor, filter)
        && only.rounding_dn2 == 0.0
        && only.dark.is_none()
    {
        return Joined {
            dn: exposures.remove(0).dn,
            noise: None,
            scale_dn,
            frames,
        };
    }
    let black = camera.black_level_dn;
    let mut darks: Vec<Arc<DarkPixels>> = Vec::new();
    for own in exposures.iter().filter_map(|e| e.dark.as_ref()) {
        if !darks.iter().any(|d| Arc::ptr_eq(d, own)) {
            darks.push(Arc::clone(own));
        }
    }
    let even = SensorPixels::even(camera, exposures[0].dn.dim());
    let sensor = sensor.or((!darks.is_empty()).then_some(&even));
    let masks: Vec<Array2<bool>> = exposures
        .iter_mut()
        .map(|e| match sensor {
            Some(sensor) => sensor.take_out(&mut e.dn, filter, e.dark.as_deref()),
            None => saturated(&e.dn, camera.saturation_dn),
        })
        .collect();
    let mut dn = exposures[0].dn.clone();
    let usable = |at: (usize, usize)| {
        let told = exposures.iter().zip(&masks).filter(move |(_, full)| !full[at]);
        told.map(|(e, _)| e)
    };
    let signal = |e: &ExposedFrame, at| f64::from(e.dn[at]) - black;
    // Light of each pixel by all exposures, and the electrons that it rests on.
    let mut electrons = Array2::zeros(dn.dim());
    let first = Array2::from_shape_fn(dn.dim(), |at| {
        let (light, weight) = usable(at).fold((0.0, 0.0), |(light, weight), e| {
            let frames = f64::from(e.frames);
            (light + frames * signal(e, at), weight + frames * e.scale_dn)
        });
        if weight == 0.0 {
            return f32::INFINITY;
        }
        if filter.is_none_or(|pixels| pixels.has(at)) {
            let own = usable(at).map(|e| camera.electrons(signal(e, at), e.frames));
            electrons[at] = own.sum::<f64>() as f32;
        }
        (light / weight) as f32
    });
    let first = expected(&first, &electrons);
    let mut noise = Array2::from_elem(dn.dim(), f32::INFINITY);
    // Of the dark frame of all exposures, of the flat frame, and of the dark frames that are of some.
    let mut shared = vec![0.0; 2 + darks.len()];
    for (at, to) in dn.indexed_iter_mut() {
        if usable(at).next().is_none() {
            // All that is known is that there is much of it.
            *to = (black
                + scale_dn / exposures.iter().map(|e| e.scale_dn).fold(f64::MAX, f64::min) * camera.saturation_dn)
                as f32;
            continue;
        }
        let first = f64::from(first[at]);
        let (mut sum, mut certainty) = (0.0, 0.0);
        shared.fill(0.0);
        for e in usable(at) {
            let (expected, dark) = (first * e.scale_dn, e.dark.as_deref());
            let variance = sensor.map_or_else(
                || camera.variance_dn2(expected, e.frames) + e.rounding_dn2,
                |s| s.own_variance_dn2(at, expected, (e.frames, e.rounding_dn2), dark),
            );
            let own = e.scale_dn * e.scale_dn / variance;
            sum += own * signal(e, at) / e.scale_dn;
            certainty += own;
            let errors = sensor.map_or([0.0; 3], |s| s.shared_errors_dn(at, expected, dark));
            let place = e
                .dark
                .as_ref()
                .and_then(|own| darks.iter().position(|d| Arc::ptr_eq(d, own)));
            for (k, error) in [Some(0), Some(1), place.map(|k| 2 + k)].into_iter().zip(errors) {
                if let Some(k) = k {
                    shared[k] += own * error / e.scale_dn;
                }
            }
        }
        *to = (black + scale_dn * sum / certainty) as f32;
        let of_sensor: f64 = shared.iter().map(|error| (error / certainty).powi(2)).sum();
        noise[at] = (scale_dn * scale_dn * (1.0 / certainty + of_sensor)) as f32;
    }
    if let Some(pixels) = filter {
        dn = pixels.filled(&dn);
        for (at, v) in noise.indexed_iter_mut() {
            if !pixels.has(at) {
                *v = f32::INFINITY;
            }
        }
    }
    Joined {
        dn,
        noise: Some(noise),
        scale_dn,
        frames,
    }
}

#[cfg(test)]
mod tests {
    use super::super::SensorFrame;
    use super::super::sensor::tests::camera;
    use super::*;
    use crate::{Colour, ColourFilter};

    fn exposure(scale_dn: f64, frames: u32, values: [f32; 6]) -> ExposedFrame {
        ExposedFrame {
            dn: Array2::from_shape_vec((2, 3), values.to_vec()).unwrap(),
            scale_dn,
            frames,
            rounding_dn2: 0.0,
            dark: None,
        }
    }

    /// A mean that was rounded to whole numbers scatters by that too.
    #[test]
    fn rounding_is_noise() {
        let mut rounded = exposure(1.0, 100, [140.0; 6]);
        rounded.rounding_dn2 = 1.0 / 12.0;
        let joined = joined(vec![rounded], None, &camera(), None);
        // 100 e in 100 frames, read noise of 1 DN in as many, single precision.
        let want = 1.0 + 0.01 + 1.0 / 12.0;
        assert!(
            joined
                .noise
                .unwrap()
                .iter()
                .all(|v| (f64::from(*v) - want).abs() < 1e-6)
        );
    }

    /// Two exposures of unlike length: what is saturated in the long one comes from the short one, the rest from both,
    /// with the variance of a mean that is weighted by certainty.
    #[test]
    fn exposures_are_joined_with_their_noise() {
        // Single precision.
        const ROUNDING: f64 = 1e-5;
        let mut camera = camera();
        (camera.saturation_dn, camera.gain_e_per_dn, camera.read_noise_dn) = (1000.0, 2.0, 3.0);
        let long = exposure(100.0, 4, [1000.0, 440.0, 340.0, 240.0, 140.0, 40.0]);
        let short = exposure(10.0, 16, [540.0, 80.0, 70.0, 60.0, 50.0, 40.0]);
        let joined = joined(vec![short, long], None, &camera, None);
        assert_eq!((joined.scale_dn, joined.frames), (100.0, 4));
        let noise = joined.noise.unwrap();
        // Pixels beside the saturated one are the short exposure's alone: 40 DN over black in 16 frames, times ten.
        assert!((f64::from(joined.dn[(0, 0)]) - 5040.0).abs() < 5040.0 * ROUNDING);
        assert!((f64::from(joined.dn[(0, 1)]) - 440.0).abs() < 440.0 * ROUNDING);
        let alone = (40.0 / 2.0 + 9.0) / 16.0 * 100.0;
        assert!(
            (f64::from(noise[(0, 1)]) / alone - 1.0).abs() < ROUNDING,
            "{}",
            noise[(0, 1)]
        );
        // The far pixel has both: 300 DN in 4 frames, 30 DN in 16.
        let (a, b) = ((300.0 / 2.0 + 9.0) / 4.0, (30.0 / 2.0 + 9.0) / 16.0 * 100.0);
        let both = 1.0 / (1.0 / a + 1.0 / b);
        assert!(
            (f64::from(noise[(0, 2)]) / both - 1.0).abs() < ROUNDING,
            "{}",
            noise[(0, 2)]
        );
        assert!((f64::from(joined.dn[(0, 2)]) - 340.0).abs() < 340.0 * ROUNDING);
    }

    /// A long exposure with dark current and a short one with next to none, each with its own dark frame; and one dark frame of both,
    /// whose error they share.
    #[test]
    fn each_exposure_has_its_own_dark_current_taken_out() {
        // Single precision.
        const ROUNDING: f64 = 1e-5;
        let camera = camera();
        let dark = |dn: f32| {
            let frame = SensorFrame {
                dn: Array2::from_elem((2, 3), dn),
                frames: 25,
                rounding_dn2: 0.0,
            };
            Some(Arc::new(DarkPixels::new(&frame, &camera)))
        };
        let exposures = |long_dark, short_dark| {
            let mut long = exposure(10.0, 4, [440.0; 6]);
            let mut short = exposure(1.0, 4, [70.0; 6]);
            (long.dark, short.dark) = (long_dark, short_dark);
            joined(vec![long, short], None, &camera, None)
        };
        // 300 DN of light over 100 of dark current; 30 over none.
        let own = exposures(dark(140.0), dark(40.0));
        assert!(
            own.dn.iter().all(|v| (f64::from(*v) - 340.0).abs() < 340.0 * ROUNDING),
            "{}",
            own.dn
        );
        let weights = [100.0 / (401.0 / 4.0), 1.0 / (31.0 / 4.0)];
        let certainty = weights[0] + weights[1];
        // Of light, by the dark frames of 25 frames each.
        let of_dark = [
            weights[0] / 10.0 * (101.0f64 / 25.0).sqrt(),
            weights[1] * (1.0f64 / 25.0).sqrt(),
        ];
        let light = 1.0 / certainty + (of_dark[0] / certainty).powi(2) + (of_dark[1] / certainty).powi(2);
        let noise = f64::from(own.noise.unwrap()[(0, 0)]);
        assert!(
            (noise / (100.0 * light) - 1.0).abs() < ROUNDING,
            "{noise} {}",
            100.0 * light
        );
        // One frame for both: its error adds up before it is squared.
        let both = dark(40.0);
        let shared = exposures(both.clone(), both).noise.unwrap()[(0, 0)];
        let apart = exposures(dark(40.0), dark(40.0)).noise.unwrap()[(0, 0)];
        assert!(
            f64::from(shared) > f64::from(apart) * (1.0 + ROUNDING),
            "{shared} {apart}"
        );
    }

    #[test]
    fn pixels_under_other_filters_are_masked() {
        let filter = ColourFilter::Rggb.pixels_of(Some(Colour::Green));
        let frame = exposure(1.0, 1, [900.0, 50.0, 900.0, 60.0, 900.0, 70.0]);
        let joined = joined(vec![frame], None, &camera(), filter);
        let noise = joined.noise.unwrap();
        let counts: Vec<bool> = noise.iter().map(|v| v.is_finite()).collect();
        assert_eq!(counts, [false, true, false, true, false, true]);
        // Between two greens.
        assert_eq!(joined.dn[(0, 0)], 55.0);
        assert_eq!(joined.dn[(0, 1)], 50.0);
    }
}
