//! The numbers of one draw, from the plan's key and its own number.

use metalith_calibrate::Effect;
use metalith_core::document::Scalar;
use metalith_core::{Error, Result};
use metalith_optics::Perturbation;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, Normal, Uniform};

use crate::designs::DesignGrid;
use crate::study_file::{Distribution, TAIL_SD, Tolerance, effects};

/// Amounts that are drawn at the most until one is physical.
const MOST_TRIES: usize = 10_000;

/// The amounts of one draw, in the order of `Sampler::names`.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// Amounts in the unit of each quantity.
    pub amounts: Vec<f64>,
}

/// One number that varies.
struct Quantity {
    /// Name of its effect, with the number of its parameter where there are several.
    name: String,
    unit: String,
    /// Number of the effect; `None` for a key of the design.
    effect: Option<usize>,
    source: Source,
}

enum Source {
    Random(Distribution),
    Grid(Vec<f64>),
    Design(DesignGrid),
}

/// Makes the draws of a tolerance.
pub(crate) struct Sampler {
    effects: Vec<Box<dyn Effect>>,
    quantities: Vec<Quantity>,
    base: Perturbation,
    draws: u64,
}

impl Sampler {
    /// Sampler for a tolerance that was read; `base` is what its model says.
    pub(crate) fn new(tolerance: &Tolerance, base: Perturbation) -> Self {
        let effects = effects();
        let at = |name: &str| {
            effects
                .iter()
                .position(|e| e.name() == name)
                .expect("names were checked")
        };
        let mut quantities = Vec::new();
        let mut add = |name: &str, source: &dyn Fn() -> Source| {
            let effect: &dyn Effect = effects[at(name)].as_ref();
            let count = effect.parameters().len();
            for k in 1..=count {
                quantities.push(Quantity {
                    name: if count == 1 {
                        name.to_owned()
                    } else {
                        format!("{name}_{k}")
                    },
                    unit: effect.unit().to_owned(),
                    effect: Some(at(name)),
                    source: source(),
                });
            }
        };
        for grid in &tolerance.grids {
            add(&grid.effect, &|| Source::Grid(grid.values.clone()));
        }
        // After the effects of a grid: draws of one design stand together.
        let designs = tolerance.design_grids.iter().map(|grid| Quantity {
            name: grid.key.clone(),
            unit: String::new(),
            effect: None,
            source: Source::Design(grid.clone()),
        });
        for varied in &tolerance.varied {
            add(&varied.effect, &|| Source::Random(varied.distribution));
        }
        let random = |q: &Quantity| matches!(q.source, Source::Random(_));
        let at = quantities.iter().position(random).unwrap_or(quantities.len());
        quantities.splice(at..at, designs);
        Self {
            quantities,
            effects,
            base,
            draws: tolerance.draws,
        }
    }

    /// Perturbation from which everything that does not vary is taken.
    pub(crate) fn base(&self) -> &Perturbation {
        &self.base
    }

    /// Name and unit of each quantity; grids first.
    pub(crate) fn names(&self) -> Vec<(String, String)> {
        self.quantities
            .iter()
            .map(|q| (q.name.clone(), q.unit.clone()))
            .collect()
    }

    /// True if a quantity is drawn, and not one of a grid.
    pub(crate) fn is_random(&self, quantity: usize) -> bool {
        matches!(self.quantities[quantity].source, Source::Random(_))
    }

    /// All draws at all points of the grid.
    pub(crate) fn count(&self) -> u64 {
        self.draws * self.points()
    }

    fn points(&self) -> u64 {
        let sizes = self.quantities.iter().map(|q| match &q.source {
            Source::Grid(values) => values.len() as u64,
            Source::Design(grid) => grid.values.len() as u64,
            Source::Random(_) => 1,
        });
        sizes.product()
    }

    /// Number of the design that a draw is of.
    pub(crate) fn design_of(&self, k: u64) -> u64 {
        let effects = self.quantities.iter().map(|q| match &q.source {
            Source::Grid(values) => values.len() as u64,
            Source::Design(_) | Source::Random(_) => 1,
        });
        k / (self.draws * effects.product::<u64>())
    }

