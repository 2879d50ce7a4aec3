//! What is added to a drawn width: effects with their parameters, and what each is a factor of at a site.

use metalith_attribution::{ConditionalEffect, Extent, RefitEffect, RefitParameter};
use metalith_optics::{RANGE_UM, RANGES_UM};
use nalgebra::{DMatrix, DVector};

use super::fill::Surroundings;
use super::set::{WidthSet, WidthSite};

pub(super) const BIAS: usize = 0;
pub(super) const DOSE: usize = 1;
pub(super) const PROXIMITY: usize = 2;
pub(super) const RANGE: usize = 3;
pub(super) const LOADING: usize = 4;
pub(super) const WIDTH: usize = 5;
pub(super) const WIDTH_SQUARE: usize = 6;
pub(super) const ALONG: usize = 7;
pub(super) const CHIP_X: usize = 8;
pub(super) const CHIP_Y: usize = 9;
pub(super) const CHIP_RADIAL: usize = 10;
pub(super) const FIELD_X: usize = 11;
pub(super) const FIELD_Y: usize = 12;
pub(super) const FIELD_RADIAL: usize = 13;
pub(super) const BORDER: usize = 14;
pub(super) const REACH: usize = 15;
/// First of the biases of groups.
pub(super) const GROUPS: usize = 16;

/// Widths over which the terms of the drawn width are counted (nm).
pub(super) const PER_WIDTH_NM: f64 = 100.0;

/// Ranges that a fit may start from (um).
const STARTS_UM: [f64; 8] = [1.5, 3.0, 6.0, 12.0, RANGE_UM, 60.0, 120.0, 240.0];

/// Fill and open area that differ by less than this tell nothing of a bias by them.
const LEAST_SPAN: f64 = 0.02;

/// Least difference of fills from loadings, relative to the spread of loadings, that distinguishes a proximity from a loading.
const OWN_SHARE: f64 = 0.1;

/// Places, widths and doses of a set that its terms count from.
#[derive(Clone, Debug)]
pub(super) struct Terms {
    /// Mean drawn width, whole (nm).
    pub(super) pivot_nm: f64,
    /// Middle of the places (um), and half of what they span along the longer axis.
    pub(super) middle_um: [f64; 2],
    pub(super) half_um: f64,
    /// Size of a write field and its corner (um).
    pub(super) field: Option<(f64, [f64; 2])>,
}

impl Terms {
    pub(super) fn of(set: &WidthSet) -> Self {
        let drawn: f64 = set.sites.iter().map(|s| s.drawn_nm).sum();
        let places: Vec<[f64; 2]> = set.sites.iter().filter_map(|s| s.at_um).collect();
        let extent = Extent::of(&places);
        Self {
            pivot_nm: (drawn / set.sites.len().max(1) as f64).round(),
            half_um: extent
                .as_ref()
                .map_or(1.0, |e| e.half_spans.iter().copied().fold(1e-3, f64::max)),
            middle_um: extent.map_or([0.0; 2], |e| e.middle),
            field: set.field.map(|f| (f.size_um, f.corner_um)),
        }
    }

    /// Place in its write field: both coordinates run from -1 to 1.
    pub(super) fn in_field(&self, at_um: [f64; 2]) -> Option<[f64; 2]> {
        let (size, corner) = self.field?;
        Some([0, 1].map(|k| 2.0 * ((at_um[k] - corner[k]) / size).rem_euclid(1.0) - 1.0))
    }

    /// What the parameters are factors of, at values of the two that are ranges: the derivatives of a width. The fill, which takes
    /// longest, is computed where a parameter that is active needs it, or its value.
    pub(super) fn factors(&self, site: &WidthSite, theta: &[f64], active: &[usize]) -> [f64; GROUPS] {
        let mut out = [0.0; GROUPS];
        let wider = (site.drawn_nm - self.pivot_nm) / PER_WIDTH_NM;
        out[BIAS] = 1.0;
        out[DOSE] = site.dose_percent;
        out[LOADING] = site.loading.unwrap_or(0.0);
        out[WIDTH] = wider;
        out[WIDTH_SQUARE] = wider * wider;
        out[ALONG] = 0.5 * site.along;
        let filled = theta[PROXIMITY] != 0.0 || active.contains(&PROXIMITY);
        if let Some(around) = site.surroundings.as_ref().filter(|_| filled) {
            let range = theta[RANGE];
            out[PROXIMITY] = around.fill(range);
            if theta[PROXIMITY] != 0.0 && active.contains(&RANGE) {
                let step = 1e-3 * range;
                let change = (around.fill(range + step) - around.fill(range - step)) / (2.0 * step);
                out[RANGE] = theta[PROXIMITY] * change;
            }
        }
        let Some(at) = site.at_um else { return out };
        let [x, y] = [0, 1].map(|k| (at[k] - self.middle_um[k]) / self.half_um);
        [out[CHIP_X], out[CHIP_Y], out[CHIP_RADIAL]] = [x, y, x * x + y * y];
        if let (Some([x, y]), Some((size, _))) = (self.in_field(at), self.field) {
            [out[FIELD_X], out[FIELD_Y], out[FIELD_RADIAL]] = [x, y, x * x + y * y];
            let distance = 0.5 * size * (1.0 - x.abs().max(y.abs()));
            let reach = theta[REACH];
            out[BORDER] = (-distance / reach).exp();
            out[REACH] = theta[BORDER] * out[BORDER] * distance / (reach * reach);
        }
        out
    }

