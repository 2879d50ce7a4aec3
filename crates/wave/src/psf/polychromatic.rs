//! The point spread function of a band of wavelengths that arrive from one direction.
//!
//! A wedge is a grating: it sends each wavelength to another place. The PSF about its own chief ray changes slowly
//! with wavelength, while the chief ray moves fast. So the PSF is computed at a few wavelengths, each about its own
//! chief ray; between two of them it is the mean of both with weights that change linearly, and it moves with the
//! chief ray. Moving is done on the spectrum, for the image and for the transfer function alike:
//!
//! T(f) = sum over parts i of w_i T_i(f) exp(-2 pi i f m_i) sinc(f d_i)
//!
//! with m_i the middle of the line that the chief ray draws over part i of the band, d_i its ends' distance, and T_i
//! the transform of the PSF in force about its chief ray. It is exact for a PSF that does not change, whatever the
//! number of parts.

mod image;

use num_complex::Complex64;

use image::image;

use super::Psf;
use crate::error::{Result, WaveError};
use crate::kernels::fft_size;
use crate::propagation::{Otf, Window};

/// Most samples an axis of the window of a band (32 MB of values). A band that is spread over more loses from its
/// image what lies outside, as from any window; the transfer function keeps it.
const MOST_SAMPLES: usize = 2048;

/// The PSF of one wavelength of a band, on a window about the place where its own chief ray lands.
#[derive(Clone, Debug)]
pub struct BandSample {
    /// Place where the chief ray lands, from the element's centre (um).
    pub landing_um: [f64; 2],
    /// Per unit of arriving power: |E|^2 over that of the incident wave in the same medium.
    pub psf: Psf,
}

/// A narrow part of a band.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BandPart {
    /// Weight: what the sensor would count of its light if all that arrives at the element passed, in any scale.
    pub weight: f64,
    /// Places where the chief ray lands at its shortest and at its longest wavelength (um).
    pub landing_um: [[f64; 2]; 2],
    /// Place among the samples: at `i + s`, with `s` between 0 and 1, the PSF is that of sample `i` times 1 - s
    /// and that of sample `i + 1` times s. Beyond the ends the first and the last are in force.
    pub place: f64,
}

/// The PSF of a band.
#[derive(Clone, Debug)]
pub struct Polychromatic {
    /// PSF of all parts, weighted; weights count in the ratio to their sum. The window is the window of the samples,
    /// wider by the way of the chief ray.
    pub psf: Psf,
    /// Places where the chief ray lands when 10, 50 and 90 % of the light that passes have come, in the order of the
    /// parts (um).
    pub landing_um: [[f64; 2]; 3],
    /// The shares of the way through the parts at which it does so: `i + s` for share `s` of part `i`.
    pub at_part: [f64; 3],
}

/// Shares of the light that the spread of a band is named by.
const SHARES: [f64; 3] = [0.1, 0.5, 0.9];

/// The PSF of a band from some wavelengths of it, in rising order, and its parts, in the order of their places.
///
/// # Errors
/// If there is no sample, no part has a weight, or the samples have not windows of one size and step.
pub fn polychromatic(samples: &[BandSample], parts: &[BandPart]) -> Result<Polychromatic> {
    let moved = moved(samples, parts)?;
    let (landing_um, at_part) = shares(parts, samples);
    let window = common_window(&samples[0], &moved);
    Ok(Polychromatic {
        psf: Psf {
            values: image(samples, &moved, &window),
            otf: otf(samples, &moved, window.centre_um),
            window,
        },
        landing_um,
        at_part,
    })
}

/// The transfer function of a band alone, its phase counted from the axis of the element; none if one of the samples has
/// none.
///
/// # Errors
/// As [`polychromatic`].
pub fn band_otf(samples: &[BandSample], parts: &[BandPart]) -> Result<Option<Otf>> {
    Ok(otf(samples, &moved(samples, parts)?, [0.0; 2]))
}

