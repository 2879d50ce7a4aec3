//! Figures of widths: measured over drawn, and the residual over drawn width, dose and place with the repeats as a band.

use metalith_report::{Axis, Chart, Page};

use super::model::WidthModel;
use super::set::{WidthSet, WidthSite};

/// Add the widths of a set to a page.
pub(crate) fn figures(page: &mut Page, set: &WidthSet, model: &WidthModel<'_>, theta: &[f64]) {
    page.section("Measured, model, residual");
    let mut widths = Chart::new(
        "Measured and drawn widths",
        Axis::linear("drawn width", "nm"),
        Axis::linear("measured less drawn width", "nm"),
    );
    let over = |of: &dyn Fn(&WidthSite) -> f64, y: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
        let mut points: Vec<_> = set.sites.iter().enumerate().map(|(k, s)| (of(s), y(k))).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points
    };
    let off = |k: usize| set.sites[k].mean_nm() - set.sites[k].drawn_nm;
    let added = |k: usize| model.predicted_nm(k, theta) - set.sites[k].drawn_nm;
    widths.points("measured, mean of repeats", over(&|s| s.drawn_nm, &off));
    widths.points("model", over(&|s| s.drawn_nm, &added));
    page.figure(widths.caption("Each point is a site: one place, width and dose."));
    let left = |k: usize| set.sites[k].mean_nm() - model.predicted_nm(k, theta);
    let noise = set.repeat_rms();
    let mut residual = |title: &str, axis: Axis, of: &dyn Fn(&WidthSite) -> f64| {
        let points = over(of, &left);
        if points.first().map(|p| p.0) == points.last().map(|p| p.0) {
            return;
        }
        let mut chart = Chart::new(title, axis, Axis::linear("measured less model", "nm")).size(460.0, 260.0);
        if let Some(nm) = noise {
            let ends = [points[0].0, points[points.len() - 1].0];
            chart.band("repeats, one standard deviation", ends.map(|x| (x, -nm, nm)));
        }
        chart.points("residual", points);
        page.figure(chart.caption("Residual of the mean of the repeats."));
    };
    residual("Residual over drawn width", Axis::linear("drawn width", "nm"), &|s| {
        s.drawn_nm
    });
    residual(
        "Residual over dose",
        Axis::linear("dose, change from nominal", "%"),
        &|s| s.dose_percent,
    );
    for (k, axis) in ["x", "y"].into_iter().enumerate() {
        residual(&format!("Residual over {axis}"), Axis::linear(axis, "um"), &move |s| {
            s.at_um.map_or(0.0, |at| at[k])
        });
    }
    residual("Residual over loading", Axis::linear("open area", ""), &|s| {
        s.loading.unwrap_or(0.0)
    });
}
