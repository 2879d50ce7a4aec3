//! Expected image error as a merit that solvers climb: its slopes by the transmissions of all rings.

use num_complex::{Complex32, Complex64};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::Objective;
use crate::image::deconvolution::{Channel, Deconvolution, bracket};
use crate::image::imaging::Imaging;

impl Deconvolution {
    /// Merit over the given channels at phases, widths not rounded; its gradient (1/turn) is added.
    fn climb_channels(&self, waves: &[f64], channels: &[Channel], gradient: &mut [f64]) -> f64 {
        let (widths_nm, rises): (Vec<_>, Vec<_>) = waves.iter().map(|&t| self.mapping.width_nm(t)).unzip();
        let (merit, slopes) = self.evaluate(&widths_nm, channels, true);
        // View after view: the same on any number of threads.
        for slope in slopes {
            let table = &self.tables[slope.length];
            for (ring, g) in gradient.iter_mut().enumerate() {
                let (low, _) = bracket(table, widths_nm[ring]);
                let dt = table[low + 1] - table[low];
                *g += 2.0 * (f64::from(slope.re[ring]) * dt.re + f64::from(slope.im[ring]) * dt.im) * rises[ring];
            }
        }
        merit
    }

    /// Merit over the given channels and, if asked for, its slopes at every view of them.
    fn evaluate(&self, widths_nm: &[f64], channels: &[Channel], with_slopes: bool) -> (f64, Vec<Slope>) {
        let scale = -1.0 / (self.views.scene.contrast.powi(2) * channels.len() as f64);
        let (mut merit, mut slopes) = (0.0, Vec::new());
        for group in channels.chunk_by(in_one_group()) {
            let views = group
                .iter()
                .flat_map(|c| c.lengths.iter().map(|&length| (c.angle, length)))
                .collect::<Vec<_>>();
            let mut done = views
                .par_iter()
                .map(|&(angle, length)| {
                    let t = self.transmissions(length, widths_nm);
                    let (pupil, buffers) = (&self.pupils[angle][length], self.buffers.take());
                    let mut imaging = Imaging::new(pupil, self.views.window, buffers);
                    let transfer = imaging.transfer(&t.0, &t.1);
                    (imaging, transfer)
                })
                .collect::<Vec<_>>();
            let mut by_transfer = vec![vec![Complex64::ZERO; self.spectrum.modes()]; views.len()];
            let mut first = 0;
            for channel in group {
                let own = first..first + channel.lengths.len();
                first = own.end;
                let blurs = done[own.clone()].iter().map(|(_, h)| &h[..]).collect::<Vec<_>>();
                let wanted = with_slopes.then(|| &mut by_transfer[own]);
                merit += scale * self.error(&blurs, scale, wanted);
            }
            if with_slopes {
                let narrow = |s: &Complex64| Complex32::new(s.re as f32, s.im as f32);
                let by_ring = done
                    .par_iter_mut()
                    .zip(&by_transfer)
                    .zip(&views)
                    .map(|((done, slope), view)| {
                        let slope = slope.iter().map(narrow).collect::<Vec<_>>();
                        let (mut re, mut im) = (vec![0.0; self.rings], vec![0.0; self.rings]);
                        done.0.adjoint(&slope, &mut re, &mut im);
                        Slope { length: view.1, re, im }
                    });
                slopes.par_extend(by_ring);
            }
            done.into_iter().for_each(|(imaging, _)| self.buffers.put_back(imaging));
        }
        (merit, slopes)
    }
}

/// Derivative of the merit by the conjugate of the transmission of each ring, at one view.
struct Slope {
    length: usize,
    re: Vec<f32>,
    im: Vec<f32>,
}

/// Channels are taken together until they have this many views: enough for all threads, not too many to hold
/// the fields of.
const VIEWS_AT_A_TIME: usize = 24;

/// True if a channel still belongs to the group of the one before.
fn in_one_group() -> impl FnMut(&Channel, &Channel) -> bool {
    let mut views = 0;
    move |one: &Channel, next: &Channel| {
        views += one.lengths.len();
        let together = views + next.lengths.len() <= VIEWS_AT_A_TIME;
        if !together {
            views = 0;
        }
        together
    }
}

impl Objective for Deconvolution {
    fn merit(&self, widths_nm: &[u16]) -> f64 {
        let widths_nm = widths_nm.iter().map(|&w| f64::from(w)).collect::<Vec<_>>();
        self.evaluate(&widths_nm, &self.channels(|all| all.collect()), false).0
    }

