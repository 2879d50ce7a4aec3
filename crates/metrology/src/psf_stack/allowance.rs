//! What a set cannot know: the error of the samples of the light, and scales that look alike.

use metalith_attribution::{RefitFinding, RefitModel, RefitPlan};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::model::StackModel;
use super::sampling::{FINER, Sampling};
use super::set::StackSet;

/// Error of a value over its change on the finer grid: means over samples err by the square of their distance.
const WHOLE: f64 = 1.0 / (1.0 - 1.0 / (FINER * FINER));

/// Widen the intervals of a finding by the error of the samples of the light, from the change of the values on a finer grid; what was
/// done, in words.
pub(crate) fn allow_for_samples(
    set: &StackSet,
    sampling: &Sampling,
    (model, plan): (&StackModel<'_>, &RefitPlan),
    found: &mut RefitFinding,
) -> Option<String> {
    let effects = model.effects();
    let active: Vec<usize> = found.chosen.iter().flat_map(|&e| effects[e].slots.clone()).collect();
    let finer = sampling.finer().filter(|_| !active.is_empty())?;
    let other = StackModel::new(set, &finer, found.theta[super::setting::FOCUS]);
    let step = |model: &StackModel<'_>| -> Option<DVector<f64>> {
        let size = active.len() + 1;
        let fitted = (0..model.count()).into_par_iter().filter(|&m| plan.fitted[m]);
        let forms: Vec<DMatrix<f64>> = fitted.map(|m| model.form(m, &active, &found.theta)).collect();
        let sum = forms.into_iter().fold(DMatrix::zeros(size, size), |a, b| a + b);
        let normal = sum.view((0, 0), (size - 1, size - 1)).into_owned();
        let right = sum.view((0, size - 1), (size - 1, 1)).column(0).into_owned();
        Some(normal.cholesky()?.solve(&right))
    };
    let change = step(&other)? - step(model)?;
    for (&slot, change) in active.iter().zip(change.iter()) {
        let error = WHOLE * change.abs();
        let range = model.parameters()[slot].range;
        if let Some([low, high]) = &mut found.intervals[slot] {
            (*low, *high) = (*low - error, *high + error);
            [low, high].into_iter().for_each(|v| *v = v.clamp(range.0, range.1));
        }
    }
    Some(format!(
        "intervals: each is wider on either side by {WHOLE:.1} times the change of its value with {} samples of {:.3} um across the light",
        finer.n, finer.dx_um
    ))
}

/// Effects whose values look alike together: what is larger in the plane of the light has a smaller image.
const SCALES: [&str; 4] = ["aperture_scale", "mask_scale", "pixel_scale", "plane_spacing"];

/// A remark where scales were found that others explain as well.
pub(crate) fn equal_scales(model: &StackModel<'_>, found: &RefitFinding) -> Option<String> {
    let is_scale = |&&e: &&usize| SCALES.contains(&model.effects()[e].name.as_str());
    (found.chosen.iter().filter(is_scale).count() > 1).then(|| {
        "scales: aperture_scale and mask_scale larger by a factor, pixel_scale smaller by it and plane_spacing smaller by its square look alike; state what you know of them, and the others follow".into()
    })
}
