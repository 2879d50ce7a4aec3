//! The process file: everything about a lab that a hand-off needs and a design does not know.

mod read;

use std::path::{Path, PathBuf};

use include_dir::{Dir, File, include_dir};
use serde::Serialize;

use metalith_core::Result;
use metalith_core::document::{KeyTable, load};
use metalith_core::text::printable;
use metalith_design::Design;
use metalith_drc::Deck;
use metalith_pillars::{DatabaseUnit, OutlineForm, PillarShape, Rectangles, UprightRectangles};

/// The processes that ship with the program.
static SHIPPED: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/processes");

const STANDARD: &str = "jbx6300_zep520a.toml";

/// Doses of a matrix: three by three blocks.
pub(super) const DOSES: usize = 9;

/// One lab's way to make the chip.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Process {
    pub name: String,
    /// One line of description.
    pub title: String,
    pub writer: Writer,
    pub resist: Resist,
    pub transfer: PatternTransfer,
    pub proximity: Proximity,
    pub apertures: ApertureStep,
    pub dose_matrix: DoseMatrixSpec,
    pub tests: TestSpec,
    pub metrology: MetrologySpec,
    pub checks: CheckSpec,
    pub job: JobSpec,
    #[serde(skip)]
    path: PathBuf,
    #[serde(skip)]
    text: String,
    /// True if it is one of the program's own, and so are its decks.
    #[serde(skip)]
    standard: bool,
}

/// The electron-beam writer of the first step.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Writer {
    pub name: String,
    pub acceleration_kv: f64,
    /// Name of the lens mode.
    pub mode: String,
    /// Largest edge of a write field (um).
    pub field_um: f64,
    /// Edge of a write field as used (um), so that its border runs between pillars.
    pub field_used_um: f64,
    /// Grid that figures are placed on (nm).
    pub grid_nm: f64,
    /// Fastest shot rate (MHz).
    pub clock_max_mhz: f64,
    /// Beam currents to choose from (nA).
    pub currents_na: Vec<f64>,
    /// Error between neighbouring fields, in use (nm).
    pub stitching_nm: f64,
    /// Time lost at each figure (us), at each field (s), and once (s).
    pub shape_overhead_us: f64,
    pub field_overhead_s: f64,
    pub job_overhead_s: f64,
}

/// Tone: whether the exposed resist goes or stays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Tone {
    Positive,
    Negative,
}

/// The resist of the first step and its dose.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Resist {
    pub name: String,
    pub tone: Tone,
    pub thickness_nm: f64,
    pub developer: String,
    /// Charge an area (uC/cm2), and the range that labs report.
    pub dose_uc_cm2: f64,
    pub dose_range_uc_cm2: [f64; 2],
}

/// Method of transfer of the pattern from resist to film.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Mask material stays where the resist was opened.
    LiftOff,
    /// The film goes where the resist was opened.
    DirectEtch,
}

/// Pattern transfer from the resist into the film.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PatternTransfer {
    pub method: Method,
    pub mask: String,
    pub mask_thickness_nm: f64,
    pub etch: String,
    /// Films that this etch is for, by the names that designs give to the material of their pillars.
    pub films: Vec<String>,
    /// Least and greatest thickness of the film (nm), where the etch and the rules are for some alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub film_nm: Option<[f64; 2]>,
}

impl PatternTransfer {
    /// True if it is for a film of this material.
    pub(super) fn etches(&self, film: &str) -> bool {
        self.films.iter().any(|known| known == film)
    }

    /// True if it is for films of this thickness (nm).
    pub(super) fn reaches(&self, thickness_nm: f64) -> bool {
        let within = |[low, high]: [f64; 2]| (low..=high).contains(&thickness_nm);
        self.film_nm.is_none_or(within)
    }
}

/// Backscatter of electrons: range (um) and ratio to the direct dose, with their uncertainty.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Proximity {
    pub range_um: f64,
    pub range_limits_um: [f64; 2],
    pub ratio: f64,
    pub ratio_limits: [f64; 2],
    pub source: String,
}

/// The second step: openings in the metal.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ApertureStep {
    pub writer: String,
    pub tone: String,
    pub resist: String,
    pub metal: String,
    pub metal_thickness_nm: f64,
    pub overlay_nm: f64,
    pub max_references: i64,
}

