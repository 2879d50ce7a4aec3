//! Residual of the effects, effects that are hard to distinguish, and the nuisances.

use crate::data::Nuisances;
use crate::session::{Session, Simulations};
use crate::simulator_model::separating_measurement;
use crate::smooth_residual::SmoothResidual;
use crate::statistics::{Evidence, FitProblem, ForwardModel, cosines};
use metalith_report::{Axis, Cell, Chart, Column, HeatMap, Page, Table, fixed, sig};

/// Pairs of signatures with a cosine above this are listed.
const ALIKE: f64 = 0.9;

/// The smooth residual, as pictures with units.
pub(super) fn smooth_residual(page: &mut Page, session: &Session<'_>, evidence: &Evidence) {
    let simulator = &session.simulator;
    let problem = evidence.problem(simulator);
    let Some(free) = SmoothResidual::new(simulator, &problem, &evidence.finding.after) else {
        return;
    };
    page.section("Smooth residual");
    page.paragraph(format!(
        "Smooth terms, which represent no effect, are fitted to the residual of the effects. They lower the reduced chi-square per pixel from {} to {}. Their optical path over the lens is {} nm rms, with a noise of {} nm.",
        sig(free.chi2.0, 4),
        sig(free.chi2.1, 4),
        sig(free.path_rms_nm.0, 3),
        sig(free.path_rms_nm.1, 2)
    ));
    let mut strong: Vec<String> = free
        .coefficients_nm
        .iter()
        .filter(|(_, c, sigma)| c.abs() > 3.0 * sigma)
        .map(|(j, c, sigma)| format!("Noll {j}: {} +- {} nm", sig(*c, 3), sig(*sigma, 1)))
        .collect();
    let blurs = ["along x", "across", "along y"].into_iter().zip(&free.blur_um2);
    strong.extend(
        blurs
            .filter(|(_, (v, sigma))| v.abs() > 3.0 * sigma)
            .map(|(axis, (v, sigma))| format!("Blur {axis}: {} +- {} um^2", sig(*v, 3), sig(*sigma, 1))),
    );
    if !strong.is_empty() {
        page.list(strong);
    }
    let r = free.radius_um;
    let map = HeatMap::new(
        "Path over the lens",
        free.path_nm.clone(),
        (Axis::linear("x", "um"), -r, r),
        (Axis::linear("y", "um"), -r, r),
    )
    .values("optical path", "nm")
    .diverging()
    .to_scale()
    .size(400.0, 360.0);
    let mut curves = Chart::new(
        "Transmission over width",
        Axis::linear("width", "nm"),
        Axis::linear("relative change of amplitude", ""),
    )
    .size(460.0, 360.0);
    for (led, curve) in session.set().leds.iter().zip(&free.transmission) {
        curves.line(format!("{} nm", led.name()), curve.iter().copied());
    }
    page.row([
        map.caption("Optical path common to all colours and elements; tilts and defocus are nuisances or effects."),
        curves.caption("Change of amplitude over width, fitted for each colour."),
    ]);
}

/// Pairs of effects that these measurements can hardly distinguish.
pub(super) fn confusable(page: &mut Page, session: &Session<'_>, simulations: &Simulations, evidence: &Evidence) {
    page.section("Effects that are hard to distinguish");
    let problem = FitProblem {
        used: evidence.used.clone(),
        data: &evidence.data,
        ..session.problem(simulations)
    };
    let c = cosines(&problem, &evidence.finding.before);
    let slots = 0..session.simulator.slots.len();
    let names: Vec<String> = slots.map(|s| session.simulator.slot_name(s)).collect();
    let mut pairs: Vec<(usize, usize)> = (0..names.len()).flat_map(|i| (0..i).map(move |j| (j, i))).collect();
    pairs.retain(|&(i, j)| c[(i, j)].abs() > ALIKE);
    pairs.sort_by(|a, b| c[*b].abs().total_cmp(&c[*a].abs()));
    if pairs.is_empty() {
        page.paragraph(format!(
            "All effects that were tried can be distinguished: no two signatures have a cosine above {ALIKE}."
        ));
        return;
    }
    let mut table = Table::new([
        Column::text("Effect"),
        Column::text("and"),
        Column::number("Cosine", ""),
        Column::text("Measurement that would distinguish them"),
    ])
    .caption(
        "Cosines between the signatures of this layout in these measurements, nuisances projected out, weighted by noise.",
    );
    for (i, j) in pairs {
        let [a, b] = [i, j].map(|k| session.simulator.slots[k].effect);
        let how = separating_measurement(&session.simulator, a, &[b]);
        table.row([
            Cell::code(&names[i]),
            Cell::code(&names[j]),
            Cell::fixed(c[(i, j)], 3),
            how.as_deref().map_or_else(Cell::none, Cell::from),
        ]);
    }
    page.table(table);
}

/// Registration, flux and black level as fitted.
pub(super) fn nuisances(page: &mut Page, session: &Session<'_>, found: &Nuisances) {
    page.details("Nuisances: registration, flux, black level", |inner| {
        let mut table = Table::new([
            Column::text("Measurement"),
            Column::number("Off in x", "pixels"),
            Column::number("Off in y", "pixels"),
        ]);
        let pixel = session.set().camera.pixel_um;
        for (measurement, shift) in session.set().measurements.iter().zip(&found.shift_um) {
            table.row([
                Cell::code(&measurement.name),
                Cell::fixed(shift[0] / pixel, 3),
                Cell::fixed(shift[1] / pixel, 3),
            ]);
        }
        inner.table(table);
        let flux: Vec<String> = session
            .set()
            .leds
            .iter()
            .zip(&found.flux)
            .map(|(led, f)| format!("{} nm: {}", led.name(), fixed(*f, 4)))
            .collect();
        inner.paragraph(format!(
            "Flux over the stated flux: {}. Error of the black level: {} DN.",
            flux.join(", "),
            fixed(found.black_dn, 3)
        ));
    });
}
