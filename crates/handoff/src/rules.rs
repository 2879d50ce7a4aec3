//! Every layout of the hand-off held to the rules of the process.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::path::PathBuf;

use super::contents::{HandoffCheck, RuleReports};
use super::cures::BrokenRule;
use super::inputs::Sources;
use super::lab::Lab;
use super::layouts::{Layouts, OfEach};
use super::listing::Listing;
use super::process::Process;
use super::structures::{Structure, middle_of_reference};
use metalith_core::text::printable;
use metalith_core::{AtomicFile, Progress, Result};
use metalith_design::Design;
use metalith_design::array::PillarArray;
use metalith_drc::{CheckInput, Date, Deck, DrcReport, Waiver, Waivers};
use metalith_gds::{LayerNumber, Layout};
use metalith_report::{Verdict, counted, write_json};

/// Kinds of files that a check writes, with their purpose.
const FILES: [(&str, &str); 3] = [
    ("txt", "what became of each design rule, waivers counted"),
    ("json", "the same for programs"),
    ("lyrdb", "the same for the marker browser of KLayout"),
];

/// Markers kept for each rule; all violations are counted.
const MARKERS: usize = 100;
/// Markers among which what test structures break on purpose is looked for.
const MARKERS_ON_PURPOSE: usize = 100_000;
/// Expiry date of waivers for structures that break rules by intention.
const NO_END: &str = "2099-12-31";

/// One layout to check.
pub(super) struct Subject<'a> {
    /// Also the name of the report's files.
    pub name: &'static str,
    pub layout: &'a Layout,
    /// The deck of the process.
    pub deck: &'a Deck,
    /// The pillars under openings.
    pub with: Option<&'a Layout>,
    /// The design that it should hold, and its pillars.
    pub design: Option<(&'a Design, &'a PillarArray)>,
    /// Layer whose shapes are to be pillars, where no design says what it should hold.
    pub recognised: Option<LayerNumber>,
    /// Structures that break rules by intention.
    pub structures: Cow<'a, [Structure]>,
}

/// The layouts of a hand-off with the rules of each.
pub(super) fn subjects<'a>(sources: &'a Sources, layouts: &'a Layouts, opened: &'a OfEach<Layout>) -> [Subject<'a>; 7] {
    let (decks, first) = (&sources.lab.process.checks, sources.lab.first_step());
    let design = Some((&sources.design, &layouts.array));
    let reference = Some((&layouts.reference, &layouts.reference_array));
    let subject = |name, layout, rules: &std::path::Path| Subject::of(name, layout, sources.lab.deck(rules));
    [
        Subject {
            design,
            ..subject("pillars", &opened.pillars, &first.pillar_rules)
        },
        Subject {
            design,
            with: Some(&opened.pillars),
            ..subject("apertures", &opened.apertures, &decks.aperture_rules)
        },
        subject("dose_matrix", &opened.dose_matrix, &first.dose_rules),
        Subject {
            structures: Cow::Borrowed(&layouts.structures),
            ..subject("tests_pillars", &opened.tests, &first.test_rules)
        },
        Subject {
            with: Some(&opened.tests),
            ..subject("tests_apertures", &opened.test_openings, &decks.test_opening_rules)
        },
        Subject {
            design: reference,
            structures: Cow::Owned(vec![middle_of_reference()]),
            ..subject("reference_pillars", &opened.reference, &first.pillar_rules)
        },
        Subject {
            design: reference,
            with: Some(&opened.reference),
            ..subject("reference_apertures", &opened.reference_openings, &decks.aperture_rules)
        },
    ]
}

/// Output of the checks.
pub(super) struct Checked {
    pub checks: Vec<HandoffCheck>,
    pub reports: RuleReports,
}