/// Nine blocks of equal geometry and different dose.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DoseMatrixSpec {
    /// Doses as shares of that of the resist.
    pub factors: [f64; DOSES],
    /// Layer of the blocks; the datatype is the number of the dose, from one.
    pub layer: i16,
    pub lens_diameter_um: f64,
    pub pad_um: f64,
    pub pad_widths_nm: Vec<f64>,
    pub gap_um: f64,
}

/// Sizes of the test structures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TestSpec {
    pub pad_um: f64,
    pub pad_width_step_nm: f64,
    pub sparse_pitches: i64,
    pub cd_widths_nm: Vec<f64>,
    pub cd_length_um: f64,
    pub vernier_pitch_um: f64,
    pub vernier_step_nm: f64,
    pub overlay_vernier_pitch_um: f64,
    pub overlay_vernier_step_nm: f64,
    pub etch_pad_um: f64,
    pub film_witness_um: f64,
    /// Wavelength of the reference lens; where it is left out, the wavelength of the mapping of the design.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference_wavelength_nm: Option<f64>,
}

/// Places where widths are to be measured, and how well they should fit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MetrologySpec {
    pub sites_per_width: i64,
    /// Standard deviation of the width in this process (nm).
    pub width_tolerance_nm: f64,
}

/// The decks of rules that layouts for this process must keep: their files, or those of the program.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CheckSpec {
    /// Rules for designs of squares, of circles and of rectangles.
    #[serde(skip)]
    pub squares: Option<ShapeRules>,
    #[serde(skip)]
    pub circles: Option<ShapeRules>,
    #[serde(skip)]
    pub rectangles: Option<ShapeRules>,
    #[serde(skip)]
    pub aperture_rules: PathBuf,
    #[serde(skip)]
    pub test_opening_rules: PathBuf,
    /// Whether a lab has confirmed the limits of the decks; where it is left out, those that ship with the program are assumed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limits: Option<LimitOrigin>,
}

/// Origin of the limits of a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LimitOrigin {
    /// Guesses that no lab has confirmed: what exceeds them is reported and fails nothing.
    Assumed,
    Confirmed,
}

/// The decks of the first step for one shape of pillars.
#[derive(Clone, Debug, PartialEq)]
pub struct ShapeRules {
    pub pillar_rules: PathBuf,
    pub dose_rules: PathBuf,
    pub test_rules: PathBuf,
}

/// Files for the writer beside the layouts.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum JobSpec {
    /// Drafts of job deck and schedule.
    Jeol(JeolJob),
    /// Layouts whose datatype is the dose factor.
    Raith(RaithJob),
}

/// Marker of a writer that reads the dose factor from the datatype.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RaithJob {
    pub format: &'static str,
}

/// Values of the draft job that the staff must confirm.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JeolJob {
    pub substrate_inch: f64,
    pub cassette_slot: String,
    pub path: String,
    pub layer_step1: i64,
}

impl CheckSpec {
    /// The decks of the first step for pillars of a shape, if the process has them.
    pub fn of_shape(&self, shape: PillarShape) -> Option<&ShapeRules> {
        match shape.outline() {
            OutlineForm::Square => self.squares.as_ref(),
            OutlineForm::Circle => self.circles.as_ref(),
            OutlineForm::Polygon => self.rectangles.as_ref(),
            OutlineForm::Mixed => None,
        }
    }

    /// A shape that there are decks for.
    pub(super) fn some_shape(&self) -> PillarShape {
        match (&self.squares, &self.circles) {
            (None, Some(_)) => PillarShape::Circle,
            // Decks for rectangles do not depend on their size.
            (None, None) => {
                let smallest = UprightRectangles {
                    shortest_nm: 2,
                    step_nm: 2,
                    lengths: 1,
                };
                PillarShape::Rectangle(Rectangles::Upright(smallest))
            }
            _ => PillarShape::Square,
        }
    }

    /// The decks of rules for pillars of a shape, those of the first step first.
    pub(super) fn decks(&self, shape: PillarShape) -> Vec<&Path> {
        let of_shape = self.of_shape(shape).into_iter();
        of_shape
            .flat_map(|rules| [&rules.pillar_rules, &rules.dose_rules, &rules.test_rules])
            .chain([&self.aperture_rules, &self.test_opening_rules])
            .map(PathBuf::as_path)
            .collect()
    }
}