    /// Amount and value at each place of the grid of a quantity; none for one that is drawn.
    pub(crate) fn grid(&self, quantity: usize) -> Option<Vec<(f64, Scalar)>> {
        match &self.quantities[quantity].source {
            Source::Grid(values) => Some(values.iter().map(|v| (*v, Scalar::Number(*v))).collect()),
            Source::Design(grid) => {
                let each = grid.values.iter().enumerate();
                Some(each.map(|(k, v)| (grid.amount(k), v.clone())).collect())
            }
            Source::Random(_) => None,
        }
    }

    /// Draw `k`: the point of the grid `k / draws`, and random amounts from ChaCha8 with the key and stream `k`.
    ///
    /// # Errors
    /// If a distribution has next to nothing within the physical range of its effect.
    pub(crate) fn draw(&self, key: [u8; 32], k: u64) -> Result<Drawn> {
        let mut rng = ChaCha8Rng::from_seed(key);
        rng.set_stream(k);
        let mut point = k / self.draws;
        let mut amounts = Vec::with_capacity(self.quantities.len());
        let mut place = |size: usize| {
            let place = (point % size as u64) as usize;
            point /= size as u64;
            place
        };
        for quantity in &self.quantities {
            amounts.push(match &quantity.source {
                Source::Grid(values) => values[place(values.len())],
                Source::Design(grid) => grid.amount(place(grid.values.len())),
                Source::Random(distribution) => self.amount(quantity, distribution, &mut rng)?,
            });
        }
        Ok(Drawn { amounts })
    }

    fn amount(&self, quantity: &Quantity, distribution: &Distribution, rng: &mut ChaCha8Rng) -> Result<f64> {
        let effect = &self.effects[quantity.effect.expect("effects alone are drawn")];
        let (low, high) = effect.parameters()[0].range;
        for _ in 0..MOST_TRIES {
            let (amount, inside) = match *distribution {
                Distribution::Normal { mean, sd } => {
                    let normal = Normal::new(mean, sd).expect("the deviation is positive");
                    let amount = normal.sample(rng);
                    (amount, (amount - mean).abs() <= TAIL_SD * sd)
                }
                Distribution::Uniform { low, high } => {
                    let uniform = Uniform::new(low, high).expect("the range is not empty");
                    (uniform.sample(rng), true)
                }
            };
            if inside && (low..=high).contains(&effect.parameter(amount)) {
                return Ok(amount);
            }
        }
        Err(Error::refused(
            "study/distribution-out-of-range",
            format!(
                "the distribution of `{}` is almost entirely outside of the physical range",
                quantity.name
            ),
            "give a distribution that overlaps with the physical range of the effect",
        ))
    }

    /// The middle of a quantity: what it is where nothing varies.
    pub(crate) fn middle(&self, quantity: usize) -> f64 {
        match &self.quantities[quantity].source {
            Source::Random(Distribution::Normal { mean, .. }) => *mean,
            Source::Random(Distribution::Uniform { low, high }) => 0.5 * (low + high),
            Source::Grid(values) => values.iter().sum::<f64>() / values.len() as f64,
            Source::Design(grid) => {
                let amounts = (0..grid.values.len()).map(|k| grid.amount(k));
                amounts.sum::<f64>() / grid.values.len() as f64
            }
        }
    }

