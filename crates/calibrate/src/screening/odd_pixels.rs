//! Hot and dead pixels: single pixels that stand out of their neighbours where the model has no such detail.

use std::collections::BTreeSet;

use ndarray::Array2;

use crate::data::Data;
use crate::set::{MeasuredSet, MeasurementIndex, PerMeasurement};
use metalith_attribution::Measurements;
use metalith_sensor::ColourFilter;

/// A pixel stands out by this many standard deviations of its noise: of a million pixels none does by chance.
const SIGMAS: f32 = 10.0;

/// Least difference of a hot pixel from its neighbours, as a share of its signal; of a dead pixel, as a share of the signal of its
/// neighbours. No effect changes one pixel alone by so much.
const SHARE: f32 = 0.5;

/// A model that has half of that at this place, or beside it, shows such a detail.
const SHARE_OF_MODEL: f32 = 0.5 * SHARE;

/// Where a larger share of a frame stands out it is no matter of single pixels.
const MOST: f64 = 0.01;

/// Fewest neighbours that say what a pixel should show.
const FEWEST: usize = 5;

/// A pixel that stands out of its neighbours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OddPixel {
    /// Row and column.
    pub at: (usize, usize),
    pub is_hot: bool,
    /// Median of its neighbours.
    expected: f32,
}

/// Neighbours of a pixel: the second largest, the second smallest and the median of their values, so that one odd neighbour hides
/// nothing; none with too few that count.
fn neighbours(
    values: &Array2<f32>,
    counts: impl Fn((usize, usize)) -> bool,
    (y, x): (usize, usize),
    stride: usize,
) -> Option<[f32; 3]> {
    let (rows, cols) = values.dim();
    let along = |at: usize, size: usize| {
        [
            at.checked_sub(stride),
            Some(at),
            Some(at + stride).filter(|p| *p < size),
        ]
    };
    let (mut near, mut n) = ([0.0; 9], 0);
    for ny in along(y, rows).into_iter().flatten() {
        for nx in along(x, cols).into_iter().flatten() {
            if (ny, nx) != (y, x) && counts((ny, nx)) {
                near[n] = values[(ny, nx)];
                n += 1;
            }
        }
    }
    near[..n].sort_unstable_by(f32::total_cmp);
    (n >= FEWEST).then(|| [near[n - 2], near[1], near[n / 2]])
}

/// Pixels of each measurement that stand out. A pixel is dead only if it is so wherever its neighbours have light, twice at least:
/// the middle of an image out of focus may be dark.
pub(super) fn candidates(set: &MeasuredSet, data: &Data) -> PerMeasurement<Vec<OddPixel>> {
    // Next to a pixel under a filter are others, under the second next are its like.
    let stride = if set.camera.filter == ColourFilter::None { 1 } else { 2 };
    let mut found: PerMeasurement<Vec<OddPixel>> = data.indices().map(|c| odd_pixels(data, c, stride)).collect();
    let dead: BTreeSet<(usize, usize)> = found.iter().flatten().filter(|p| !p.is_hot).map(|p| p.at).collect();
    for at in dead {
        let is_lit = |c: MeasurementIndex| {
            let (signal, weight) = (&data.signal[c], &data.weight[c]);
            let light = neighbours(signal, |p| weight[p] > 0.0, at, stride);
            weight[at] > 0.0 && light.is_some_and(|[_, low, _]| SHARE * low > SIGMAS * weight[at].recip())
        };
        let lit = data.indices().filter(|&c| is_lit(c)).count();
        let is_here = |p: &OddPixel| p.at == at && !p.is_hot;
        let times = found.iter().filter(|own| own.iter().any(is_here)).count();
        if times < 2 || 2 * times < lit {
            found.iter_mut().for_each(|own| own.retain(|p| !is_here(p)));
        }
    }
    found
}

