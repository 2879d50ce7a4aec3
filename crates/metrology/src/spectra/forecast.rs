//! What spectra of a film and of pads would determine, before any is measured: Fisher information of the forward model of a
//! calibration.

use metalith_attribution::RefitModel;
use metalith_core::{Progress, Result};
use metalith_rcwa::Material;
use nalgebra::DMatrix;

use super::model::SpectrumModel;
use super::set::{Spectrum, SpectrumSet, StatedLayer, StatedPads};

/// Half of a 95 % interval in standard deviations.
const HALF_95: f64 = 1.96;

/// One more pad is worth its while if it narrows the interval of an effect that is not determined yet by this share.
const WORTH: f64 = 0.05;

/// Name of the layer of film and of pillars.
const FILM: &str = "film";

/// A process whose spectra could be measured, along the normal.
#[derive(Clone, Debug)]
pub struct SpectrumForecast {
    /// Film that pillars are etched from.
    pub film: Material,
    pub substrate: Material,
    /// Films between substrate and pillars, from the pillars downwards.
    pub under: Vec<StatedLayer>,
    /// Medium around and above the pillars.
    pub ambient: Material,
    /// Pillars; their layer is the first.
    pub pads: StatedPads,
    pub wavelengths_nm: Vec<f64>,
    /// Standard deviation of a reflectance.
    pub sigma: f64,
}

/// An effect that spectra would determine.
#[derive(Clone, Debug, PartialEq)]
pub struct ForecastEffect {
    pub name: &'static str,
    pub unit: &'static str,
    /// Half of the 95 % interval that noise alone makes.
    pub half_interval: f64,
}

/// Effects of pads: name, name in a calibration, and unit. The gain of the reference is free beside them.
const OF_PADS: [(&str, &str, &str); 5] = [
    ("cd_bias", "cd_bias", "nm"),
    ("film_height", "film_height", "nm"),
    ("film_index", "film_index_offset", "delta n"),
    ("sidewall_taper", "sidewall_taper", "deg"),
    ("residual_film", "residual_film", "nm"),
];

/// Effects of a film that is not etched yet.
const OF_FILM: [(&str, &str, &str); 2] = [
    ("film_height", "film_thickness", "nm"),
    ("film_index", "film_index_offset", "delta n"),
];

const REFERENCE: &str = "reference_gain";

/// Information on effects by one spectrum each, and half of the range of each effect.
struct Informed {
    each: Vec<DMatrix<f64>>,
    ranges: Vec<f64>,
}

impl Informed {
    /// Half of the 95 % interval of each effect by some of the spectra; the range of an effect bounds it.
    fn half_intervals(&self, chosen: &[usize]) -> Vec<f64> {
        let size = self.ranges.len();
        let mut sum = DMatrix::from_fn(size, size, |i, j| {
            if i == j {
                (HALF_95 / self.ranges[i]).powi(2)
            } else {
                0.0
            }
        });
        chosen.iter().for_each(|&k| sum += &self.each[k]);
        let inverse = sum.try_inverse();
        (0..size)
            .map(|k| {
                inverse
                    .as_ref()
                    .map_or(self.ranges[k], |v| HALF_95 * v[(k, k)].max(0.0).sqrt())
            })
            .collect()
    }
}

impl SpectrumForecast {
    /// Effects that one reflectance spectrum of the film determines, before it is etched.
    pub fn of_film(&self) -> Vec<ForecastEffect> {
        let film = layer(FILM, Some(&self.film), Some(self.pads.height_nm));
        let set = self.set(vec![film, layer("nothing", None, None)], None, &[0.0]);
        let informed = self.informed(&set, &OF_FILM);
        effects(&OF_FILM, &informed.half_intervals(&[0]))
    }

    /// Widths of pads, among some, whose spectra determine the effects to the sizes that are wanted, with the effects: the fewest by
    /// a greedy choice, or those after which no further pad is worth its while.
    ///
    /// # Errors
    /// If the user stopped it.
    pub fn of_pads(
        &self,
        widths_nm: &[f64],
        wanted: &dyn Fn(&str) -> Option<f64>,
        progress: &dyn Progress,
    ) -> Result<(Vec<f64>, Vec<ForecastEffect>)> {
        progress.begin("spectra of pads", widths_nm.len() as u64);
        let mut all = Informed {
            each: Vec::new(),
            ranges: Vec::new(),
        };
        for width in widths_nm {
            progress.check_stopped()?;
            let pillars = layer(FILM, Some(&self.film), None);
            let set = self.set(vec![pillars], Some(&self.pads), &[*width]);
            let own = self.informed(&set, &OF_PADS);
            all.each.extend(own.each);
            all.ranges = own.ranges;
            progress.advance(1);
        }
        let mut chosen: Vec<usize> = Vec::new();
        // Half intervals over what is wanted, of effects that are not determined yet; none where no size is asked for.
        let open = |halves: &[f64]| -> Vec<f64> {
            let shares = OF_PADS
                .iter()
                .zip(halves)
                .filter_map(|((name, ..), half)| Some(half / wanted(name)?));
            shares.map(|share| share.max(1.0).ln()).collect()
        };
        loop {
            let sum = |chosen: &[usize]| open(&all.half_intervals(chosen)).iter().sum::<f64>();
            let now = sum(&chosen);
            let rest = (0..widths_nm.len()).filter(|k| !chosen.contains(k));
            let best = rest
                .map(|k| (sum(&[&chosen[..], &[k]].concat()), k))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            match best {
                Some((then, k)) if chosen.is_empty() || now > 0.0 && then < now - WORTH => chosen.push(k),
                _ => break,
            }
        }
        let mut widths: Vec<f64> = chosen.iter().map(|&k| widths_nm[k]).collect();
        widths.sort_by(f64::total_cmp);
        Ok((widths, effects(&OF_PADS, &all.half_intervals(&chosen))))
    }

