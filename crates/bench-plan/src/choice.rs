//! Choice of measurements: the fewest that detect every effect at its wanted size and distinguish it from every other.
//!
//! What a set tells of a parameter is the Schur complement of its normal equations: the chi-square that an effect of the
//! wanted size adds and that nuisances, and one other effect, cannot take up. Per pixel this is the gain by which a
//! calibration judges, so an effect counts as detected or distinguished if it is [`NEEDED`].
//!
//! The choice is greedy by the worst detection: at each step the measurement that raises the sum of the logarithms of all
//! margins that are still below one. Then measurements without which all margins stay are taken out again, and the rest gets
//! the fewest frames that do.

use nalgebra::DMatrix;

use crate::information::Information;
use metalith_attribution::{LEAST_GAIN, covariance, projected};

/// Gain in reduced chi-square per pixel that is asked for: twice what a calibration takes for more than the error of its
/// own model, because what comes back is noisy.
pub(crate) const NEEDED: f64 = 2.0 * LEAST_GAIN;

/// Least margin that differs from zero.
const NOTHING: f64 = 1e-9;

/// Cost of a missing group, equal to that of a margin which is below one by this logarithm: a second colour, element and distance,
/// and beams, are what a calibration holds its fits against.
const MISSING_GROUP: f64 = 3.0;

/// Beams, each an element in one colour from one angle, that a bootstrap needs.
const LEAST_BEAMS: usize = 4;

/// Scores that differ by less are equal.
const SAME: f64 = 1e-9;

/// One thing that is asked of a set.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Requirement {
    /// Number of the parameter.
    pub slot: usize,
    /// Wanted size.
    pub size: f64,
    /// Parameters of the effect that it must be distinguished from; none where it is only to be detected.
    pub beside: Vec<usize>,
}

/// Groups of a candidate that a calibration leaves out in turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Place {
    pub element: usize,
    pub led: usize,
    pub aoi_rad: [f64; 2],
    pub distance_um: f64,
}

/// Quantities that are weighed.
pub(crate) struct Choice<'a> {
    pub information: &'a Information,
    pub places: Vec<Place>,
    pub requirements: Vec<Requirement>,
    /// Frames that a measurement may have, fewest first; forms are those of the most.
    pub frames: Vec<u32>,
}

/// A measurement that was chosen, with its frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ChosenMeasurement {
    pub candidate: usize,
    pub frames: u32,
}

