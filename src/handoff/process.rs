//! The process file: everything about a lab that a hand-off needs and a design does not know.

use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::document::{Document, Limits, Section, load};
use crate::error::Result;

/// Version of the format of process files that this program reads.
const SCHEMA: i64 = 1;
/// Doses of a matrix: three by three blocks.
pub(super) const DOSES: usize = 9;

/// One lab's way to make the chip.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Process {
    pub name: String,
    /// One line for people.
    pub title: String,
    pub writer: Writer,
    pub resist: Resist,
    pub transfer: Transfer,
    pub proximity: Proximity,
    pub apertures: ApertureStep,
    pub dose_matrix: DoseMatrixSpec,
    pub tests: TestSpec,
    pub metrology: MetrologySpec,
    pub checks: CheckSpec,
    pub job: JobSpec,
}

/// The electron-beam writer of the first step.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Writer {
    pub name: String,
    pub acceleration_kv: f64,
    /// Name of the lens mode.
    pub mode: String,
    /// Largest edge of a write field [um].
    pub field_um: f64,
    /// Edge of a write field as used [um], so that its border runs between pillars.
    pub field_used_um: f64,
    /// Grid that figures are placed on [nm].
    pub grid_nm: f64,
    /// Fastest shot rate [MHz].
    pub clock_max_mhz: f64,
    /// Beam currents to choose from [nA].
    pub currents_na: Vec<f64>,
    /// Error between neighbouring fields, in use [nm].
    pub stitching_nm: f64,
    /// Time lost at each figure [us], at each field [s], and once [s].
    pub shape_overhead_us: f64,
    pub field_overhead_s: f64,
    pub job_overhead_s: f64,
}

/// Whether the exposed resist goes or stays.
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
    /// Charge an area [uC/cm2], and the range that labs report.
    pub dose_uc_cm2: f64,
    pub dose_range_uc_cm2: [f64; 2],
}

/// How the pattern gets from resist to film.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Mask material stays where the resist was opened.
    LiftOff,
    /// The film goes where the resist was opened.
    DirectEtch,
}

/// What becomes of what was exposed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Transfer {
    pub method: Method,
    pub mask: String,
    pub mask_thickness_nm: f64,
    pub etch: String,
}

/// Backscatter of electrons: range [um] and ratio to the direct dose, with limits on what is not known.
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
    pub reference_wavelength_nm: f64,
}

/// Where widths are to be measured, and how well they should fit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MetrologySpec {
    pub sites_per_width: i64,
    /// One standard deviation of the width that this process holds [nm].
    pub width_tolerance_nm: f64,
}

/// The decks of rules that layouts for this process must keep.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CheckSpec {
    #[serde(skip)]
    pub pillar_rules: PathBuf,
    #[serde(skip)]
    pub aperture_rules: PathBuf,
}

/// What the draft of the job says and staff must confirm.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JobSpec {
    pub substrate_inch: f64,
    pub cassette_slot: String,
    pub path: String,
    pub layer_step1: i64,
}

impl Process {
    /// Read the process file at `path`.
    ///
    /// # Errors
    /// [`crate::Error::Text`] with every mistake, each with line, column and remedy.
    pub fn read(path: &Path) -> Result<Self> {
        let text = load(path)?;
        Self::parse(path, &text)
    }

    pub(super) fn parse(path: &Path, text: &str) -> Result<Self> {
        Document::read(path, text, |root| {
            root.integer("schema", SCHEMA..=SCHEMA, "");
            let name = root.text("name");
            Self {
                title: root.optional_text("title").unwrap_or_else(|| name.clone()),
                name,
                writer: Writer::read(&root.section("writer")),
                resist: Resist::read(&root.section("resist")),
                transfer: Transfer::read(&root.section("transfer")),
                proximity: Proximity::read(&root.section("proximity")),
                apertures: ApertureStep::read(&root.section("apertures")),
                dose_matrix: DoseMatrixSpec::read(&root.section("dose_matrix")),
                tests: TestSpec::read(&root.section("tests")),
                metrology: MetrologySpec::read(&root.section("metrology")),
                checks: CheckSpec::read(&root.section("checks")),
                job: JobSpec::read(&root.section("job")),
            }
        })
    }

