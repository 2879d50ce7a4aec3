//! The front page of a hand-off.

mod chip;
mod measuring;
mod writing;

use std::path::Path;

use crate::contents::Contents;
use metalith_core::Result;
use metalith_core::text::printable;
use metalith_report::{Cell, Column, Page, Table, Verdict, count, sig};

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
    verdict(&mut page, c);
    for warning in c.design.warnings()? {
        page.note(warning.paragraph());
    }
    let (w, h) = c.design.layout.chip.size_nm;
    page.facts(&[
        ("Pillars", count(c.pillars)),
        ("Elements", count(c.design.elements().len() as u64)),
        (
            "Chip",
            format!("{} x {} mm", sig(w as f64 * 1e-6, 3), sig(h as f64 * 1e-6, 3)),
        ),
        ("Base dose", format!("{} uC/cm2", c.process.resist.dose_uc_cm2)),
    ]);
    page.section("Files");
    page.paragraph(
        "`metalith handoff --verify FOLDER` says whether this folder is complete and unaltered; `manifest.json` holds the \
         SHA-256 of every file.",
    );
    let mut files = Table::new([Column::text("File"), Column::text("What it is")]);
    for (file, purpose) in &c.files {
        files.row([Cell::code(file), purpose.as_str().into()]);
    }
    page.table(files);
    chip::chip(&mut page, c, folder)?;
    chip::layers(&mut page, c, folder)?;
    chip::cells(&mut page, c);
    chip::stack(&mut page, c);
    writing::doses(&mut page, c);
    writing::dose_classes(&mut page, c);
    writing::write_time(&mut page, c);
    measuring::tests(&mut page, c);
    measuring::metrology(&mut page, c);
    writing::job_files(&mut page, c);
    checks(&mut page, c);
    page.section("Made by");
    page.code(printable(c.command));
    page.write(&folder.join("index.html"))
}

fn verdict(page: &mut Page, c: &Contents<'_>) {
    let failed: Vec<_> = c.checks.iter().filter(|k| k.verdict == Verdict::Fail).collect();
    let open: Vec<_> = c.checks.iter().filter(|k| k.verdict == Verdict::NotRun).collect();
    if let Some(first) = failed.first() {
        page.verdict(Verdict::Fail, format!("{}: {}", first.name, first.words));
    } else if let Some(first) = open.first() {
        page.verdict(Verdict::NotRun, format!("{}: {}", first.name, first.words));
    } else if !c.checks.is_empty() {
        page.verdict(Verdict::Pass, "All checks of the layout passed; see the last section.");
    }
}

fn checks(page: &mut Page, c: &Contents<'_>) {
    page.section("Checks");
    let mut table = Table::new([
        Column::text("Check"),
        Column::verdict(),
        Column::text("What came out"),
        Column::text("Report"),
    ]);
    for check in &c.checks {
        table.row([
            check.name.as_str().into(),
            check.verdict.into(),
            check.words.as_str().into(),
            check.report.as_deref().map_or_else(Cell::none, Cell::link),
        ]);
    }
    page.table(table);
    for (name, report) in &c.rules {
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
