//! The report of a session for people.

use std::path::Path;

use ndarray::Array2;

use super::atlas::Atlas;
use super::attribute::Finding;
use super::diagnosis::{Diagnosis, SetVerdict};
use super::free::FreeTerm;
use super::nuisance::Nuisances;
use super::session::Session;
use super::signature::{cosines, separate_by};
use crate::error::Result;
use crate::report::{Axis, Cell, Chart, Column, HeatMap, ImageGrid, Page, Ranking, Table, Verdict, fixed, sig};

/// Colours of residuals reach so many standard deviations of the noise.
const SIGMAS: f64 = 6.0;

/// Cosines between signatures above this are named.
const ALIKE: f64 = 0.9;

/// Write the report of a session.
///
/// # Errors
/// If the file cannot be written.
pub fn write_page(
    path: &Path,
    session: &Session<'_>,
    atlas: &Atlas,
    diagnosis: &Diagnosis,
    finding: Option<&Finding>,
) -> Result<()> {
    let mut page = Page::new(
        format!("Calibration: {}", diagnosis.set),
        format!(
            "{} captures of `{}`",
            session.set().captures.len(),
            session.set().path.display()
        ),
    );
    let holds = matches!(diagnosis.verdict, SetVerdict::NoResidual | SetVerdict::Explained);
    page.verdict(
        if holds { Verdict::Pass } else { Verdict::Fail },
        capitalised(&diagnosis.sentence()),
    );
    let error = &diagnosis.error;
    page.facts(&[
        ("Before, held out", sig(error.before.held_out, 4)),
        ("After, held out", sig(error.after.held_out, 4)),
        ("Noise floor", sig(error.noise_floor, 3)),
        ("Placebo, held out", sig(error.placebo_held_out, 4)),
        (
            "Left unexplained",
            format!("{} %", fixed(100.0 * diagnosis.unexplained_share, 1)),
        ),
    ]);
    page.paragraph(
        "Errors are chi-square a pixel: one is noise alone. Held out means predicted by a fit that has not seen the colour, the element or the distance of the capture; its placement, flux and black level alone are adjusted.",
    );
    effects(&mut page, diagnosis);
    ladder(&mut page, diagnosis);
    if let Some(finding) = finding {
        ranking(&mut page, diagnosis);
        captures(&mut page, session, atlas, finding);
        widths(&mut page, session, finding);
        free_term(&mut page, session, atlas, finding);
        confusable(&mut page, session, atlas, finding);
        nuisances(&mut page, session, &finding.after.nuisances);
    }
    if !diagnosis.left_out.is_empty() {
        page.section("Captures left out");
        page.list(
            diagnosis
                .left_out
                .iter()
                .map(|l| format!("`{}`: {}", l.capture, l.reason)),
        );
    }
    page.write(path)
}

fn effects(page: &mut Page, diagnosis: &Diagnosis) {
    if diagnosis.effects.is_empty() {
        return;
    }
    page.section("What was found");
    let mut table = Table::new([
        Column::text("Effect"),
        Column::text("Value"),
        Column::text("95 % interval"),
        Column::text("Not told apart from"),
        Column::text("What would tell"),
    ]);
    for e in &diagnosis.effects {
        let shown = |v: &serde_json::Value| round_json(v);
        table.row([
            Cell::code(&e.name),
            format!("{} {}", shown(&e.value), e.unit).as_str().into(),
            shown(&e.interval).as_str().into(),
            if e.confounded_with.is_empty() {
                Cell::none()
            } else {
                e.confounded_with.join(", ").as_str().into()
            },
            e.separate_by.as_deref().map_or_else(Cell::none, Cell::from),
        ]);
    }
    page.table(table);
}

fn ladder(page: &mut Page, diagnosis: &Diagnosis) {
    if diagnosis.ladder.is_empty() {
        return;
    }
    page.section("How truly the cell is described");
    let mut table = Table::new([
        Column::text("Cell"),
        Column::number("Chi-square a pixel", "fitted"),
        Column::number("Chi-square a pixel", "held out"),
    ])
    .caption("Nuisances fitted, nothing else. What the polynomials lack is amplitude and resonances.");
    for rung in &diagnosis.ladder {
        table.row([
            Cell::code(&rung.fidelity),
            Cell::sig(rung.fit, 4),
            Cell::sig(rung.held_out, 4),
        ]);
    }
    page.table(table);
}

fn ranking(page: &mut Page, diagnosis: &Diagnosis) {
    page.section("Candidates");
    page.paragraph(
        "Every effect is scored by the share of the residual that its signature explains; the leaders are fitted in full, and judged by what they gain on captures left out.",
    );
    let mut chart = Ranking::new(
        "Candidates",
        Axis::linear("gain on captures left out", "chi-square a pixel"),
    );
    for r in diagnosis.ranking.iter().filter(|r| r.held_out_gain.is_some()) {
        let remark = r.rejected.as_deref().unwrap_or("taken");
        let interval = r.held_out_gain_interval.map(|[a, b]| (a, b));
        chart.bar(
            r.name.as_str(),
            r.held_out_gain.unwrap_or(0.0),
            interval,
            shortened(remark),
            r.rejected.is_none(),
        );
    }
    page.figure(chart.caption("What each leader gains, with its interval over groups of captures."));
    let mut table = Table::new([
        Column::text("Candidate"),
        Column::number("Explains alone", "%"),
        Column::number("Gain, held out", ""),
        Column::text("Value"),
        Column::text("Why not"),
    ]);
    for r in &diagnosis.ranking {
        table.row([
            Cell::code(&r.name),
            Cell::sig(100.0 * r.score, 3),
            r.held_out_gain.map_or_else(Cell::none, |g| Cell::sig(g, 3)),
            r.value
                .as_ref()
                .map_or_else(Cell::none, |v| round_json(v).as_str().into()),
            r.rejected.as_deref().map_or_else(|| "taken".into(), Cell::from),
        ]);
    }
    page.details("All candidates", |inner| {
        inner.table(table);
    });
}