    /// What stays on the chip where the first step exposes, in words.
    pub fn exposed_becomes(&self) -> &'static str {
        match (self.resist.tone, self.transfer.method) {
            (Tone::Positive, Method::LiftOff) | (Tone::Negative, Method::DirectEtch) => {
                "what is exposed stays as a pillar"
            }
            _ => "what is exposed is etched away",
        }
    }

    /// Whether pillars are what the first step exposes; else the tone of the layout is the wrong one.
    pub fn exposes_pillars(&self) -> bool {
        self.exposed_becomes().ends_with("pillar")
    }
}

fn within(s: &Section<'_, '_>, key: &str, low: f64, high: f64, unit: &'static str) -> f64 {
    s.float(key, Limits::new(low..=high, unit))
}

/// A list that must not be empty.
fn some(s: &Section<'_, '_>, key: &str, low: f64, high: f64, unit: &'static str) -> Vec<f64> {
    let list = s.floats(key, Limits::new(low..=high, unit));
    if list.is_empty() {
        s.fault(
            key,
            "the list is missing or empty",
            format!("list at least one value in {unit}"),
        );
    }
    list
}

/// Two numbers, the smaller first.
fn range(s: &Section<'_, '_>, key: &str, low: f64, high: f64, unit: &'static str) -> [f64; 2] {
    let pair = s.array::<2>(key, Limits::new(low..=high, unit));
    if pair[0] > pair[1] {
        s.fault(key, "the range ends before it begins", "write the smaller number first");
    }
    pair
}

impl Writer {
    fn read(s: &Section<'_, '_>) -> Self {
        let field_um = within(s, "field_um", 1.0, 10_000.0, "um");
        let writer = Self {
            name: s.text("name"),
            acceleration_kv: within(s, "acceleration_kv", 1.0, 300.0, "kV"),
            mode: s.text("mode"),
            field_um,
            field_used_um: within(s, "field_used_um", 1.0, 10_000.0, "um"),
            grid_nm: within(s, "grid_nm", 0.01, 100.0, "nm"),
            clock_max_mhz: within(s, "clock_max_mhz", 0.001, 1000.0, "MHz"),
            currents_na: some(s, "currents_na", 0.001, 10_000.0, "nA"),
            stitching_nm: within(s, "stitching_nm", 0.0, 10_000.0, "nm"),
            shape_overhead_us: within(s, "shape_overhead_us", 0.0, 1e6, "us"),
            field_overhead_s: within(s, "field_overhead_s", 0.0, 1e4, "s"),
            job_overhead_s: within(s, "job_overhead_s", 0.0, 1e6, "s"),
        };
        if s.has("field_used_um") && writer.field_used_um > field_um {
            s.fault(
                "field_used_um",
                "the field in use is larger than the field of the writer",
                format!("use at most {field_um} um"),
            );
        }
        s.finish();
        writer
    }
}

impl Resist {
    fn read(s: &Section<'_, '_>) -> Self {
        let tones = [("positive", Tone::Positive), ("negative", Tone::Negative)];
        let resist = Self {
            name: s.text("name"),
            tone: s.choice("tone", &tones, None),
            thickness_nm: within(s, "thickness_nm", 1.0, 100_000.0, "nm"),
            developer: s.text("developer"),
            dose_uc_cm2: within(s, "dose_uc_cm2", 0.1, 1e6, "uC/cm2"),
            dose_range_uc_cm2: range(s, "dose_range_uc_cm2", 0.1, 1e6, "uC/cm2"),
        };
        s.finish();
        resist
    }
}

impl Transfer {
    fn read(s: &Section<'_, '_>) -> Self {
        let methods = [("lift_off", Method::LiftOff), ("direct_etch", Method::DirectEtch)];
        let transfer = Self {
            method: s.choice("method", &methods, None),
            mask: s.text("mask"),
            mask_thickness_nm: within(s, "mask_thickness_nm", 0.0, 10_000.0, "nm"),
            etch: s.text("etch"),
        };
        s.finish();
        transfer
    }
}

impl Proximity {
    fn read(s: &Section<'_, '_>) -> Self {
        let proximity = Self {
            range_um: within(s, "range_um", 0.01, 1000.0, "um"),
            range_limits_um: range(s, "range_limits_um", 0.01, 1000.0, "um"),
            ratio: within(s, "ratio", 0.0, 10.0, ""),
            ratio_limits: range(s, "ratio_limits", 0.0, 10.0, ""),
            source: s.text("source"),
        };
        s.finish();
        proximity
    }
}

