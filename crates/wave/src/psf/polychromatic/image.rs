//! The image of a band: the PSFs of its parts, moved to where they land, on one window.

use metalith_core::part;
use ndarray::Array2;
use num_complex::Complex64;

use super::{BandSample, SampledPart};
use crate::kernels::{Fourier, fft_size};
use crate::propagation::Window;

/// Samples of a period on which parts that reach so far from the middle of the window are moved, without coming back into
/// it on the other side: those of the window where their own windows lie within it, else at most those of both.
fn period(window: &Window, own: &Window, reach_um: f64) -> usize {
    // Rounding of the size of the window.
    const SLACK: f64 = 1.5;
    let room = window.half_width_um() - own.half_width_um();
    if reach_um <= room + SLACK * own.step_um {
        return window.samples;
    }
    fft_size(window.samples + ((reach_um - room) / own.step_um).ceil() as usize)
}

/// All parts on the common window, cut at its border. Parts that reach so far out that their own windows lie beside it are
/// left out.
pub(super) fn image(samples: &[BandSample], moved: &[SampledPart], window: &Window) -> Array2<f64> {
    let own = samples[0].psf.window;
    let touching_um = window.half_width_um() + own.half_width_um();
    let lit: Vec<&SampledPart> = moved
        .iter()
        .filter(|m| m.weight > 0.0 && m.reach_um(window) <= touching_um)
        .collect();
    let size = period(window, &own, lit.iter().map(|m| m.reach_um(window)).fold(0.0, f64::max));
    let fourier = Fourier::periodic([size; 2]);
    // First samples of the common window and of an embedded one.
    let (first, offset) = ((size - window.samples) / 2, (size - own.samples) / 2);
    let spectrum_of = |k: usize| {
        let mut wide = Array2::zeros([size; 2]);
        for ((iy, ix), v) in samples[k].psf.values.indexed_iter() {
            wide[[iy + offset, ix + offset]] = *v;
        }
        fourier.of_image(&wide)
    };
    // Where the middle of an embedded window is, from the middle of the common one.
    let from_first = offset as f64 - first as f64;
    let embedded_um = (from_first + 0.5 * (own.samples as f64 - window.samples as f64)) * own.step_um;
    let mut held: [Option<(usize, Array2<Complex64>)>; 2] = [None, None];
    let half = size / 2;
    let mut sum = Array2::<Complex64>::zeros((size, half + 1));
    for m in lit {
        hold(&mut held, m.between, &spectrum_of);
        let [low, high] = m.between.map(|k| {
            let found = held.iter().flatten().find(|h| h.0 == k);
            &found.expect("both are held").1
        });
        let axes = [0, 1].map(|a| {
            let origin = window.centre_um[a] + embedded_um;
            Axis::new(&fourier, a, size, m.middle_um[a] - origin, m.along_um[a], own.step_um)
        });
        let rows = sum.rows_mut().into_iter().zip(low.rows()).zip(high.rows());
        for (iy, ((mut to, low), high)) in rows.enumerate() {
            let y = &axes[1].0[iy];
            let along_y = y.shift * m.weight;
            let pairs = to.iter_mut().zip(&axes[0].0).zip(low).zip(high);
            for (((to, x), low), high) in pairs {
                let factor = x.shift * along_y * x.smear(y);
                *to += (low + (high - low) * m.upper) * factor;
            }
        }
    }
    let full = Array2::from_shape_fn([size; 2], |(iy, ix)| {
        if ix <= half {
            sum[[iy, ix]]
        } else {
            sum[[(size - iy) % size, size - ix]].conj()
        }
    });
    let shown = first..first + window.samples;
    part(fourier.to_image(full).view(), shown.clone(), shown).to_owned()
}

/// Make sure that the spectra of two samples are at hand, and no more of them than needed.
fn hold(
    held: &mut [Option<(usize, Array2<Complex64>)>; 2],
    wanted: [usize; 2],
    spectrum_of: &dyn Fn(usize) -> Array2<Complex64>,
) {
    for k in wanted {
        if held.iter().flatten().any(|h| h.0 == k) {
            continue;
        }
        let free = held
            .iter()
            .position(|h| h.as_ref().is_none_or(|h| !wanted.contains(&h.0)));
        held[free.expect("two are wanted and two places are there")] = Some((k, spectrum_of(k)));
    }
}

/// A shift and a smear along one axis, at each frequency.
struct Axis(Vec<AxisFrequency>);

struct AxisFrequency {
    /// exp(-2 pi i f m).
    shift: Complex64,
    /// pi f d, with its sine and cosine.
    angle: f64,
    sine: f64,
    cosine: f64,
}

impl Axis {
    fn new(fourier: &Fourier, axis: usize, size: usize, middle_um: f64, along_um: f64, step_um: f64) -> Self {
        let at = |i: usize| {
            // The image's rows are y, axis 0 of the transform.
            let cycles = fourier.frequency(1 - axis, i) / step_um;
            let angle = std::f64::consts::PI * cycles * along_um;
            AxisFrequency {
                shift: Complex64::cis(-std::f64::consts::TAU * cycles * middle_um),
                angle,
                sine: angle.sin(),
                cosine: angle.cos(),
            }
        };
        Self((0..size).map(at).collect())
    }
}

impl AxisFrequency {
    /// sinc of the sum over both axes, by the sine of a sum.
    fn smear(&self, other: &Self) -> f64 {
        let angle = self.angle + other.angle;
        // Below it sin(x) / x is 1 to 1e-9.
        const SMALL: f64 = 1e-4;
        if angle.abs() < SMALL {
            1.0
        } else {
            (self.sine * other.cosine + self.cosine * other.sine) / angle
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{ROUNDING, line, sample};
    use super::super::{common_window, moved};
    use super::*;

    /// A window no wider than those of the samples is the middle of a wider one: parts that reach beyond it are cut, and
    /// nothing comes back on the other side.
    #[test]
    fn a_narrow_window_cuts_what_reaches_beyond_it() {
        let ends = [[-30.0, 4.0], [41.0, -18.0]];
        let samples = [sample(1.4, ends[0], 1.0), sample(1.9, ends[1], 2.0)];
        let moved = moved(&samples, &line(40, ends, 2, |_| 1.0)).unwrap();
        let wide = common_window(&samples[0], &moved);
        let whole = image(&samples, &moved, &wide);
        for less in [0, 1, 24] {
            let narrow = Window {
                samples: wide.samples - 2 * ((wide.samples - samples[0].psf.window.samples) / 2 - less),
                ..wide
            };
            let first = (wide.samples - narrow.samples) / 2;
            let inside = first..first + narrow.samples;
            let cut = image(&samples, &moved, &narrow);
            assert_eq!(cut.dim(), (narrow.samples, narrow.samples));
            let want = part(whole.view(), inside.clone(), inside);
            // A third of the way and more crosses the window.
            assert!(want.sum() > 0.3 * whole.sum() && want.sum() < 0.9 * whole.sum());
            assert!(cut.iter().zip(&want).all(|(a, b)| (a - b).abs() < ROUNDING), "{less}");
        }
    }
}
