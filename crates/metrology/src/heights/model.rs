//! Forward model of heights: from a drawn map to the relief that the writer and the material make of it.

use std::borrow::Cow;

use metalith_attribution::{
    ConditionalEffect, LeaveOut, RefitEffect, RefitEquations, RefitModel, RefitParameter, RefitPlan,
};
use nalgebra::DMatrix;
use ndarray::Array2;
use num_complex::Complex;
use rayon::prelude::*;

use super::far_field::{FarFieldPlan, relative_error};
use super::fft::{Fft2, frequency};
use super::set::HeightSet;
use crate::declared::{DeclaredEffect, DeclaredSlots, Stage};
use crate::noise::root_mean_square;

/// Samples that a drawn map goes on beyond its rim, as its outermost samples are: a blur of 2 um at 0.1 um a sample.
const MARGIN: usize = 64;

/// Only each second sample along both axes is fitted: neighbours within a blur tell the same.
const STRIDE: usize = 2;

/// Weight of the level of a field in a fit, over that of as many independent samples: a level is one number, whatever its samples.
const LEVEL_WEIGHT: f64 = 1e-3;

const GAIN: usize = 0;
const LEVEL: usize = 1;
const BLUR: usize = 2;
const LONG_SHARE: usize = 3;
const LONG_RANGE: usize = 4;
const CURVE: usize = 5;
const GAIN_OVER_FIELD: usize = 7;
const BEND: usize = 11;
/// First of the levels of groups.
const LEVELS: usize = 15;

/// A set of heights with its forward model.
pub struct HeightModel<'a> {
    set: &'a HeightSet,
    parameters: Vec<RefitParameter>,
    /// Effects that are tried.
    pub(crate) effects: Vec<RefitEffect>,
    /// Spectra of the drawn maps with their margin, transposed.
    spectra: Vec<Vec<Complex<f32>>>,
    forward: Fft2<f32>,
    inverse: Fft2<f32>,
    /// Square of the angular frequency of each element of a spectrum (1/um^2).
    squared: Vec<f32>,
    far_field: Option<(FarFieldPlan, Vec<Vec<f64>>)>,
    /// Middle and half of the span of drawn heights (nm).
    span: [f64; 2],
    declared: DeclaredSlots,
}

/// The relief of a field without its level, at all samples inside the rim, and what it is made of.
struct Relief {
    /// Blurred heights (nm), by a mixture of a short and a long range, and the change with each parameter of the blurs.
    core: Vec<f64>,
    changes: [Vec<f64>; 3],
}

impl<'a> HeightModel<'a> {
    /// A model of a set that was read.
    pub fn new(set: &'a HeightSet) -> Self {
        let (rows, cols) = set.fields.first().map_or((16, 16), |f| f.drawn.dim());
        let [n, m] = [rows, cols].map(|n| n + 2 * MARGIN);
        let forward = Fft2::new(n, m, false);
        let spectra = set
            .fields
            .par_iter()
            .map(|f| forward.transposed(with_margin(&f.drawn)))
            .collect();
        let squared = (0..n * m)
            .map(|k| {
                let along = |k, n| std::f64::consts::TAU * frequency(k, n) / set.sample_um;
                (along(k / n, m).powi(2) + along(k % n, n).powi(2)) as f32
            })
            .collect();
        let inside = [rows, cols].map(|n| n - 2 * set.rim);
        let far_field = set.far_field.map(|light| {
            let plan = FarFieldPlan::new(light, inside[0], inside[1]);
            let measured = set
                .fields
                .par_iter()
                .map(|f| plan.intensities(inside_rim(&f.measured, set.rim).view()));
            let measured = measured.collect();
            (plan, measured)
        });
        let ends = set.fields.iter().filter(|f| f.fitted).flat_map(|f| f.drawn.iter());
        let (low, high) = ends.fold((f32::MAX, f32::MIN), |(a, b), v| (a.min(*v), b.max(*v)));
        let span = [0.5 * f64::from(low + high), (0.5 * f64::from(high - low)).max(1e-3)];
        let (parameters, effects) = effects(set);
        Self {
            set,
            parameters,
            effects,
            spectra,
            forward,
            // Spectra are transposed: so is what comes back.
            inverse: Fft2::new(m, n, true),
            squared,
            far_field,
            span,
            declared: DeclaredSlots::default(),
        }
    }