impl ApertureStep {
    fn read(s: &Section<'_, '_>) -> Self {
        let step = Self {
            writer: s.text("writer"),
            tone: s.text("tone"),
            resist: s.text("resist"),
            metal: s.text("metal"),
            metal_thickness_nm: within(s, "metal_thickness_nm", 1.0, 100_000.0, "nm"),
            overlay_nm: within(s, "overlay_nm", 0.0, 100_000.0, "nm"),
            max_references: s.integer("max_references", 0..=i64::from(u32::MAX), "references"),
        };
        s.finish();
        step
    }
}

impl DoseMatrixSpec {
    fn read(s: &Section<'_, '_>) -> Self {
        let spec = Self {
            factors: s.array::<DOSES>("factors", Limits::new(0.05..=20.0, "of the dose")),
            layer: s.integer("layer", 0..=255, "") as i16,
            lens_diameter_um: within(s, "lens_diameter_um", 5.0, 200.0, "um"),
            pad_um: within(s, "pad_um", 5.0, 1000.0, "um"),
            pad_widths_nm: some(s, "pad_widths_nm", 10.0, 2000.0, "nm"),
            gap_um: within(s, "gap_um", 0.0, 10_000.0, "um"),
        };
        s.finish();
        spec
    }
}

impl TestSpec {
    fn read(s: &Section<'_, '_>) -> Self {
        let spec = Self {
            pad_um: within(
                s,
                "pad_um",
                100.0,
                1000.0,
                "um, of which the beam of an ellipsometer needs 100",
            ),
            pad_width_step_nm: within(s, "pad_width_step_nm", 2.0, 1000.0, "nm"),
            sparse_pitches: s.integer("sparse_pitches", 2..=100, "pitches"),
            cd_widths_nm: some(s, "cd_widths_nm", 10.0, 5000.0, "nm"),
            cd_length_um: within(s, "cd_length_um", 5.0, 1000.0, "um"),
            vernier_pitch_um: within(s, "vernier_pitch_um", 0.5, 100.0, "um"),
            vernier_step_nm: within(s, "vernier_step_nm", 1.0, 1000.0, "nm"),
            overlay_vernier_pitch_um: within(s, "overlay_vernier_pitch_um", 0.5, 100.0, "um"),
            overlay_vernier_step_nm: within(s, "overlay_vernier_step_nm", 1.0, 5000.0, "nm"),
            etch_pad_um: within(s, "etch_pad_um", 10.0, 2000.0, "um"),
            film_witness_um: within(s, "film_witness_um", 50.0, 5000.0, "um"),
            reference_wavelength_nm: within(s, "reference_wavelength_nm", 150.0, 20_000.0, "nm"),
        };
        s.finish();
        spec
    }
}

impl MetrologySpec {
    fn read(s: &Section<'_, '_>) -> Self {
        let spec = Self {
            sites_per_width: s.integer("sites_per_width", 1..=100, "sites"),
            width_tolerance_nm: within(s, "width_tolerance_nm", 0.1, 1000.0, "nm"),
        };
        s.finish();
        spec
    }
}

impl CheckSpec {
    fn read(s: &Section<'_, '_>) -> Self {
        let spec = Self {
            pillar_rules: s.file("pillar_rules"),
            aperture_rules: s.file("aperture_rules"),
        };
        s.finish();
        spec
    }
}

impl JobSpec {
    fn read(s: &Section<'_, '_>) -> Self {
        let spec = Self {
            substrate_inch: within(s, "substrate_inch", 0.1, 12.0, "inch"),
            cassette_slot: s.text("cassette_slot"),
            path: s.text("path"),
            layer_step1: s.integer("layer_step1", 1..=99, ""),
        };
        s.finish();
        spec
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHIPPED: &str = include_str!("../../processes/jbx6300_zep520a.toml");

    #[test]
    fn the_shipped_process_is_read_and_exposes_pillars() {
        let process = Process::parse(Path::new("processes/p.toml"), SHIPPED).unwrap();
        assert_eq!(process.resist.dose_uc_cm2, 280.0);
        assert!(process.exposes_pillars());
    }

    #[test]
    fn all_mistakes_are_told_at_once_with_their_places() {
        let text = SHIPPED
            .replace("tone = \"positive\"", "tone = \"possitive\"")
            .replace("field_used_um = 499.8", "field_used_um = 600")
            .replace("dose_uc_cm2 = 280", "dose = 280");
        let error = Process::parse(Path::new("processes/p.toml"), &text)
            .unwrap_err()
            .to_string();
        for said in [
            "possitive",
            "larger than the field",
            "dose_uc_cm2",
            "unknown key `dose`",
        ] {
            assert!(error.contains(said), "{said} not in {error}");
        }
    }
}
