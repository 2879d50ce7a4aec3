//! The interface of rules.

use serde::Serialize;

use super::drawn_outline::DrawnOutline;
use super::findings::Findings;
use super::flat_layout::FlatLayout;
use super::work::Stop;
use metalith_core::document::Section;
use metalith_gds::LayerNumber;

/// Severity of a violation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Information; not a reason to stop.
    Note,
    Warning,
    Error,
}

/// Outcome of a rule.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case", tag = "status", content = "reason")]
pub enum Status {
    Run,
    /// There was nothing to run it on: not clean.
    Skipped(String),
    /// Rule about something that such a layout does not have: clean.
    NotApplicable(String),
    /// Rule that could not be run: not clean.
    Failed(String),
    /// The deck applies it only when a design is given, and none was.
    NotInForce,
}

impl Status {
    /// Reason why it did not run.
    pub(super) fn reason(&self) -> Option<&str> {
        match self {
            Self::Skipped(why) | Self::NotApplicable(why) | Self::Failed(why) => Some(why),
            Self::Run | Self::NotInForce => None,
        }
    }

    /// Status in one word.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Run => "run",
            Self::Skipped(_) => "skipped",
            Self::NotApplicable(_) => "not applicable",
            Self::Failed(_) => "failed",
            Self::NotInForce => "not in force",
        }
    }
}

/// Reason why a rule did not run.
#[derive(Debug)]
pub(super) enum NotRun {
    /// There was nothing to run it on.
    Skipped(String),
    /// Rule about something that such a layout does not have.
    NotApplicable(String),
    /// Rule that could not be run.
    Failed(String),
    /// The user asked to stop.
    Interrupted,
}

impl From<Stop> for NotRun {
    fn from(stop: Stop) -> Self {
        match stop {
            Stop::TooMuch(why) => Self::Failed(why),
            Stop::Interrupted => Self::Interrupted,
        }
    }
}

/// Reason why a rule that compares with a design did not run where there is none.
pub(super) const NO_DESIGN: &str = "no design was given: name it with --design";

/// True if the design sets the limit of a rule, by `from = "design"`, in place of a number.
pub(super) fn from_design(s: &Section<'_, '_>) -> bool {
    s.has("from") && s.choice("from", &[("design", true)], None)
}

/// Outcome of running a rule; its findings are collected in [`Findings`].
pub(super) type RuleOutcome = Result<(), NotRun>;

/// One rule of the deck, ready to run.
pub(super) struct DeckRule {
    pub id: String,
    pub check: String,
    pub severity: Severity,
    /// True if it applies without a design; some rules are written to wait for one.
    pub always: bool,
    pub rule: Box<dyn Rule>,
}

/// Input that a rule requires.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Needs {
    /// Counts of the first pass over the file.
    Numbers,
    /// To have been shown every outline.
    Outlines,
    /// All shapes, available in `judge`.
    Geometry,
    /// The design, and the pillars computed from it beside all shapes.
    Array,
}

/// One rule of a deck with its limits. It keeps nothing between layouts.
pub(super) trait Rule: Send + Sync {
    /// The requirement, with its limit.
    fn words(&self) -> String;

    /// Layers whose outlines it checks one by one, independent of position.
    fn outlines(&self) -> &[LayerNumber] {
        &[]
    }

    /// True if a square of this width with five points is clean at any position. One call decides millions of equal
    /// squares. Millions of equal squares are decided by this once.
    fn passes_square(&self, _width_nm: f64, _clockwise: bool) -> bool {
        false
    }

    /// Look at one outline of those layers.
    fn outline(&self, _outline: &DrawnOutline<'_>, _found: &mut Findings) {}

    /// Input that it requires.
    fn needs(&self) -> Needs {
        if self.outlines().is_empty() {
            Needs::Geometry
        } else {
            Needs::Outlines
        }
    }

    /// Look at the layout as a whole, after all outlines.
    fn judge(&self, _scene: &FlatLayout<'_>, _found: &mut Findings) -> RuleOutcome {
        Ok(())
    }
}