fn captures(page: &mut Page, session: &Session<'_>, atlas: &Atlas, finding: &Finding) {
    page.section("Captures");
    page.paragraph(
        "Each row: what the camera saw, what the model predicts, and the residual in standard deviations of the noise, before and after.",
    );
    let set = session.set();
    let mut problem = session.problem(atlas);
    problem.exact.clone_from(&finding.exact);
    let plain = session.problem(atlas);
    let wide = |a: &Array2<f32>| a.mapv(f64::from);
    for (place, group) in super::heldout::groups(&problem).iter().enumerate() {
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
                    .residual(&session.data, &plain.grid(&finding.before.theta, c), c);
                let after = finding
                    .after
                    .nuisances
                    .residual(&session.data, &problem.grid(&finding.after.theta, c), c);
                let error = |h: &super::heldout::HeldOut| h[c].map_or_else(String::new, |e| sig(e, 3));
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

fn widths(page: &mut Page, session: &Session<'_>, finding: &Finding) {
    let set = session.set();
    if set.sem.is_empty() {
        return;
    }
    page.section("Widths by SEM");
    let geometry = session.simulator.departure(&finding.after.theta).geometry;
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

fn free_term(page: &mut Page, session: &Session<'_>, atlas: &Atlas, finding: &Finding) {
    let Some(free) = FreeTerm::new(session, atlas, finding) else {
        return;
    };
    page.section("What is left");
    page.paragraph(format!(
        "Smooth shapes fitted to what the effects leave; they go by no name. They take chi-square a pixel from {} to {}. The path over the lens is {} nm rms, with a noise of {} nm.",
        sig(free.chi2.0, 4),
        sig(free.chi2.1, 4),
        sig(free.path_rms_nm.0, 3),
        sig(free.path_rms_nm.1, 2)
    ));
    let strong: Vec<String> = free
        .coefficients_nm
        .iter()
        .filter(|(_, c, sigma)| c.abs() > 3.0 * sigma)
        .map(|(j, c, sigma)| format!("Noll {j}: {} +- {} nm", sig(*c, 3), sig(*sigma, 1)))
        .collect();
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
    .size(420.0, 360.0);
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
        curves.caption("Change of amplitude over width that each colour asks for."),
    ]);
}

fn confusable(page: &mut Page, session: &Session<'_>, atlas: &Atlas, finding: &Finding) {
    page.section("What looks alike");
    let problem = session.problem(atlas);
    let c = cosines(&problem, &finding.before);
    let names: Vec<String> = session
        .simulator
        .slots
        .iter()
        .map(|s| {
            let e = &session.simulator.effects[s.effect];
            if e.parameters().len() > 1 {
                format!("{} {}", e.name(), ["x", "y"][s.index])
            } else {
                e.name()
            }
        })
        .collect();
    let mut table = Table::new([
        Column::text("Effect"),
        Column::text("and"),
        Column::number("Cosine", ""),
        Column::text("What would tell them apart"),
    ])
    .caption("Signatures of this layout in these captures, nuisances projected out, weighted by noise.");
    let mut pairs: Vec<(usize, usize)> = (0..names.len()).flat_map(|i| (0..i).map(move |j| (j, i))).collect();
    pairs.retain(|&(i, j)| c[(i, j)].abs() > ALIKE);
    pairs.sort_by(|a, b| c[*b].abs().total_cmp(&c[*a].abs()));
    for (i, j) in pairs {
        let [a, b] = [i, j].map(|k| session.simulator.slots[k].effect);
        let how = separate_by(&session.simulator, a, &[b]);
        table.row([
            Cell::code(&names[i]),
            Cell::code(&names[j]),
            Cell::fixed(c[(i, j)], 3),
            how.as_deref().map_or_else(Cell::none, Cell::from),
        ]);
    }
    page.table(table);
}

fn nuisances(page: &mut Page, session: &Session<'_>, found: &Nuisances) {
    page.details("Nuisances: placement, flux, black level", |inner| {
        let mut table = Table::new([
            Column::text("Capture"),
            Column::number("Off in x", "pixels"),
            Column::number("Off in y", "pixels"),
        ]);
        let pixel = session.set().camera.pixel_um;
        for (capture, shift) in session.set().captures.iter().zip(&found.shift_um) {
            table.row([
                Cell::code(&capture.name),
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
            "Flux over what is stated: {}. Black level off by {} DN.",
            flux.join(", "),
            fixed(found.black_dn, 3)
        ));
    });
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters
        .next()
        .map_or_else(String::new, |c| c.to_uppercase().chain(letters).collect())
}

/// A remark that fits beside a bar.
fn shortened(text: &str) -> String {
    const LONGEST: usize = 44;
    if text.chars().count() <= LONGEST {
        return text.to_owned();
    }
    text.chars().take(LONGEST - 3).chain("...".chars()).collect()
}

fn round_json(value: &serde_json::Value) -> String {
    match value {
        serde_json::Value::Array(items) => {
            format!("[{}]", items.iter().map(round_json).collect::<Vec<_>>().join(", "))
        }
        serde_json::Value::Number(n) => sig(n.as_f64().unwrap_or(f64::NAN), 4),
        other => other.to_string(),
    }
}