    /// Add effects of a file.
    pub(crate) fn declare(&mut self, effects: &[DeclaredEffect]) -> metalith_core::Result<()> {
        let to = (&mut self.parameters, &mut self.effects);
        self.declared.add(effects, self.set.groups.len(), to)
    }

    /// Half of the longer edge of a field (um), and the middle and half of the span of drawn heights (nm).
    pub(crate) fn extent(&self) -> (f64, [f64; 2]) {
        let longer = self.inside().into_iter().max().unwrap_or(2);
        (0.5 * (longer - 1) as f64 * self.set.sample_um, self.span)
    }

    /// Roles of the fields: groups and single fields are left out in turn.
    pub fn plan(&self) -> RefitPlan {
        let fields = &self.set.fields;
        RefitPlan {
            fitted: fields.iter().map(|f| f.fitted).collect(),
            ways: vec![
                LeaveOut {
                    name: self.set.group_name.clone(),
                    groups: fields.iter().map(|f| f.group).collect(),
                },
                LeaveOut {
                    name: "field".into(),
                    groups: (0..fields.len()).collect(),
                },
            ],
        }
    }

    /// Size of a map inside the rim.
    fn inside(&self) -> [usize; 2] {
        let (rows, cols) = self.set.fields[0].drawn.dim();
        [rows, cols].map(|n| n - 2 * self.set.rim)
    }

