//! Both layouts held to the rules of the process.

use std::path::Path;

use super::build::{Check, HandoffOptions};
use super::process::Process;
use crate::design::Design;
use crate::drc::{self, CheckInput, Date, Deck, DrcReport, Waivers};
use crate::error::Result;
use crate::file::WholeFile;
use crate::gds::{Layout, ReadLimits};
use crate::progress::Progress;
use crate::report::{Verdict, write_json};

/// Kinds of files that a check leaves, with what they are for.
pub(super) const FILES: [(&str, &str); 3] = [
    ("txt", "what became of each design rule, waivers counted"),
    ("json", "the same for programs"),
    ("lyrdb", "the same for the marker browser of KLayout"),
];

/// What became of the rules, by layout.
pub(super) type RuleReports = Vec<(&'static str, DrcReport)>;

/// Markers kept for each rule; all violations are counted.
const MARKERS: usize = 100;

/// Check the pillars against the design, and the openings over the pillars.
///
/// # Errors
/// Mistakes in a deck or the waivers; a file that cannot be read or written; the user stopped it.
pub(super) fn check(
    options: &HandoffOptions,
    design: &Design,
    process: &Process,
    pillars: &Path,
    apertures: &Path,
    folder: &Path,
    progress: &dyn Progress,
) -> Result<(Vec<Check>, RuleReports)> {
    let decks = [
        Deck::read(&process.checks.pillar_rules)?,
        Deck::read(&process.checks.aperture_rules)?,
    ];
    let waivers = options.waivers.as_deref().map(Waivers::read).transpose()?;
    let open = |path: &Path| Layout::open_with(path, ReadLimits::default(), progress);
    let (pillars, apertures) = (open(pillars)?, open(apertures)?);
    let mut checks = Vec::new();
    let mut reports = Vec::new();
    for (name, layout, with, deck) in [
        ("pillars", &pillars, Vec::new(), &decks[0]),
        ("apertures", &apertures, vec![&pillars], &decks[1]),
    ] {
        let input = CheckInput {
            with,
            design: Some(design),
            waivers: waivers.as_ref(),
            today: Date::today(),
            markers: MARKERS,
        };
        let mut report = drc::check(layout, deck, &input, progress)?;
        // Where the files lay while they were made is of no use to who receives them.
        let bare = |path: &str| {
            Path::new(path)
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned()
        };
        report.layout = bare(&report.layout);
        report.with.iter_mut().for_each(|w| *w = bare(w));
        let file = |kind: &str| folder.join(format!("{name}.{kind}"));
        WholeFile::write(&file("txt"), drc::text(&report).as_bytes())?;
        write_json(&file("json"), "check", &report)?;
        WholeFile::write(&file("lyrdb"), drc::lyrdb(&report).as_bytes())?;
        checks.push(summary(name, &report));
        reports.push((name, report));
    }
    Ok((checks, reports))
}

fn summary(name: &str, report: &DrcReport) -> Check {
    let waived: u64 = report.rules.iter().map(|r| r.waived).sum();
    let mut words = format!(
        "{} rules, {} violations, {waived} waived",
        report.rules.len(),
        report.open()
    );
    if report.not_run() > 0 {
        words.push_str(&format!(", {} rules did not run", report.not_run()));
    }
    Check {
        name: format!("design rules of the {name}"),
        verdict: match report.exit_code() {
            0 => Verdict::Pass,
            1 => Verdict::Fail,
            _ => Verdict::NotRun,
        },
        words,
        report: Some(format!("checks/{name}.txt")),
    }
}
