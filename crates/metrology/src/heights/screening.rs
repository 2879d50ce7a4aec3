//! Mistakes of height maps that no fit shows: other units, maps that are turned, upside down, exchanged or cut, and dead samples.

use metalith_report::sig;
use ndarray::{Array2, Axis};

use super::set::{FieldNuisances, HeightField};
use crate::number_rows::median;

/// Most samples along an axis of the maps that are compared: means of blocks.
const COMPARED: usize = 64;

/// Correlation from which on two maps show the same relief, and below which they do not.
const ALIKE: f64 = 0.6;
const UNLIKE: f64 = 0.3;

/// Largest ratio of measured to drawn heights, and of drawn to measured ones: beyond it units differ.
const RATIO: f64 = 6.0;

/// Share of the range of a map by which a dead sample is beyond all its neighbours.
const BEYOND: f64 = 0.25;

/// Largest share of dead samples that are mended.
const MOST_DEAD: f64 = 0.01;

/// Share of samples with the largest number of a format, from which on heights were cut.
const CUT: f64 = 0.005;

/// Largest numbers of the formats of 8 and 16 bits.
const LARGEST: [f32; 2] = [255.0, 65_535.0];

/// The words for the eight orientations: rows and columns exchanged, rows reversed, columns reversed.
const WORDS: [&str; 8] = [
    "upright",
    "with their columns reversed",
    "with their rows reversed",
    "turned by half a turn",
    "with rows and columns exchanged",
    "turned by a quarter",
    "turned by a quarter the other way",
    "mirrored at the other diagonal",
];

/// True if heights were cut at the largest number of the format of a map as read.
pub(super) fn is_cut(map: &Array2<f32>) -> bool {
    let largest = map.iter().copied().fold(f32::MIN, f32::max);
    let count = map.iter().filter(|v| **v == largest).count();
    LARGEST.contains(&largest) && count as f64 > CUT * map.len() as f64
}

/// Replace dead samples, which have no number or lie far beyond all their neighbours where the drawing does not, by the median of
/// their neighbours; their number, or in words that there are too many.
pub(super) fn mend(drawn: &Array2<f32>, measured: &mut Array2<f32>) -> Result<usize, String> {
    let mut sorted: Vec<f32> = measured.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f32::total_cmp);
    let at = |share: f64| sorted.get((share * sorted.len() as f64) as usize).copied();
    let (Some(low), Some(high)) = (at(0.02), at(0.98)) else {
        return Err("no sample is a finite number".into());
    };
    let beyond = (BEYOND * f64::from(high - low)) as f32;
    let (rows, cols) = measured.dim();
    let around = |map: &Array2<f32>, y: usize, x: usize| -> Vec<f32> {
        let (ys, xs) = (
            y.saturating_sub(1)..(y + 2).min(rows),
            x.saturating_sub(1)..(x + 2).min(cols),
        );
        let all = ys.flat_map(|j| xs.clone().map(move |i| (j, i)));
        all.filter(|own| *own != (y, x)).map(|own| map[own]).collect()
    };
    let outside = |map: &Array2<f32>, y: usize, x: usize, by: f32| {
        let (least, most) = around(map, y, x)
            .into_iter()
            .filter(|v| v.is_finite())
            .fold((f32::MAX, f32::MIN), |(a, b), v| (a.min(v), b.max(v)));
        map[(y, x)] < least - by || map[(y, x)] > most + by
    };
    let dead: Vec<(usize, usize)> = (0..rows * cols)
        .map(|k| (k / cols, k % cols))
        .filter(|&(y, x)| {
            let own = measured[(y, x)];
            !own.is_finite() || high > low && outside(measured, y, x, beyond) && !outside(drawn, y, x, 0.0)
        })
        .collect();
    if dead.len() as f64 > MOST_DEAD * measured.len() as f64 {
        let (n, all) = (dead.len(), measured.len());
        return Err(format!(
            "{n} of its {all} samples are dead: no number, or far beyond their neighbours"
        ));
    }
    let values: Vec<f32> = dead
        .iter()
        .map(|&(y, x)| {
            let mut near: Vec<f32> = around(measured, y, x).into_iter().filter(|v| v.is_finite()).collect();
            near.sort_by(f32::total_cmp);
            near.get(near.len() / 2).copied().unwrap_or(low)
        })
        .collect();
    for (place, value) in dead.iter().zip(values) {
        measured[*place] = value;
    }
    Ok(dead.len())
}

