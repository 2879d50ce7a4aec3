//! Orientation of the sensor and order of the planes, found before any fit, and the noise of frames.

use ndarray::Array2;
use rayon::prelude::*;

use super::detector::Detector;
use super::light::{Light, Place};
use super::sampling::Sampling;
use super::set::{StackPlane, StackSet};
use super::setting::Setting;

/// Share of the error that another orientation has to take away.
const BETTER: f64 = 0.15;

/// Planes of each object that are compared.
const COMPARED: usize = 5;

/// Focus offsets that are compared, on either side, in steps of two depths of focus.
const OFFSETS: i32 = 6;

/// Orientations of a sensor: transposed first, then mirrored along x and y.
const ORIENTATIONS: [(&str, [bool; 3]); 8] = [
    ("as stated", [false, false, false]),
    ("mirrored left to right", [false, true, false]),
    ("mirrored top to bottom", [false, false, true]),
    ("turned by 180 degrees", [false, true, true]),
    ("transposed", [true, false, false]),
    ("turned by 90 degrees clockwise", [true, true, false]),
    ("turned by 90 degrees anticlockwise", [true, false, true]),
    ("transposed about the other diagonal", [true, true, true]),
];

fn turned<T: Copy>(map: &Array2<T>, [transpose, x, y]: [bool; 3]) -> Array2<T> {
    let mut out = if transpose { map.t().to_owned() } else { map.clone() };
    if x {
        out.invert_axis(ndarray::Axis(1));
    }
    if y {
        out.invert_axis(ndarray::Axis(0));
    }
    out.as_standard_layout().to_owned()
}

/// Bring the frames of a set to the orientation, and its planes to the order, in which the stated model predicts them best; the focus
/// offset (um) at which it does.
pub(super) fn settle(set: &mut StackSet, sampling: &Sampling) -> f64 {
    let (orientation, reversed, focus_um) = best(set, sampling);
    if orientation > 0 {
        let (words, turn) = ORIENTATIONS[orientation];
        for plane in &mut set.planes {
            plane.frame = turned(&plane.frame, turn);
            plane.used = turned(&plane.used, turn);
        }
        set.remarks.push(format!(
            "orientation: frames agree better with the objects when {words}; they are used like this"
        ));
    }
    if reversed {
        set.planes.iter_mut().for_each(|p| p.position_um = -p.position_um);
        set.remarks
            .push("order: planes agree better when positions count towards the lens; they are used like this".into());
    }
    focus_um
}

