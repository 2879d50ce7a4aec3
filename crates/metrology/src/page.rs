//! The answer for people: the parts of the page that all kinds of sets share.

use metalith_report::{Axis, Cell, Chart, Column, Page, Ranking, Table, Verdict, number_words, sig};

use crate::diagnosis::{Diagnosis, FoundEffect};
use crate::proposal::Proposal;

/// Most groups whose values a row shows.
const MOST_GROUPS: usize = 8;

/// The page of a set up to its figures.
pub(crate) fn page(diagnosis: &Diagnosis, unit: &str) -> Page {
    let mut page = Page::new(
        format!("Calibration: {}", diagnosis.set),
        format!("measured {}", diagnosis.kind),
    );
    let verdict = diagnosis.verdict;
    page.finding(
        Verdict::of_explained(verdict.is_explained(), verdict.is_partial()),
        verdict.label(),
        diagnosis.sentence(),
    );
    let error = &diagnosis.error;
    let with_unit = |v: f64| format!("{} {unit}", sig(v, 3)).trim().to_owned();
    page.facts(&[
        ("Fitted, before", with_unit(error.before.fit)),
        ("Fitted, after", with_unit(error.after.fit)),
        ("Left out, before", with_unit(error.before.held_out)),
        ("Left out, after", with_unit(error.after.held_out)),
    ]);
    page.list(&diagnosis.validation);
    if !diagnosis.remarks.is_empty() {
        page.list(&diagnosis.remarks);
    }
    if !diagnosis.effects.is_empty() {
        page.section("Effects found");
        let mut table = Table::new([
            Column::text("Effect"),
            Column::text("Value"),
            Column::text("95 % interval"),
            Column::text("Belongs to"),
        ]);
        for e in &diagnosis.effects {
            table.row([
                Cell::code(&e.name),
                format!("{} {}", number_words(&e.value), e.unit).as_str().into(),
                number_words(&e.interval).as_str().into(),
                e.of.as_str().into(),
            ]);
        }
        page.table(table);
        let groups: Vec<String> = diagnosis.effects.iter().filter_map(in_groups).collect();
        if !groups.is_empty() {
            page.subsection("In each group alone");
            page.list(groups);
        }
    }
    ladder(&mut page, diagnosis, unit);
    let mut ranking = Ranking::new(
        "Effects tried",
        Axis::linear("share of the fitted mean square removed", ""),
    );
    for tried in &diagnosis.ranking {
        let (remark, chosen) = match &tried.rejected {
            None => ("taken", true),
            Some(_) => ("refused", false),
        };
        ranking.bar(&tried.name, tried.score.max(0.0), None, remark, chosen);
    }
    page.figure(ranking.caption("Each effect as it was tried last, on top of those that were taken before."));
    // The table of the ladder has the other reasons.
    let in_ladder = |name: &String| diagnosis.ladder.iter().any(|step| step.effect.as_ref() == Some(name));
    let others = diagnosis.ranking.iter().filter(|t| !in_ladder(&t.name));
    let others: Vec<String> = { others }
        .filter_map(|t| Some(format!("`{}`: {}", t.name, t.rejected.as_ref()?)))
        .collect();
    if !others.is_empty() {
        page.subsection("Other effects that were refused");
        page.list(others);
    }
    if !diagnosis.proposals.is_empty() {
        page.section("Patterns of the residual");
        page.paragraph("No effect of the list explains these. `proposal.toml` declares them: give it to `--declare`.");
        page.list(diagnosis.proposals.iter().map(Proposal::sentence));
    }
    page
}

/// Whether the values of groups agree, which they are, and which groups an effect makes worse; none where each has its own.
fn in_groups(effect: &FoundEffect) -> Option<String> {
    let agreement = effect.agreement.as_ref()?;
    let worse = match effect.worse_for.as_slice() {
        [] => String::new(),
        worse => format!(" Worse with it: {}.", worse.join(", ")),
    };
    let values = by_group(&effect.by_group);
    Some(format!("`{}`: {agreement}. {values}.{worse}", effect.name))
}

/// Values in each group alone: of each parameter, groups with their values.
fn by_group(parameters: &[Vec<(String, f64, [f64; 2])>]) -> String {
    let of_one = |own: &Vec<(String, f64, [f64; 2])>| {
        let each = own.iter().take(MOST_GROUPS);
        let each = each
            .map(|(name, v, [low, high])| format!("{name}: {} ({} to {})", sig(*v, 3), sig(*low, 3), sig(*high, 3)));
        let more = own.len().saturating_sub(MOST_GROUPS);
        let more = (more > 0).then(|| format!("and {more} more"));
        each.chain(more).collect::<Vec<_>>().join(", ")
    };
    parameters.iter().map(of_one).collect::<Vec<_>>().join("; ")
}

/// Errors before and after each effect, fitted and left out.
fn ladder(page: &mut Page, diagnosis: &Diagnosis, unit: &str) {
    page.section("Errors before and after each effect");
    let Some(first) = diagnosis.ladder.first() else { return };
    let mut columns = vec![Column::text("Model"), Column::number("Fitted", unit)];
    columns.extend(
        first
            .held_out
            .iter()
            .map(|(way, _)| Column::number(format!("Left out: each {way}"), unit)),
    );
    columns.extend(
        first
            .not_fitted_figures
            .iter()
            .map(|(name, _)| Column::number(format!("Not fitted: {name}"), "")),
    );
    columns.push(Column::text("Refused"));
    let mut table = Table::new(columns)
        .caption("Root mean squares. Rows below the effects that were taken show each refused effect on top of them.");
    for step in &diagnosis.ladder {
        let name = match &step.effect {
            None => Cell::from("as stated"),
            Some(name) => Cell::code(format!("+ {name}")),
        };
        let mut row = vec![name, Cell::sig(step.fit, 4)];
        row.extend(
            step.held_out
                .iter()
                .map(|(_, v)| v.map_or_else(Cell::none, |v| Cell::sig(v, 4))),
        );
        row.extend(step.not_fitted_figures.iter().map(|(_, v)| Cell::sig(*v, 4)));
        row.push(step.rejected.as_deref().map_or_else(Cell::none, Cell::from));
        table.row(row);
    }
    page.table(table);
    let taken = || diagnosis.ladder.iter().filter(|s| s.rejected.is_none()).enumerate();
    let mut chart = Chart::new(
        "Ladder of errors",
        Axis::linear("effects in the model", ""),
        Axis::log("root mean square", unit),
    );
    chart.line("fitted", taken().map(|(k, s)| (k as f64, s.fit)));
    for (w, (way, _)) in first.held_out.iter().enumerate() {
        let line: Vec<_> = taken()
            .filter_map(|(k, s)| Some((k as f64, s.held_out[w].1?)))
            .collect();
        if !line.is_empty() {
            chart.line(format!("left out: each {way}"), line);
        }
    }
    page.figure(chart.caption("Errors of what was fitted and of what was left out, after each effect that was taken."));
}
