//! Figures of stacks: measured, model and residual side by side.

use metalith_report::{ImageGrid, Page, sig};
use ndarray::Array2;

use super::model::StackModel;
use super::set::StackSet;

/// Most objects that are shown, by three planes each.
const MOST_SHOWN: usize = 8;

/// Add planes of each object to a page.
pub(crate) fn figures(page: &mut Page, set: &StackSet, model: &StackModel<'_>, theta: &[f64]) {
    page.section("Measured, model, residual");
    page.paragraph("The first, the middle and the last plane of each stack, each over the norm of the measured frame.");
    for object in 0..set.objects.len().min(MOST_SHOWN) {
        let own: Vec<usize> = (0..set.planes.len())
            .filter(|&m| set.planes[m].object == object)
            .collect();
        let mut shown = vec![0, own.len() / 2, own.len().saturating_sub(1)];
        shown.dedup();
        for m in shown.into_iter().filter_map(|k| own.get(k).copied()) {
            let [measured, predicted] = model.pair(m, theta);
            let residual: Array2<f64> = &measured - &predicted;
            let error = residual.iter().map(|v| v * v).sum::<f64>().sqrt();
            let name = &set.planes[m].name;
            let mut maps = ImageGrid::new(format!("{name}: light"), 2);
            maps.image("measured", measured);
            maps.image("model", predicted);
            let mut left = ImageGrid::new(format!("{name}: residual"), 1);
            left.image("measured less model", residual);
            let role = if set.planes[m].fitted { "fitted" } else { "not fitted" };
            page.row([
                maps.pixel_um(set.bench.pixel_um)
                    .values("light", "")
                    .caption(format!("{name}, {role}.")),
                left.pixel_um(set.bench.pixel_um)
                    .values("residual", "")
                    .diverging()
                    .caption(format!("{} of the measured norm.", sig(error, 3))),
            ]);
        }
    }
}