/// The parts as they act on the samples.
fn moved(samples: &[BandSample], parts: &[BandPart]) -> Result<Vec<SampledPart>> {
    let total: f64 = parts.iter().map(|p| p.weight).sum();
    let usable = parts.iter().all(|p| p.weight >= 0.0 && p.place.is_finite());
    let Some(first) = samples.first().filter(|_| usable && total > 0.0 && total.is_finite()) else {
        return Err(WaveError::Band {
            samples: samples.len(),
            parts: parts.len(),
        });
    };
    for sample in samples {
        let shape = sample.psf.values.dim();
        if shape != first.psf.values.dim() || sample.psf.window.step_um != first.psf.window.step_um {
            return Err(WaveError::Shape {
                what: "the PSF of a wavelength of a band",
                given: shape.into(),
                wanted: first.psf.values.dim().into(),
            });
        }
    }
    Ok(parts.iter().map(|p| SampledPart::new(p, samples, total)).collect())
}

/// A part of a band as it acts on its samples.
struct SampledPart {
    weight: f64,
    /// The sample below it and the one above it, with the weight of the latter.
    between: [usize; 2],
    upper: f64,
    /// Middle of the windows of its samples, where their chief ray is where that of this part is (um).
    middle_um: [f64; 2],
    /// Distance from one end of the chief ray's line to the other (um).
    along_um: [f64; 2],
}

impl SampledPart {
    fn new(part: &BandPart, samples: &[BandSample], total: f64) -> Self {
        let place = part.place.clamp(0.0, (samples.len() - 1) as f64);
        let low = place.floor() as usize;
        let high = (low + 1).min(samples.len() - 1);
        let near = &samples[low];
        let [from, to] = part.landing_um;
        let middle = |a: usize| 0.5 * (from[a] + to[a]) + near.psf.window.centre_um[a] - near.landing_um[a];
        Self {
            weight: part.weight / total,
            between: [low, high],
            upper: place.fract(),
            middle_um: [middle(0), middle(1)],
            along_um: [to[0] - from[0], to[1] - from[1]],
        }
    }

    /// Distance from the middle of a window to the farthest place of the chief ray, the larger of both axes (um).
    fn reach_um(&self, window: &Window) -> f64 {
        let along = |a: usize| (self.middle_um[a] - window.centre_um[a]).abs() + 0.5 * self.along_um[a].abs();
        along(0).max(along(1))
    }

    /// exp(-2 pi i f m) sinc(f d) at a frequency along one axis (cycles / um), places counted from `origin_um`.
    fn transfer(&self, axis: usize, cycles: f64, origin_um: f64) -> Complex64 {
        let turns = cycles * (self.middle_um[axis] - origin_um);
        Complex64::cis(-std::f64::consts::TAU * turns) * crate::kernels::sinc(cycles * self.along_um[axis])
    }
}

/// Places of the chief ray, and how far through the parts, at which the shares of the light that passes have come.
fn shares(parts: &[BandPart], samples: &[BandSample]) -> ([[f64; 2]; 3], [f64; 3]) {
    let passes: Vec<f64> = parts
        .iter()
        .map(|part| {
            let m = SampledPart::new(part, samples, 1.0);
            let [low, high] = m.between.map(|k| power_um2(&samples[k].psf));
            part.weight * (low * (1.0 - m.upper) + high * m.upper)
        })
        .collect();
    let all: f64 = passes.iter().sum();
    let found = SHARES.map(|share| {
        let mut before = 0.0;
        for (i, (part, own)) in parts.iter().zip(&passes).enumerate() {
            if before + own >= share * all && *own > 0.0 {
                let within = ((share * all - before) / own).clamp(0.0, 1.0);
                let [from, to] = part.landing_um;
                let at = [0, 1].map(|a| from[a] + within * (to[a] - from[a]));
                return (at, i as f64 + within);
            }
            before += own;
        }
        // No light passes, or rounding at the very end.
        let last = parts.last().map_or([0.0; 2], |p| p.landing_um[1]);
        (last, parts.len() as f64)
    });
    (found.map(|f| f.0), found.map(|f| f.1))
}

/// All light that an element passes, where it is known; else that of the window (um^2).
fn power_um2(psf: &Psf) -> f64 {
    psf.otf.as_ref().map_or_else(|| psf.energy_um2(), |otf| otf.power_um2)
}

