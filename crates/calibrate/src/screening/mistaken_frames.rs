//! Frames that are mirrored or turned, or of another colour than stated: the model fits them far better as what they are.

use ndarray::Array2;

use crate::data::{Data, MeasurementSetup, Nuisances};
use crate::optics::PixelGrid;
use crate::set::{LedIndex, MeasuredSet, MeasurementIndex, PerMeasurement};
use crate::statistics::FitProblem;
use metalith_attribution::Measurements;
use metalith_sensor::frame::Orientation;

/// Reduced chi-square below which a frame has the colour that is stated: no other one can fit far better.
const FITS: f64 = 3.0;

/// The same for orientations, over the brightest frames: frames of symmetric lenses fit in each of them.
const MISFIT: f64 = 1.5;

/// Another orientation fits far better if it leaves this share of chi-square above noise, or less. An effect that makes a mirrored image fit
/// better must undo the asymmetry of the lens.
const OF_CHI2: f64 = 0.5;

/// No measurement may fit worse by this factor in it.
const NO_WORSE: f64 = 1.2;

/// Largest ratio of chi-square of orientations that cannot be distinguished from the best one.
const ALIKE: f64 = 1.1;

/// The image of another colour fits far better if it leaves this share: a wrong distance makes colours alike, but not by as much.
const OF_CHI2_BY_COLOUR: f64 = 0.2;

/// A single frame of another colour fits worse than most frames by this factor: an effect changes them alike.
const FAR_WORSE: f64 = 4.0;

/// Measurements that orientations are tried on: the brightest ones of each element.
const OF_EACH_ELEMENT: usize = 3;

/// Error of the light of a frame whose colour or place on the sensor is not known.
const FLUX_SIGMA: f64 = 0.5;

/// Reduced chi-square of each of some measurements against some images, with place, light and black level fitted.
fn misfits(data: &Data, seen: &[(MeasurementIndex, &PixelGrid)], orientation: Orientation) -> Vec<f64> {
    let of = |(c, image): &(MeasurementIndex, &PixelGrid)| {
        let turned = |a: &Array2<f32>| orientation.upright(a);
        let alone = Data {
            weight: vec![turned(&data.weight[*c])].into(),
            signal: vec![turned(&data.signal[*c])].into(),
            beam: vec![data.beam[*c]].into(),
            scale: vec![data.scale[*c]].into(),
            flux_sigma: FLUX_SIGMA,
            ..data.empty()
        };
        let images: PerMeasurement<PixelGrid> = vec![(*image).clone()].into();
        let first = MeasurementIndex::from(0);
        let found = Nuisances::registered(&alone, &images).fit(&alone, &images, &vec![true].into());
        let residual = found.residual(&alone, &images[first], first);
        let chi2: f64 = residual.iter().map(|v| f64::from(*v).powi(2)).sum();
        chi2 / (alone.points(first) as f64).max(1.0)
    };
    seen.iter().map(of).collect()
}

/// The orientations of the frames in which the model fits them far better, best first; none if they are upright.
pub(super) fn orientations(problem: &FitProblem<'_>, used: &PerMeasurement<bool>) -> Option<Vec<Orientation>> {
    let data = problem.data;
    let energy = |c: &MeasurementIndex| {
        let pairs = data.signal[*c].iter().zip(&data.weight[*c]);
        pairs.map(|(v, w)| f64::from(v * w).powi(2)).sum::<f64>()
    };
    let mut brightest: Vec<MeasurementIndex> = data.indices().filter(|c| used[*c]).collect();
    brightest.sort_by(|a, b| energy(b).total_cmp(&energy(a)));
    let mut tried: Vec<MeasurementIndex> = Vec::new();
    for c in brightest {
        let alike = tried.iter().filter(|t| data.beam[**t].element == data.beam[c].element);
        if alike.count() < OF_EACH_ELEMENT {
            tried.push(c);
        }
    }
    let images: Vec<PixelGrid> = tried
        .iter()
        .map(|c| problem.prediction(&problem.surrogate.about, *c))
        .collect();
    let seen: Vec<_> = tried.iter().copied().zip(&images).collect();
    let upright = misfits(data, &seen, Orientation::Upright);
    let sum = |misfits: &[f64]| misfits.iter().sum::<f64>();
    // Above the noise, which no orientation takes away.
    let excess = |misfits: &[f64]| misfits.iter().map(|m| (m - 1.0).max(0.0)).sum::<f64>();
    if seen.is_empty() || sum(&upright) < MISFIT * seen.len() as f64 {
        return None;
    }
    let is_square = data.signal[tried[0]].is_square();
    let mut better: Vec<(Orientation, f64)> = Orientation::ALL
        .into_iter()
        .map(|(_, o)| o)
        .filter(|o| *o != Orientation::Upright && (is_square || !o.is_transposed()))
        .map(|o| (o, misfits(data, &seen, o)))
        .filter(|(_, m)| excess(m) < OF_CHI2 * excess(&upright))
        .filter(|(_, m)| m.iter().zip(&upright).all(|(a, b)| *a < NO_WORSE * b))
        .map(|(o, m)| (o, sum(&m)))
        .collect();
    better.sort_by(|a, b| a.1.total_cmp(&b.1));
    let least = better.first()?.1;
    better.retain(|(_, m)| *m <= ALIKE * least);
    Some(better.into_iter().map(|(o, _)| o).collect())
}