    /// Perturbation of a chip by these amounts.
    pub(crate) fn perturbation(&self, drawn: &Drawn) -> Perturbation {
        let mut to = self.base.clone();
        for (e, effect) in self.effects.iter().enumerate() {
            let own = self
                .quantities
                .iter()
                .zip(&drawn.amounts)
                .filter(|(q, _)| q.effect == Some(e));
            let parameters: Vec<f64> = own.map(|(_, amount)| effect.parameter(*amount)).collect();
            if !parameters.is_empty() {
                effect.apply(&parameters, &mut to);
            }
        }
        to
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study_file::{Grid, Varied};
    use metalith_wave::Accuracy;

    fn drawer(sd: f64) -> Sampler {
        let normal = |effect: &str, sd| Varied {
            effect: effect.into(),
            distribution: Distribution::Normal { mean: 0.0, sd },
        };
        let tolerance = Tolerance {
            path: "t.toml".into(),
            design: "d.toml".into(),
            layout: None,
            model: None,
            draws: 1000,
            accuracy: Accuracy::Fast,
            varied: vec![
                normal("cd_bias", sd),
                normal("tilt", 1.0),
                normal("corner_rounding", 10.0),
            ],
            grids: vec![Grid {
                effect: "defocus".into(),
                values: vec![-5.0, 0.0, 5.0],
            }],
            design_grids: vec![DesignGrid {
                key: "mapping.basis".into(),
                values: vec![Scalar::Text("all_powers".into()), Scalar::Text("even_powers".into())],
            }],
            picture: None,
            limits: Vec::new(),
        };
        Sampler::new(&tolerance, Perturbation::default())
    }

    #[test]
    fn a_draw_follows_from_its_number_and_is_of_its_distribution() {
        let drawer = drawer(2.0);
        let names: Vec<String> = drawer.names().into_iter().map(|n| n.0).collect();
        assert_eq!(
            names,
            [
                "defocus",
                "mapping.basis",
                "cd_bias",
                "tilt_1",
                "tilt_2",
                "corner_rounding"
            ]
        );
        assert_eq!(drawer.count(), 6000);
        let draw = |k| drawer.draw([7; 32], k).unwrap().amounts;
        assert_eq!(draw(17), draw(17));
        assert_ne!(draw(17)[2], draw(18)[2]);
        assert_eq!([draw(0)[0], draw(1000)[0], draw(2999)[0]], [-5.0, 0.0, 5.0]);
        // A choice counts by its place; draws of one design stand together.
        assert_eq!([draw(2999)[1], draw(3000)[1]], [0.0, 1.0]);
        assert_eq!([drawer.design_of(2999), drawer.design_of(3000)], [0, 1]);
        let bias: Vec<f64> = (0..3000).map(|k| draw(k)[2]).collect();
        let mean = bias.iter().sum::<f64>() / 3000.0;
        let sd = (bias.iter().map(|b| (b - mean).powi(2)).sum::<f64>() / 3000.0).sqrt();
        // Four standard errors of 3000 draws; tails beyond three deviations are left out, which takes 1.3 % off.
        assert!(mean.abs() < 4.0 * 2.0 / 3000_f64.sqrt(), "{mean}");
        assert!((sd - 2.0 * 0.987).abs() < 4.0 * 2.0 / 6000_f64.sqrt(), "{sd}");
        assert!((0..3000).all(|k| draw(k)[5] >= 0.0));
    }

    /// Quantities that vary are not counted from the model that all else is taken from.
    #[test]
    fn what_varies_takes_the_place_of_what_the_model_says() {
        let mut drawer = drawer(2.0);
        drawer.base.geometry.cd_bias_nm = 7.0;
        // Coma along x, which the model has and a draw sets.
        drawer.base.geometry.add_wavefront(8, 30.0);
        drawer.base.geometry.add_wavefront(5, 12.0);
        let coma = effects().into_iter().find(|e| e.name() == "coma").unwrap();
        let mut drawn = drawer.perturbation(&Drawn {
            amounts: vec![0.0, 1.0, -3.0, 0.0, 0.0, 0.0],
        });
        coma.apply(&[0.0, 2.5], &mut drawn);
        assert_eq!(drawn.geometry.cd_bias_nm, -3.0);
        assert_eq!(drawn.geometry.wavefront_nm, [12.0, 0.0, 0.0, 2.5]);
    }

    #[test]
    fn amounts_become_a_perturbation_in_the_unit_of_their_effect() {
        let amounts = vec![5.0, 1.0, -3.0, 1.0, 2.0, 20.0];
        let p = drawer(2.0).perturbation(&Drawn { amounts });
        assert_eq!(p.path.defocus_um, 5.0);
        assert_eq!(p.geometry.cd_bias_nm, -3.0);
        assert_eq!(p.path.tilt_mrad, [1.0, 2.0]);
        // The square is what is fitted; its root comes back to rounding.
        assert!((p.cell.corner_rounding_nm - 20.0).abs() < 1e-12);
    }
}
