//! Richardson and Lucy: the most likely picture for photons alone, reached by steps that keep it positive.

use metalith_core::{Progress, Result};
use ndarray::Array2;

use crate::frame_model::Planes;
use crate::recorded::Recorded;

/// Rounds; noise grows with them.
const ROUNDS: usize = 12;

pub(crate) fn restore(
    recorded: &Recorded<'_>,
    elements: &[usize],
    stray_light: bool,
    progress: &dyn Progress,
) -> Result<Planes> {
    let operator = recorded.operator;
    progress.begin("restoring by Richardson and Lucy", ROUNDS as u64);
    let known: Planes = recorded
        .inverse_variance
        .iter()
        .map(|t| t.mapv(|v| f32::from(u8::from(v > 0.0))))
        .collect();
    let reach = operator.adjoint_elements(&known, elements, stray_light);
    let floor = 1e-6 * reach.iter().flatten().copied().fold(0.0f32, f32::max);
    // A grey picture with the light of the frame.
    let mut x = operator.white();
    let seen = operator.apply_elements(&x, elements, stray_light);
    let sum = |frames: &[Array2<f32>]| {
        let pairs = frames.iter().zip(&known).flat_map(|(f, k)| f.iter().zip(k));
        pairs.map(|(v, k)| f64::from(v * k)).sum::<f64>()
    };
    let level = (sum(recorded.light) / sum(&seen).max(f64::MIN_POSITIVE)).max(1e-6) as f32;
    x.iter_mut().for_each(|plane| *plane *= level);
    for _ in 0..ROUNDS {
        progress.check_stopped()?;
        progress.advance(1);
        let mut ratio = operator.apply_elements(&x, elements, stray_light);
        for (c, plane) in ratio.iter_mut().enumerate() {
            let least = 1e-4 * plane.iter().copied().fold(0.0f32, f32::max);
            ndarray::Zip::from(plane)
                .and(&recorded.light[c])
                .and(&known[c])
                .for_each(|r, s, k| *r = k * s.max(0.0) / r.max(least).max(f32::MIN_POSITIVE));
        }
        let back = operator.adjoint_elements(&ratio, elements, stray_light);
        for c in 0..x.len() {
            ndarray::Zip::from(&mut x[c])
                .and(&back[c])
                .and(&reach[c])
                .for_each(|x, b, r| *x = if *r > floor { *x * b / r } else { *x });
        }
    }
    Ok(x)
}