    /// Spectrum of the drawn map of a field with what a file declares to be added to it.
    fn drawn(&self, field: usize, theta: &[f64]) -> Cow<'_, [Complex<f32>]> {
        if !self.declared.acts(Stage::Drawn, theta) {
            return Cow::Borrowed(&self.spectra[field]);
        }
        let own = &self.set.fields[field];
        let (rows, cols) = own.drawn.dim();
        let map = Array2::from_shape_fn((rows, cols), |(y, x)| {
            let h = own.drawn[(y, x)];
            let at = |k: usize, n: usize| (k as f64 - 0.5 * (n - 1) as f64) * self.set.sample_um;
            let variables = [at(x, cols), at(y, rows), f64::from(h)];
            h + self.declared.value(Stage::Drawn, own.group, &variables, theta) as f32
        });
        Cow::Owned(self.forward.transposed(with_margin(&map)))
    }

    /// What files declare to be added to a height (nm) at a stage after the blur, at a sample inside the rim.
    fn added(&self, stage: Stage, field: usize, k: usize, height: f64, theta: &[f64]) -> f64 {
        let [rows, cols] = self.inside();
        let at = |k: usize, n: usize| (k as f64 - 0.5 * (n - 1) as f64) * self.set.sample_um;
        let variables = [at(k % cols, cols), at(k / cols, rows), height];
        self.declared
            .value(stage, self.set.fields[field].group, &variables, theta)
    }

    /// Predicted height (nm) at a sample inside the rim for its height after the blur.
    fn height(&self, field: usize, theta: &[f64], k: usize, core: f64, [is_printed, is_measured]: [bool; 2]) -> f64 {
        let (factor, terms) = Self::over_field(theta, self.place(k));
        let more = if is_printed {
            self.added(Stage::Printed, field, k, core, theta)
        } else {
            0.0
        };
        let height = theta[GAIN] * factor * self.curved(theta, core + more).0 + self.base(field, theta, terms);
        if is_measured {
            height + self.added(Stage::Measured, field, k, height, theta)
        } else {
            height
        }
    }

    /// Whether files declare something that acts on a printed and on a measured map.
    fn declared_stages(&self, theta: &[f64]) -> [bool; 2] {
        [Stage::Printed, Stage::Measured].map(|stage| self.declared.acts(stage, theta))
    }

    /// Two real maps: the drawn one through two real transfer functions of the squared frequency.
    fn filtered(&self, drawn: &[Complex<f32>], transfer: impl Fn(f32) -> (f32, f32)) -> [Vec<f64>; 2] {
        let product = drawn.iter().zip(&self.squared).map(|(s, k2)| {
            let (a, b) = transfer(*k2);
            s * Complex::new(a, b)
        });
        let back = self.inverse.transposed(product.collect());
        let (m, n) = (self.inverse.rows, self.inverse.cols);
        let [rows, cols] = self.inside();
        let first = MARGIN + self.set.rim;
        let scale = 1.0 / (m * n) as f64;
        let mut out = [Vec::with_capacity(rows * cols), Vec::with_capacity(rows * cols)];
        for y in first..first + rows {
            for v in &back[y * m + first..y * m + first + cols] {
                out[0].push(f64::from(v.re) * scale);
                out[1].push(f64::from(v.im) * scale);
            }
        }
        out
    }

    fn relief(&self, field: usize, theta: &[f64], active: &[usize]) -> Relief {
        let gaussian = |variance: f64| move |k2: f32| (-0.5 * k2 * variance as f32).exp();
        let is = |slot: usize| active.contains(&slot);
        let (short, long) = (gaussian(theta[BLUR]), gaussian(theta[LONG_RANGE]));
        let share = theta[LONG_SHARE];
        let drawn = self.drawn(field, theta);
        let [mut core, mut by_blur] = self.filtered(&drawn, |k2| (short(k2), -0.5 * k2 * short(k2)));
        let (mut by_share, mut by_range) = (Vec::new(), Vec::new());
        if share != 0.0 || is(LONG_SHARE) {
            let [far, by_far] = self.filtered(&drawn, |k2| (long(k2), -0.5 * k2 * long(k2)));
            by_share = far.iter().zip(&core).map(|(f, c)| f - c).collect();
            by_range = by_far.iter().map(|v| share * v).collect();
            for (c, f) in core.iter_mut().zip(&far) {
                *c += share * (f - *c);
            }
            by_blur.iter_mut().for_each(|v| *v *= 1.0 - share);
        }
        Relief {
            core,
            changes: [by_blur, by_share, by_range],
        }
    }

    /// Factor and its terms by the place in the field: both coordinates run from -1 to 1.
    fn over_field(theta: &[f64], [x, y]: [f64; 2]) -> (f64, [f64; 4]) {
        let terms = [x, y, x * x - 1.0 / 3.0, y * y - 1.0 / 3.0];
        let sum: f64 = terms.iter().zip(&theta[GAIN_OVER_FIELD..]).map(|(t, c)| t * c).sum();
        (1.0 + sum, terms)
    }

    /// The curve of the dose: height over blurred height, and its derivative.
    fn curved(&self, theta: &[f64], core: f64) -> (f64, f64, [f64; 2]) {
        let [middle, half] = self.span;
        let u = (core - middle) / half;
        let [square, cube] = [theta[CURVE], theta[CURVE + 1]];
        let terms = [half * u * u, half * u * u * u];
        let height = core + square * terms[0] + cube * terms[1];
        (height, 1.0 + 2.0 * square * u + 3.0 * cube * u * u, terms)
    }

    fn place(&self, k: usize) -> [f64; 2] {
        let [rows, cols] = self.inside();
        let along = |i: usize, n: usize| 2.0 * i as f64 / (n - 1) as f64 - 1.0;
        [along(k % cols, cols), along(k / cols, rows)]
    }

    /// Level of a field with what bends it, at a place.
    fn base(&self, field: usize, theta: &[f64], terms: [f64; 4]) -> f64 {
        let bend: f64 = terms.iter().zip(&theta[BEND..]).map(|(t, c)| t * c).sum();
        theta[LEVEL] + theta[LEVELS + self.set.fields[field].group] + bend
    }

    /// Predicted heights of a field inside the rim (nm).
    pub fn predicted(&self, field: usize, theta: &[f64]) -> Array2<f64> {
        self.heights(&self.relief(field, theta, &[]), field, theta)
    }

    /// Root mean square of the residual of a field without its level (nm).
    pub fn shape_rms(&self, field: usize, theta: &[f64]) -> f64 {
        self.squares(&self.relief(field, theta, &[]), field, theta)[0].sqrt()
    }

    /// Mean squares of the residual of a field: of its shape, and of its level (nm^2).
    fn squares(&self, relief: &Relief, field: usize, theta: &[f64]) -> [f64; 2] {
        let forms = self.shape_and_level(relief, field, &[], theta);
        forms.map(|form| form[(0, 0)] / self.points(field))
    }

    fn heights(&self, relief: &Relief, field: usize, theta: &[f64]) -> Array2<f64> {
        let [rows, cols] = self.inside();
        let stages = self.declared_stages(theta);
        let values = relief.core.iter().enumerate();
        let values = values.map(|(k, core)| self.height(field, theta, k, *core, stages));
        Array2::from_shape_vec((rows, cols), values.collect()).expect("as many as inside the rim")
    }

    /// Measured heights of a field inside the rim (nm).
    pub fn measured(&self, field: usize) -> Array2<f64> {
        inside_rim(&self.set.fields[field].measured, self.set.rim)
    }

    /// Columns of derivatives and of the residual at the samples that are fitted, and those of nuisances.
    fn columns(
        &self,
        relief: &Relief,
        field: usize,
        active: &[usize],
        theta: &[f64],
    ) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
        let [rows, cols] = self.inside();
        let measured = &self.set.fields[field].measured;
        let (rim, group) = (self.set.rim, self.set.fields[field].group);
        let mut out = vec![Vec::new(); active.len() + 1];
        let nuisances = &self.set.nuisances;
        let mut own = vec![Vec::new(); 4];
        let stages = self.declared_stages(theta);
        // Changes with declared parameters, by differences.
        let changes: Vec<Option<(Array2<f64>, f64)>> = active
            .iter()
            .map(|&slot| {
                let mut moved = theta.to_vec();
                let step = self.declared.step(slot)?;
                let step = if theta[slot] + step > self.parameters[slot].range.1 {
                    -step
                } else {
                    step
                };
                moved[slot] += step;
                let is_drawn = self.declared.acts(Stage::Drawn, &moved);
                let changed = if is_drawn {
                    self.predicted(field, &moved)
                } else {
                    self.heights(relief, field, &moved)
                };
                Some((changed, step))
            })
            .collect();
        for y in (0..rows).step_by(STRIDE) {
            for x in (0..cols).step_by(STRIDE) {
                let k = y * cols + x;
                let place = self.place(k);
                let (factor, terms) = Self::over_field(theta, place);
                let core = relief.core[k];
                let more = if stages[0] {
                    self.added(Stage::Printed, field, k, core, theta)
                } else {
                    0.0
                };
                let (height, slope, curves) = self.curved(theta, core + more);
                let predicted = self.height(field, theta, k, core, stages);
                let gain = theta[GAIN];
                for ((column, &slot), change) in out.iter_mut().zip(active).zip(&changes) {
                    if let Some((moved, step)) = change {
                        column.push((moved[(y, x)] - predicted) / step);
                        continue;
                    }
                    column.push(match slot {
                        GAIN => factor * height,
                        LEVEL => 1.0,
                        BLUR..CURVE => gain * factor * slope * relief.changes[slot - BLUR][k],
                        CURVE..GAIN_OVER_FIELD => gain * factor * curves[slot - CURVE],
                        GAIN_OVER_FIELD..BEND => gain * height * terms[slot - GAIN_OVER_FIELD],
                        BEND..LEVELS => terms[slot - BEND],
                        _ => f64::from(u8::from(slot - LEVELS == group)),
                    });
                }
                out[active.len()].push(f64::from(measured[(y + rim, x + rim)]) - predicted);
                if nuisances.plane {
                    own[0].push(place[0]);
                    own[1].push(place[1]);
                }
                if nuisances.shift {
                    let at = |y: usize, x: usize| relief.core[y * cols + x];
                    own[2].push(at(y, (x + 1).min(cols - 1)) - at(y, x.saturating_sub(1)));
                    own[3].push(at((y + 1).min(rows - 1), x) - at(y.saturating_sub(1), x));
                }
            }
        }
        own.retain(|column| !column.is_empty());
        (out, own)
    }

    /// Normal equations of the shape, nuisances eliminated, and of the mean.
    fn shape_and_level(&self, relief: &Relief, field: usize, active: &[usize], theta: &[f64]) -> [DMatrix<f64>; 2] {
        let (mut columns, mut own) = self.columns(relief, field, active, theta);
        let size = columns.len();
        let along = self.inside()[1].div_ceil(STRIDE);
        let means: Vec<f64> = columns.iter().map(|c| mean(c)).collect();
        for column in columns.iter_mut().chain(&mut own) {
            if self.set.nuisances.lines {
                column.chunks_mut(along).for_each(without_mean);
            } else {
                without_mean(column);
            }
        }
        // Columns of nuisances are made orthonormal; those that lines hold already are rounding.
        let mut basis: Vec<Vec<f64>> = Vec::new();
        for mut column in own {
            let before = dot(&column, &column);
            basis.iter().for_each(|b| take_off(&mut column, b));
            let left = dot(&column, &column);
            if left > 1e-9 * before && left > 1e-12 {
                let norm = left.sqrt();
                column.iter_mut().for_each(|v| *v /= norm);
                basis.push(column);
            }
        }
        for column in &mut columns {
            basis.iter().for_each(|b| take_off(column, b));
        }
        let count = columns[0].len() as f64;
        let mut shape = DMatrix::zeros(size, size);
        for i in 0..size {
            for j in 0..=i {
                shape[(i, j)] = dot(&columns[i], &columns[j]);
                shape[(j, i)] = shape[(i, j)];
            }
        }
        [shape, DMatrix::from_fn(size, size, |i, j| count * means[i] * means[j])]
    }
}

