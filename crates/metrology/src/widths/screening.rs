//! Mistakes of a table of widths that no fit shows: other units, exchanged columns, and single repeats that are far from the others.

use std::collections::BTreeSet;

use super::set::WidthSite;
use super::table::Table;
use crate::number_rows::{NORMAL, median};

/// Largest ratio of measured to drawn widths, and of drawn to measured ones, half of which lie beyond it only by other units.
const MEDIAN_RATIO: f64 = 3.0;

/// Ratio from which on the report asks whether edges or radii were measured.
const ODD_RATIO: f64 = 1.6;

/// Columns are exchanged if the drawn one has this multiple of the different values that the measured one has.
const MORE_DRAWN: usize = 10;

/// Distance of a repeat from the median of its site, over the standard deviation of repeats, from which on it is left out.
const FAR: f64 = 10.0;

/// Least such distance (nm): repeats may be rounded.
const FAR_NM: f64 = 5.0;

/// Numbers of the columns of widths.
pub(super) struct Screening {
    drawn: Vec<f64>,
    measured: Vec<f64>,
}

impl Screening {
    pub(super) fn new(table: &Table, drawn: usize, measured: &[(usize, Option<f64>)]) -> Self {
        Self {
            drawn: table.numbers(drawn),
            measured: measured.iter().flat_map(|(c, _)| table.numbers(*c)).collect(),
        }
    }

    /// What is wrong with the columns as a whole, and the remedy.
    pub(super) fn wrong_columns(&self) -> Option<(String, String)> {
        if self.drawn.is_empty() || self.measured.is_empty() {
            return None;
        }
        let [drawn, measured] = [&self.drawn, &self.measured].map(|values| median(values.clone()));
        let ratio = measured / drawn;
        if drawn < 1.0 || !(1.0 / MEDIAN_RATIO..=MEDIAN_RATIO).contains(&ratio) {
            return Some((
                format!("the medians of the drawn and measured widths are {drawn} nm and {measured} nm"),
                "give both columns in nm, and check which column is which".into(),
            ));
        }
        let distinct = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<BTreeSet<_>>().len();
        let [of_drawn, of_measured] = [&self.drawn, &self.measured].map(|values| distinct(values));
        (of_drawn >= MORE_DRAWN * of_measured.max(2)).then(|| {
            (
                format!("{of_drawn} different drawn widths have only {of_measured} different measured ones"),
                "check whether the columns of drawn and measured widths are exchanged".into(),
            )
        })
    }
}

/// Leave out repeats that are far from the others of their site; what was found, in words.
pub(super) fn remarks(sites: &mut [WidthSite]) -> Vec<String> {
    let mut out = Vec::new();
    let middles: Vec<f64> = sites.iter().map(|s| median(s.measured_nm.clone())).collect();
    let repeated = sites.iter().zip(&middles).filter(|(s, _)| s.measured_nm.len() > 2);
    let off: Vec<f64> = repeated
        .flat_map(|(s, middle)| s.measured_nm.iter().map(move |nm| (nm - middle).abs()))
        .collect();
    let limit = (FAR * NORMAL * median(off)).max(FAR_NM);
    let mut left_out = Vec::new();
    for (site, middle) in sites.iter_mut().zip(&middles).filter(|(s, _)| s.measured_nm.len() > 2) {
        let drawn = site.drawn_nm;
        site.measured_nm.retain(|nm| {
            let is_near = (nm - middle).abs() <= limit;
            if !is_near {
                left_out.push(format!("{nm:.1} nm beside {middle:.1} nm (drawn: {drawn} nm)"));
            }
            is_near
        });
    }
    if !left_out.is_empty() {
        let shown = left_out.iter().take(MOST_SHOWN).cloned().collect::<Vec<_>>().join("; ");
        out.push(format!(
            "{} repeats are left out, because they differ from the median of their site by more than {limit:.1} nm: {shown}",
            left_out.len()
        ));
    }
    let ratios = sites.iter().map(|s| s.mean_nm() / s.drawn_nm).collect();
    let ratio = median(ratios);
    if !(1.0 / ODD_RATIO..=ODD_RATIO).contains(&ratio) {
        out.push(format!(
            "The median of measured over drawn widths is {ratio:.2}: check the units, and whether radii or other edges were measured"
        ));
    }
    out
}

/// Most repeats that a remark lists.
const MOST_SHOWN: usize = 5;
