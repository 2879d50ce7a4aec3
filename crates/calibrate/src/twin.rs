//! Sets of our own, to be judged by: made with another sampling, another number of orders and other draws
//! than fits use, with whatever is asked to differ.

use std::sync::Arc;

use ndarray::Array2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::bench::{Bench, Lit, Sampling};
use super::cells::{CellSource, RigorousCells};
use super::effects;
use super::optics::PixelGrid;
use super::session::{Settings, stated_cell};
use super::set::MeasuredSet;
use super::simulator::{Simulator, WIDTH_ROOM_NM};
use metalith_core::{Error, Progress, Result};
use metalith_made::Perturbation;

/// Orders along an axis; fits use others.
const ORDERS: usize = 11;

/// And what leaning walls change, which takes six layers.
const LEANING_ORDERS: usize = 9;

/// Seed of the places of missing pillars.
const MISSING_SEED: u64 = 77;

/// Standard deviation of the black level of a twin [DN].
const BLACK_DN: f64 = 0.1;

/// What no list of effects knows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OffList {
    /// A bowed substrate: astigmatism along the axes [nm rms of path].
    Astigmatism(f64),
    /// A second image, this bright and so far off [um].
    Ghost(f64, [f64; 2]),
    /// Pillars wider along x and narrower along y [nm].
    Anisotropy(f64),
}

/// Makes sets like one that is given.
pub struct Twins<'a> {
    simulator: Simulator<'a>,
}

/// What the captures of a twin show before noise, and what its widths are.
pub struct Exposed {
    grids: Vec<PixelGrid>,
    ghost: Option<(f64, [f64; 2])>,
    departure: Perturbation,
}

impl<'a> Twins<'a> {
    /// Twins of `like`: its layout, captures and noise.
    ///
    /// # Errors
    /// If a material is not known.
    pub fn new(like: &'a MeasuredSet, settings: &Settings) -> Result<Self> {
        let s = settings.sampling;
        let sampling = Sampling {
            spectrum: 0.85 * s.spectrum,
            step_nm: 0.85 * s.step_nm,
            step_um: 0.9 * s.step_um,
            margin: s.margin + 5,
        };
        let mut bench = Bench::new(like, sampling);
        bench.follows = false;
        let (low, high) = bench.widths_nm();
        let cells = RigorousCells::new(
            stated_cell(like)?,
            bench.wavelengths_nm(),
            (low - WIDTH_ROOM_NM, high + WIDTH_ROOM_NM),
            settings.cache.clone(),
        )
        .with_orders(ORDERS, LEANING_ORDERS);
        let mut simulator = Simulator::new(bench, CellSource::Rigorous(Box::new(cells)), effects::all(like));
        // Fits count with the mean of missing pillars; here single ones are gone.
        simulator.scatter = Some(MISSING_SEED);
        Ok(Self { simulator })
    }

    /// What captures show where an effect has these numbers.
    ///
    /// # Errors
    /// If there is no such effect, or a cell cannot be solved.
    pub fn with_effect(&self, name: &str, numbers: &[f64], progress: &dyn Progress) -> Result<Exposed> {
        Ok(self.with_effects(&[vec![(name, numbers)]], progress)?.remove(0))
    }

    /// The same for many chips at once, each with some effects, or none.
    ///
    /// # Errors
    /// As [`Twins::with_effect`].
    pub fn with_effects(&self, chips: &[Vec<(&str, &[f64])>], progress: &dyn Progress) -> Result<Vec<Exposed>> {
        let mut departures = Vec::new();
        for chip in chips {
            let mut departure = Perturbation::default();
            for (name, numbers) in chip.iter().filter(|(name, _)| !name.is_empty()) {
                let effect = self.simulator.effects.iter().find(|e| e.name() == *name);
                effect
                    .ok_or_else(|| Error::invalid(format!("no effect is called {name}"), "use a name of the list"))?
                    .apply(numbers, &mut departure);
            }
            departures.push(departure);
        }
        let exposed = self.simulator.expose(&departures, progress)?;
        Ok(exposed
            .into_iter()
            .zip(departures)
            .map(|(grids, departure)| Exposed {
                grids,
                ghost: None,
                departure,
            })
            .collect())
    }