impl Choice<'_> {
    fn most_frames(&self) -> u32 {
        self.frames.last().copied().unwrap_or(1)
    }

    /// Some candidates with all of the frames.
    pub(crate) fn whole(&self, candidates: impl IntoIterator<Item = usize>) -> Vec<ChosenMeasurement> {
        let frames = self.most_frames();
        candidates
            .into_iter()
            .map(|candidate| ChosenMeasurement { candidate, frames })
            .collect()
    }

    /// Inner products of all parameters in a set, with its nuisances projected out, and its pixels. Registration was taken
    /// out with the most frames: a frame knows it far better than the stage does, so that fewer make no difference.
    pub(crate) fn products(&self, picked: &[ChosenMeasurement]) -> (DMatrix<f64>, f64) {
        let mut form = self.information.prior.clone();
        let mut pixels = 0.0;
        for p in picked {
            let measured = &self.information.measurements[p.candidate];
            form += &measured.form * (f64::from(p.frames) / f64::from(self.most_frames()));
            pixels += measured.pixels;
        }
        let inner = projected(&form, self.information.shared);
        (inner, pixels)
    }

    /// Gain per pixel of each requirement, over what is needed.
    pub(crate) fn margins(&self, picked: &[ChosenMeasurement]) -> Vec<f64> {
        if picked.is_empty() {
            return vec![0.0; self.requirements.len()];
        }
        let (products, pixels) = self.products(picked);
        let margin = |r: &Requirement| energy(&products, r) / pixels.max(1.0) / NEEDED;
        self.requirements.iter().map(margin).collect()
    }

    /// Zero if nothing is missing, the more negative the more is.
    fn score(&self, picked: &[ChosenMeasurement], reachable: &[bool]) -> f64 {
        let margins = self.margins(picked);
        let counted = margins.iter().zip(reachable).filter(|(_, r)| **r);
        let short: f64 = counted.map(|(m, _)| m.max(NOTHING).ln().min(0.0)).sum();
        short - MISSING_GROUP * self.missing_groups(picked) as f64
    }

    fn missing_groups(&self, picked: &[ChosenMeasurement]) -> usize {
        let all: Vec<usize> = (0..self.places.len()).collect();
        let own: Vec<usize> = picked.iter().map(|p| p.candidate).collect();
        let lacking = |key: &dyn Fn(&Place) -> [f64; 4], least: usize| {
            let groups = |of: &[usize]| {
                let mut known: Vec<[f64; 4]> = Vec::new();
                for k in of.iter().map(|&c| key(&self.places[c])) {
                    if !known.contains(&k) {
                        known.push(k);
                    }
                }
                known.len()
            };
            groups(&all).min(least).saturating_sub(groups(&own))
        };
        lacking(&|p| [p.element as f64, 0.0, 0.0, 0.0], 2)
            + lacking(&|p| [p.led as f64, 0.0, 0.0, 0.0], 2)
            + lacking(&|p| [p.distance_um, 0.0, 0.0, 0.0], 2)
            + lacking(
                &|p| [p.element as f64, p.led as f64, p.aoi_rad[0], p.aoi_rad[1]],
                LEAST_BEAMS,
            )
    }

    /// True if any measurements of the bench meet each requirement: all of them, those of one colour, element, distance or angle,
    /// or one alone. Measurements that show nothing of an effect dilute its gain, so that all are not always the best.
    pub(crate) fn reachable(&self) -> Vec<bool> {
        let all: Vec<usize> = (0..self.places.len()).collect();
        let mut sets: Vec<Vec<usize>> = vec![all.clone()];
        for &c in &all {
            let p = self.places[c];
            let like = |same: &dyn Fn(&Place) -> bool| -> Vec<usize> {
                all.iter().copied().filter(|&o| same(&self.places[o])).collect()
            };
            for set in [
                vec![c],
                like(&|o| o.led == p.led),
                like(&|o| o.element == p.element),
                like(&|o| o.distance_um == p.distance_um),
                like(&|o| o.aoi_rad == p.aoi_rad),
            ] {
                if !sets.contains(&set) {
                    sets.push(set);
                }
            }
        }
        let mut reached = vec![false; self.requirements.len()];
        for set in sets {
            for (r, margin) in reached.iter_mut().zip(self.margins(&self.whole(set))) {
                *r |= margin >= 1.0;
            }
        }
        reached
    }

    /// The measurements to take, at most so many, in the order of the candidates.
    pub(crate) fn measurements(&self, reachable: &[bool], most: usize) -> Vec<ChosenMeasurement> {
        let mut picked: Vec<ChosenMeasurement> = Vec::new();
        let mut now = self.score(&picked, reachable);
        while now < -SAME && picked.len() < most {
            let mut best: Option<(f64, ChosenMeasurement)> = None;
            for next in self.whole(0..self.places.len()) {
                if picked.iter().any(|p| p.candidate == next.candidate) {
                    continue;
                }
                picked.push(next);
                let score = self.score(&picked, reachable);
                picked.pop();
                if best.is_none_or(|(b, _)| score > b + SAME) {
                    best = Some((score, next));
                }
            }
            let Some((score, next)) = best.filter(|(score, _)| *score > now + SAME) else {
                break;
            };
            picked.push(next);
            now = score;
        }
        self.without_needless(&mut picked, now, reachable);
        self.with_fewest_frames(&mut picked, now, reachable);
        picked.sort_by_key(|p| p.candidate);
        picked
    }

    /// Take out what the others have made needless, the earliest first: it was chosen knowing the least.
    fn without_needless(&self, picked: &mut Vec<ChosenMeasurement>, score: f64, reachable: &[bool]) {
        let mut place = 0;
        while place < picked.len() && picked.len() > 1 {
            let out = picked.remove(place);
            if self.score(picked, reachable) < score - SAME {
                picked.insert(place, out);
                place += 1;
            }
        }
    }

    fn with_fewest_frames(&self, picked: &mut [ChosenMeasurement], score: f64, reachable: &[bool]) {
        for place in 0..picked.len() {
            let most = picked[place].frames;
            for &frames in &self.frames {
                picked[place].frames = frames;
                if self.score(picked, reachable) >= score - SAME {
                    break;
                }
                picked[place].frames = most;
            }
        }
    }
}