impl RefitModel for HeightModel<'_> {
    fn parameters(&self) -> &[RefitParameter] {
        &self.parameters
    }

    fn effects(&self) -> &[RefitEffect] {
        &self.effects
    }

    fn count(&self) -> usize {
        self.set.fields.len()
    }

    fn points(&self, _: usize) -> f64 {
        self.inside().iter().map(|n| n.div_ceil(STRIDE)).product::<usize>() as f64
    }

    fn equations(&self, field: usize, active: &[usize], theta: &[f64]) -> RefitEquations {
        let relief = self.relief(field, theta, active);
        let [shape, level] = self.shape_and_level(&relief, field, active, theta);
        RefitEquations {
            fit: &shape + &level * LEVEL_WEIGHT,
            judged: shape + level,
        }
    }

    fn figure_names(&self) -> Vec<(&'static str, &'static str)> {
        let mut names = vec![
            ("height, level included", "nm rms"),
            ("height, own level removed", "nm rms"),
        ];
        if self.far_field.is_some() {
            names.push(("relative error of the far field", ""));
        }
        names
    }

    fn is_mean(&self, figure: usize) -> bool {
        figure == 2
    }

    fn figures(&self, field: usize, theta: &[f64]) -> Vec<f64> {
        let relief = self.relief(field, theta, &[]);
        let [shape, level] = self.squares(&relief, field, theta);
        let mut out = vec![(shape + level).sqrt(), shape.sqrt()];
        if let Some((plan, measured)) = &self.far_field {
            let found = plan.intensities(self.heights(&relief, field, theta).view());
            out.push(relative_error(&found, &measured[field]));
        }
        out
    }

    fn noise(&self, theta: &[f64]) -> Option<f64> {
        let fitted: Vec<usize> = (0..self.count()).filter(|&f| self.set.fields[f].fitted).collect();
        let of = |&f: &usize| crate::noise::of_map(&(self.measured(f) - self.predicted(f, theta)));
        let each: Vec<f64> = fitted.par_iter().map(of).collect();
        Some(root_mean_square(each.into_iter())).filter(|noise| *noise > 0.0)
    }

    fn group_name(&self, way: usize, group: usize) -> String {
        match way {
            0 => self.set.groups[group].clone(),
            _ => self.set.fields[group].name.clone(),
        }
    }

    /// The level of a group that was not fitted is not predicted, so it refuses nothing.
    fn decides(&self, figure: usize) -> bool {
        figure > 0
    }
}