/// A field as it is compared: small maps without mean and slopes.
struct Small {
    drawn: Array2<f64>,
    measured: Array2<f64>,
}

/// What is wrong with the measured maps, and the remedy.
pub(super) fn wrong_maps(
    fields: &[HeightField],
    rim: usize,
    nuisances: FieldNuisances,
) -> Option<(String, &'static str)> {
    let of = |map: &Array2<f32>| small(map, rim, nuisances.lines);
    let all: Vec<Small> = fields
        .iter()
        .map(|f| Small {
            drawn: of(&f.drawn),
            measured: of(&f.measured),
        })
        .collect();
    if let Some(flat) = fields
        .iter()
        .find(|f| f.measured.iter().all(|v| *v == f.measured[(0, 0)]))
    {
        return Some((
            format!("{} is flat: all its samples are equal", flat.name),
            "leave it out by the pattern",
        ));
    }
    let mean = |own: &dyn Fn(&Small) -> f64| all.iter().map(own).sum::<f64>() / all.len().max(1) as f64;
    let upright = mean(&|s| correlation(&s.drawn, &s.measured));
    let is_square = all.iter().all(|s| s.drawn.nrows() == s.drawn.ncols());
    let best = (1..if is_square { 8 } else { 4 })
        .map(|k| (mean(&|s| correlation(&s.drawn, &turned(&s.measured, k))), k))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    if let Some((found, k)) = best.filter(|(found, _)| *found > ALIKE && upright < UNLIKE) {
        let what = format!(
            "the measured maps agree with the drawn ones {} (correlation {found:.2}), and not as they are ({upright:.2})",
            WORDS[k]
        );
        return Some((what, "save the maps so that rows and columns run as in the drawn ones"));
    }
    if upright < -ALIKE {
        let what = format!("measured heights fall where drawn ones rise (correlation {upright:.2})");
        return Some((what, "save one of the maps with the other sign"));
    }
    if upright > UNLIKE {
        let ratio = median(
            all.iter()
                .map(|s| product(&s.drawn, &s.measured) / product(&s.drawn, &s.drawn))
                .collect(),
        );
        if !(1.0 / RATIO..=RATIO).contains(&ratio) {
            let what = format!("measured heights are {} times the drawn ones", sig(ratio, 3));
            return Some((
                what,
                "check `nm_per_level` of [drawn] and [measured], and the unit of the files",
            ));
        }
    }
    exchanged(fields, &all)
}

/// Fields whose measured map shows what was drawn for another field.
fn exchanged(fields: &[HeightField], all: &[Small]) -> Option<(String, &'static str)> {
    let wrong: Vec<String> = (0..all.len())
        .filter(|&k| correlation(&all[k].drawn, &all[k].measured) < UNLIKE)
        .filter_map(|k| {
            let other = (0..all.len()).find(|&j| j != k && correlation(&all[j].drawn, &all[k].measured) > ALIKE)?;
            Some(format!(
                "{} shows what was drawn for {}",
                fields[k].name, fields[other].name
            ))
        })
        .collect();
    (!wrong.is_empty()).then(|| (wrong.join("; "), "correct the names of these files"))
}

