//! Every layout of the hand-off held to the rules of the process.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::build::Check;
use super::process::Process;
use super::structures::Structure;
use metalith_core::{Progress, Result, WholeFile};
use metalith_design::Design;
use metalith_drc::{CheckInput, Date, DrcReport, Waiver, Waivers};
use metalith_gds::{Layout, ReadLimits};
use metalith_report::{Verdict, write_json};

/// Kinds of files that a check leaves, with what they are for.
const FILES: [(&str, &str); 3] = [
    ("txt", "what became of each design rule, waivers counted"),
    ("json", "the same for programs"),
    ("lyrdb", "the same for the marker browser of KLayout"),
];

/// What became of the rules, by layout.
pub(super) type RuleReports = Vec<(&'static str, DrcReport)>;

/// Markers kept for each rule; all violations are counted.
const MARKERS: usize = 100;
/// Markers among which what test structures break on purpose is looked for.
const MARKERS_ON_PURPOSE: usize = 100_000;
/// Last day of what is waived because a structure is meant so.
const NO_END: &str = "2099-12-31";

/// One layout to check.
pub(super) struct Subject<'a> {
    /// Also the name of the report's files.
    pub name: &'static str,
    pub layout: &'a Path,
    /// The deck of the process.
    pub rules: &'a Path,
    /// The pillars under openings.
    pub with: Option<&'a Path>,
    pub design: Option<&'a Design>,
    /// What breaks rules on purpose.
    pub structures: &'a [Structure],
}

/// What checking left behind.
pub(super) struct Checked {
    pub checks: Vec<Check>,
    pub reports: RuleReports,
    /// Files in the folder of the checks, with what they are for.
    pub files: Vec<(String, String)>,
}

/// Check each layout and write what came out into `folder`.
///
/// # Errors
/// Mistakes in a deck or the waivers; a file that cannot be read or written; the user stopped it.
pub(super) fn check(
    subjects: &[Subject<'_>],
    process: &Process,
    waivers: Option<&Path>,
    folder: &Path,
    progress: &dyn Progress,
) -> Result<Checked> {
    let accepted = waivers.map(Waivers::read).transpose()?;
    let mut layouts = BTreeMap::new();
    for path in subjects.iter().flat_map(|s| std::iter::once(s.layout).chain(s.with)) {
        if !layouts.contains_key(path) {
            layouts.insert(path, Layout::open_with(path, ReadLimits::default(), progress)?);
        }
    }
    let mut files = Vec::new();
    let mut reports = Vec::new();
    for subject in subjects {
        let deck = process.deck(subject.rules)?;
        let judge = |waivers: Option<&Waivers>, markers| {
            let input = CheckInput {
                with: subject.with.iter().map(|path| &layouts[path]).collect(),
                design: subject.design,
                waivers,
                today: Date::today(),
                markers,
            };
            metalith_drc::check(&layouts[subject.layout], &deck, &input, progress)
        };
        let mut waivers = accepted.clone();
        let meant = match subject.structures.is_empty() {
            true => Vec::new(),
            false => on_purpose(subject.structures, &judge(None, MARKERS_ON_PURPOSE)?),
        };
        if !meant.is_empty() {
            let name = format!("{}_waivers.toml", subject.name);
            WholeFile::write(&folder.join(&name), text(&meant).as_bytes())?;
            files.push((
                name.clone(),
                "what test structures break on purpose, and why".to_owned(),
            ));
            let meant = Waivers::read(&folder.join(name))?;
            waivers = Some(waivers.map_or(meant.clone(), |accepted| accepted.and(&meant)));
        }
        let mut report = judge(waivers.as_ref(), MARKERS)?;
        // Where the files lay while they were made is of no use to who receives them.
        let bare = |path: &str| {
            PathBuf::from(path)
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned()
        };
        report.layout = bare(&report.layout);
        report.with.iter_mut().for_each(|w| *w = bare(w));
        reports.push((subject.name, report));
    }
    warn_once(&mut reports);
    for (name, report) in &reports {
        let file = |kind: &str| folder.join(format!("{name}.{kind}"));
        WholeFile::write(&file("txt"), metalith_drc::text(report).as_bytes())?;
        write_json(&file("json"), "check", report)?;
        WholeFile::write(&file("lyrdb"), metalith_drc::lyrdb(report).as_bytes())?;
        files.extend(FILES.map(|(kind, purpose)| (format!("{name}.{kind}"), purpose.to_owned())));
    }
    Ok(Checked {
        checks: reports.iter().map(|(name, report)| summary(name, report)).collect(),
        reports,
        files,
    })
}

/// Waivers for what lies inside a structure that breaks the rule because it is what it is.
fn on_purpose(structures: &[Structure], report: &DrcReport) -> Vec<Waiver> {
    let mut waivers = Vec::new();
    for rule in &report.rules {
        for marker in rule.markers.iter().filter(|m| !m.outline_nm.is_empty()) {
            let within = |s: &&Structure| {
                let b = s.bounds;
                let inside = |p: &[f64; 2]| {
                    (b.x0 as f64..=b.x1 as f64).contains(&p[0]) && (b.y0 as f64..=b.y1 as f64).contains(&p[1])
                };
                marker.outline_nm.iter().all(inside)
            };
            let reason = |s: &Structure| {
                let of_check = s.on_purpose.iter().find(|(check, _)| *check == rule.check);
                of_check.map(|(_, why)| format!("{}: {why}", s.id))
            };
            let Some(reason) = structures.iter().filter(within).find_map(reason) else {
                continue;
            };
            waivers.push(Waiver {
                rule: rule.id.clone(),
                hash: marker.hash.clone(),
                reason,
                author: concat!("metalith ", env!("CARGO_PKG_VERSION"), ", which drew it").into(),
                expires: Date::parse(NO_END).expect("a date"),
                index: waivers.len(),
            });
        }
    }
    waivers
}

fn text(waivers: &[Waiver]) -> String {
    let mut text =
        "# What structures break on purpose, made with them; tests/structures.csv says what each is.\n".to_owned();
    waivers.iter().for_each(|w| text.push_str(&format!("\n{}", w.text())));
    text
}

/// A waiver that covers something in one layout is not stale because it covers nothing in another; one that covers
/// nothing anywhere is told once.
fn warn_once(reports: &mut RuleReports) {
    let mut told: BTreeSet<String> = reports.iter().flat_map(|(_, r)| r.covered.iter().cloned()).collect();
    for (_, report) in reports {
        let warnings = std::mem::take(&mut report.warnings)
            .into_iter()
            .zip(std::mem::take(&mut report.warned));
        for (words, hash) in warnings {
            if told.insert(hash.clone()) {
                report.warnings.push(words);
                report.warned.push(hash);
            }
        }
    }
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
        name: format!("design rules, {}", name.replace('_', " ")),
        verdict: match report.exit_code() {
            0 => Verdict::Pass,
            1 => Verdict::Fail,
            _ => Verdict::NotRun,
        },
        words,
        report: Some(format!("checks/{name}.txt")),
    }
}