impl Process {
    /// Read the process file at `path`.
    ///
    /// # Errors
    /// [`metalith_core::Error::Text`] with every mistake, each with line, column and remedy.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(path, load(path)?)
    }

    /// The process that ships with the program, `processes/jbx6300_zep520a.toml`, with the decks that do.
    ///
    /// # Panics
    /// Never: it is tested.
    pub fn standard() -> Self {
        Self::shipped(SHIPPED.get_file(STANDARD).expect("it is one of them"))
    }

    /// The process that ships with the program and etches a film of a material, as designs name it: one for its thickness (nm)
    /// before others; the standard one where none does.
    pub fn of_film(film: &str, thickness_nm: f64) -> Self {
        let mut files: Vec<_> = SHIPPED.files().collect();
        files.sort_by_key(|file| file.path());
        let all = files.into_iter().map(Self::shipped);
        let mut fitting: Vec<Self> = all.filter(|process| process.transfer.etches(film)).collect();
        fitting.sort_by_key(|process| !process.transfer.reaches(thickness_nm));
        fitting.into_iter().next().unwrap_or_else(Self::standard)
    }

    /// This process with rules for pillars of a shape: a process of the program that has none uses the decks of what holds of
    /// every layout of such pillars. One of a lab stays as it is.
    #[must_use]
    pub(super) fn with_rules_for(mut self, shape: PillarShape) -> Self {
        if self.standard && self.checks.of_shape(shape).is_none() {
            let shapes = shape.plural();
            let deck = |kind: &str| PathBuf::from(format!("../rules/{kind}{shapes}.toml"));
            let rules = ShapeRules {
                pillar_rules: deck(""),
                dose_rules: deck("dose_"),
                test_rules: deck("test_"),
            };
            match shape.outline() {
                // Rules of the dose matrix and the tests of squares are of the paper's cell, and no deck is of mixed shapes.
                OutlineForm::Square | OutlineForm::Mixed => {}
                OutlineForm::Circle => self.checks.circles = Some(rules),
                OutlineForm::Polygon => self.checks.rectangles = Some(rules),
            }
        }
        self
    }

    /// True if no lab has confirmed the limits of a deck.
    pub(super) fn assumes(&self, deck: &Deck) -> bool {
        match self.checks.limits {
            Some(origin) => origin == LimitOrigin::Assumed,
            None => deck.is_shipped(),
        }
    }

    /// Words that name the process: its name, and where it is from.
    pub(super) fn words(&self) -> String {
        if self.standard {
            format!("process {} (shipped)", self.name)
        } else {
            let file = self.path.file_name().unwrap_or_default().to_string_lossy();
            format!("process {} in {}", self.name, printable(&file))
        }
    }

    fn shipped(file: &File<'_>) -> Self {
        let text = file.contents_utf8().expect("processes are text");
        let path = Path::new("processes").join(file.path());
        read::process(&path, text.to_owned(), true).expect("the processes of the program are sound")
    }

    /// Wavelength of the hyperbolic reference lens and of the small lenses of the dose matrix (nm).
    pub fn reference_wavelength_nm(&self, design: &Design) -> f64 {
        self.tests
            .reference_wavelength_nm
            .unwrap_or(design.mapping.wavelength_um * 1e3)
    }

    /// The keys of a process file.
    pub fn keys() -> KeyTable {
        read::keys()
    }

    pub(super) fn parse(path: &Path, text: String) -> Result<Self> {
        read::process(path, text, false)
    }

    /// Name and text of the file that it was read from.
    pub(super) fn source(&self) -> (&Path, &str) {
        (&self.path, &self.text)
    }

    /// A deck of [`CheckSpec`]; one of the program is on the grid of this database unit.
    ///
    /// # Errors
    /// With every mistake of the file.
    pub(super) fn deck(&self, rules: &Path, unit: DatabaseUnit) -> Result<Deck> {
        if self.standard {
            let deck = Deck::shipped(rules).expect("tested with the process of the program");
            Ok(deck.on_grid(unit))
        } else {
            Deck::read(rules)
        }
    }

    /// True if a shipped process etches a film.
    pub(super) fn any_etches(film: &str) -> bool {
        SHIPPED
            .files()
            .map(Self::shipped)
            .any(|process| process.transfer.etches(film))
    }

    /// Names of all shipped process files.
    pub(super) fn shipped_names() -> Vec<String> {
        let mut names: Vec<_> = SHIPPED
            .files()
            .map(|file| format!("processes/{}", file.path().display()))
            .collect();
        names.sort();
        names
    }

    /// The shipped process file to copy for a film that none is for: one with rules for pillars of this shape.
    pub(super) fn template(shape: PillarShape) -> &'static str {
        if shape.is_square() {
            "processes/jbx6300_zep520a.toml"
        } else {
            "processes/jbx6300_tio2.toml"
        }
    }

    /// Description of what remains on the chip where the first step exposes.
    pub fn exposed_becomes(&self) -> &'static str {
        match (self.resist.tone, self.transfer.method) {
            (Tone::Positive, Method::LiftOff) | (Tone::Negative, Method::DirectEtch) => {
                "what is exposed stays as a pillar"
            }
            _ => "what is exposed is etched away",
        }
    }

    /// True if the first step exposes the pillars; if not, the tone of the layout is wrong.
    pub fn exposes_pillars(&self) -> bool {
        self.exposed_becomes().ends_with("pillar")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_core::FaultKind;

    #[test]
    fn the_shipped_processes_are_read_and_expose_pillars() {
        let rectangles = metalith_pillars::RotatedRectangles {
            width_nm: 100,
            length_nm: 250,
            steps: 180,
        };
        let rectangles = PillarShape::Rectangle(rectangles.into());
        for process in SHIPPED.files().map(Process::shipped) {
            for shape in [PillarShape::Square, PillarShape::Circle, rectangles] {
                for rules in process.checks.decks(shape) {
                    // The same deck, built in and from its file.
                    let name = |deck: Deck| deck.name;
                    let file = Path::new(env!("CARGO_MANIFEST_DIR"))
                        .join("../../rules")
                        .join(rules.file_name().unwrap());
                    assert_eq!(
                        name(process.deck(rules, DatabaseUnit::Nanometre).unwrap()),
                        name(Deck::read(&file).unwrap())
                    );
                }
            }
            assert!(process.exposes_pillars());
            for film in &process.transfer.films {
                let thickness_nm = process.transfer.film_nm.map_or(600.0, |[low, high]| 0.5 * (low + high));
                assert_eq!(Process::of_film(film, thickness_nm), process);
            }
        }
        // None is for films so thin: one for the material, which says so.
        let thin = Process::of_film("a_si_pierce_1972", 10.0);
        assert_eq!(thin.name, "jbx6300_asi");
        assert_eq!(Process::of_film("no film that is known", 600.0), Process::standard());
        for shape in [PillarShape::Square, PillarShape::Circle, rectangles] {
            let file = Path::new(Process::template(shape)).file_name().unwrap();
            let template = Process::shipped(SHIPPED.get_file(file).unwrap());
            assert!(template.checks.of_shape(shape).is_some());
        }
        assert_eq!(Process::standard().resist.dose_uc_cm2, 280.0);
    }

    #[test]
    fn all_mistakes_are_reported_at_once_with_their_places() {
        let standard = SHIPPED.get_file(STANDARD).unwrap();
        let text = standard
            .contents_utf8()
            .unwrap()
            .replace("tone = \"positive\"", "tone = \"possitive\"")
            .replace("field_used_um = 499.8", "field_used_um = 600")
            .replace("dose_uc_cm2 = 280", "dose = 280");
        let error = Process::parse(Path::new("processes/p.toml"), text).unwrap_err();
        for (kind, key) in [
            (FaultKind::UnknownChoice, "resist.tone"),
            (FaultKind::Inconsistent, "writer.field_used_um"),
            (FaultKind::Missing, "resist.dose_uc_cm2"),
            (FaultKind::Unknown, "resist.dose"),
        ] {
            assert!(error.has_fault(kind, key), "{kind:?} {key}: {error}");
        }
    }
}