    /// Width that is added at a site with these factors (nm).
    pub(super) fn added_nm(site: &WidthSite, factors: &[f64; GROUPS], theta: &[f64]) -> f64 {
        let linear = (0..GROUPS).filter(|slot| ![RANGE, REACH].contains(slot));
        linear.map(|slot| factors[slot] * theta[slot]).sum::<f64>() + theta.get(GROUPS + site.group).unwrap_or(&0.0)
    }
}

/// Effects that need more than drawn and measured widths.
pub(crate) const CONDITIONAL: [ConditionalEffect; 9] = {
    const PLACES: &str = "more than two places: columns `x_um` and `y_um`, or pads of `[fill] regions`";
    const FIELDS: &str = "a section `[field]`, and places";
    const fn of(name: &'static str, needs: &'static str) -> ConditionalEffect {
        ConditionalEffect { name, needs }
    }
    [
        of("dose_slope", "a column `dose` with three doses or more"),
        of(
            "proximity",
            "a column `fill`, or a section `[fill]`, and places of different fill",
        ),
        of(
            "loading",
            "a column `open_area`, or a section `[fill]`, and places of different loading",
        ),
        of("width_*", "four drawn widths or more"),
        of("orientation", "widths along x and along y, or a column `orientation`"),
        of("chip_*", PLACES),
        of("field_slope", FIELDS),
        of("field_radial", FIELDS),
        of("field_border", FIELDS),
    ]
};

/// Parameters of all effects, and the effects that a set can tell of.
pub(super) fn effects(set: &WidthSet, terms: &Terms) -> (Vec<RefitParameter>, Vec<RefitEffect>) {
    let fitted = || set.sites.iter().filter(|s| s.fitted);
    let distinct = |of: &dyn Fn(&WidthSite) -> Option<f64>| {
        let mut values: Vec<f64> = fitted().filter_map(of).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        values
    };
    let spans = |values: &[f64]| values.len() > 2 && values[values.len() - 1] - values[0] > LEAST_SPAN;
    let shortest = shortest_um(set);
    let start = start_um(set, terms, shortest);
    let size = terms.field.map_or(1.0, |(size, _)| size);
    let plain = |name: &str, unit| parameter(name, unit, 0.0, (-1e4, 1e4));
    let width = format!("width_slope about {} nm", terms.pivot_nm);
    let mut parameters = vec![
        plain("bias", "nm"),
        plain("dose_slope", "nm/%"),
        plain("proximity", "nm"),
        parameter("proximity range", "um", start, (shortest, *RANGES_UM.end())),
        plain("loading", "nm"),
        plain(&width, "nm/100 nm"),
        plain("width_square", "nm/(100 nm)^2"),
        plain("orientation", "nm"),
        plain("chip_slope x", "nm"),
        plain("chip_slope y", "nm"),
        plain("chip_radial", "nm"),
        plain("field_slope x", "nm"),
        plain("field_slope y", "nm"),
        plain("field_radial", "nm"),
        plain("field_border", "nm"),
        parameter("field_border reach", "um", 0.05 * size, (0.002 * size, 0.25 * size)),
    ];
    let mut out: Vec<RefitEffect> = Vec::new();
    let mut effect = |name: &str, slots: &[usize], after: Option<&str>, across: Option<usize>| {
        out.push(RefitEffect {
            name: name.into(),
            slots: slots.to_vec(),
            after: after
                .iter()
                .filter_map(|n| out.iter().position(|e| e.name == **n))
                .collect(),
            across,
        });
    };
    effect("bias", &[BIAS], None, None);
    if distinct(&|s| Some(s.dose_percent)).len() > 2 {
        effect("dose_slope", &[DOSE], None, None);
    }
    if spans(&distinct(&|s| s.fill(start))) {
        let stated = fitted().any(|s| matches!(s.surroundings, Some(Surroundings::Stated(_))));
        effect(
            "proximity",
            if stated { &[PROXIMITY] } else { &[PROXIMITY, RANGE] },
            None,
            None,
        );
    }
    if spans(&distinct(&|s| s.loading)) {
        effect("loading", &[LOADING], None, None);
    }
    let widths = distinct(&|s| Some(s.drawn_nm)).len();
    if widths > 2 {
        effect("width_slope", &[WIDTH], None, None);
    }
    if widths > 3 {
        effect("width_square", &[WIDTH_SQUARE], Some("width_slope"), None);
    }
    if distinct(&|s| Some(s.along)).len() > 1 {
        effect("orientation", &[ALONG], None, None);
    }
    let apart = [0, 1].map(|k| distinct(&|s| Some(s.at_um?[k])).len() > 2);
    let axes = |x: usize| -> Vec<usize> { (0..2).filter(|k| apart[*k]).map(|k| x + k).collect() };
    if apart.contains(&true) {
        effect("chip_slope", &axes(CHIP_X), None, None);
        effect("chip_radial", &[CHIP_RADIAL], None, None);
        if set.field.is_some() {
            effect("field_slope", &axes(FIELD_X), None, None);
            effect("field_radial", &[FIELD_RADIAL], None, None);
            effect("field_border", &[BORDER, REACH], None, None);
        }
    }
    if let Some((name, groups)) = set.groups.as_ref().filter(|(_, groups)| groups.len() > 1) {
        let by = format!("bias_by_{name}");
        parameters.extend(groups.iter().map(|g| plain(&format!("{by} {g}"), "nm")));
        let slots: Vec<usize> = (GROUPS..GROUPS + groups.len()).collect();
        effect(&by, &slots, None, Some(0));
    }
    (parameters, out)
}

