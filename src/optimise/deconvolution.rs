//! The merit `deconvolution`: the error to be expected of images after inverse filtering, over
//! wavelengths and field angles.

use std::ops::Range;

use num_complex::{Complex32, Complex64};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::Objective;
use super::focus::Lens;
use super::imaging::{Imaging, Transfer};
use super::mapping::Mapping;
use super::pupil::{Pupil, USED, Window};
use super::wiener::{Scene, Spectrum};
use crate::cell::CellModel;
use crate::error::{Error, Result};
use crate::progress::Progress;

/// What the merit is taken over.
#[derive(Clone, Debug, PartialEq)]
pub struct Views {
    /// Wavelengths [um], ascending.
    pub wavelengths_um: Vec<f64>,
    /// Field angles in the x-z plane [rad].
    pub angles_rad: Vec<f64>,
    /// Colour channels: the wavelengths are split evenly among them.
    pub channels: usize,
    /// The window, larger than the blur by a quarter at least.
    pub window: Window,
    /// Weight, 0 to 1, of the error if one filter must serve the blurs of all wavelengths of a channel, as in
    /// a camera it must (the regulariser of the paper); the rest is with a filter for each wavelength.
    pub shared_filter: f64,
    /// Wavelengths of each channel that a step of the optimiser draws.
    pub drawn: usize,
    /// Scene and noise.
    pub scene: Scene,
}

impl Default for Views {
    /// 400 to 700 nm every 10 nm; 0, 15 and 30 degrees; three channels; 160 pixels of 5.86 um.
    fn default() -> Self {
        Self {
            wavelengths_um: super::wavelengths(400.0, 700.0, 10.0),
            angles_rad: [0.0f64, 15.0, 30.0].map(f64::to_radians).to_vec(),
            channels: 3,
            window: Window {
                pixels: 160,
                pixel_um: 5.86,
            },
            shared_filter: 0.5,
            drawn: 3,
            scene: Scene::default(),
        }
    }
}

/// Expected image error as a function of the phases of the rings. Larger merits are better: the merit is
/// less the mean square error, in units of the variance of the scene.
pub struct Deconvolution {
    views: Views,
    rings: usize,
    mapping: Mapping,
    spectrum: Spectrum,
    /// `[angle][wavelength]`.
    pupils: Vec<Vec<Pupil>>,
    /// Transmission over its full value by whole width, one for each wavelength.
    tables: Vec<Vec<Complex64>>,
}

/// Wavelengths of one channel at one angle, by index.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Channel {
    angle: usize,
    lengths: Vec<usize>,
}

impl Deconvolution {
    /// Build the kernels of all views.
    ///
    /// # Errors
    /// If the views are empty or do not fit `memory_bytes`, the cell does not cover them, or the user
    /// stopped.
    pub fn new(
        lens: &Lens,
        views: Views,
        cell: &dyn CellModel,
        mapping: Mapping,
        memory_bytes: u64,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let (angles, lengths) = (views.angles_rad.len(), views.wavelengths_um.len());
        if angles == 0 || views.channels == 0 || lengths < 2 * views.channels || !views.window.pixels.is_multiple_of(2)
        {
            return Err(Error::invalid(
                format!(
                    "{lengths} wavelengths in {} channels at {angles} angles",
                    views.channels
                ),
                "give at least two wavelengths a channel, one angle, and an even number of pixels",
            ));
        }
        let widest = usize::from(mapping.max_width_nm()) + 1;
        let tables = views
            .wavelengths_um
            .par_iter()
            .map(|&wavelength| {
                let full = cell.full_transmission(wavelength)?;
                let pure = cell.transmissions(wavelength, widest as u16)?;
                Ok(pure.into_iter().map(|t| t / full).collect())
            })
            .collect::<Result<Vec<_>>>()?;
        progress.begin("kernels of all views", (angles * lengths) as u64);
        let used = std::sync::atomic::AtomicU64::new(0);
        let pupils = views
            .angles_rad
            .par_iter()
            .map(|&angle| {
                let offset = window_offset_um(lens, angle, views.window.side_um());
                views
                    .wavelengths_um
                    .par_iter()
                    .map(|&wavelength| {
                        if progress.stopped() {
                            return Err(Error::Interrupted);
                        }
                        let pupil = Pupil::new(lens, wavelength, angle, views.window, offset)?;
                        let bytes = pupil.bytes();
                        let so_far = used.fetch_add(bytes, std::sync::atomic::Ordering::Relaxed) + bytes;
                        if so_far > memory_bytes {
                            return Err(Error::invalid(
                                format!(
                                    "the kernels of {} views take more than {memory_bytes} bytes",
                                    angles * lengths
                                ),
                                "take fewer wavelengths or angles or a smaller window, or raise `memory_mb`",
                            ));
                        }
                        progress.advance(1);
                        Ok(pupil)
                    })
                    .collect()
            })
            .collect::<Result<Vec<Vec<_>>>>()?;
        Ok(Self {
            rings: lens.rings.len(),
            spectrum: Spectrum::new(&views.scene, views.window),
            views,
            mapping,
            pupils,
            tables,
        })
    }