    fn set(&self, mut layers: Vec<StatedLayer>, pads: Option<&StatedPads>, sizes_nm: &[f64]) -> SpectrumSet {
        layers.extend(self.under.iter().cloned());
        let middle = self.wavelengths_nm[self.wavelengths_nm.len() / 2];
        let spectrum = |size_nm: &f64| Spectrum {
            name: String::new(),
            size_nm: *size_nm,
            medium: 0,
            reflectance: vec![0.0; self.wavelengths_nm.len()],
            fitted: true,
        };
        SpectrumSet {
            path: "forecast".into(),
            title: String::new(),
            wavelengths_nm: self.wavelengths_nm.clone(),
            is_transmission: false,
            ambient_index: self.ambient.index(middle * 1e-3).map_or(1.0, |n| n.re),
            layers,
            pads: pads.cloned(),
            substrate: Some(self.substrate.clone()),
            numerical_aperture: 0.0,
            media: vec![("ambient".into(), self.ambient.clone())],
            spectra: sizes_nm.iter().map(spectrum).collect(),
            remarks: Vec::new(),
        }
    }

    /// Information of each spectrum of a set on some effects and on the gain of the reference.
    fn informed(&self, set: &SpectrumSet, effects: &[(&str, &str, &str)]) -> Informed {
        let model = SpectrumModel::new(set);
        let names = effects.iter().map(|(_, name, _)| *name).chain([REFERENCE]);
        let slots: Vec<usize> = names
            .filter_map(|name| Some(model.effects().iter().find(|e| e.name == name)?.slots[0]))
            .collect();
        let parameters = model.parameters();
        let theta: Vec<f64> = parameters.iter().map(|p| p.neutral).collect();
        let size = slots.len();
        let of = |s: usize| {
            let form = model.equations(s, &slots, &theta).fit;
            form.view((0, 0), (size, size)) / self.sigma.powi(2)
        };
        Informed {
            each: (0..set.spectra.len()).map(of).collect(),
            ranges: slots
                .iter()
                .map(|&s| 0.5 * (parameters[s].range.1 - parameters[s].range.0))
                .collect(),
        }
    }
}

fn layer(name: &str, material: Option<&Material>, thickness_nm: Option<f64>) -> StatedLayer {
    StatedLayer {
        name: name.into(),
        material: material.cloned(),
        thickness_nm,
    }
}

fn effects(names: &[(&'static str, &str, &'static str)], halves: &[f64]) -> Vec<ForecastEffect> {
    let each = names.iter().zip(halves);
    each.map(|((name, _, unit), half)| ForecastEffect {
        name,
        unit,
        half_interval: *half,
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_core::Silent;
    use metalith_rcwa::CellLattice;

    fn forecast(sigma: f64) -> SpectrumForecast {
        let constant = |n: f64| Material::constant(n, 0.0).unwrap();
        SpectrumForecast {
            film: constant(2.05),
            substrate: constant(1.46),
            under: Vec::new(),
            ambient: constant(1.0),
            pads: StatedPads {
                layer: 0,
                pitch_nm: 300.0,
                lattice: CellLattice::Square,
                is_round: false,
                height_nm: 500.0,
                residual_nm: 0.0,
                taper_deg: 0.0,
            },
            wavelengths_nm: (0..10).map(|k| 640.0 + 20.0 * f64::from(k)).collect(),
            sigma,
        }
    }

    fn half(effects: &[ForecastEffect], name: &str) -> f64 {
        effects.iter().find(|e| e.name == name).unwrap().half_interval
    }

    /// Intervals are proportional to the noise where the range of an effect does not bound them.
    #[test]
    fn intervals_of_a_film_follow_the_noise() {
        let [low, high] = [1e-5, 2e-5].map(|sigma| half(&forecast(sigma).of_film(), "film_height"));
        assert!(low > 0.0 && (high / low - 2.0).abs() < 1e-3, "{low} {high}");
    }

    /// One pad does not distinguish what two do, and a third is not asked for if two suffice.
    #[test]
    fn pads_are_added_until_the_wanted_sizes_are_reached() {
        let of = |size: f64| {
            let wanted = |name: &str| (name == "cd_bias").then_some(size);
            forecast(1e-3).of_pads(&[90.0, 120.0, 150.0], &wanted, &Silent).unwrap()
        };
        let (few, loose) = of(1e3);
        let (more, tight) = of(0.5);
        assert_eq!(few.len(), 1);
        assert!(
            more.len() > 1 && half(&tight, "cd_bias") < half(&loose, "cd_bias"),
            "{more:?}"
        );
    }
}
