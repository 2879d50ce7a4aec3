//! Frequencies of an element that count for a window, and length of the period that keeps its images apart.

use std::ops::Range;

use metalith_pillars::Lattice;

use super::Window;
use crate::error::{Result, WaveError};
use crate::kernels::fft_size;

/// Accuracy that is asked of a folded field.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Accuracy {
    /// All light that can reach the window, and none that cannot: errors of 1e-6 of a matched peak, which
    /// is single precision.
    Accurate,
    /// Mode for sweeps and optimisers: a shorter period and a steeper fade, through which light of orders other than
    /// the designed one comes back into the window: errors of 1e-3 of a matched peak.
    Fast,
}

/// Fade with which a field was folded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fade {
    /// Period of the transform along x and along y (um).
    pub period_um: [f64; 2],
    /// Frequencies whose ray from the element's centre lands this near to the window's middle count in full (um).
    pub full_um: f64,
    /// Frequencies whose ray lands this far from the window's middle, or farther, do not count (um).
    pub zero_um: f64,
    /// Frequencies inside the fade that are not in the transform's own period, -1/2 to 1/2 a step of the lattice's grid
    /// along each axis, and had to be relabelled by a multiple of 1 / step towards the rays that reach the window.
    pub relabelled: u64,
}

/// Width of the fade in units of sqrt(wavelength * distance), the size that diffraction gives to a sharp edge.
/// Measured over whole windows of lenses of 1 mm, 140 um and 60 um, steered, at 450 to 660 nm: errors of 1e-6 of
/// the matched peak for 1 mm, 1e-5 for 60 um.
const FADE_WIDTHS: f64 = 5.5;
/// Gain of the focus below which the fade is wider. What a fade lets through falls with the cube of its width and
/// counts against the gain: below this gain the fade is made wider to match, at most twice.
const FADE_GAIN: f64 = 100.0;
/// Distances by which the fade begins beyond the last needed ray, and ends before the first ray that would come back,
/// in the same unit.
const FADE_MARGINS: [f64; 2] = [1.0, 0.5];
/// Width of the fade in fast mode, in the same unit.
const FAST_FADE_WIDTHS: f64 = 3.0;
/// Length by which a period exceeds lens and window in fast mode, in the same unit.
const FAST_MARGIN: f64 = 1.5;
/// Undiffracted light of an element is a disc of its size, 1 / gain of the focus; where that is less than this, its
/// coming back into the window is within what fast mode may err by, and the period need not hold it.
const FAST_STRAY: f64 = 2.5e-3;
/// Period in fast mode with a gain that allows it, in units of lens radius and half the window.
const FAST_PERIOD: f64 = 1.19;
/// More bins an axis than any element of this program needs: a lens of 30 mm has 94,000.
const MOST_BINS: usize = 1 << 17;

/// The frequency bins that count: `bins` of each axis in a period, of which a disc (in landing points) is kept.
pub(super) struct FrequencyBand {
    pub bins: [usize; 2],
    /// First kept bin of each axis, counted from zero frequency; may be outside the transform's own period.
    pub first: [i64; 2],
    /// Number of kept bins of each axis.
    pub count: [usize; 2],
    /// Kept rows of each kept column, counted from `first`.
    pub rows: Vec<Range<usize>>,
    pub fade: Fade,
}

impl FrequencyBand {
    pub(crate) fn choose(
        lattice: Lattice,
        radius_um: f64,
        wavelength_um: f64,
        window: &Window,
        accuracy: Accuracy,
    ) -> Result<Self> {
        let sizes = FadeSizes::new(radius_um, wavelength_um, window, accuracy);
        let steps = lattice.steps_um();
        let bins = steps.map(|step| fft_size((sizes.period_um / step).ceil() as usize));
        let [x, y] = periods_um(bins, &lattice);
        Self::new(lattice, wavelength_um, window, bins, sizes.ends_um(x.min(y)))
    }

    /// Band with a period and a fade of the caller's: `fade_um` is where it begins and where it ends.
    pub(crate) fn new(
        lattice: Lattice,
        wavelength_um: f64,
        window: &Window,
        bins: [usize; 2],
        fade_um: [f64; 2],
    ) -> Result<Self> {
        window.check(wavelength_um)?;
        let [full_um, zero_um] = fade_um;
        let held = bins.iter().all(|bins| (1..=MOST_BINS).contains(bins));
        if !held || full_um.is_nan() || zero_um <= full_um {
            return Err(WaveError::Fade { bins, full_um, zero_um });
        }
        let period_um = periods_um(bins, &lattice);
        let RetainedBins { first, count, rows } =
            RetainedBins::within(window, zero_um, wavelength_um, period_um, [0.0; 2]);
        let mut band = Self {
            bins,
            first,
            count,
            rows,
            fade: Fade {
                period_um,
                full_um,
                zero_um,
                relabelled: 0,
            },
        };
        band.fade.relabelled = band.relabelled();
        Ok(band)
    }