    /// What the merit is taken over.
    pub fn views(&self) -> &Views {
        &self.views
    }

    /// Bytes that all kernels take.
    pub fn bytes(&self) -> u64 {
        self.pupils.iter().flatten().map(Pupil::bytes).sum()
    }

    /// Transfer function of each view, `[angle][wavelength]`, with pillars of `widths_nm[k]` in ring `k`.
    /// Shape of each: `[j][i]`, frequencies (i, j) / window from zero to the pixels' Nyquist.
    pub fn transfers(&self, widths_nm: &[f64]) -> Vec<Vec<Transfer>> {
        (0..self.pupils.len())
            .into_par_iter()
            .map(|angle| {
                (0..self.tables.len())
                    .into_par_iter()
                    .map(|length| {
                        let t = self.transmissions(length, widths_nm);
                        Imaging::new(&self.pupils[angle][length], self.views.window).transfer(&t.0, &t.1)
                    })
                    .collect()
            })
            .collect()
    }

    /// Expected peak signal-to-noise ratio of restored images [dB], white being one: over all views, and at
    /// each angle.
    pub fn expected_psnr(&self, widths_nm: &[f64]) -> (f64, Vec<f64>) {
        let transfers = self.transfers(widths_nm);
        let mut errors = vec![0.0; self.pupils.len()];
        for channel in self.channels(|all| all.collect()) {
            let blurs = channel
                .lengths
                .iter()
                .map(|&l| &transfers[channel.angle][l][..])
                .collect::<Vec<_>>();
            errors[channel.angle] += self.error(&blurs, 0.0, None) / self.views.channels as f64;
        }
        let decibel = |e: f64| -10.0 * e.log10();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        (decibel(mean), errors.into_iter().map(decibel).collect())
    }

    /// Mean square error of one channel: each wavelength with a filter of its own, and all with one.
    fn error(&self, blurs: &[&[Complex32]], scale: f64, mut slopes: Option<&mut [Vec<Complex64>]>) -> f64 {
        let shared = self.views.shared_filter;
        let own = (1.0 - shared) / blurs.len() as f64;
        let mut sum = shared * self.spectrum.error(blurs, scale * shared, slopes.as_deref_mut());
        for i in 0..blurs.len() {
            let slope = slopes.as_deref_mut().map(|s| &mut s[i..=i]);
            sum += own * self.spectrum.error(&blurs[i..=i], scale * own, slope);
        }
        sum
    }

    /// Every channel at every angle, with the wavelengths that `choose` takes from all of it.
    fn channels(&self, mut choose: impl FnMut(Range<usize>) -> Vec<usize>) -> Vec<Channel> {
        let (count, channels) = (self.tables.len(), self.views.channels);
        (0..self.pupils.len() * channels)
            .map(|i| {
                let channel = i % channels;
                Channel {
                    angle: i / channels,
                    lengths: choose(channel * count / channels..(channel + 1) * count / channels),
                }
            })
            .collect()
    }

