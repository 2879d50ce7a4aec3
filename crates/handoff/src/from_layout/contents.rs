//! Content of the front page and of `handoff.json` of a layout.

use serde::Serialize;

use super::central;
use super::places::{Density, LayoutPiece, Places};
use super::read::Pattern;
use crate::contents::{HandoffCheck, RuleReports};
use crate::dose::{Beam, DoseRow, Exposure, WriteTime};
use crate::dose_matrix::DoseBlock;
use crate::layout_statistics::LayoutStatistics;
use crate::metrology_sites::MetrologySite;
use crate::process::Process;

/// Everything that the front page and `handoff.json` state.
#[derive(Serialize)]
pub(super) struct LayoutContents<'a> {
    pub process: &'a Process,
    pub command: &'a str,
    pub source: &'static str,
    /// The file that is handed over, and the SHA-256 of it.
    pub layout: String,
    pub layout_digest: String,
    /// Cell to expose.
    pub top: String,
    /// Exposed layers, the pillars first.
    pub exposed: Vec<String>,
    pub database_unit_nm: f64,
    /// Bounding box of what is exposed.
    pub bounds_um: [f64; 4],
    pub density: Density,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub found: Option<FoundPillars>,
    pub piece: LensPiece,
    pub census: Vec<LayoutStatistics>,
    pub exposures: Vec<(String, Exposure, Vec<WriteTime>)>,
    pub snapping: Vec<(Beam, f64)>,
    pub doses: Vec<DoseRow>,
    pub sites: Vec<MetrologySite>,
    pub blocks: Vec<DoseBlock>,
    /// Parts of a hand-off that need a design.
    pub left_out: Vec<LeftOut>,
    pub checks: Vec<HandoffCheck>,
    pub rules: RuleReports,
    pub files: Vec<(String, String)>,
    #[serde(skip)]
    pub places: Places,
}

impl LayoutContents<'_> {
    /// Middle of what is exposed (um).
    pub(super) fn middle_um(&self) -> [f64; 2] {
        let [x0, y0, x1, y1] = self.bounds_um;
        [(x0 + x1) / 2.0, (y0 + y1) / 2.0]
    }
}

/// Pillars that were found in a layout.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct FoundPillars {
    pub pillars: u64,
    pub shape: &'static str,
    pub elements: usize,
    /// Pitch and lattice of the central element.
    pub pitch_nm: f64,
    pub lattice: String,
    /// Other shapes on the layer of the pillars, by reason.
    pub others: Vec<(String, u64)>,
}

impl FoundPillars {
    pub(super) fn of(pattern: &Pattern) -> Option<Self> {
        let Pattern::Pillars(found) = pattern else { return None };
        let lattice = central(found).site.lattice;
        Some(Self {
            pillars: found.pillars,
            shape: found.shape.plural(),
            elements: found.elements.len(),
            pitch_nm: lattice.pitch_nm().nm(),
            lattice: lattice.kind().to_string(),
            others: found
                .oddities
                .by_why
                .met()
                .map(|(why, n)| (why.words().to_owned(), n))
                .collect(),
        })
    }
}

/// Piece of the layout in each block of the dose matrix.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct LensPiece {
    /// Place in the layout that is in the middle of it (um).
    pub middle_um: [f64; 2],
    pub shapes: usize,
    /// Shapes that there was no room for.
    pub left_out: u64,
}

impl LensPiece {
    pub(super) fn of(piece: &LayoutPiece, unit_nm: f64) -> Self {
        Self {
            middle_um: piece.middle.map(|v| v as f64 * unit_nm * 1e-3),
            shapes: piece.polygons.len(),
            left_out: piece.left_out,
        }
    }
}

/// Part of a hand-off that is left out, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(super) struct LeftOut {
    pub part: &'static str,
    pub why: String,
}

impl LeftOut {
    /// Parts that are left out of a hand-off in which rules of the checks `waiting` are not in force.
    pub(super) fn of(pattern: &Pattern, waiting: &[&str]) -> Vec<Self> {
        let mut parts = vec![
            ("apertures", "openings of step 2 follow from the elements of a design"),
            (
                "chip",
                "size and edge of the chip are in a design: the page shows the bounding box of what is exposed",
            ),
            (
                "film",
                "material and thickness are in a design: the process is taken as it is, whether it fits or not",
            ),
            (
                "test structures",
                "pads, lines and verniers follow from the cell and the layers of a design",
            ),
            ("reference lens", "it has the mapping of a design"),
            (
                "alignment crosses",
                "a layout does not say which shapes are marks: name their layer with --expose",
            ),
            (
                "simulation",
                "focal length, wavelength and limits are in a design: use `metalith psf`",
            ),
            ("compensation and dose classes", "they need the elements of a design"),
        ];
        parts.extend(match pattern {
            Pattern::Pillars(_) => vec![(
                "height of the pillars",
                "rules about aspect ratios use the height that the rules file states",
            )],
            Pattern::Shapes { .. } => vec![
                ("pads of the dose matrix", "no pillars were found to make them of"),
                ("places to measure", "no pillars were found"),
            ],
        });
        let parts = parts.into_iter().map(|(part, why)| Self {
            part,
            why: why.to_owned(),
        });
        let rules = Self {
            part: "rules",
            why: format!(
                "rules of checks {} state what a design or its pillars and marks hold and are not in force",
                waiting.join(", ")
            ),
        };
        parts.chain([rules]).collect()
    }
}
