//! Synthetic sets: made with another sampling, another number of orders and other draws than fits use, with any
//! effects, listed or not.

use std::sync::Arc;

use ndarray::Array2;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::bench::{Bench, BenchSampling, IlluminatedChip};
use crate::cells::{CellSource, RigorousCells};
use crate::effects;
use crate::optics::PixelGrid;
use crate::session::{Settings, check_effects};
use crate::set::{MeasuredSet, PerLed, PerMeasurement};
use crate::simulator::{Simulator, WIDTH_ROOM_NM};
use metalith_core::{Error, Progress, Result};
use metalith_optics::Perturbation;

/// Diffraction orders along an axis; fits use others.
pub(crate) const ORDERS: usize = 11;

/// And for the change by tapered walls, which takes six layers.
const TAPER_ORDERS: usize = 9;

/// Seed of the places of missing pillars.
const MISSING_SEED: u64 = 77;

/// Standard deviation of the black level of a synthetic set (DN).
const BLACK_DN: f64 = 0.1;

/// Effects that are not listed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum UnlistedEffect {
    /// A bowed substrate: astigmatism along the axes (nm rms of path), where it is left out of the list.
    Astigmatism(f64),
    /// A second image: its brightness, relative to the first, and its offset (um).
    Ghost(f64, [f64; 2]),
    /// Pillars wider along x and narrower along y (nm).
    Anisotropy(f64),
}

/// Makes sets like a measured one.
pub struct Synthesizer<'a> {
    simulator: Simulator<'a>,
}

/// The images of a synthetic set before noise, and what its widths follow from.
pub struct SyntheticImages {
    images: Vec<PixelGrid>,
    ghost: Option<(f64, [f64; 2])>,
    perturbation: Perturbation,
}

impl<'a> Synthesizer<'a> {
    /// Synthesizer of `like`: its layout, measurements and noise.
    ///
    /// # Errors
    /// If a material is not known.
    pub fn new(like: &'a MeasuredSet, settings: &Settings) -> Result<Self> {
        Self::with_orders(like, settings, ORDERS)
    }

    /// This synthesizer with cells solved with so many orders along an axis.
    ///
    /// # Errors
    /// As [`Synthesizer::new`].
    pub fn with_orders(like: &'a MeasuredSet, settings: &Settings, orders: usize) -> Result<Self> {
        let s = settings.sampling;
        let sampling = BenchSampling {
            spectrum: 0.85 * s.spectrum,
            step_nm: 0.85 * s.step_nm,
            step_um: 0.9 * s.step_um,
            margin: s.margin + 5,
        };
        let mut bench = Bench::new(like, sampling);
        bench.follows = false;
        let (low, high) = bench.widths_nm();
        let cells = RigorousCells::new(
            like.stack.cell.clone(),
            bench.wavelengths_nm(),
            (low - WIDTH_ROOM_NM, high + WIDTH_ROOM_NM),
            settings.cache.clone(),
        )
        .with_orders(orders, TAPER_ORDERS);
        let effects = effects::with_declared(like, &settings.declared)?;
        let mut simulator = Simulator::new(bench, CellSource::Rigorous(Box::new(cells)), effects);
        // Fits use the mean of missing pillars; here single ones are missing.
        simulator.scatter = Some(MISSING_SEED);
        Ok(Self { simulator })
    }

    /// Images with one effect; no effect if its name is empty.
    ///
    /// # Errors
    /// If the effect is not known, or a cell cannot be solved.
    pub fn with_effect(&self, name: &str, numbers: &[f64], progress: &dyn Progress) -> Result<SyntheticImages> {
        Ok(self.with_effects(&[vec![(name, numbers)]], progress)?.remove(0))
    }

    /// Images of many chips at once, each with any number of effects.
    ///
    /// # Errors
    /// As [`Synthesizer::with_effect`].
    pub fn with_effects(&self, chips: &[Vec<(&str, &[f64])>], progress: &dyn Progress) -> Result<Vec<SyntheticImages>> {
        let mut perturbations = Vec::new();
        for chip in chips {
            let mut perturbation = Perturbation::default();
            for (name, numbers) in chip.iter().filter(|(name, _)| !name.is_empty()) {
                check_effects(&self.simulator.effects, &[(*name).to_owned()])?;
                if let Some(effect) = self.simulator.effects.iter().find(|e| e.name() == *name) {
                    effect.apply(numbers, &mut perturbation);
                }
            }
            perturbations.push(perturbation);
        }
        let images = self.simulator.expose(&perturbations, progress)?;
        Ok(images
            .into_iter()
            .zip(perturbations)
            .map(|(images, perturbation)| SyntheticImages {
                images,
                ghost: None,
                perturbation,
            })
            .collect())
    }

