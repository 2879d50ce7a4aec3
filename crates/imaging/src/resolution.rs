//! Resolution: the contrast of fine detail that a frame and a picture keep, from scenes whose truth is a formula.
//!
//! A slanted edge gives the whole curve: places near it are sorted by their distance from it into quarters of a pixel, the
//! step is differentiated, and its spectrum is that of a line (ISO 12233). A Siemens star gives one frequency for each
//! radius: the part of the light that turns with the spokes, over the mean. Both are divided by what the scene itself
//! gives at the same places.

use std::f64::consts::TAU;

use ndarray::{Array2, Array3};
use serde::Serialize;

use crate::acceptance::Acceptance;
use crate::exposure::{Frame, counts_channel};
use crate::imaging_system::ImagingSystem;
use crate::scene::{BuiltIn, LEAN_DEG, SPOKES, STAR};

/// Contrast by frequency.
#[derive(Clone, Debug, Serialize)]
pub struct ContrastCurve {
    pub of: String,
    /// Cycles per degree in the middle of the field, and contrast over that of the scene.
    pub points: Vec<(f64, f64)>,
}

/// Light at a place of the scene.
#[derive(Clone, Copy)]
struct Sample {
    /// Pixels of the scene from its middle.
    x: f64,
    y: f64,
    seen: f64,
    truth: f64,
}

/// Distance from the edge up to which it is looked at (pixels of the scene).
const NEAR: f64 = 32.0;
/// Bins a pixel of the distance from the edge.
const BINS: f64 = 4.0;
/// Below this share of its contrast the scene itself says nothing about a frequency.
const LEAST: f64 = 0.05;
/// Frequencies: cycles a pixel of the scene.
const STEP: f64 = 0.02;
/// Highest frequency of a star: nearer to its middle spokes differ too much within what a blur mixes.
const STAR_MOST: f64 = 0.2;

/// Curves of the frame behind the element that looks ahead, channel by channel, and of the picture; none for a scene from
/// which they cannot be read.
pub fn contrast_curves(
    system: &ImagingSystem,
    kind: BuiltIn,
    truth: &Array3<f64>,
    frame: &Frame,
    picture: &Array3<f64>,
) -> Vec<ContrastCurve> {
    let grey = |a: &Array3<f64>| a.mean_axis(ndarray::Axis(2)).expect("three colours");
    let (truth, picture) = (grey(truth), grey(picture));
    let mut all: Vec<(String, Vec<Sample>)> = (0..system.channels.len())
        .map(|c| {
            (
                format!("frame, {}", system.channels[c].name),
                of_frame(system, c, frame, &truth),
            )
        })
        .collect();
    all.push(("picture".into(), of_picture(&picture, &truth)));
    // Cycles a pixel to cycles a degree.
    let per_degree = 1.0 / system.view.pixel().atan().to_degrees();
    let points = |samples: &[Sample]| match kind {
        BuiltIn::Edge => edge(samples),
        BuiltIn::Star => star(samples, STAR * truth.ncols() as f64),
        BuiltIn::Chart => Vec::new(),
    };
    all.into_iter()
        .map(|(of, samples)| ContrastCurve {
            of,
            points: points(&samples).into_iter().map(|(f, c)| (f * per_degree, c)).collect(),
        })
        .filter(|curve| !curve.points.is_empty())
        .collect()
}

fn of_picture(picture: &Array2<f64>, truth: &Array2<f64>) -> Vec<Sample> {
    let (rows, columns) = truth.dim();
    let sample = |((row, column), seen): ((usize, usize), &f64)| Sample {
        x: column as f64 - 0.5 * (columns as f64 - 1.0),
        y: row as f64 - 0.5 * (rows as f64 - 1.0),
        seen: *seen,
        truth: truth[[row, column]],
    };
    picture.indexed_iter().map(sample).collect()
}

/// The pixels that count a channel behind the element whose wedge is the least.
fn of_frame(system: &ImagingSystem, channel: usize, frame: &Frame, truth: &Array2<f64>) -> Vec<Sample> {
    let wedge = |k: &usize| {
        let w = system.elements[*k].wedge;
        w.sin_x.hypot(w.sin_y)
    };
    let ahead = (0..system.elements.len()).min_by(|a, b| wedge(a).total_cmp(&wedge(b)));
    let Some(ahead) = ahead else {
        return Vec::new();
    };
    let element = system.elements[ahead];
    let (sensor, view) = (&system.camera.sensor, &system.view);
    let acceptance = Acceptance::new(&system.elements, sensor);
    let names = system.camera.channel_names();
    let plane = &frame.planes[channel.min(frame.planes.len() - 1)];
    let mut samples = Vec::new();
    for ((row, column), value) in plane.indexed_iter() {
        if !counts_channel(frame.filter, &names, [row, column], channel) {
            continue;
        }
        let on_chip = sensor.place_um([row, column]);
        let place = [0, 1].map(|axis| on_chip[axis] - element.centre_um[axis]);
        let sines = element.sines_of_landing(place, system.bank.channel_um[channel]);
        let Some(tangents) = element.tangents(sines, view.distance_um) else {
            continue;
        };
        let [y, x] = view.place(tangents);
        let inside = |v: f64, n: usize| v >= 0.0 && v + 1.0 < n as f64;
        let share = acceptance.share(ahead, on_chip);
        let held = place.iter().all(|v| v.abs() < system.bank.spec.reach_um);
        if held && share > 0.0 && inside(y, view.rows) && inside(x, view.columns) {
            samples.push(Sample {
                x: x - 0.5 * (view.columns as f64 - 1.0),
                y: y - 0.5 * (view.rows as f64 - 1.0),
                seen: f64::from(*value) / frame.gain[channel] / (share * element.flux_per_um2(place)),
                truth: between(truth, y, x),
            });
        }
    }
    samples
}