    fn transmissions(&self, length: usize, widths_nm: &[f64]) -> (Vec<f32>, Vec<f32>) {
        let table = &self.tables[length];
        widths_nm
            .iter()
            .map(|&w| {
                let low = (w.max(0.0) as usize).min(table.len() - 2);
                let t = table[low] + (table[low + 1] - table[low]) * (w - low as f64);
                (t.re as f32, t.im as f32)
            })
            .unzip()
    }

    /// Merit over the given channels and, if asked for, its gradient [1/turn], added.
    fn evaluate(&self, turns: &[f64], channels: &[Channel], gradient: Option<&mut [f64]>) -> f64 {
        let widths = turns.iter().map(|&t| self.mapping.width_nm(t)).collect::<Vec<_>>();
        let widths_nm = widths.iter().map(|w| w.0).collect::<Vec<_>>();
        let views = channels
            .iter()
            .flat_map(|c| c.lengths.iter().map(|&length| (c.angle, length)))
            .collect::<Vec<_>>();
        let mut done = views
            .par_iter()
            .map(|&(angle, length)| {
                let t = self.transmissions(length, &widths_nm);
                let mut imaging = Imaging::new(&self.pupils[angle][length], self.views.window);
                let transfer = imaging.transfer(&t.0, &t.1);
                (imaging, transfer)
            })
            .collect::<Vec<_>>();
        let mut slopes = vec![vec![Complex64::ZERO; self.spectrum.modes()]; views.len()];
        let scale = -1.0 / (self.views.scene.contrast.powi(2) * channels.len() as f64);
        let (mut total, mut first) = (0.0, 0);
        for channel in channels {
            let group = first..first + channel.lengths.len();
            first = group.end;
            let blurs = done[group.clone()].iter().map(|(_, h)| &h[..]).collect::<Vec<_>>();
            let wanted = gradient.is_some().then(|| &mut slopes[group]);
            total += scale * self.error(&blurs, scale, wanted);
        }
        if let Some(gradient) = gradient {
            // Each view by itself, then summed in order: the same on any number of threads.
            let parts = done
                .par_iter_mut()
                .zip(&slopes)
                .zip(&views)
                .map(|(((imaging, _), slope), &(_, length))| {
                    let slope = slope
                        .iter()
                        .map(|s| Complex32::new(s.re as f32, s.im as f32))
                        .collect::<Vec<_>>();
                    let mut g = (vec![0.0; self.rings], vec![0.0; self.rings]);
                    imaging.adjoint(&slope, &mut g.0, &mut g.1);
                    let table = &self.tables[length];
                    (0..self.rings)
                        .map(|ring| {
                            let low = (widths[ring].0.max(0.0) as usize).min(table.len() - 2);
                            let dt = table[low + 1] - table[low];
                            2.0 * (f64::from(g.0[ring]) * dt.re + f64::from(g.1[ring]) * dt.im) * widths[ring].1
                        })
                        .collect::<Vec<_>>()
                })
                .collect::<Vec<_>>();
            for part in parts {
                gradient.iter_mut().zip(part).for_each(|(g, p)| *g += p);
            }
        }
        total
    }
}

impl Objective for Deconvolution {
    fn merit(&self, turns: &[f64]) -> f64 {
        self.evaluate(turns, &self.channels(|all| all.collect()), None)
    }

    /// Over some wavelengths of each channel, drawn afresh for each angle and step.
    fn climb(&self, turns: &[f64], seed: u64, step: u32, gradient: &mut [f64]) -> f64 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(u64::from(step));
        let drawn = self.channels(|all| {
            let mut some = all.collect::<Vec<_>>();
            some.shuffle(&mut random);
            some.truncate(self.views.drawn);
            some
        });
        self.evaluate(turns, &drawn, Some(gradient))
    }
}

