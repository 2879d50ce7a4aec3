//! The report of a session for people.

mod measurements;
mod residual;

use std::path::Path;

use measurements::{SIGMAS, measurements, widths};
use ndarray::Array2;
use residual::{confusable, nuisances, smooth_residual};

use crate::diagnosis::{Diagnosis, FreePattern, Ranked};
use crate::interval_parts::WidthParts;
use crate::session::{Session, Simulations};
use crate::statistics::Evidence;
use metalith_core::Result;
use metalith_report::{Axis, Cell, Column, ImageGrid, Page, Ranking, Table, Verdict, counted, sig};

/// Write the report of a session.
///
/// # Errors
/// If the file cannot be written.
pub(crate) fn write_page(
    path: &Path,
    session: &Session<'_>,
    simulations: &Simulations,
    diagnosis: &Diagnosis,
    evidence: Option<&Evidence>,
) -> Result<()> {
    let mut page = Page::new(
        format!("Calibration: {}", diagnosis.set),
        format!(
            "{} of `{}`",
            counted(session.set().measurements.len(), "measurement"),
            session.set().path.display()
        ),
    );
    let verdict = diagnosis.verdict;
    page.finding(
        Verdict::of_explained(verdict.is_explained(), verdict.is_partial()),
        verdict.label(),
        diagnosis.sentence(),
    );
    let error = &diagnosis.error;
    page.facts(&[
        ("Held out, before", sig(error.before.held_out, 4)),
        ("Held out, after", sig(error.after.held_out, 4)),
        ("Noise floor", sig(error.noise_floor, 3)),
        ("Held out, null test", sig(error.null_test_held_out, 4)),
        (
            "Unexplained",
            format!("{} %", sig(100.0 * diagnosis.unexplained_share, 2)),
        ),
    ]);
    page.paragraph(
        "Errors are reduced chi-square per pixel; noise alone gives 1. Held out: the measurement is predicted by a fit to measurements of other colours, elements or distances, and only registration, flux and black level are adjusted. Null test: held-out error with random smooth terms in place of effects.",
    );
    if !diagnosis.warnings.is_empty() {
        page.section("Frames");
        page.list(&diagnosis.warnings);
    }
    if let Some(share) = diagnosis.missing_by_speckle {
        page.paragraph(format!(
            "Pillars that are missing at random places make a speckle that no fit can predict. The variance of the speckle is known. It counts as noise in the errors after the fit. Speckle-based missing fraction: {} % of the pillars.",
            sig(100.0 * share, 3)
        ));
    }
    effects(&mut page, diagnosis);
    if !diagnosis.patterns.is_empty() {
        page.section("Patterns of the residual");
        page.paragraph(
            "Each quantity was also fitted separately for each element, colour, distance and angle. The quantities of this list remove most of the residual. The trend of their values shows which effect is missing.",
        );
        page.list(diagnosis.patterns.iter().map(FreePattern::sentence));
    }
    if let Some(proposal) = &diagnosis.proposal {
        page.section("Proposal");
        page.paragraph(capitalised(&proposal.sentence(diagnosis)));
        page.list(&proposal.reasons);
    }
    ladder(&mut page, session, diagnosis);
    if let Some(evidence) = evidence {
        ranking(&mut page, diagnosis);
        measurements(&mut page, session, simulations, evidence);
        widths(&mut page, session, &evidence.finding);
        smooth_residual(&mut page, session, evidence);
        confusable(&mut page, session, simulations, evidence);
        nuisances(&mut page, session, &evidence.finding.after.nuisances);
    }
    if !diagnosis.left_out.is_empty() {
        page.section("Measurements left out");
        page.list(
            diagnosis
                .left_out
                .iter()
                .map(|l| format!("`{}`: {}", l.measurement, l.reason)),
        );
    }
    page.write(path)
}

fn effects(page: &mut Page, diagnosis: &Diagnosis) {
    if diagnosis.effects.is_empty() {
        return;
    }
    page.section("Effects found");
    let mut table = Table::new([
        Column::text("Effect"),
        Column::text("Value"),
        Column::text("95 % interval"),
        Column::text("Half of the interval by noise alone, by the error of the model alone"),
        Column::text("Cannot be distinguished from"),
        Column::text("Measurement that would distinguish"),
    ]);
    for e in &diagnosis.effects {
        let shown = |v: &serde_json::Value| round_json(v);
        table.row([
            Cell::code(&e.name),
            format!("{} {}", shown(&e.value), e.unit).as_str().into(),
            shown(&e.interval).as_str().into(),
            e.interval_from
                .iter()
                .map(made_of)
                .collect::<Vec<_>>()
                .join("; ")
                .as_str()
                .into(),
            if e.confounded_with.is_empty() {
                Cell::none()
            } else {
                e.confounded_with.join(", ").as_str().into()
            },
            e.separate_by.as_deref().map_or_else(Cell::none, Cell::from),
        ]);
    }
    page.table(table);
    for remark in &diagnosis.remarks {
        page.paragraph(remark);
    }
}

