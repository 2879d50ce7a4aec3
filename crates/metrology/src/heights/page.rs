//! Figures of heights: measured, model and residual side by side.

use metalith_report::{ImageGrid, Page, sig};
use ndarray::Array2;
use rayon::prelude::*;

use super::model::HeightModel;
use super::set::HeightSet;

/// Most groups that are shown, by one field each.
const MOST_SHOWN: usize = 6;

/// Add the maps of one field of each group to a page.
pub(crate) fn figures(page: &mut Page, set: &HeightSet, model: &HeightModel<'_>, theta: &[f64]) {
    page.section("Measured, model, residual");
    page.paragraph("The field of each group whose residual is the median of its group. The residual has the level of the field removed.");
    for group in 0..set.groups.len().min(MOST_SHOWN) {
        let mut own: Vec<(f64, usize)> = (0..set.fields.len())
            .into_par_iter()
            .filter(|&f| set.fields[f].group == group)
            .map(|f| (model.shape_rms(f, theta), f))
            .collect();
        own.sort_by(|a, b| a.0.total_cmp(&b.0));
        let Some(&(error, field)) = own.get(own.len() / 2) else {
            continue;
        };
        let (measured, predicted) = (model.measured(field), model.predicted(field, theta));
        let mut residual: Array2<f64> = &measured - &predicted;
        let mean = residual.mean().unwrap_or(0.0);
        residual -= mean;
        let mut maps = ImageGrid::new(format!("{}: heights", set.fields[field].name), 2);
        maps.image("measured", measured);
        maps.image("model", predicted);
        let mut left = ImageGrid::new(format!("{}: residual", set.fields[field].name), 1);
        left.image("measured less model", residual);
        let role = if set.fields[field].fitted {
            "fitted"
        } else {
            "not fitted"
        };
        page.row([
            maps.pixel_um(set.sample_um)
                .values("height", "nm")
                .caption(format!("{} {}, {role}.", set.group_name, set.groups[group])),
            left.pixel_um(set.sample_um)
                .values("residual", "nm")
                .diverging()
                .caption(format!("{} nm rms after the nuisances of the field.", sig(error, 3))),
        ]);
    }
}
