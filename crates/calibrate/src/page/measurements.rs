//! Measurements beside their predictions and residuals; widths by SEM.

use ndarray::Array2;

use crate::session::{Session, Simulations};
use crate::statistics::{Evidence, Finding, HeldOutErrors, cluster_groups, error_of_measurement};
use metalith_report::{Axis, Chart, ImageGrid, Page, fixed, sig};

/// Range of the colours of residuals [standard deviations of the noise].
pub(super) const SIGMAS: f64 = 6.0;

/// Every measurement that counts: measured, predicted, and the residual before and after.
pub(super) fn measurements(page: &mut Page, session: &Session<'_>, simulations: &Simulations, evidence: &Evidence) {
    page.section("Measurements");
    page.paragraph(
        "Each row shows the recorded image, the model, and the residual in standard deviations of the noise, before and after the fit.",
    );
    let set = session.set();
    let (finding, data) = (&evidence.finding, &evidence.data);
    let problem = evidence.problem(&session.simulator);
    // Before anything was found, the camera was the only noise.
    let plain = session.problem(simulations);
    let wide = |a: &Array2<f32>| a.mapv(f64::from);
    for (place, group) in cluster_groups(&problem).iter().enumerate() {
        let first = &set.measurements[group[0]];
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
                let name = format!("{} um", fixed(set.measurements[c].distance_um, 0));
                let factor = finding.after.nuisances.dn(data, c);
                let model = problem
                    .prediction(&finding.after.theta, c)
                    .pixels(finding.after.nuisances.shift_um[c]);
                seen.image(format!("camera, {name}"), wide(&data.signal[c]).mapv(|v| v.max(0.1)));
                seen.image(
                    format!("model, {name}"),
                    model.mapv(|v| (f64::from(v) * factor).max(0.1)),
                );
                let before =
                    finding
                        .before
                        .nuisances
                        .residual(&session.data, &plain.prediction(&finding.before.theta, c), c);
                let after = finding
                    .after
                    .nuisances
                    .residual(data, &problem.prediction(&finding.after.theta, c), c);
                let error = |h: &HeldOutErrors| error_of_measurement(&h[c]).map_or_else(String::new, |e| sig(e, 3));
                left.image(
                    format!("before, {name}: {}", error(&finding.held_before)),
                    wide(&before),
                );
                left.image(format!("after, {name}: {}", error(&finding.held_after)), wide(&after));
            }
            page.row([
                seen.caption("Camera and model on one logarithmic scale."),
                left.caption("Residual. The number is the reduced chi-square per pixel with the measurement held out."),
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

/// Widths by SEM and the fitted bias.
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
        Axis::linear("measured minus designed", "nm"),
    );
    let (low, high) = session.simulator.bench.widths_nm();
    chart.band(
        "fitted bias, +- 2 sigma of the SEM offset",
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
    page.figure(chart.caption("Widths by SEM with one standard deviation, and the fitted bias."));
}
