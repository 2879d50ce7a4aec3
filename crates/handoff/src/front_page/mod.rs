//! The front page of a hand-off.

pub(super) mod chip;
mod measuring;
pub(super) mod writing;

use std::path::Path;

use crate::contents::{Contents, HandoffCheck, RuleReports};
use crate::cures::BrokenRule;
use crate::job::JobPatterns;
use crate::kind_words::KindWords;
use crate::pad::dose_pads;
use metalith_core::Result;
use metalith_core::text::printable;
use metalith_report::{Cell, Column, Page, Table, Verdict, count, counted, sig};

/// Rows of long tables that the page shows; all are in the CSV files.
const SHOWN: usize = 40;

/// Write `index.html` and the separate picture files.
///
/// # Errors
/// If a file cannot be written.
pub(super) fn write(folder: &Path, c: &Contents<'_>) -> Result<()> {
    let mut page = Page::new(
        format!("Hand-off of {}", c.design.name),
        format!("{}. Process: {}.", c.design.title, c.process.title),
    );
    verdict(&mut page, &c.checks);
    for warning in c.design.warnings()? {
        page.note(warning.paragraph());
    }
    let (w, h) = c.design.layout.chip.size_nm;
    page.facts(&[
        (
            "Chip",
            format!("{} x {} mm", sig(w as f64 * 1e-6, 3), sig(h as f64 * 1e-6, 3)),
        ),
        ("Tone of step 1", c.process.exposed_becomes().to_owned()),
        ("Base dose", format!("{} uC/cm2", c.process.resist.dose_uc_cm2)),
        ("Pillars", count(c.pillars)),
        ("Elements", count(c.design.elements().len() as u64)),
    ]);
    broken_rules(&mut page, &c.checks);
    chip::chip(&mut page, c, folder)?;
    chip::layers(&mut page, c, folder)?;
    let pads = dose_pads(c.design, c.process);
    let kind = KindWords::of(c.design.cell.shape);
    writing::doses(
        &mut page,
        c.process,
        ("small lens", &pads, kind.measured),
        (&c.blocks, &c.documents.doses),
    );
    writing::dose_classes(&mut page, c);
    writing::write_time(&mut page, c.process, kind.snapped, &c.documents.exposures);
    let cell = &c.design.cell;
    let row_nm = cell.lattice.row_nm(cell.pitch_nm, cell.database_unit);
    writing::snapping(
        &mut page,
        kind.changed,
        [cell.pitch_nm.nm(), row_nm],
        &c.documents.snapping,
    );
    chip::stack(&mut page, c);
    measuring::tests(&mut page, c);
    measuring::metrology(&mut page, c);
    writing::job_files(
        &mut page,
        &JobPatterns::of(c.design),
        c.process,
        &c.documents.crosses,
        &c.documents.snapping,
    );
    checks(&mut page, &c.checks, &c.rules);
    chip::cells(&mut page, &c.census);
    made_by(&mut page, c.command);
    list(&mut page, &c.files);
    page.write(&folder.join("index.html"))
}

/// The command.
pub(super) fn made_by(page: &mut Page, command: &str) {
    page.section("Made by");
    page.code(printable(command));
}

/// The list of the files, which ends the page.
pub(super) fn list(page: &mut Page, files: &[(String, String)]) {
    page.section("Files");
    page.paragraph(
        "`metalith handoff --verify FOLDER` says whether this folder is complete and unaltered; `manifest.json` holds the \
         SHA-256 of every file.",
    );
    let mut table = Table::new([Column::text("File"), Column::text("What it is")]);
    for (file, purpose) in files {
        table.row([Cell::code(file), purpose.as_str().into()]);
    }
    page.table(table);
}

/// Rules that are broken, with their cures.
pub(super) fn broken_rules(page: &mut Page, checks: &[HandoffCheck]) {
    let mut rows: Vec<_> = checks
        .iter()
        .flat_map(|c| c.broken.iter().map(move |rule| (c, rule)))
        .collect();
    if rows.is_empty() {
        return;
    }
    // What fails comes first.
    rows.sort_by_key(|(_, rule)| rule.assumed);
    page.section("What to change or to confirm");
    page.list(rows.into_iter().map(|(check, rule)| {
        let BrokenRule {
            rule: id,
            requirement,
            deck,
            cure,
            ..
        } = rule;
        format!(
            "{}`{id}` of {deck}, {} in {}: {requirement}. Cure: {cure}.",
            if rule.assumed { "Assumed limit: " } else { "" },
            counted(rule.violations as usize, "violation"),
            check.name.trim_start_matches("design rules, "),
        )
    }));
    if checks.iter().any(HandoffCheck::exceeds_assumed) {
        page.paragraph(
            "Assumed limits are guesses that no lab has confirmed: they fail nothing. Ask the lab for its limits before the first \
             wafer.",
        );
    }
}

/// The verdict over all checks.
pub(super) fn verdict(page: &mut Page, checks: &[HandoffCheck]) {
    let failed: Vec<_> = checks.iter().filter(|k| k.verdict == Verdict::Fail).collect();
    let open: Vec<_> = checks.iter().filter(|k| k.verdict == Verdict::NotRun).collect();
    if let Some(first) = failed.first() {
        page.verdict(Verdict::Fail, format!("{}: {}", first.name, first.words));
    } else if let Some(first) = open.first() {
        page.verdict(Verdict::NotRun, format!("{}: {}", first.name, first.words));
    } else if checks.iter().any(HandoffCheck::exceeds_assumed) {
        page.verdict(
            Verdict::Pass,
            "All checks against confirmed limits passed; assumed limits are exceeded: see the table below.",
        );
    } else if !checks.is_empty() {
        page.verdict(Verdict::Pass, "All checks of the layout passed.");
    }
}

/// All checks, and every rule of each layout.
pub(super) fn checks(page: &mut Page, checks: &[HandoffCheck], rules: &RuleReports) {
    page.section("Checks");
    let mut table = Table::new([
        Column::text("Check"),
        Column::verdict(),
        Column::text("What came out"),
        Column::text("Report"),
    ]);
    for check in checks {
        table.row([
            check.name.as_str().into(),
            check.verdict.into(),
            check.words.as_str().into(),
            check.report.as_deref().map_or_else(Cell::none, Cell::link),
        ]);
    }
    page.table(table);
    for (name, report) in rules {
        let mut table = Table::new([
            Column::text("Rule"),
            Column::text("What must hold"),
            Column::text("Came out"),
            Column::number("Violations", ""),
            Column::number("Waived", ""),
        ])
        .caption(format!("Design rules of the {name}: {}", report.deck));
        for rule in &report.rules {
            table.row([
                Cell::code(&rule.id),
                rule.words.as_str().into(),
                rule.status.word().into(),
                rule.violations.into(),
                rule.waived.into(),
            ]);
        }
        page.table(table);
        page.list(&report.warnings);
    }
}