fn parameter(name: &str, unit: &'static str, start: f64, range: (f64, f64)) -> RefitParameter {
    RefitParameter {
        name: name.into(),
        unit,
        neutral: start,
        start,
        range,
        shown: |v| v,
    }
}

/// Shortest range (um) at which the fill differs from the loading of a place by a share of what loadings differ by: below it, a
/// proximity is a loading.
fn shortest_um(set: &WidthSet) -> f64 {
    let sites: Vec<_> = set.sites.iter().filter(|s| s.fitted).collect();
    let pairs: Vec<_> = sites
        .iter()
        .filter_map(|s| Some((s.surroundings.as_ref()?, s.loading?)))
        .collect();
    let count = pairs.len().max(1) as f64;
    let mean = pairs.iter().map(|(_, l)| l).sum::<f64>() / count;
    let spread: f64 = pairs.iter().map(|(_, l)| (l - mean).powi(2)).sum();
    let (first, last) = (*RANGES_UM.start(), *RANGES_UM.end());
    let differs = |range: &f64| {
        let off: f64 = pairs.iter().map(|(around, l)| (around.fill(*range) - l).powi(2)).sum();
        off > OWN_SHARE * OWN_SHARE * spread
    };
    let ranges = std::iter::successors(Some(first), |range| Some(1.1 * range)).take_while(|range| *range < last / 3.0);
    if pairs.is_empty() || spread == 0.0 {
        return first;
    }
    { ranges }.find(differs).unwrap_or(first)
}

/// Range of the fill that a fit starts from (um): the one with which a bias by the fill leaves least beside a plain bias and
/// slopes with dose and width.
fn start_um(set: &WidthSet, terms: &Terms, shortest_um: f64) -> f64 {
    if let Some(stated) = set.stated_range_um {
        return stated;
    }
    let sites: Vec<&WidthSite> = set.sites.iter().filter(|s| s.fitted).collect();
    let left = |range: f64| {
        let mut theta = [0.0; GROUPS];
        (theta[RANGE], theta[REACH]) = (range, 1.0);
        let slots = [BIAS, DOSE, WIDTH, PROXIMITY];
        let rows: Vec<[f64; GROUPS]> = sites.iter().map(|s| terms.factors(s, &theta, &slots)).collect();
        let a = DMatrix::from_fn(sites.len(), slots.len(), |i, k| rows[i][slots[k]]);
        let b = DVector::from_fn(sites.len(), |i, _| sites[i].mean_nm() - sites[i].drawn_nm);
        let x = a.clone().svd(true, true).solve(&b, 1e-9);
        x.map_or(f64::MAX, |x| (a * x - b).norm_squared())
    };
    let all = STARTS_UM.into_iter().map(|range| range.max(1.5 * shortest_um));
    let all = all.map(|range| (left(range), range));
    all.min_by(|a, b| a.0.total_cmp(&b.0))
        .map_or(RANGE_UM, |(_, range)| range)
}