fn between(plane: &Array2<f64>, y: f64, x: f64) -> f64 {
    let (i, j) = (y as usize, x as usize);
    let (u, v) = (y - i as f64, x - j as f64);
    (plane[[i, j]] * (1.0 - v) + plane[[i, j + 1]] * v) * (1.0 - u)
        + (plane[[i + 1, j]] * (1.0 - v) + plane[[i + 1, j + 1]] * v) * u
}

/// Contrast from the middle of a slanted edge: cycles a pixel, and contrast.
fn edge(samples: &[Sample]) -> Vec<(f64, f64)> {
    let lean = LEAN_DEG.to_radians();
    let bins = (2.0 * NEAR * BINS) as usize;
    let mut sums = vec![[0.0; 3]; bins];
    for s in samples.iter().filter(|s| s.y.abs() < 2.0 * NEAR) {
        let place = ((s.x * lean.cos() + s.y * lean.sin()) + NEAR) * BINS;
        if place >= 0.0 && (place as usize) < bins {
            let sum = &mut sums[place as usize];
            *sum = [sum[0] + 1.0, sum[1] + s.seen, sum[2] + s.truth];
        }
    }
    if sums.iter().any(|s| s[0] == 0.0) {
        return Vec::new();
    }
    let spectrum = |which: usize, cycles: f64| {
        let (mut re, mut im) = (0.0, 0.0);
        for i in 1..bins {
            let step = sums[i][which] / sums[i][0] - sums[i - 1][which] / sums[i - 1][0];
            let at = i as f64 / BINS - NEAR;
            let fade = 0.5 + 0.5 * (std::f64::consts::PI * at / NEAR).cos();
            re += fade * step * (TAU * cycles * at).cos();
            im += fade * step * (TAU * cycles * at).sin();
        }
        re.hypot(im)
    };
    let (seen, truth) = (spectrum(1, 0.0), spectrum(2, 0.0));
    let contrast = |k: usize| {
        let cycles = k as f64 * STEP;
        let own = spectrum(2, cycles) / truth;
        (own > LEAST).then(|| (cycles, spectrum(1, cycles) / seen / own))
    };
    (1..=(0.5 / STEP) as usize).filter_map(contrast).collect()
}

/// Contrast from a star of a radius (pixels): cycles a pixel, and contrast. Rings of which a part is not seen say
/// nothing.
fn star(samples: &[Sample], reach: f64) -> Vec<(f64, f64)> {
    let contrast = |k: usize| {
        let cycles = k as f64 * STEP;
        let radius = SPOKES / (TAU * cycles);
        let ring = samples.iter().filter(|s| (s.x.hypot(s.y) - radius).abs() < 1.0);
        // What is seen, and the light of the scene: mean, and the part that turns with the spokes.
        let (mut spokes, mut sums) = ([false; SPOKES as usize], [[0.0; 3]; 2]);
        for s in ring {
            let turns = s.y.atan2(s.x) / TAU * SPOKES;
            spokes[turns.rem_euclid(SPOKES) as usize % spokes.len()] = true;
            let (sin, cos) = (TAU * turns).sin_cos();
            for (sum, v) in sums.iter_mut().zip([s.seen, s.truth]) {
                *sum = [sum[0] + v, sum[1] + v * cos, sum[2] + v * sin];
            }
        }
        let [seen, truth] = sums.map(|s| s[1].hypot(s[2]) / s[0]);
        let whole = radius + 2.0 < reach && spokes.iter().all(|s| *s);
        (whole && truth > LEAST).then_some((cycles, seen / truth))
    };
    (1..=(STAR_MOST / STEP).round() as usize).filter_map(contrast).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::chart;

    /// Samples of a built-in scene and of the same after a blur that keeps `exp(-(6 f)^2)` of each frequency.
    fn blurred(kind: BuiltIn) -> Vec<Sample> {
        let scene = chart(kind, 240, 60.0, f64::INFINITY).planes[0].mapv(f64::from);
        // The Gaussian whose transform that is.
        let deviation = 6.0 / (2f64.sqrt() * std::f64::consts::PI);
        let taps: Vec<f64> = (-10..=10)
            .map(|k| (-0.5 * (f64::from(k) / deviation).powi(2)).exp())
            .collect();
        let sum: f64 = taps.iter().sum();
        let mut soft = scene.clone();
        for axis in [0, 1] {
            let from = soft.clone();
            for (mut to, line) in soft
                .lanes_mut(ndarray::Axis(axis))
                .into_iter()
                .zip(from.lanes(ndarray::Axis(axis)))
            {
                for i in 0..line.len() {
                    let at = |k: usize| line[(i + k).saturating_sub(10).min(line.len() - 1)];
                    to[i] = taps.iter().enumerate().map(|(k, t)| t * at(k)).sum::<f64>() / sum;
                }
            }
        }
        of_picture(&soft, &scene)
    }

    #[test]
    fn a_known_blur_is_read_from_edge_and_star() {
        /// Quarters of a pixel, and rings of two pixels.
        const READ: f64 = 0.03;
        for kind in [BuiltIn::Edge, BuiltIn::Star] {
            let samples = blurred(kind);
            let found = match kind {
                BuiltIn::Edge => edge(&samples),
                _ => star(&samples, STAR * 240.0),
            };
            assert!(found.len() > 6, "{kind:?}");
            for (cycles, contrast) in found.into_iter().filter(|(f, _)| *f < 0.3) {
                let want = (-(6.0 * cycles).powi(2)).exp();
                assert!((contrast - want).abs() < READ, "{kind:?} {cycles}: {contrast} {want}");
            }
        }
    }
}