/// Number of the best orientation, whether positions are reversed, and the focus offset.
fn best(set: &StackSet, sampling: &Sampling) -> (usize, bool, f64) {
    let (rows, cols) = set.planes[0].frame.dim();
    let detector = Detector::new(rows, cols, sampling);
    let light = Light::new(set, sampling);
    let mut picked = Vec::new();
    for object in 0..set.objects.len() {
        let own: Vec<usize> = (0..set.planes.len())
            .filter(|&m| set.planes[m].object == object)
            .collect();
        let n = own.len();
        picked.extend((0..COMPARED.min(n)).map(|k| own[(2 * k + 1) * n / (2 * COMPARED.min(n))]));
    }
    let known = if rows == cols { ORIENTATIONS.len() } else { 4 };
    let frames: Vec<Vec<_>> = { picked.par_iter() }
        .map(|&m| {
            let plane = &set.planes[m];
            let of = |turn| {
                let plane = StackPlane {
                    frame: turned(&plane.frame, turn),
                    used: turned(&plane.used, turn),
                    ..plane.clone()
                };
                detector.measured(&plane, set.bench.background)
            };
            ORIENTATIONS[..known].iter().map(|(_, turn)| of(*turn)).collect()
        })
        .collect();
    let still = Setting::of(&vec![0.0; super::setting::slots(set)], 0);
    let most = if set.bench.shift { [cols / 2, rows / 2] } else { [0, 0] };
    let trials: Vec<(bool, f64)> = [false, true]
        .into_iter()
        .flat_map(|r| (-OFFSETS..=OFFSETS).map(move |k| (r, 2.0 * f64::from(k) * sampling.depth_of_focus_um)))
        .collect();
    let errors: Vec<Vec<f64>> = trials
        .par_iter()
        .map(|&(reversed, focus_um)| {
            let mut sums = vec![0.0; known];
            for (&m, frames) in picked.iter().zip(&frames) {
                let plane = &set.planes[m];
                let sign = if reversed { -1.0 } else { 1.0 };
                let distance_um = set.bench.sensor_um + sign * plane.position_um + focus_um;
                let place = Place {
                    distance_um: distance_um.max(0.05 * set.bench.sensor_um),
                    pixel_um: set.bench.pixel_um,
                    mask_um: 0.0,
                    origin_px: [0.0; 2],
                };
                let intensity = light.intensity(&light.pupil(plane.object, &still.pupil), place);
                let spectrum = detector.spectrum(intensity, set.bench.pixel_um, [0.0; 2]);
                for (sum, frame) in sums.iter_mut().zip(frames) {
                    *sum += 1.0 - detector.correlate(&spectrum, frame, most).1.powi(2);
                }
            }
            sums
        })
        .collect();
    let least = |wanted: &dyn Fn(usize, bool) -> bool| {
        let all = trials
            .iter()
            .zip(&errors)
            .flat_map(|(t, sums)| sums.iter().enumerate().map(move |(o, e)| (*e, o, t)));
        all.filter(|(_, o, t)| wanted(*o, t.0))
            .min_by(|a, b| a.0.total_cmp(&b.0))
    };
    let stated = least(&|o, r| o == 0 && !r);
    // The simplest change that takes almost all of the error away that any takes.
    let any = least(&|_, _| true);
    let (Some(stated), Some(any)) = (stated, any) else {
        return (0, false, 0.0);
    };
    if any.0 > (1.0 - BETTER) * stated.0 {
        return (0, false, stated.2.1);
    }
    let enough = any.0 + 0.02 * (stated.0 - any.0);
    let in_order = least(&|_, r| !r).filter(|found| found.0 <= enough);
    let found = in_order.unwrap_or(any);
    (found.1, found.2.0, found.2.1)
}

/// Relative error that the noise of frames makes alone: root mean square over planes. Noise is what a second difference along both
/// axes shows, robustly, in eight classes of brightness.
pub(super) fn noise(set: &StackSet) -> f64 {
    let of = |plane: &StackPlane| {
        let f = &plane.frame;
        let (rows, cols) = f.dim();
        let level = f64::from(super::frames::level_of(f));
        let mut all: Vec<(f32, f32)> = Vec::new();
        for y in 1..rows - 1 {
            for x in 1..cols - 1 {
                let cross = f[(y - 1, x)] + f[(y + 1, x)] + f[(y, x - 1)] + f[(y, x + 1)];
                let corners = f[(y - 1, x - 1)] + f[(y - 1, x + 1)] + f[(y + 1, x - 1)] + f[(y + 1, x + 1)];
                // Weights 4, -2 and 1: noise of one has a variance of 36.
                let difference = (4.0 * f[(y, x)] - 2.0 * cross + corners) / 6.0;
                all.push(((f[(y, x)] + cross + corners) / 9.0, difference.abs()));
            }
        }
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let squares: f64 = { all.chunks(all.len().div_ceil(8)) }
            .map(|class| {
                let mut own: Vec<f32> = class.iter().map(|c| c.1).collect();
                let middle = own.len() / 2;
                let sigma = 1.4826 * f64::from(*own.select_nth_unstable_by(middle, f32::total_cmp).1);
                sigma * sigma * class.len() as f64
            })
            .sum();
        let whole: f64 = f.iter().map(|v| (f64::from(*v) - level).powi(2)).sum();
        squares / whole.max(f64::MIN_POSITIVE)
    };
    let all: f64 = set.planes.par_iter().map(of).sum();
    (all / set.planes.len() as f64).sqrt()
}