/// Check each layout and write the results into the folder of the checks.
///
/// # Errors
/// A file that cannot be read or written; the user stopped it.
pub(super) fn check(
    files: &mut Listing,
    subjects: &[Subject<'_>],
    lab: &Lab,
    pitch_nm: Option<f64>,
    progress: &dyn Progress,
) -> Result<Checked> {
    let accepted = lab.waivers.as_ref();
    let mut reports = Vec::new();
    for subject in subjects {
        reports.push((subject.name, subject.check(files, accepted, progress)?));
    }
    warn_once(&mut reports);
    for (name, report) in &reports {
        let texts = [metalith_drc::text(report), String::new(), metalith_drc::lyrdb(report)];
        for ((kind, purpose), text) in FILES.into_iter().zip(texts) {
            let path = files.add(format!("checks/{name}.{kind}"), purpose);
            if kind == "json" {
                write_json(&path, "check", report)?;
            } else {
                AtomicFile::write(&path, text.as_bytes())?;
            }
        }
    }
    Ok(Checked {
        checks: reports
            .iter()
            .zip(subjects)
            .map(|((name, report), subject)| summary(name, report, subject.deck, &lab.process, pitch_nm))
            .collect(),
        reports,
    })
}

impl<'a> Subject<'a> {
    /// A layout with its rules, and nothing else.
    pub(super) fn of(name: &'static str, layout: &'a Layout, deck: &'a Deck) -> Self {
        Self {
            name,
            layout,
            deck,
            with: None,
            design: None,
            recognised: None,
            structures: Cow::Borrowed(&[]),
        }
    }

    /// Variant of this layout in which shapes of a layer that are no pillars are counted, as `metalith check` counts them.
    pub(super) fn recognising(mut self, layer: LayerNumber) -> Self {
        self.recognised = Some(layer);
        self
    }

    /// Check one layout; what it breaks on purpose is waived, and the waivers are written.
    fn check(&self, files: &mut Listing, accepted: Option<&Waivers>, progress: &dyn Progress) -> Result<DrcReport> {
        let mut waivers = accepted.cloned();
        if !self.structures.is_empty() {
            let on_purpose = on_purpose(&self.structures, &self.judge(None, MARKERS_ON_PURPOSE, progress)?);
            if !on_purpose.is_empty() {
                let path = files.add(
                    format!("checks/{}_waivers.toml", self.name),
                    "what test structures break on purpose, and why",
                );
                AtomicFile::write(&path, text(&on_purpose).as_bytes())?;
                let on_purpose = Waivers::read(&path)?;
                waivers = Some(waivers.map_or(on_purpose.clone(), |accepted| accepted.and(&on_purpose)));
            }
        }
        let mut report = self.judge(waivers.as_ref(), MARKERS, progress)?;
        // Where the files lay while they were made is of no use to who receives them.
        let bare = |path: &str| {
            let path = PathBuf::from(path);
            path.file_name().unwrap_or_default().to_string_lossy().into_owned()
        };
        report.layout = bare(&report.layout);
        report.with.iter_mut().for_each(|w| *w = bare(w));
        Ok(report)
    }

    fn judge(&self, waivers: Option<&Waivers>, markers: usize, progress: &dyn Progress) -> Result<DrcReport> {
        let input = CheckInput {
            with: self.with.into_iter().collect(),
            design: self.design.map(|(design, _)| design),
            array: self.design.map(|(_, array)| array),
            waivers,
            today: Date::today(),
            markers,
        };
        let mut report = metalith_drc::check(self.layout, self.deck, &input, progress)?;
        if let Some(layer) = self.recognised {
            metalith_drc::add_recognition(&mut report, self.layout, layer, &input, progress)?;
        }
        Ok(report)
    }
}

/// Waivers for findings inside a structure that breaks the rule by intention.
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
/// nothing anywhere is reported once.
fn warn_once(reports: &mut RuleReports) {
    let mut reported_once: BTreeSet<String> = reports.iter().flat_map(|(_, r)| r.covered.iter().cloned()).collect();
    for (_, report) in reports {
        let warnings = std::mem::take(&mut report.warnings)
            .into_iter()
            .zip(std::mem::take(&mut report.warned));
        for (words, hash) in warnings {
            if reported_once.insert(hash.clone()) {
                report.warnings.push(words);
                report.warned.push(hash);
            }
        }
    }
}

fn summary(name: &str, report: &DrcReport, deck: &Deck, process: &Process, pitch_nm: Option<f64>) -> HandoffCheck {
    let (file, _) = deck.source();
    let file = file.file_name().unwrap_or_default().to_string_lossy();
    let file = printable(&file);
    let rules = report.rules.iter();
    let broken: Vec<BrokenRule> = rules
        .filter_map(|rule| BrokenRule::of(rule, &file, process.assumes(deck), process, pitch_nm))
        .collect();
    let waived: u64 = report.rules.iter().map(|r| r.waived).sum();
    let mut words = format!(
        "{}, {}, {waived} waived",
        counted(report.rules.len(), "rule"),
        counted(report.open() as usize, "violation")
    );
    if report.not_run() > 0 {
        let not_run = report.not_run_names().collect::<Vec<_>>().join(", ");
        words.push_str(&format!(", {} not run: {not_run}", counted(report.not_run(), "rule")));
    }
    let named = |assumed: bool| {
        let rules = broken.iter().filter(|rule| rule.assumed == assumed);
        rules.map(|rule| rule.rule.as_str()).collect::<Vec<_>>().join(", ")
    };
    let (assumed, confirmed) = (named(true), named(false));
    let named_by = format!("in {file}, which [checks] of {} names", process.words());
    if !confirmed.is_empty() {
        words.push_str(&format!(": {confirmed} {named_by}"));
    }
    if !assumed.is_empty() {
        let exceeded = format!("assumed limits exceeded: {assumed} {named_by}; no lab has confirmed them, ask yours");
        words = if confirmed.is_empty() {
            format!("{exceeded}; {words}")
        } else {
            format!("{words}; {exceeded}")
        };
    }
    HandoffCheck {
        name: format!("design rules, {}", name.replace('_', " ")),
        verdict: match report.not_run() {
            0 => Verdict::of(broken.iter().all(|rule| rule.assumed)),
            _ => Verdict::NotRun,
        },
        words,
        report: Some(format!("checks/{name}.txt")),
        broken,
    }
}
