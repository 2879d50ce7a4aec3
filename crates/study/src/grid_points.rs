//! Statistics of draws at each value of a grid.

use std::collections::BTreeMap;

use metalith_core::document::Scalar;
use serde::Serialize;

use crate::draw::Sampler;
use crate::record::DrawRecord;
use crate::yields::wilson;

/// Combinations of grid values that are told one by one; yields of so many points are a table that a person reads.
const MOST_COMBINATIONS: usize = 200;

/// The draws at one value of a grid, or at one combination of values of several.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GridPoint {
    /// Name and value of each quantity that is held.
    pub at: Vec<(String, Scalar)>,
    pub draws: u64,
    /// Draws that hold all limits.
    pub held: u64,
    /// Wilson's interval of 95 % of the yield.
    pub interval: [f64; 2],
    /// Figures by key, over the draws where the figure is a number.
    pub figures: BTreeMap<String, Spread>,
}

/// Mean and standard deviation of a figure over draws.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    pub mean: f64,
    pub sd: f64,
    /// Draws where it is a number.
    pub of: u64,
}

/// One value of a quantity: its place among the amounts, its name, amount and value.
type Held<'n> = (usize, &'n str, f64, Scalar);

/// The values of each quantity of a grid, one quantity after the other.
pub(crate) fn each_value(drawer: &Sampler, names: &[(String, String)], draws: &[DrawRecord]) -> Vec<GridPoint> {
    let grids = grids(drawer, names);
    let values = grids.into_iter().flatten();
    values.map(|held| point(&[held], draws)).collect()
}

/// Every combination of values, where there are several grids and not too many combinations.
pub(crate) fn combinations(drawer: &Sampler, names: &[(String, String)], draws: &[DrawRecord]) -> Vec<GridPoint> {
    let grids = grids(drawer, names);
    let sizes = grids.iter().map(Vec::len);
    if grids.len() < 2 || sizes.fold(1, usize::saturating_mul) > MOST_COMBINATIONS {
        return Vec::new();
    }
    let mut all: Vec<Vec<Held<'_>>> = vec![Vec::new()];
    for values in grids {
        let longer = all.iter().flat_map(|held| {
            values
                .iter()
                .map(|value| held.iter().chain([value]).cloned().collect::<Vec<_>>())
        });
        all = longer.collect();
    }
    all.iter().map(|held| point(held, draws)).collect()
}

fn grids<'n>(drawer: &Sampler, names: &'n [(String, String)]) -> Vec<Vec<Held<'n>>> {
    let each = names.iter().enumerate().filter_map(|(q, (name, _))| {
        let mut values = drawer.grid(q)?;
        // A value that stands twice is one value with twice the draws.
        let mut seen: Vec<f64> = Vec::new();
        values.retain(|(amount, _)| {
            let new = !seen.contains(amount);
            seen.push(*amount);
            new
        });
        Some(values.into_iter().map(|(a, v)| (q, name.as_str(), a, v)).collect())
    });
    each.collect()
}

fn point(held: &[Held<'_>], draws: &[DrawRecord]) -> GridPoint {
    // Amounts of a grid are copies of its values, bit for bit.
    let here = |d: &&DrawRecord| held.iter().all(|(q, _, amount, _)| d.amounts[*q] == *amount);
    let draws: Vec<&DrawRecord> = draws.iter().filter(here).collect();
    let passed = draws.iter().filter(|d| d.passed).count() as u64;
    let mut values: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for (key, value) in draws.iter().flat_map(|d| &d.figures) {
        values.entry(key).or_default().extend(*value);
    }
    GridPoint {
        at: held.iter().map(|(_, n, _, v)| ((*n).to_owned(), v.clone())).collect(),
        draws: draws.len() as u64,
        held: passed,
        interval: wilson(passed, draws.len() as u64),
        figures: values
            .into_iter()
            .filter(|(_, v)| !v.is_empty())
            .map(|(key, v)| (key.to_owned(), Spread::of(&v)))
            .collect(),
    }
}

impl Spread {
    fn of(values: &[f64]) -> Self {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let squares = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
        Self {
            mean,
            sd: (squares / n).sqrt(),
            of: values.len() as u64,
        }
    }
}