/// Chi-square that an effect of the wanted size adds and that the parameters beside it cannot take up.
pub(crate) fn energy(products: &DMatrix<f64>, r: &Requirement) -> f64 {
    let own = products[(r.slot, r.slot)];
    let taken: f64 = match lookalike(products, r) {
        Some(values) => r
            .beside
            .iter()
            .zip(&values)
            .map(|(&s, v)| v * products[(s, r.slot)])
            .sum(),
        None => 0.0,
    };
    (r.size * own - taken).max(0.0) * r.size
}

/// The values of the parameters beside it that look most like an effect of the wanted size; none if there are none beside it.
pub(crate) fn lookalike(products: &DMatrix<f64>, r: &Requirement) -> Option<Vec<f64>> {
    if r.beside.is_empty() {
        return None;
    }
    let inverse = covariance(products, &r.beside);
    let cross = nalgebra::DVector::from_iterator(r.beside.len(), r.beside.iter().map(|&s| products[(s, r.slot)]));
    Some((inverse * cross * r.size).iter().copied().collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::information::MeasurementInformation;
    use metalith_calibrate::{ElementIndex, LedIndex, Measurement};

    /// Pixels of every test measurement.
    const PIXELS: f64 = 1000.0;

    fn told(form: DMatrix<f64>) -> MeasurementInformation {
        let measurement = Measurement {
            name: String::new(),
            element: ElementIndex::from(0),
            led: LedIndex::from(0),
            aoi_rad: [0.0; 2],
            distance_um: 1.0,
            window_centre_um: [0.0; 2],
            scale_dn: 1.0,
            frames: 1,
            dn: ndarray::Array2::zeros((1, 1)),
            noise: None,
        };
        MeasurementInformation {
            measurement,
            form,
            pixels: PIXELS,
        }
    }

    /// Measurements by what they tell of two parameters, no nuisance worth the name.
    fn information(of: &[[f64; 2]]) -> Information {
        let mut prior = DMatrix::zeros(4, 4);
        prior[(0, 0)] = 1.0;
        let forms = of.iter().map(|v| {
            let mut form = DMatrix::zeros(4, 4);
            for i in 0..2 {
                for j in 0..2 {
                    form[(1 + i, 1 + j)] = v[i] * v[j];
                }
            }
            told(form)
        });
        Information {
            measurements: forms.collect(),
            prior,
            widths: None,
            shared: 1,
        }
    }

    fn choice(information: &Information) -> Choice<'_> {
        let one = |slot: usize, beside: Vec<usize>| Requirement {
            slot,
            size: 1.0,
            beside,
        };
        Choice {
            places: (0..information.measurements.len())
                .map(|k| Place {
                    element: 0,
                    led: 0,
                    aoi_rad: [k as f64, 0.0],
                    distance_um: 1.0,
                })
                .collect(),
            information,
            requirements: vec![one(0, vec![]), one(1, vec![]), one(0, vec![1]), one(1, vec![0])],
            frames: vec![1, 4],
        }
    }

    /// Measurements that see the sum alone cannot split two effects; those that see the difference can.
    #[test]
    fn a_confusion_is_split_by_the_measurements_that_can() {
        let strong = (100.0 * NEEDED * PIXELS).sqrt();
        let alike = information(&[[strong, strong]; 5]);
        let same = choice(&alike);
        assert_eq!(same.reachable(), [true, true, false, false]);
        let mut seen = vec![[strong, strong]; 5];
        seen.push([strong, -strong]);
        let unlike = information(&seen);
        let two = choice(&unlike);
        assert_eq!(two.reachable(), [true; 4]);
        let picked = two.measurements(&[true; 4], 6);
        assert!(picked.iter().any(|p| p.candidate == 5), "{picked:?}");
        assert!(two.margins(&picked).iter().all(|m| *m >= 1.0 - SAME), "{picked:?}");
        // Four beams are asked for, and no more is needed; what is strong needs few frames.
        assert_eq!(picked.len(), LEAST_BEAMS);
        assert!(picked.iter().all(|p| p.frames == 1), "{picked:?}");
    }

    /// One unit of the first looks like two of the second if this shows half as much.
    #[test]
    fn what_looks_alike_has_a_size() {
        let products = DMatrix::from_row_slice(2, 2, &[4.0, 2.0, 2.0, 1.0 + 1e-6]);
        let r = Requirement {
            slot: 0,
            size: 3.0,
            beside: vec![1],
        };
        // What the second does not share, of its energy of one.
        const APART: f64 = 1e-5;
        assert!((lookalike(&products, &r).unwrap()[0] - 6.0).abs() < 6.0 * APART);
        assert!(energy(&products, &r) < 36.0 * APART);
    }
}