    /// What captures show under something that is in no list.
    ///
    /// # Errors
    /// If a cell cannot be solved.
    pub fn off_list(&self, what: OffList, progress: &dyn Progress) -> Result<Exposed> {
        let mut departure = Perturbation::default();
        match what {
            OffList::Astigmatism(nm) => {
                departure.geometry.wavefront_nm = vec![0.0, nm];
                self.expose(departure, None, progress)
            }
            OffList::Ghost(share, at) => self.expose(departure, Some((share, at)), progress),
            OffList::Anisotropy(nm) => {
                let tables = match &self.simulator.cells {
                    CellSource::Rigorous(cells) => cells.anisotropic(nm, progress)?,
                    CellSource::Model(_) => return Err(Error::invalid("no rigorous cells", "make twins of a set")),
                };
                let chips = tables.map(|table| Lit {
                    cells: Arc::new(table),
                    geometry: &departure.geometry,
                    lights: vec![&departure.light],
                    scatter: None,
                });
                let planes = self.simulator.bench.intensities(&chips, &departure.path, progress)?;
                let both: Vec<Vec<f32>> = planes[0][0]
                    .iter()
                    .zip(&planes[1][0])
                    .map(|(x, y)| x.iter().zip(y).map(|(a, b)| 0.5 * (a + b)).collect())
                    .collect();
                Ok(Exposed {
                    grids: self.simulator.bench.grids(&both, &departure),
                    ghost: None,
                    departure,
                })
            }
        }
    }

    fn expose(
        &self,
        departure: Perturbation,
        ghost: Option<(f64, [f64; 2])>,
        progress: &dyn Progress,
    ) -> Result<Exposed> {
        let grids = self
            .simulator
            .expose(std::slice::from_ref(&departure), progress)?
            .remove(0);
        Ok(Exposed {
            grids,
            ghost,
            departure,
        })
    }

    /// A set with placement, flux, black level and noise drawn from `seed`.
    pub fn draw(&self, exposed: &Exposed, seed: u64) -> MeasuredSet {
        let like = self.simulator.bench.set();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut set = like.clone();
        let camera = like.camera;
        let flux: Vec<f64> = like
            .leds
            .iter()
            .map(|_| 1.0 + camera.flux_sigma * normal(&mut rng))
            .collect();
        let black = camera.black_level_dn + BLACK_DN * normal(&mut rng);
        let reach = camera.registration_sigma_px * camera.pixel_um;
        for (capture, grid) in set.captures.iter_mut().zip(&exposed.grids) {
            let shift = [reach * normal(&mut rng), reach * normal(&mut rng)];
            let mut light: Array2<f32> = grid.pixels(shift);
            if let Some((share, at)) = exposed.ghost {
                light.scaled_add(share as f32, &grid.pixels([shift[0] + at[0], shift[1] + at[1]]));
            }
            let factor = capture.scale_dn * flux[capture.led];
            capture.dn = light.mapv(|v| {
                let signal = (f64::from(v) * factor).max(0.0);
                let variance = signal / camera.gain_e_per_dn + camera.read_noise_dn.powi(2);
                let noise = (variance / f64::from(capture.frames)).sqrt() * normal(&mut rng);
                (black + signal + noise) as f32
            });
        }
        let offset = like.sem_offset_sigma_nm * normal(&mut rng);
        for site in &mut set.sem {
            let Some(element) = like.elements.iter().position(|e| e.index == site.element) else {
                continue;
            };
            let lattice = like.elements[element].pillars.lattice;
            let index = |x: f64| (x / lattice.pitch_um() + 0.5 * (lattice.sites() as f64 - 1.0)).round() as usize;
            let at = index(site.at_um[1]) * lattice.sites() + index(site.at_um[0]);
            let bias = self.simulator.bench.bias_nm(element, at, &exposed.departure.geometry);
            site.measured_nm = site.designed_nm + bias + offset + site.sigma_nm * normal(&mut rng);
        }
        set
    }
}

/// A draw from the normal distribution (Box and Muller).
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let (u, v): (f64, f64) = (1.0 - rng.random::<f64>(), rng.random());
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}