/// Effects that are tried on some sets only.
pub(crate) const CONDITIONAL: [ConditionalEffect; 2] = [
    ConditionalEffect {
        name: "slope",
        needs: "`each_field` of `[nuisances]` without `plane`",
    },
    ConditionalEffect {
        name: "level_by_*",
        needs: "the name in braces after `level_by_` as `by` of `[groups]`, with two groups or more",
    },
];

fn effects(set: &HeightSet) -> (Vec<RefitParameter>, Vec<RefitEffect>) {
    let parameter = |name: &str, unit, neutral, start, range, shown| RefitParameter {
        name: name.into(),
        unit,
        neutral,
        start,
        range,
        shown,
    };
    let plain = |name: &str, unit| parameter(name, unit, 0.0, 0.0, (-1e4, 1e4), |v| v);
    let short = (2.0 * set.sample_um).powi(2);
    let long = (40.0 * set.sample_um).powi(2);
    let mut parameters = vec![
        parameter("gain", "", 1.0, 1.0, (0.0, 10.0), |v| v),
        plain("level", "nm"),
        parameter("blur", "um", 0.0, short, (0.0, 400.0 * short), f64::sqrt),
        parameter("long_range share", "", 0.0, 0.0, (-0.5, 0.9), |v| v),
        parameter("long_range", "um", long, long, (4.0 * short, 9.0 * long), f64::sqrt),
        plain("dose_curve 2", ""),
        plain("dose_curve 3", ""),
        plain("gain_slope x", ""),
        plain("gain_slope y", ""),
        plain("gain_curvature x", ""),
        plain("gain_curvature y", ""),
        plain("slope x", "nm"),
        plain("slope y", "nm"),
        plain("curvature x", "nm"),
        plain("curvature y", "nm"),
    ];
    let by = format!("level_by_{}", set.group_name);
    parameters.extend(set.groups.iter().map(|g| plain(&format!("{by} {g}"), "nm")));
    let mut out: Vec<RefitEffect> = Vec::new();
    let mut effect = |name: &str, slots: Vec<usize>, after: &[&str], across| {
        let after = after
            .iter()
            .filter_map(|n| out.iter().position(|e| e.name == *n))
            .collect();
        out.push(RefitEffect {
            name: name.into(),
            slots,
            after,
            across,
        });
    };
    effect("gain", vec![GAIN], &[], None);
    effect("level", vec![LEVEL], &[], None);
    effect("blur", vec![BLUR], &["gain"], None);
    effect("long_range", vec![LONG_SHARE, LONG_RANGE], &["blur"], None);
    effect("dose_curve", vec![CURVE, CURVE + 1], &["gain"], None);
    effect(
        "gain_slope",
        vec![GAIN_OVER_FIELD, GAIN_OVER_FIELD + 1],
        &["gain"],
        None,
    );
    effect(
        "gain_curvature",
        vec![GAIN_OVER_FIELD + 2, GAIN_OVER_FIELD + 3],
        &["gain"],
        None,
    );
    // Nuisances hold some of these effects; only the others are tried.
    let nuisances = set.nuisances;
    let slopes: &[usize] = match (nuisances.plane, nuisances.lines) {
        (true, _) => &[],
        (_, true) => &[BEND],
        _ => &[BEND, BEND + 1],
    };
    if !slopes.is_empty() {
        effect("slope", slopes.to_vec(), &["level"], None);
    }
    let bends = if nuisances.lines { 1 } else { 2 };
    effect("curvature", (BEND + 2..).take(bends).collect(), &["level"], None);
    if set.groups.len() > 1 {
        let slots = (0..set.groups.len()).map(|g| LEVELS + g).collect();
        effect(&by, slots, &["level"], Some(0));
    }
    (parameters, out)
}

