//! Measurement screening: frames that nothing can be learned from.

mod mistaken_frames;
mod odd_pixels;
mod window_offsets;

use ndarray::Array2;

use crate::data::{BLACK_SIGMA_DN, Data, Nuisances};
use crate::set::{MeasuredSet, MeasurementIndex};
use crate::statistics::{FitProblem, Measurements};
use metalith_core::{Error, Result};
use mistaken_frames::{OtherColour, exchanged, orientations, other_colours};
use window_offsets::window_offsets;

/// Share of pixels that are saturated or beside such past which a measurement is left out; fewer are masked. What surrounds a
/// lost peak still tells of distance, path and width; a window that is fuller was exposed for something else.
const MOST_SATURATED: f64 = 0.5;

/// Share of the expected light below which a shutter was closed or a lamp off.
const LEAST_LIGHT: f64 = 0.1;

/// Times the expected light above which a scale is wrong: a chip changes light by less.
const MOST_LIGHT: f64 = 4.0;

/// A window this many standard deviations away was moved.
const MOST_SIGMAS: f64 = 8.0;

/// A pixel is below dark if its signal is negative by this many standard deviations, more than the black level drifts by.
const BELOW_DARK_SIGMAS: f32 = 5.0;
const DRIFT_DN: f32 = 3.0 * BLACK_SIGMA_DN as f32;

/// Share of such pixels past which a dark frame is wrong: single cold pixels are fewer.
const MOST_BELOW_DARK: f64 = 0.02;

/// Share of the pixels that count whose signal is negative beyond noise.
fn below_dark(signal: &Array2<f32>, weight: &Array2<f32>) -> f64 {
    let pairs = || signal.iter().zip(weight).filter(|(_, w)| **w > 0.0);
    let below = pairs().filter(|(v, w)| (**v + DRIFT_DN) * **w < -BELOW_DARK_SIGMAS);
    below.count() as f64 / (pairs().count() as f64).max(1.0)
}

/// Mistakes of frames that were recognised, and the data without pixels that are masked for them.
#[derive(Default)]
pub(crate) struct Recognised {
    /// None where no pixel is masked.
    pub data: Option<Data>,
    pub warnings: Vec<String>,
    colours: Vec<OtherColour>,
    /// Measurements whose frame is the frame of another, and the other.
    exchanged: Vec<(MeasurementIndex, MeasurementIndex)>,
}

/// Recognise hot, dead and saturated pixels, frames of another colour, and frames that are mirrored or turned.
///
/// # Errors
/// If all frames are mirrored, turned or transposed.
pub(crate) fn recognise(set: &MeasuredSet, problem: &FitProblem<'_>) -> Result<Recognised> {
    let mut found = Recognised::default();
    let mut odd = odd_pixels::candidates(set, problem.data);
    if odd.iter().any(|own| !own.is_empty()) {
        let without = odd_pixels::without(problem.data, &odd);
        let masked = FitProblem {
            data: &without,
            ..problem.clone()
        };
        let nuisances = masked.nuisance_fit().nuisances;
        for (c, own) in odd.iter_mut_enumerated().filter(|(_, own)| !own.is_empty()) {
            let model = problem
                .prediction(&problem.surrogate.about, c)
                .pixels(nuisances.shift_um[c]);
            own.retain(|pixel| !odd_pixels::is_of_the_model(pixel, &model));
        }
        found.warnings.extend(odd_pixels::described(&odd));
        odd_pixels::mask_everywhere(problem.data, &mut odd);
        if odd.iter().any(|own| !own.is_empty()) {
            found.data = Some(odd_pixels::without(problem.data, &odd));
        }
    }
    found.warnings.extend(saturation(set));
    let masked = FitProblem {
        data: found.data.as_ref().unwrap_or(problem.data),
        ..problem.clone()
    };
    if let Some(better) = orientations(&masked, &problem.used) {
        let words: Vec<String> = better
            .iter()
            .map(|o| format!("`orientation = \"{}\"`", o.word()))
            .collect();
        return Err(Error::refused(
            "set/orientation",
            format!(
                "{}: the frames fit far better mirrored, turned or transposed than as they are",
                set.path.display()
            ),
            format!(
                "add {} to [camera]; rows of a frame must grow with +y of the layout, columns with +x",
                words.join(" or ")
            ),
        ));
    }
    found.exchanged = exchanged(&masked);
    found.colours = other_colours(set, &masked);
    let mut common: Vec<String> = Vec::new();
    for own in found.colours.iter().filter(|o| o.is_common) {
        let stated = set.leds[set.measurements[own.measurement].led].name();
        let words = format!(
            "images of {} nm fit all measurements of {stated} nm far better than its own: correct `led_nm` if frames were exchanged",
            set.leds[own.led].name()
        );
        if !common.contains(&words) {
            common.push(words);
        }
    }
    found.warnings.extend(common);
    Ok(found)
}