/// Middle of the window from where the chief ray lands [um]: half way between the rays from both edges of
/// the lens, if it is a perfect lens for light along its axis.
pub(crate) fn window_offset_um(lens: &Lens, angle_rad: f64, side_um: f64) -> f64 {
    let radius = 0.5e-3 * f64::from(lens.rings.diameter_nm());
    let landing = |x: f64| {
        let sine = (angle_rad.sin() - x / x.hypot(lens.gap_um)).clamp(-0.999, 0.999);
        x + lens.gap_um * sine / (1.0 - sine * sine).sqrt()
    };
    let middle = 0.5 * (landing(radius) + landing(-radius)) - lens.gap_um * angle_rad.tan();
    // No further than leaves the chief ray well within the window's part that is used.
    let most = 0.25 * USED * side_um;
    middle.clamp(-most, most)
}

#[cfg(test)]
mod tests {
    use super::super::mapping::tests::published;
    use super::super::{Rings, Start};
    use super::*;
    use crate::cell::PublishedCell;
    use crate::lattice::Lattice;
    use crate::progress::Silent;

    fn small() -> (Lens, Deconvolution) {
        let rings = Rings::new(Lattice::covering(60_000, 350).unwrap(), 60_000).unwrap();
        let lens = Lens { rings, gap_um: 144.0 };
        let views = Views {
            wavelengths_um: vec![0.45, 0.5, 0.6, 0.65],
            angles_rad: vec![0.0, 0.26],
            channels: 2,
            window: Window {
                pixels: 20,
                pixel_um: 2.93,
            },
            ..Views::default()
        };
        let cell = PublishedCell::new(350);
        let problem = Deconvolution::new(&lens, views, &cell, published(), 1 << 28, &Silent).unwrap();
        (lens, problem)
    }

    #[test]
    fn the_gradient_is_that_of_differences() {
        /// Single precision of the transforms, over steps of 4e-3 turns.
        const TOLERANCE: f64 = 2e-2;
        let (lens, problem) = small();
        let turns = Start::LogAsphere { band_um: (0.4, 0.7) }
            .turns(&lens, 0)
            .into_iter()
            .map(|t| {
                // Half way between whole widths, where transmission is a straight line.
                let (width, slope) = problem.mapping.width_nm(t);
                t + (width.floor() + 0.5 - width) / slope
            })
            .collect::<Vec<_>>();
        let all = problem.channels(|all| all.collect());
        let mut gradient = vec![0.0; turns.len()];
        problem.evaluate(&turns, &all, Some(&mut gradient));
        let largest = gradient.iter().map(|g| g.abs()).fold(0.0, f64::max);
        let h = 1.5e-3;
        // Away from the end of a turn, where the width jumps.
        let smooth = |&ring: &usize| (0.05..0.95).contains(&turns[ring].rem_euclid(1.0));
        for ring in (0..turns.len()).step_by(9).filter(smooth) {
            let at = |h: f64| {
                let mut moved = turns.clone();
                moved[ring] += h;
                problem.merit(&moved)
            };
            let difference = (at(h) - at(-h)) / (2.0 * h);
            let error = (difference - gradient[ring]).abs() / largest;
            assert!(error < TOLERANCE, "ring {ring}: {difference} {}", gradient[ring]);
        }
    }

    /// A sharp lens promises better images than phases at random.
    #[test]
    fn a_lens_is_better_than_a_diffuser() {
        let (lens, problem) = small();
        let psnr = |start: Start| {
            let turns = start.turns(&lens, 1);
            let widths = turns.iter().map(|&t| problem.mapping.width_nm(t).0).collect::<Vec<_>>();
            problem.expected_psnr(&widths).0
        };
        assert!(psnr(Start::Hyperbolic { wavelength_um: 0.55 }) > psnr(Start::Random) + 1.0);
    }

    #[test]
    fn memory_is_bounded() {
        let (lens, problem) = small();
        let cell = PublishedCell::new(350);
        let views = problem.views.clone();
        let built = Deconvolution::new(&lens, views, &cell, published(), problem.bytes() / 2, &Silent);
        assert!(built.is_err());
    }
}