    /// Over some wavelengths of each channel, drawn afresh for each angle and step.
    fn climb(&self, waves: &[f64], seed: u64, step: u32, gradient: &mut [f64]) -> f64 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(u64::from(step));
        let drawn = self.channels(|all| {
            let mut some = all.collect::<Vec<_>>();
            some.shuffle(&mut random);
            some.truncate(self.views.drawn);
            some
        });
        self.climb_channels(waves, &drawn, gradient)
    }

    fn expand(&self, widths_nm: &[u16], gains: &mut [f64]) -> f64 {
        let exact = widths_nm.iter().map(|&w| f64::from(w)).collect::<Vec<_>>();
        let (merit, slopes) = self.evaluate(&exact, &self.channels(|all| all.collect()), true);
        // One wavelength has one transmission at all angles.
        let mut sums = vec![vec![Complex64::ZERO; self.tables.len()]; self.rings];
        for slope in slopes {
            for (sum, (&re, &im)) in sums.iter_mut().zip(slope.re.iter().zip(&slope.im)) {
                sum[slope.length] += Complex64::new(re.into(), im.into());
            }
        }
        let choices = self.mapping.choices();
        gains
            .par_chunks_exact_mut(choices.len())
            .zip(&sums)
            .zip(widths_nm)
            .for_each(|((gains, sum), &now)| {
                for (table, slope) in self.tables.iter().zip(sum) {
                    for (gain, choice) in gains.iter_mut().zip(choices) {
                        let change = table[usize::from(choice.width_nm)] - table[usize::from(now)];
                        *gain += 2.0 * (slope.re * change.re + slope.im * change.im);
                    }
                }
            });
        merit
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Start;
    use crate::image::deconvolution::tests::small;

    #[test]
    fn the_gradient_is_that_of_differences() {
        /// Single precision of the transforms, over steps of 4e-3 waves.
        const TOLERANCE: f64 = 2e-2;
        let (lens, problem) = small();
        let waves = Start::LogAsphere { band_um: (0.4, 0.7) }
            .waves(&lens, 0)
            .into_iter()
            .map(|t| {
                // Half way between whole widths, where transmission is a straight line.
                let (width, slope) = problem.mapping.width_nm(t);
                t + (width.floor() + 0.5 - width) / slope
            })
            .collect::<Vec<_>>();
        let all = problem.channels(|all| all.collect());
        let mut gradient = vec![0.0; waves.len()];
        problem.climb_channels(&waves, &all, &mut gradient);
        let largest = gradient.iter().map(|g| g.abs()).fold(0.0, f64::max);
        let h = 1.5e-3;
        // Away from the end of a turn, where the width jumps.
        let smooth = |&ring: &usize| (0.05..0.95).contains(&waves[ring].rem_euclid(1.0));
        for ring in (0..waves.len()).step_by(9).filter(smooth) {
            let at = |h: f64| {
                let mut moved = waves.clone();
                moved[ring] += h;
                problem.climb_channels(&moved, &all, &mut vec![0.0; moved.len()])
            };
            let difference = (at(h) - at(-h)) / (2.0 * h);
            let error = (difference - gradient[ring]).abs() / largest;
            assert!(error < TOLERANCE, "ring {ring}: {difference} {}", gradient[ring]);
        }
    }

    /// Gain of a choice to first order, against the merit with the next wider and the next narrower pillar: half their
    /// difference is free of the second order.
    #[test]
    fn first_order_gains_are_those_of_differences() {
        /// Third order over steps of 2 nm, and single precision of the transforms.
        const TOLERANCE: f64 = 2e-2;
        let (lens, problem) = small();
        let choices = problem.mapping.choices();
        let start = Start::LogAsphere { band_um: (0.4, 0.7) }.waves(&lens, 0);
        let chosen = start
            .iter()
            .map(|&t| problem.mapping.nearest(t).clamp(1, choices.len() - 2))
            .collect::<Vec<_>>();
        let widths = problem.mapping.widths_of(&chosen);
        let mut gains = vec![0.0; widths.len() * choices.len()];
        assert_eq!(problem.expand(&widths, &mut gains), problem.merit(&widths));
        let of = |ring: usize| {
            let gain = |choice: usize| gains[ring * choices.len() + choice];
            0.5 * (gain(chosen[ring] + 1) - gain(chosen[ring] - 1))
        };
        let largest = (0..widths.len()).map(|ring| of(ring).abs()).fold(0.0, f64::max);
        for ring in (0..widths.len()).step_by(11) {
            let at = |choice: usize| {
                let mut moved = widths.clone();
                moved[ring] = choices[choice].width_nm;
                problem.merit(&moved)
            };
            let difference = 0.5 * (at(chosen[ring] + 1) - at(chosen[ring] - 1));
            let error = (difference - of(ring)).abs() / largest;
            assert!(error < TOLERANCE, "ring {ring}: {difference} {}", of(ring));
            assert_eq!(gains[ring * choices.len() + chosen[ring]], 0.0);
        }
    }
}