/// A window that holds the windows of all parts, or as much of it as is held at a time about the middle of the band.
fn common_window(first: &BandSample, moved: &[SampledPart]) -> Window {
    let own = first.psf.window;
    let lit = || moved.iter().filter(|m| m.weight > 0.0);
    let ends = |a: usize| {
        lit().fold((f64::MAX, f64::MIN), |(low, high), m| {
            let reach = 0.5 * m.along_um[a].abs();
            (low.min(m.middle_um[a] - reach), high.max(m.middle_um[a] + reach))
        })
    };
    let [x, y] = [ends(0), ends(1)];
    let wide = ((x.1 - x.0).max(y.1 - y.0) / own.step_um).ceil();
    // A band that does not move needs no room.
    let samples = if wide == 0.0 {
        own.samples
    } else if wide < MOST_SAMPLES as f64 && own.samples + (wide as usize) < MOST_SAMPLES {
        fft_size(own.samples + wide as usize)
    } else {
        MOST_SAMPLES.max(own.samples)
    };
    let centre_um = if samples >= own.samples + wide as usize {
        [x, y].map(|(low, high)| 0.5 * (low + high))
    } else {
        [0, 1].map(|a| lit().map(|m| m.weight * m.middle_um[a]).sum())
    };
    Window {
        centre_um,
        samples,
        ..own
    }
}