    fn relabelled(&self) -> u64 {
        let own = |axis: usize, range: &Range<usize>| {
            let (first, bins) = (self.first[axis], self.bins[axis] as i64);
            let start = (first + range.start as i64).max(-(bins / 2));
            let end = (first + range.end as i64).min(bins - bins / 2);
            (end - start).max(0) as u64
        };
        let mut moved = 0;
        for (k, rows) in self.rows.iter().enumerate() {
            let kept = if own(0, &(k..k + 1)) == 1 { own(1, rows) } else { 0 };
            moved += rows.len() as u64 - kept;
        }
        moved
    }
}

/// Sizes of a fade and of a period, for a lens and a window.
pub(super) struct FadeSizes {
    /// Distance from the window's middle where the fade begins, and its least width (um).
    full_um: f64,
    width_um: f64,
    /// Shortest period that keeps images apart (um).
    pub period_um: f64,
    /// What a period has beside the fade, where rounding it up makes the fade wider (um).
    beside_um: Option<f64>,
}

impl FadeSizes {
    pub(super) fn new(radius_um: f64, wavelength_um: f64, window: &Window, accuracy: Accuracy) -> Self {
        let half = window.half_width_um();
        let edge = edge_um(window, wavelength_um, radius_um + half);
        let gain = std::f64::consts::PI * radius_um * radius_um / (wavelength_um * window.distance_um);
        let (full_um, width_um) = match accuracy {
            Accuracy::Accurate => {
                let corner = half * std::f64::consts::SQRT_2;
                let wider = (FADE_GAIN / gain).cbrt().clamp(1.0, 2.0);
                (radius_um + corner + FADE_MARGINS[0] * edge, FADE_WIDTHS * wider * edge)
            }
            Accuracy::Fast => (radius_um + half, FAST_FADE_WIDTHS * edge),
        };
        let period_um = match accuracy {
            Accuracy::Accurate => full_um + width_um + FADE_MARGINS[1] * edge + radius_um + half,
            Accuracy::Fast if gain * FAST_STRAY > 1.0 => FAST_PERIOD * (radius_um + half),
            Accuracy::Fast => 2.0 * (radius_um + half) + FAST_MARGIN * edge,
        };
        Self {
            full_um,
            width_um,
            period_um,
            beside_um: (accuracy == Accuracy::Accurate).then(|| radius_um + half + FADE_MARGINS[1] * edge),
        }
    }

    /// Begin and end of the fade in a period (um). What rounding an accurate one up leaves makes the fade wider; it costs nothing.
    pub(super) fn ends_um(&self, period_um: f64) -> [f64; 2] {
        let zero_um = self
            .beside_um
            .map_or(self.full_um + self.width_um, |beside| period_um - beside);
        [self.full_um, zero_um]
    }
}

/// Bins whose rays land within the end of a fade.
pub(super) struct RetainedBins {
    /// First one of each axis, counted from zero frequency.
    pub first: [i64; 2],
    /// Number of each axis.
    pub count: [usize; 2],
    /// Rows of each column, counted from `first`.
    pub rows: Vec<Range<usize>>,
}

impl RetainedBins {
    /// Bins of a period, `offset` of a bin beyond whole numbers, whose rays land within `zero_um` of a window's middle.
    pub(super) fn within(
        window: &Window,
        zero_um: f64,
        wavelength_um: f64,
        period_um: [f64; 2],
        offset: [f64; 2],
    ) -> Self {
        // Bins per unit of sine.
        let per_sine = period_um.map(|period| period / wavelength_um);
        let samples = rim_samples(window, zero_um, per_sine[0].max(per_sine[1]));
        let rim: Vec<[i64; 2]> = (0..samples)
            .map(|i| {
                let sines = rim_sines(window, zero_um, i as f64 / samples as f64);
                [0, 1].map(|a| (sines[a] * per_sine[a] - offset[a]).floor() as i64)
            })
            .collect();
        let first = [0, 1].map(|a| rim.iter().map(|b| b[a]).min().unwrap_or(0));
        let highest = [0, 1].map(|a| rim.iter().map(|b| b[a]).max().unwrap_or(0) + 1);
        let count = [0, 1].map(|a| (highest[a] - first[a] + 1) as usize);
        let mut rows = vec![Range::<usize>::default(); count[0]];
        for b in &rim {
            let [column, row] = [0, 1].map(|a| (b[a] - first[a]) as usize);
            for r in &mut rows[column..=column + 1] {
                let start = if r.end == 0 { row } else { r.start.min(row) };
                *r = start..r.end.max(row + 2);
            }
        }
        Self { first, count, rows }
    }
}