/// A measurement that the image of another LED fits far better.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OtherColour {
    pub measurement: MeasurementIndex,
    pub led: LedIndex,
    /// Reduced chi-square as stated, and as the other colour.
    pub chi2: [f64; 2],
    /// True if all measurements of the stated LED are so: a wrong distance or a wrong LED may be the cause.
    pub is_common: bool,
}

/// Measurements that the image of another LED fits far better, and that fit far worse than most; or all of an LED.
pub(super) fn other_colours(set: &MeasuredSet, problem: &FitProblem<'_>) -> Vec<OtherColour> {
    let data = problem.data;
    let image = |c| problem.prediction(&problem.surrogate.about, c);
    let misfit = |c, of| misfits(data, &[(c, &image(of))], Orientation::Upright)[0];
    let own: PerMeasurement<f64> = data.indices().map(|c| misfit(c, c)).collect();
    let mut sorted = own.raw.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    let mut found: Vec<OtherColour> = Vec::new();
    for (c, beam) in data.beam.iter_enumerated() {
        if own[c] < FITS / OF_CHI2_BY_COLOUR {
            continue;
        }
        let place = |b: &MeasurementSetup| (b.element, b.aoi_rad, b.distance_um);
        let others = data.beam.iter_enumerated();
        let others = others.filter(|(_, other)| other.led != beam.led && place(other) == place(beam));
        let best = others
            .map(|(o, other)| (other.led, misfit(c, o)))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((led, as_other)) = best.filter(|(_, m)| *m < OF_CHI2_BY_COLOUR * own[c]) {
            found.push(OtherColour {
                measurement: c,
                led,
                chi2: [own[c], as_other],
                is_common: false,
            });
        }
    }
    for led in set.leds.keys() {
        let of_led = |c: MeasurementIndex| data.beam[c].led == led;
        let all = data.indices().filter(|&c| of_led(c)).count();
        let odd = found.iter().filter(|f| of_led(f.measurement)).count();
        for own in found.iter_mut().filter(|f| of_led(f.measurement)) {
            own.is_common = odd == all;
        }
    }
    found.retain(|f| f.is_common || f.chi2[0] > FAR_WORSE * usual);
    found
}

/// Pairs of measurements, in both orders, whose frames fit the image of the other far better. They differ in the element with its
/// angle, in the colour, or in the distance. An effect of the chip or bench makes one frame of a pair fit better, not both.
pub(super) fn exchanged(problem: &FitProblem<'_>) -> Vec<(MeasurementIndex, MeasurementIndex)> {
    let data = problem.data;
    let image = |c| problem.prediction(&problem.surrogate.about, c);
    let misfit = |c, of| misfits(data, &[(c, &image(of))], Orientation::Upright)[0];
    let own: PerMeasurement<f64> = data.indices().map(|c| misfit(c, c)).collect();
    let odd: Vec<MeasurementIndex> = data
        .indices()
        .filter(|&c| problem.used[c] && own[c] > FITS / OF_CHI2_BY_COLOUR)
        .collect();
    let mut found: Vec<(MeasurementIndex, MeasurementIndex)> = Vec::new();
    for (k, &a) in odd.iter().enumerate() {
        let alike = |&b: &MeasurementIndex| {
            let (one, other) = (&data.beam[a], &data.beam[b]);
            let same = [
                one.element == other.element && one.aoi_rad == other.aoi_rad,
                one.led == other.led,
                one.distance_um == other.distance_um,
            ];
            same.iter().filter(|same| !**same).count() == 1
        };
        let fits = |b: &MeasurementIndex| {
            misfit(a, *b) < OF_CHI2_BY_COLOUR * own[a] && misfit(*b, a) < OF_CHI2_BY_COLOUR * own[*b]
        };
        let free = |b: &MeasurementIndex| !found.iter().any(|(own, _)| own == b || *own == a);
        if let Some(b) = odd[k + 1..].iter().copied().filter(alike).filter(free).find(fits) {
            found.extend([(a, b), (b, a)]);
        }
    }
    found
}