fn made_of(parts: &WidthParts) -> String {
    format!("{}, {}", sig(parts.noise, 2), sig(parts.of_model(), 2))
}

fn ladder(page: &mut Page, session: &Session<'_>, diagnosis: &Diagnosis) {
    if diagnosis.ladder.is_empty() {
        return;
    }
    page.section("Simulation models");
    let mut table = Table::new([
        Column::text("Simulation model"),
        Column::number("Reduced chi-square per pixel", "fitted"),
        Column::number("Reduced chi-square per pixel", "held out"),
    ])
    .caption("Only the nuisances are fitted. The polynomials lack amplitude and resonances.");
    for rung in &diagnosis.ladder {
        table.row([
            Cell::code(&rung.fidelity),
            Cell::sig(rung.fit, 4),
            Cell::sig(rung.held_out, 4),
        ]);
    }
    page.table(table);
    // The measurement with the largest residual under the first fidelity.
    let power = |a: &Array2<f32>| a.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>();
    let first = &diagnosis.ladder[0].residuals;
    let Some(worst) = first
        .keys()
        .max_by(|&a, &b| power(&first[a]).total_cmp(&power(&first[b])))
    else {
        return;
    };
    let mut pictures = ImageGrid::new("Residual with each simulation model", diagnosis.ladder.len())
        .pixel_um(session.set().camera.pixel_um)
        .values("residual", "sigma")
        .range(-SIGMAS, SIGMAS)
        .diverging()
        .side(200.0);
    for rung in &diagnosis.ladder {
        pictures.image(rung.fidelity.as_str(), rung.residuals[worst].mapv(f64::from));
    }
    page.figure(pictures.caption(format!(
        "Residual of measurement `{}`, in standard deviations of the noise.",
        session.set().measurements[worst].name
    )));
}

fn ranking(page: &mut Page, diagnosis: &Diagnosis) {
    page.section("Candidates");
    page.paragraph(
        "The score of an effect is the share of the residual that its signature explains. The leading effects are fitted. Their gain on held-out measurements decides.",
    );
    let mut chart = Ranking::new(
        "Candidates",
        Axis::linear("gain on held-out measurements", "reduced chi-square per pixel"),
    );
    for r in diagnosis.ranking.iter().filter(|r| r.held_out_gain.is_some()) {
        let interval = r.held_out_gain_interval.map(|[a, b]| (a, b));
        chart.bar(
            r.name.as_str(),
            r.held_out_gain.unwrap_or(0.0),
            interval,
            r.remark.as_str(),
            r.rejected.is_none(),
        );
    }
    page.figure(chart.caption(
        "Gain of each leading effect, with its 95 % confidence interval over groups of measurements. The gain of an effect that was taken in a later step is additional to the gain of the effects before it.",
    ));
    page.details("All candidates", |inner| {
        inner.table(candidates(&diagnosis.ranking));
    });
    for (place, ranking) in diagnosis.later_rankings.iter().enumerate() {
        page.details(format!("Candidates in step {}", place + 2), |inner| {
            inner.table(candidates(ranking));
        });
    }
}

fn candidates(ranking: &[Ranked]) -> Table {
    let mut table = Table::new([
        Column::text("Candidate"),
        Column::number("Explains alone", "%"),
        Column::number("Gain, held out", ""),
        Column::text("Value"),
        Column::text("Reason for rejection"),
    ]);
    for r in ranking {
        table.row([
            Cell::code(&r.name),
            Cell::sig(100.0 * r.score, 3),
            r.held_out_gain.map_or_else(Cell::none, |g| Cell::sig(g, 3)),
            r.value
                .as_ref()
                .map_or_else(Cell::none, |v| round_json(v).as_str().into()),
            Cell::from(r.rejected.as_deref().unwrap_or(&r.remark)),
        ]);
    }
    table
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters
        .next()
        .map_or_else(String::new, |c| c.to_uppercase().chain(letters).collect())
}

/// Numbers of a JSON value to four digits.
pub(crate) fn round_json(value: &serde_json::Value) -> String {
    match value {
        serde_json::Value::Array(items) => {
            format!("[{}]", items.iter().map(round_json).collect::<Vec<_>>().join(", "))
        }
        serde_json::Value::Number(n) => sig(n.as_f64().unwrap_or(f64::NAN), 4),
        other => other.to_string(),
    }
}