/// Sines of the ray to a place on the rim of the disc of kept rays, by its turn about the window's middle.
pub(super) fn rim_sines(window: &Window, zero_um: f64, turn: f64) -> [f64; 2] {
    let (sin, cos) = (std::f64::consts::TAU * turn).sin_cos();
    let x = window.centre_um[0] + zero_um * cos;
    let y = window.centre_um[1] + zero_um * sin;
    let ray = (x * x + y * y + window.distance_um * window.distance_um).sqrt();
    [x / ray, y / ray]
}

/// Samples along the rim of the disc of kept rays, of which neighbours are a quarter of a bin or less apart where there are
/// `per_sine` bins per unit of sine: sines change by no more than places do over the length of a ray.
fn rim_samples(window: &Window, zero_um: f64, per_sine: f64) -> usize {
    let [x, y] = window.centre_um;
    let z = window.distance_um;
    let shortest_ray = (x.hypot(y) - zero_um).hypot(z);
    // In whole distances: up to 60 degrees the samples are those of a rim at its foot.
    let ray = (shortest_ray / z).floor().max(1.0) * z;
    (8.0 * std::f64::consts::PI * zero_um / ray * per_sine).ceil() as usize + 64
}

/// Length of so many places of the grid of a lattice along each axis (um).
fn periods_um(bins: [usize; 2], lattice: &Lattice) -> [f64; 2] {
    let steps = lattice.steps_um();
    [0, 1].map(|a| bins[a] as f64 * steps[a])
}

/// Size of the diffraction of a sharp edge along the steepest ray that is needed, which lands `reach_um` from the
/// window's middle (um).
fn edge_um(window: &Window, wavelength_um: f64, reach_um: f64) -> f64 {
    let [x, y] = window.centre_um;
    let z = window.distance_um;
    let landing = x.hypot(y) + reach_um;
    let cosine = z / landing.hypot(z);
    (wavelength_um * z / cosine.powi(3)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every frequency whose ray lands within the rim is kept, however steep the rim is, and a steep rim takes no more samples
    /// than twice those of sines that go from none to one.
    #[test]
    fn a_band_holds_all_rays_within_its_rim() {
        let lattice = Lattice::new(350, 400).unwrap();
        let (um, bins) = (0.5, [160, 180]);
        for (z, zero, centre_um) in [
            (100.0, 40.0, [0.0, 0.0]),
            (10.0, 60.0, [3.0, -2.0]),
            (5.0, 400.0, [50.0, 20.0]),
            (20.0, 60.0, [60.0, 0.0]),
            (30.0, 60.0, [120.0, 160.0]),
        ] {
            let window = Window {
                centre_um,
                step_um: 0.5,
                samples: 8,
                distance_um: z,
            };
            let band = FrequencyBand::new(lattice, um, &window, bins, [0.5 * zero, zero]).unwrap();
            let per_sine = band.fade.period_um.map(|period| period / um);
            let kept = |bin: [i64; 2]| {
                let [column, row] = [0, 1].map(|a| usize::try_from(bin[a] - band.first[a]).unwrap_or(usize::MAX));
                band.rows.get(column).is_some_and(|rows| rows.contains(&row))
            };
            let mut inside = 0;
            let reach = per_sine.map(|most| most.ceil() as i64);
            for (kx, ky) in (-reach[0]..=reach[0]).flat_map(|kx| (-reach[1]..=reach[1]).map(move |ky| (kx, ky))) {
                let [x, y] = [kx as f64 / per_sine[0], ky as f64 / per_sine[1]];
                let cosine = (1.0 - x * x - y * y).max(0.0).sqrt();
                let away = (z * x / cosine - centre_um[0]).hypot(z * y / cosine - centre_um[1]);
                if away < zero {
                    inside += 1;
                    assert!(kept([kx, ky]), "{z}, {zero}, {centre_um:?}: bin {kx}, {ky}");
                }
            }
            assert!(inside > 0, "{z}, {zero}, {centre_um:?}");
        }
        let steep = Window::about([0.0; 2], 0.5, 8, 1.0);
        let most = (2.0 * 8.0 * std::f64::consts::PI * 100.0) as usize + 65;
        assert!(rim_samples(&steep, 1e6, 100.0) <= most);
    }
}
