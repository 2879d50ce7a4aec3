//! The result of a check.

use std::collections::BTreeMap;

use metalith_pillars::PillarShape;
use serde::Serialize;

use super::deck::Deck;
use super::findings::{Findings, Marker};
use super::flat_layout::FlatLayout;
use super::input::CheckInput;
use super::rule::{Severity, Status};

/// Result of one rule.
#[derive(Clone, Debug, Serialize)]
pub struct RuleReport {
    pub id: String,
    pub check: String,
    pub severity: Severity,
    /// The requirement.
    pub words: String,
    #[serde(flatten)]
    pub status: Status,
    /// Places where it does not, all of them.
    pub violations: u64,
    /// Number of violations that a waiver covers.
    pub waived: u64,
    /// The first of them.
    pub markers: Vec<Marker>,
    /// Values that are reported whether or not they are within limits.
    pub facts: BTreeMap<String, f64>,
}

impl RuleReport {
    /// Violations that count against the layout.
    pub fn open(&self) -> u64 {
        self.violations - self.waived
    }
}

/// Result of a check.
#[derive(Clone, Debug, Serialize)]
pub struct DrcReport {
    pub layout: String,
    pub with: Vec<String>,
    pub deck: String,
    pub top: String,
    pub bytes: u64,
    /// Shapes with all references followed.
    pub shapes: u64,
    pub elements: usize,
    /// Shape of the pillars: as the design says, or as they were found.
    #[serde(skip)]
    pub shape: PillarShape,
    pub pillars_on_lattices: u64,
    /// Largest distance of a pillar from its site along an axis (nm), where places were rounded one by one. Distances between pillars
    /// are those of their sites, and err by up to twice as much.
    #[serde(skip_serializing_if = "is_exact")]
    pub slack_nm: f64,
    /// Shapes of elements that are no pillars, in words, where no design says what should be there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub not_understood: Option<String>,
    /// Angle at which all pillars stand (degrees), if they are not upright.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turned_deg: Option<f64>,
    /// Every rule of the deck, in its order.
    pub rules: Vec<RuleReport>,
    /// Warnings about the check itself: waivers that cover nothing or have expired.
    pub warnings: Vec<String>,
    /// Hash of the waiver of each of them.
    #[serde(skip)]
    pub warned: Vec<String>,
    /// Hashes of the waivers that cover something.
    #[serde(skip)]
    pub covered: Vec<String>,
}

impl DrcReport {
    /// Number of rules in force that did not run.
    pub fn not_run(&self) -> usize {
        self.not_run_names().count()
    }

    /// Rules in force that did not run.
    pub fn not_run_names(&self) -> impl Iterator<Item = &str> {
        let not_run = |r: &&RuleReport| matches!(r.status, Status::Skipped(_) | Status::Failed(_));
        self.rules.iter().filter(not_run).map(|r| r.id.as_str())
    }

    /// Violations of errors and warnings that no waiver covers.
    pub fn open(&self) -> u64 {
        let counts = |r: &&RuleReport| r.severity > Severity::Note;
        self.rules.iter().filter(counts).map(RuleReport::open).sum()
    }

    /// Exit code of the program: 0 clean, 1 violations, 3 a rule did not run.
    pub fn exit_code(&self) -> u8 {
        match (self.not_run(), self.open()) {
            (0, 0) => 0,
            (0, _) => 1,
            _ => 3,
        }
    }
}

fn is_exact(slack_nm: &f64) -> bool {
    *slack_nm == 0.0
}

pub(super) fn assemble(
    flat: &FlatLayout<'_>,
    deck: &Deck,
    statuses: Vec<Status>,
    found: Vec<Findings>,
    input: &CheckInput<'_>,
) -> DrcReport {
    let (covered, stale) = waivers(&found, input);
    let (warned, warnings) = stale.into_iter().unzip();
    let rules = deck
        .rules()
        .iter()
        .zip(statuses)
        .zip(found)
        .map(|((rule, status), found)| RuleReport {
            words: rule.rule.words(),
            id: rule.id.clone(),
            check: rule.check.clone(),
            severity: rule.severity,
            status,
            violations: found.total,
            waived: found.waived,
            markers: found.markers,
            facts: found.facts.into_iter().collect(),
        })
        .collect();
    let layout = flat.layout;
    let name = |l: &metalith_gds::Layout| l.path().display().to_string();
    DrcReport {
        layout: name(layout),
        with: flat.with.iter().map(|l| name(l)).collect(),
        deck: deck.name.clone(),
        top: layout
            .tops()
            .first()
            .map_or_else(String::new, |&t| layout.cells()[t].name.clone()),
        bytes: layout.bytes(),
        shapes: layout.flat_shapes(),
        elements: flat.elements.len(),
        shape: flat.shape,
        pillars_on_lattices: flat.pillars_on_lattices(),
        slack_nm: flat.slack_nm,
        not_understood: None,
        turned_deg: None,
        rules,
        warnings,
        warned,
        covered,
    }
}

/// Hashes of the waivers that cover a finding, and faults of the others.
fn waivers(found: &[Findings], input: &CheckInput<'_>) -> (Vec<String>, Vec<(String, String)>) {
    let list = input.waivers.map_or(&[][..], |w| &w.list);
    let mut counts = vec![None; list.len()];
    for (index, count) in found.iter().flat_map(Findings::tried) {
        counts[index] = Some(count);
    }
    let (mut covered, mut warnings) = (Vec::new(), Vec::new());
    for (waiver, count) in list.iter().zip(counts) {
        let who = format!("waiver {} of {} by {}", waiver.hash, waiver.rule, waiver.author);
        let words = match count {
            _ if waiver.expires < input.today => format!("{who} expired on {}", waiver.expires),
            None => format!("{who} is for a rule that is not in the deck"),
            Some(0) => format!("{who} covers nothing: the violation is gone, or the geometry changed"),
            Some(_) => {
                covered.push(waiver.hash.clone());
                continue;
            }
        };
        warnings.push((waiver.hash.clone(), words));
    }
    (covered, warnings)
}