/// A map without its rim.
fn inside_rim(map: &Array2<f32>, rim: usize) -> Array2<f64> {
    let (rows, cols) = map.dim();
    Array2::from_shape_fn((rows - 2 * rim, cols - 2 * rim), |(y, x)| {
        f64::from(map[(y + rim, x + rim)])
    })
}

fn with_margin(map: &Array2<f32>) -> Vec<Complex<f32>> {
    let (rows, cols) = map.dim();
    let inner = |k: usize, n: usize| k.saturating_sub(MARGIN).min(n - 1);
    let row = |y: usize| (0..cols + 2 * MARGIN).map(move |x| Complex::new(map[(inner(y, rows), inner(x, cols))], 0.0));
    (0..rows + 2 * MARGIN).flat_map(row).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn without_mean(values: &mut [f64]) {
    let mean = mean(values);
    values.iter_mut().for_each(|v| *v -= mean);
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Eight sums at a time, as the processor has it.
    let (mut sums, chunks) = ([0.0; 8], a.len() / 8 * 8);
    for (a, b) in a[..chunks].chunks_exact(8).zip(b[..chunks].chunks_exact(8)) {
        for k in 0..8 {
            sums[k] += a[k] * b[k];
        }
    }
    let rest: f64 = a[chunks..].iter().zip(&b[chunks..]).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}

/// Take the part along a unit vector off.
fn take_off(values: &mut [f64], unit: &[f64]) {
    let part = dot(values, unit);
    values.iter_mut().zip(unit).for_each(|(v, u)| *v -= part * u);
}