    /// Images with an effect that is not listed.
    ///
    /// # Errors
    /// If a cell cannot be solved.
    pub fn off_list(&self, what: UnlistedEffect, progress: &dyn Progress) -> Result<SyntheticImages> {
        let mut perturbation = Perturbation::default();
        match what {
            UnlistedEffect::Astigmatism(nm) => {
                perturbation.geometry.wavefront_nm = vec![0.0, nm];
                self.expose(perturbation, None, progress)
            }
            UnlistedEffect::Ghost(share, at) => self.expose(perturbation, Some((share, at)), progress),
            UnlistedEffect::Anisotropy(nm) => {
                let tables = match &self.simulator.cells {
                    CellSource::Rigorous(cells) => cells.anisotropic(nm, progress)?,
                    CellSource::Model(_) => {
                        return Err(Error::refused(
                            "calibrate/no-rigorous-cells",
                            "the set is not simulated with rigorous cells",
                            "give a set whose cell is rigorous: synthetic sets need it",
                        ));
                    }
                };
                let chips = tables.map(|table| IlluminatedChip {
                    cells: Arc::new(table),
                    rim: None,
                    geometry: &perturbation.geometry,
                    lights: vec![&perturbation.light],
                    every: 1,
                    scatter: None,
                });
                let planes = self.simulator.bench.intensities(&chips, &perturbation.path, progress)?;
                let both: PerMeasurement<Vec<f32>> = planes[0][0]
                    .iter()
                    .zip(&planes[1][0])
                    .map(|(x, y)| x.iter().zip(y).map(|(a, b)| 0.5 * (a + b)).collect())
                    .collect();
                Ok(SyntheticImages {
                    images: self.simulator.bench.grids(&both, &perturbation),
                    ghost: None,
                    perturbation,
                })
            }
        }
    }

    fn expose(
        &self,
        perturbation: Perturbation,
        ghost: Option<(f64, [f64; 2])>,
        progress: &dyn Progress,
    ) -> Result<SyntheticImages> {
        let images = self
            .simulator
            .expose(std::slice::from_ref(&perturbation), progress)?
            .remove(0);
        Ok(SyntheticImages {
            images,
            ghost,
            perturbation,
        })
    }

    /// A set with registration, flux, black level and noise drawn from `seed`.
    pub fn draw(&self, exposed: &SyntheticImages, seed: u64) -> MeasuredSet {
        self.drawn(exposed, seed, 1.0)
    }

    /// Set without noise, in captures and in widths by SEM: the error of a fit to it is the model's own error.
    pub fn draw_noiseless(&self, exposed: &SyntheticImages, seed: u64) -> MeasuredSet {
        self.drawn(exposed, seed, 0.0)
    }

    /// Set with so many times the noise.
    fn drawn(&self, exposed: &SyntheticImages, seed: u64, noise: f64) -> MeasuredSet {
        let like = self.simulator.bench.set();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut set = like.clone();
        let camera = like.camera;
        let flux: PerLed<f64> = like
            .leds
            .iter()
            .map(|_| 1.0 + camera.flux_sigma * normal(&mut rng))
            .collect();
        let black = camera.black_level_dn + BLACK_DN * normal(&mut rng);
        let reach = camera.registration_sigma_px * camera.pixel_um;
        for (measurement, grid) in set.measurements.iter_mut().zip(&exposed.images) {
            let shift = [reach * normal(&mut rng), reach * normal(&mut rng)];
            let mut light: Array2<f32> = grid.pixels(shift);
            if let Some((share, at)) = exposed.ghost {
                // A window that is off by the negative shows what is displaced.
                light.scaled_add(share as f32, &grid.pixels([shift[0] - at[0], shift[1] - at[1]]));
            }
            let factor = measurement.scale_dn * flux[measurement.led];
            let (frames, own) = (measurement.frames, &measurement.noise);
            measurement.dn = Array2::from_shape_fn(light.dim(), |at| {
                let signal = (f64::from(light[at]) * factor).max(0.0);
                let variance = match own {
                    Some(own) if own[at].is_finite() => f64::from(own[at]),
                    Some(_) => 0.0,
                    None => camera.variance_dn2(signal, frames),
                };
                (black + signal + noise * variance.sqrt() * normal(&mut rng)) as f32
            });
        }
        let offset = noise * like.sem_offset_sigma_nm * normal(&mut rng);
        for site in &mut set.sem {
            let Some((element, at)) = like.site_of(site) else {
                continue;
            };
            let bias = self
                .simulator
                .bench
                .bias_nm(element, at, &exposed.perturbation.geometry);
            site.measured_nm = site.designed_nm + bias + offset + noise * site.sigma_nm * normal(&mut rng);
        }
        set
    }
}

/// A draw from the normal distribution.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}
