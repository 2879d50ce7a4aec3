//! Captures beside their prediction and what is left between them; widths by SEM.

use ndarray::Array2;

use super::super::atlas::Atlas;
use super::super::attribute::Finding;
use super::super::heldout::{HeldOut, groups};
use super::super::nuisance::Data;
use super::super::session::Session;
use metalith_report::{Axis, Chart, ImageGrid, Page, fixed, sig};

/// Colours of residuals reach so many standard deviations of the noise.
pub(super) const SIGMAS: f64 = 6.0;

/// Every capture that counts: seen, predicted, and the residual before and after.
pub(super) fn captures(page: &mut Page, session: &Session<'_>, atlas: &Atlas, finding: &Finding) {
    page.section("Captures");
    page.paragraph(
        "Each row: what the camera saw, what the model predicts, and the residual in standard deviations of the noise, before and after.",
    );
    let set = session.set();
    let problem = session.problem_of(finding);
    let plain = session.problem(atlas);
    // Before anything was found, nothing but the camera was noise.
    let camera_alone = Data::new(set);
    let wide = |a: &Array2<f32>| a.mapv(f64::from);
    for (place, group) in groups(&problem).iter().enumerate() {
        let first = &set.captures[group[0]];
        let words = format!(
            "Element ({}, {}), {} nm, light at {} degrees",
            set.elements[first.element].index[0],
            set.elements[first.element].index[1],
            set.leds[first.led].name(),
            fixed(first.aoi_rad[0].to_degrees(), 1),
        );
        let fill = |page: &mut Page| {
            let mut seen = ImageGrid::new(format!("{words}: camera and model"), 2)
                .pixel_um(set.camera.pixel_um)
                .values("signal", "DN")
                .log(3.0)
                .side(180.0);
            let mut left = ImageGrid::new(format!("{words}: residual"), 2)
                .pixel_um(set.camera.pixel_um)
                .values("residual", "sigma")
                .range(-SIGMAS, SIGMAS)
                .diverging()
                .side(180.0);
            for &c in group {
                let name = format!("{} um", fixed(set.captures[c].distance_um, 0));
                let factor = session.data.scale[c] * finding.after.nuisances.flux[session.data.led[c]];
                let model = problem
                    .grid(&finding.after.theta, c)
                    .pixels(finding.after.nuisances.shift_um[c]);
                seen.image(
                    format!("camera, {name}"),
                    wide(&session.data.signal[c]).mapv(|v| v.max(0.1)),
                );
                seen.image(
                    format!("model, {name}"),
                    model.mapv(|v| (f64::from(v) * factor).max(0.1)),
                );
                let before = finding
                    .before
                    .nuisances
                    .residual(&camera_alone, &plain.grid(&finding.before.theta, c), c);
                let after = finding
                    .after
                    .nuisances
                    .residual(&session.data, &problem.grid(&finding.after.theta, c), c);
                let error = |h: &HeldOut| h[c].map_or_else(String::new, |e| sig(e, 3));
                left.image(
                    format!("before, {name}: {}", error(&finding.held_before)),
                    wide(&before),
                );
                left.image(format!("after, {name}: {}", error(&finding.held_after)), wide(&after));
            }
            page.row([
                seen.caption("Camera and model on one logarithmic scale."),
                left.caption("Residual; the number is chi-square a pixel when the capture was left out."),
            ]);
        };
        if place == 0 {
            page.subsection(&words);
            fill(page);
        } else {
            page.details(&words, fill);
        }
    }
}

/// Widths by SEM against the bias that was found.
pub(super) fn widths(page: &mut Page, session: &Session<'_>, finding: &Finding) {
    let set = session.set();
    if set.sem.is_empty() {
        return;
    }
    page.section("Widths by SEM");
    let geometry = session.simulator.perturbation(&finding.after.theta).geometry;
    let offset = set.sem_offset_sigma_nm;
    let mut chart = Chart::new(
        "Widths by SEM",
        Axis::linear("designed width", "nm"),
        Axis::linear("measured less designed", "nm"),
    );
    let (low, high) = session.simulator.bench.widths_nm();
    chart.band(
        "found, with the SEM's own offset",
        [low, high].map(|w| {
            (
                w,
                geometry.cd_bias_nm - 2.0 * offset,
                geometry.cd_bias_nm + 2.0 * offset,
            )
        }),
    );
    for e in &set.elements {
        let own = set.sem.iter().filter(|s| s.element == e.index);
        chart.points_with_errors(
            format!("element ({}, {})", e.index[0], e.index[1]),
            own.map(|s| (s.designed_nm, s.measured_nm - s.designed_nm, s.sigma_nm)),
        );
    }
    page.figure(chart.caption("Widths seen from above, one standard deviation each, against the bias that was found."));
}
