//! Content of the front page and of `handoff.json`.

use serde::Serialize;

use super::cures::BrokenRule;
use super::documents::Documents;
use super::dose_classes::DoseClasses;
use super::dose_matrix::DoseBlock;
use super::drawing::RectNm;
use super::layout_statistics::LayoutStatistics;
use super::manifest::Manifest;
use super::process::Process;
use super::structures::Structure;
use metalith_core::Result;
use metalith_design::Design;
use metalith_drc::DrcReport;
use metalith_report::Verdict;

/// Result of a hand-off.
#[derive(Clone, Debug)]
pub struct Handoff {
    pub folder: std::path::PathBuf,
    pub archive: std::path::PathBuf,
    pub manifest: Manifest,
    pub checks: Vec<HandoffCheck>,
}

/// One look at the layout that is part of the hand-off.
#[derive(Clone, Debug, Serialize)]
pub struct HandoffCheck {
    pub name: String,
    #[serde(serialize_with = "as_word")]
    pub verdict: Verdict,
    /// The result in one sentence.
    pub words: String,
    /// Own report, in the folder.
    pub report: Option<String>,
    /// Rules that are broken.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub broken: Vec<BrokenRule>,
}

impl HandoffCheck {
    /// True if a limit is exceeded that no lab has confirmed.
    pub fn exceeds_assumed(&self) -> bool {
        self.broken.iter().any(|rule| rule.assumed)
    }
}

fn as_word<S: serde::Serializer>(verdict: &Verdict, s: S) -> Result<S::Ok, S::Error> {
    s.serialize_str(verdict.word())
}

/// Results of the rules, by layout.
pub(super) type RuleReports = Vec<(&'static str, DrcReport)>;

/// Everything that the front page and `handoff.json` tell of a hand-off of a design.
#[derive(Serialize)]
pub(super) struct Contents<'a> {
    #[serde(skip)]
    pub design: &'a Design,
    pub process: &'a Process,
    pub command: &'a str,
    pub design_digest: String,
    pub pillars: u64,
    pub census: Vec<LayoutStatistics>,
    #[serde(flatten)]
    pub documents: Documents,
    pub blocks: Vec<DoseBlock>,
    pub structures: Vec<Structure>,
    #[serde(skip)]
    pub tests_frame: (RectNm, (i64, i64)),
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dose_classes: Option<DoseClasses>,
    pub checks: Vec<HandoffCheck>,
    /// Result of each rule, by layout.
    pub rules: RuleReports,
    /// Path in the folder and purpose.
    pub files: Vec<(String, String)>,
}