/// Measurements with saturated pixels, which are masked; none without any.
fn saturation(set: &MeasuredSet) -> Option<String> {
    let full = |dn: &Array2<f32>| dn.iter().filter(|v| f64::from(**v) >= set.camera.full_dn()).count();
    let all = set
        .measurements
        .iter()
        .map(|c| (c, full(&c.dn)))
        .filter(|(_, n)| *n > 0);
    let all: Vec<String> = all.map(|(c, n)| format!("{n} in `{}`", c.name)).collect();
    (!all.is_empty()).then(|| format!("saturated pixels and their neighbours are masked: {}", all.join(", ")))
}

/// A measurement that cannot be used.
#[derive(Clone, Debug, PartialEq)]
pub struct UnusableMeasurement {
    pub measurement: MeasurementIndex,
    /// Reason, for people.
    pub reason: String,
}

/// Measurements that cannot be used, by a fit of the nuisances to the set as stated.
pub(crate) fn unusable_measurements(
    set: &MeasuredSet,
    problem: &FitProblem<'_>,
    nuisances: &Nuisances,
    recognised: &Recognised,
) -> Vec<UnusableMeasurement> {
    let mut out = Vec::new();
    let registration = set.camera.registration_sigma_px;
    let beyond = window_offsets(set, nuisances);
    for ((c, measurement), beyond) in set.measurements.iter_enumerated().zip(beyond) {
        let pixels = set.seeing_pixels(c);
        let lost = pixels - problem.data.points(c);
        let model = problem.prediction(&problem.surrogate.about, c).pixels([0.0; 2]);
        // Over the pixels that count: a lost peak is no lost light.
        let counted = |light: &Array2<f32>| {
            let pairs = light.iter().zip(&problem.data.weight[c]);
            f64::from(pairs.filter(|(_, w)| **w > 0.0).map(|(v, _)| *v).sum::<f32>())
        };
        let expected = counted(&model) * measurement.scale_dn * nuisances.scale[c];
        let seen = counted(&problem.data.signal[c]);
        let dark = below_dark(&problem.data.signal[c], &problem.data.weight[c]);
        let other = recognised.colours.iter().find(|o| o.measurement == c && !o.is_common);
        let reason = if let Some((_, other)) = recognised.exchanged.iter().find(|(own, _)| *own == c) {
            format!(
                "its frame and the one of `{}` were exchanged: each fits the image of the other far better",
                set.measurements[*other].name
            )
        } else if let Some(other) = other {
            format!(
                "the image of {} nm fits it far better than that of its `led_nm`: reduced chi-square {:.3} and {:.3}",
                set.leds[other.led].name(),
                other.chi2[1],
                other.chi2[0]
            )
        } else if dark > MOST_BELOW_DARK {
            format!(
                "{:.0} % of its pixels are below dark by more than their noise: its dark frame or black level is of another exposure",
                100.0 * dark
            )
        } else if lost as f64 > MOST_SATURATED * pixels as f64 {
            format!("{lost} of its {pixels} pixels are saturated or beside one that is")
        } else if seen < LEAST_LIGHT * expected {
            format!(
                "it holds {:.1} % of the expected light: correct its `scale_dn`, or `aoi_deg` and `window_centre_um`",
                100.0 * seen / expected
            )
        } else if seen > MOST_LIGHT * expected {
            format!(
                "it holds {:.1} times the expected light: correct its `scale_dn`, the bits of its values, or `aoi_deg` and \
                 `window_centre_um`, if the spot is elsewhere than expected",
                seen / expected
            )
        } else if beyond > MOST_SIGMAS * registration {
            format!("its window is {beyond:.1} pixels off; the stated standard deviation is {registration} pixels")
        } else {
            continue;
        };
        out.push(UnusableMeasurement { measurement: c, reason });
    }
    out
}