/// Pixels of a measurement that stand out.
fn odd_pixels(data: &Data, c: MeasurementIndex, stride: usize) -> Vec<OddPixel> {
    let (signal, weight) = (&data.signal[c], &data.weight[c]);
    let counts = |p| weight[p] > 0.0;
    let mut odd = Vec::new();
    for (at, &value) in signal.indexed_iter().filter(|(at, _)| counts(*at)) {
        let Some([high, low, expected]) = neighbours(signal, counts, at, stride) else {
            continue;
        };
        let clear = SIGMAS * weight[at].recip();
        let is_hot = value - high > clear.max(SHARE * value);
        let is_dead = || {
            // A dead pixel has less noise than its light would have.
            let of_light = neighbours(weight, counts, at, stride).map_or(0.0, |[_, least, _]| SIGMAS * least.recip());
            low - value > clear.max(of_light).max(SHARE * low)
        };
        if is_hot || (low - value > clear && is_dead()) {
            odd.push(OddPixel { at, is_hot, expected });
        }
    }
    if odd.len() as f64 > MOST * signal.len() as f64 {
        odd.clear();
    }
    odd
}

/// Mask a pixel in all measurements if it stands out in two or more and in half of them or more: in the others light hides it.
pub(super) fn mask_everywhere(data: &Data, odd: &mut PerMeasurement<Vec<OddPixel>>) {
    let places: BTreeSet<(usize, usize)> = odd.iter().flatten().map(|p| p.at).collect();
    for at in places {
        let times = odd.iter().filter(|own| own.iter().any(|p| p.at == at)).count();
        if times < 2 || 2 * times < odd.len() {
            continue;
        }
        for (c, own) in odd.iter_mut_enumerated() {
            if own.iter().all(|p| p.at != at) {
                let signal = &data.signal[c];
                let expected =
                    neighbours(signal, |p| data.weight[c][p] > 0.0, at, 1).map_or(signal[at], |near| near[2]);
                own.push(OddPixel {
                    at,
                    is_hot: true,
                    expected,
                });
            }
        }
    }
}

/// True if an image of the model has such a detail at the place of a pixel, or beside it.
pub(super) fn is_of_the_model(odd: &OddPixel, model: &Array2<f32>) -> bool {
    let (rows, cols) = model.dim();
    let (y, x) = odd.at;
    let mut beside = (y.saturating_sub(1)..(y + 2).min(rows))
        .flat_map(|ny| (x.saturating_sub(1)..(x + 2).min(cols)).map(move |nx| (ny, nx)));
    beside.any(|at| {
        let own = model[at];
        neighbours(model, |_| true, at, 1).is_some_and(|[high, low, _]| {
            if odd.is_hot {
                own - high > SHARE_OF_MODEL * own
            } else {
                low - own > SHARE_OF_MODEL * low
            }
        })
    })
}

/// Data without some pixels of each measurement: they do not count, and show the median of their neighbours.
pub(super) fn without(data: &Data, odd: &PerMeasurement<Vec<OddPixel>>) -> Data {
    let mut data = data.clone();
    for (c, own) in odd.iter_enumerated() {
        for pixel in own {
            data.weight[c][pixel.at] = 0.0;
            data.signal[c][pixel.at] = pixel.expected;
        }
    }
    data
}

/// Number, kind and places of pixels that are masked, in words; none without any.
pub(super) fn described(odd: &PerMeasurement<Vec<OddPixel>>) -> Option<String> {
    /// Places that are listed.
    const LISTED: usize = 8;
    let mut places: Vec<((usize, usize), bool, usize)> = Vec::new();
    for own in odd.iter().flatten() {
        match places.iter_mut().find(|p| (p.0, p.1) == (own.at, own.is_hot)) {
            Some(known) => known.2 += 1,
            None => places.push((own.at, own.is_hot, 1)),
        }
    }
    if places.is_empty() {
        return None;
    }
    let hot = places.iter().filter(|p| p.1).count();
    let list: Vec<String> = places
        .iter()
        .take(LISTED)
        .map(|((row, col), is_hot, times)| {
            let kind = if *is_hot { "hot" } else { "dead" };
            format!(
                "{kind} at row {row}, column {col} in {times} of {} measurements",
                odd.len()
            )
        })
        .collect();
    let more = if places.len() > LISTED { ", and others" } else { "" };
    Some(format!(
        "{hot} hot and {} dead pixels are masked: {}{more}",
        places.len() - hot,
        list.join("; ")
    ))
}
