//! What a set cannot know: the error of the samples of the light, and scales that look alike.

use metalith_attribution::{RefitFinding, RefitModel, RefitPlan};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::Prepared;
use super::model::StackModel;
use super::sampling::{FINER, Sampling};
use super::set::StackSet;

/// Error of a value over its change on the finer grid: means over samples err by the square of their distance.
const WHOLE: f64 = 1.0 / (1.0 - 1.0 / (FINER * FINER));

/// Widen the intervals of a finding by the error of the samples of the masks and of the light, from the change of the values where they
/// are finer; what was done, in words.
pub(crate) fn allow_for_samples(
    set: &StackSet,
    prepared: &Prepared,
    (model, plan): (&StackModel<'_>, &RefitPlan),
    found: &mut RefitFinding,
) -> Option<String> {
    let effects = model.effects();
    let active: Vec<usize> = found.chosen.iter().flat_map(|&e| effects[e].slots.clone()).collect();
    let smooth = Sampling {
        smooth_masks: true,
        ..prepared.sampling.clone()
    };
    let finer = prepared.sampling.finer();
    let here = step(set, (model, plan), &active, found)?;
    let mut errors = vec![0.0; active.len()];
    for (other, factor) in [(Some(&smooth), 1.0), (finer.as_ref(), WHOLE)] {
        let Some(other) = other else { continue };
        let prepared = Prepared {
            sampling: other.clone(),
            focus_um: found.theta[super::setting::FOCUS],
            noise: prepared.noise,
        };
        let other = StackModel::new(set, &prepared);
        let there = step(set, (&other, plan), &active, found)?;
        for ((error, here), there) in errors.iter_mut().zip(here.iter()).zip(there.iter()) {
            *error += factor * (there - here).abs();
        }
    }
    for (&slot, error) in active.iter().zip(errors) {
        let range = model.parameters()[slot].range;
        if let Some([low, high]) = &mut found.intervals[slot] {
            (*low, *high) = (*low - error, *high + error);
            [low, high].into_iter().for_each(|v| *v = v.clamp(range.0, range.1));
        }
    }
    let samples = finer.map_or_else(String::new, |finer| {
        format!(
            ", and by {WHOLE:.1} times its change with {} samples of {:.3} um across the light",
            finer.n, finer.dx_um
        )
    });
    Some(format!(
        "intervals: each is wider on either side by the change of its value where masks pass evenly from sample to sample{samples}"
    ))
}

/// Step from the fitted values towards those that a model fits; none if it does not determine them, or if there are none.
fn step(
    set: &StackSet,
    (model, plan): (&StackModel<'_>, &RefitPlan),
    active: &[usize],
    found: &RefitFinding,
) -> Option<DVector<f64>> {
    let size = active.len() + 1;
    let fitted = (0..set.planes.len()).into_par_iter().filter(|&m| plan.fitted[m]);
    let forms: Vec<DMatrix<f64>> = fitted.map(|m| model.form(m, active, &found.theta)).collect();
    let sum = forms.into_iter().fold(DMatrix::zeros(size, size), |a, b| a + b);
    let normal = sum.view((0, 0), (size - 1, size - 1)).into_owned();
    let right = sum.view((0, size - 1), (size - 1, 1)).column(0).into_owned();
    (size > 1).then(|| normal.cholesky())?.map(|c| c.solve(&right))
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
