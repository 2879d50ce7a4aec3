//! What a rule is.

use serde::Serialize;

use super::found::Found;
use super::polygon::Outline;
use super::scene::Scene;
use metalith_gds::LayerNumber;

/// How much a violation matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// True, worth knowing, and no reason to stop.
    Note,
    Warning,
    Error,
}

/// How a rule ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case", tag = "status", content = "reason")]
pub enum Status {
    Run,
    /// There was nothing to run it on: not clean.
    Skipped(String),
    /// It could not be carried out: not clean.
    Failed(String),
    /// The deck applies it only when a design is given, and none was.
    NotInForce,
}

impl Status {
    /// In one word.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Run => "run",
            Self::Skipped(_) => "skipped",
            Self::Failed(_) => "failed",
            Self::NotInForce => "not in force",
        }
    }
}

/// What a rule cannot do without.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Needs {
    /// What the first reading counted.
    Numbers,
    /// To have been shown every outline.
    Outlines,
    /// All shapes at hand in `judge`.
    Geometry,
}

/// One rule of a deck with its limits.
pub(super) trait Rule {
    /// What must hold, with the limit.
    fn words(&self) -> String;

    /// Layers whose outlines it looks at, one by one, wherever they stand.
    fn outlines(&self) -> &[LayerNumber] {
        &[]
    }

    /// Whether a square of this width with five points has nothing wrong, wherever it stands. Millions of
    /// equal squares are decided by this once.
    fn passes_square(&self, _width_nm: f64, _clockwise: bool) -> bool {
        false
    }

    /// Look at one outline of those layers.
    fn outline(&mut self, _outline: &Outline<'_>, _found: &mut Found) {}

    /// What it cannot do without.
    fn needs(&self) -> Needs {
        if self.outlines().is_empty() {
            Needs::Geometry
        } else {
            Needs::Outlines
        }
    }

    /// Look at the layout as a whole, after all outlines.
    fn judge(&mut self, _scene: &Scene<'_>, _found: &mut Found) -> Status {
        Status::Run
    }
}