/// The transfer function of all light, its phase counted from `centre_um`; none if one of the samples has none.
fn otf(samples: &[BandSample], moved: &[SampledPart], centre_um: [f64; 2]) -> Option<Otf> {
    let otfs: Vec<&Otf> = samples.iter().map(|s| s.psf.otf.as_ref()).collect::<Option<_>>()?;
    let lp_mm = otfs[0].lp_mm.clone();
    if otfs.iter().any(|o| o.lp_mm != lp_mm) {
        return None;
    }
    let mix = |m: &SampledPart, of: &dyn Fn(&Otf) -> Complex64| {
        let [low, high] = m.between.map(|k| of(otfs[k]));
        (low * (1.0 - m.upper) + high * m.upper) * m.weight
    };
    let transform_um2 = [0, 1].map(|axis| {
        let at = |(j, f): (usize, &f64)| {
            let own = |otf: &Otf| otf.transform_um2[axis][j];
            let parts = moved
                .iter()
                .map(|m| mix(m, &own) * m.transfer(axis, f * 1e-3, centre_um[axis]));
            parts.sum()
        };
        lp_mm.iter().enumerate().map(at).collect()
    });
    let power = |otf: &Otf| Complex64::from(otf.power_um2);
    Some(Otf {
        transform_um2,
        power_um2: moved.iter().map(|m| mix(m, &power).re).sum(),
        lp_mm,
    })
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::tests::{BAND, gaussian};
    use super::*;
    use crate::kernels::sinc;

    /// Sums and transforms of a few hundred thousand numbers.
    pub(crate) const ROUNDING: f64 = 1e-9;

    const LP_MM: [f64; 3] = [5.0, 42.7, 85.3];

    /// A Gaussian about a landing, with the transform that it has by its closed form.
    pub(crate) fn sample(sigma: f64, landing_um: [f64; 2], power: f64) -> BandSample {
        let mut psf = gaussian(sigma, [100.0, -40.0]);
        let peak = power / (std::f64::consts::TAU * sigma * sigma);
        psf.values *= peak;
        psf.window.centre_um = landing_um;
        let at = |f: &f64| Complex64::from(power * (-2.0 * (std::f64::consts::PI * sigma * f * 1e-3).powi(2)).exp());
        let transform: Vec<_> = LP_MM.iter().map(at).collect();
        psf.otf = Some(Otf {
            lp_mm: LP_MM.to_vec(),
            transform_um2: [transform.clone(), transform],
            power_um2: power,
        });
        BandSample { landing_um, psf }
    }

    /// Parts of a band along a line from one landing to another, with the weight at each share of the way.
    pub(crate) fn line(
        parts: usize,
        ends: [[f64; 2]; 2],
        samples: usize,
        weight: impl Fn(f64) -> f64,
    ) -> Vec<BandPart> {
        let at = |s: f64| [0, 1].map(|a| ends[0][a] + s * (ends[1][a] - ends[0][a]));
        (0..parts)
            .map(|i| {
                let [from, middle, to] = [0.0, 0.5, 1.0].map(|h| (i as f64 + h) / parts as f64);
                BandPart {
                    weight: weight(middle),
                    landing_um: [at(from), at(to)],
                    place: middle * (samples - 1) as f64,
                }
            })
            .collect()
    }

    /// A point that is drawn out evenly over d has the contrast |sinc(f d)|, times that of its own.
    #[test]
    fn even_dispersion_leaves_a_sinc() {
        let ends = [[-30.0, 4.0], [41.0, -18.0]];
        let narrow = 1.4;
        for parts in [1, 7, 40] {
            let samples = [sample(narrow, ends[0], 2.0), sample(narrow, ends[1], 2.0)];
            let found = polychromatic(&samples, &line(parts, ends, 2, |_| 3.0)).unwrap();
            let otf = found.psf.otf.as_ref().unwrap();
            assert!((otf.power_um2 - 2.0).abs() < ROUNDING);
            for (j, f) in LP_MM.iter().enumerate() {
                let own = (-2.0 * (std::f64::consts::PI * narrow * f * 1e-3).powi(2)).exp();
                let way = [0, 1].map(|axis| ends[1][axis] - ends[0][axis]);
                for (axis, way) in way.into_iter().enumerate() {
                    let want = own * sinc(f * 1e-3 * way).abs();
                    assert!((otf.contrast(j)[axis] - want).abs() < ROUNDING, "{parts} parts, {f}");
                    // The image is that of the same light.
                    let image = found.psf.mtf_curve(axis, &[*f])[0];
                    assert!((image - want).abs() < BAND, "{parts} parts, {f}: {image}, not {want}");
                }
            }
            assert!((found.psf.energy_um2() - 2.0).abs() < BAND);
            // Even light: a tenth of the way from each end.
            for (at, share) in found.landing_um.iter().zip([0.1, 0.5, 0.9]) {
                let want = [0, 1].map(|a| ends[0][a] + share * (ends[1][a] - ends[0][a]));
                assert!((0..2).all(|a| (at[a] - want[a]).abs() < ROUNDING));
            }
            let centroid = found.psf.centroid_um();
            assert!((centroid[0] - 5.5).abs() < BAND && (centroid[1] + 7.0).abs() < BAND);
        }
    }

    #[test]
    fn without_dispersion_it_is_the_weighted_mean() {
        let at = [100.0, -40.0];
        let samples = [sample(1.2, at, 1.0), sample(2.0, at, 3.0)];
        let parts = line(50, [at, at], 2, |s| 1.0 + s);
        let found = polychromatic(&samples, &parts).unwrap();
        assert_eq!(found.psf.window, samples[0].psf.window);
        // Mean place on the way: the integral of s (1 + s) over that of 1 + s, in parts.
        let total: f64 = parts.iter().map(|p| p.weight).sum();
        let upper: f64 = parts.iter().map(|p| p.weight * p.place).sum::<f64>() / total;
        for ((got, a), b) in found
            .psf
            .values
            .iter()
            .zip(&samples[0].psf.values)
            .zip(&samples[1].psf.values)
        {
            assert!((got - (a * (1.0 - upper) + b * upper)).abs() < ROUNDING);
        }
        assert!((found.psf.otf.unwrap().power_um2 - (1.0 + 2.0 * upper)).abs() < ROUNDING);
    }

    /// More spread than is held: the image is cut about its middle, contrast and power are not.
    #[test]
    fn a_band_that_is_spread_too_far_keeps_its_contrast() {
        let ends = [[0.0, 0.0], [3000.0, 0.0]];
        let samples = [sample(1.4, ends[0], 1.0), sample(1.4, ends[1], 1.0)];
        let found = polychromatic(&samples, &line(300, ends, 2, |_| 1.0)).unwrap();
        assert_eq!(found.psf.window.samples, MOST_SAMPLES);
        let otf = found.psf.otf.as_ref().unwrap();
        assert!((otf.power_um2 - 1.0).abs() < ROUNDING);
        let shown = found.psf.energy_um2();
        assert!(shown > 0.3 && shown < 0.35, "1024 um of 3000 are {shown}");
    }

    #[test]
    fn a_band_without_light_is_refused() {
        let at = [0.0; 2];
        let samples = [sample(1.4, at, 1.0)];
        assert!(polychromatic(&samples, &line(3, [at, at], 1, |_| 0.0)).is_err());
        assert!(polychromatic(&[], &line(3, [at, at], 1, |_| 1.0)).is_err());
        assert!(polychromatic(&samples, &line(3, [at, at], 1, |_| 1.0)).is_ok());
    }
}