fn small(map: &Array2<f32>, rim: usize, lines: bool) -> Array2<f64> {
    let [rows, cols] = [map.nrows(), map.ncols()].map(|n| n - 2 * rim);
    let block = rows.max(cols).div_ceil(COMPARED);
    let (rows, cols) = (rows / block, cols / block);
    let mut out = Array2::from_shape_fn((rows, cols), |(y, x)| {
        let own = (0..block * block).map(|k| (rim + y * block + k / block, rim + x * block + k % block));
        own.map(|place| f64::from(map[place])).sum::<f64>() / (block * block) as f64
    });
    let along = |n: usize, k: usize| k as f64 - (n as f64 - 1.0) / 2.0;
    let moment = |n: usize| (0..n).map(|k| along(n, k).powi(2)).sum::<f64>();
    let mean = out.sum() / out.len() as f64;
    let by_y: f64 =
        out.indexed_iter().map(|((y, _), v)| v * along(rows, y)).sum::<f64>() / (moment(rows) * cols as f64);
    let by_x: f64 =
        out.indexed_iter().map(|((_, x), v)| v * along(cols, x)).sum::<f64>() / (moment(cols) * rows as f64);
    out.indexed_iter_mut()
        .for_each(|((y, x), v)| *v -= mean + by_y * along(rows, y) + by_x * along(cols, x));
    if lines {
        for mut line in out.axis_iter_mut(Axis(0)) {
            let mean = line.sum() / cols as f64;
            line.mapv_inplace(|v| v - mean);
        }
    }
    out
}

/// One of the orientations of [`WORDS`].
fn turned(map: &Array2<f64>, k: usize) -> Array2<f64> {
    let mut view = map.view();
    if k & 4 != 0 {
        view.swap_axes(0, 1);
    }
    if k & 2 != 0 {
        view.invert_axis(Axis(0));
    }
    if k & 1 != 0 {
        view.invert_axis(Axis(1));
    }
    view.to_owned()
}

fn product(a: &Array2<f64>, b: &Array2<f64>) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Correlation of two maps without mean; zero of a flat one.
fn correlation(a: &Array2<f64>, b: &Array2<f64>) -> f64 {
    let norm = (product(a, a) * product(b, b)).sqrt();
    if norm > 0.0 { product(a, b) / norm } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(name: &str, seed: f32, of: impl Fn(&Array2<f32>) -> Array2<f32>) -> HeightField {
        let drawn = Array2::from_shape_fn((48, 48), |(y, x)| {
            let (y, x) = (y as f32, x as f32);
            100.0 * ((0.2 * x + seed).sin() + (0.13 * y + 0.07 * x * seed).cos())
        });
        HeightField {
            name: name.into(),
            measured: of(&drawn),
            drawn,
            group: 0,
            fitted: true,
        }
    }

    fn told(of: impl Fn(&Array2<f32>) -> Array2<f32> + Copy) -> String {
        let fields = [field("a", 1.0, of), field("b", 2.0, of)];
        wrong_maps(&fields, 2, FieldNuisances::default()).map_or_else(String::new, |(what, _)| what)
    }

    #[test]
    fn mistakes_of_maps_are_told() {
        assert_eq!(told(|d| d.mapv(|v| 0.8 * v + 40.0)), "");
        assert!(told(|d| d.mapv(|v| 0.001 * v)).contains("times the drawn ones"));
        assert!(told(|d| d.mapv(|v| -v)).contains("fall"));
        assert!(told(|d| Array2::from_shape_fn(d.dim(), |(y, x)| d[(y, 47 - x)])).contains("columns reversed"));
        assert!(told(|d| Array2::from_elem(d.dim(), 5.0)).contains("flat"));
        let mut fields = [field("a", 1.0, Clone::clone), field("b", 2.0, Clone::clone)];
        let first = fields[0].measured.clone();
        fields[0].measured = std::mem::replace(&mut fields[1].measured, first);
        let (what, _) = wrong_maps(&fields, 2, FieldNuisances::default()).unwrap();
        assert_eq!(what, "a shows what was drawn for b; b shows what was drawn for a");
    }

    #[test]
    fn dead_samples_are_mended() {
        let mut own = field("a", 1.0, Clone::clone);
        let whole = own.measured.clone();
        own.measured[(20, 7)] = f32::NAN;
        own.measured[(11, 30)] = 5000.0;
        assert_eq!(mend(&own.drawn, &mut own.measured), Ok(2));
        assert!((&own.measured - &whole).iter().all(|d| d.abs() < 30.0));
        own.measured
            .indexed_iter_mut()
            .filter(|((y, _), _)| *y < 4)
            .for_each(|(_, v)| *v = f32::NAN);
        assert!(mend(&own.drawn, &mut own.measured).is_err());
    }
}
