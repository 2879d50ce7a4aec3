//! Reading a process file: one function for each of its tables.

use std::path::{Path, PathBuf};

use super::{
    ApertureStep, CheckSpec, DOSES, DoseMatrixSpec, JeolJob, JobSpec, LimitOrigin, Method, MetrologySpec,
    PatternTransfer, Process, Proximity, RaithJob, Resist, ShapeRules, TestSpec, Tone, Writer,
};
use metalith_core::Result;
use metalith_core::document::{Document, KeyTable, Limits, Section, explore};

/// Version of the format of process files that this program reads.
const SCHEMA: i64 = 1;

/// Read a process; the decks of the program's own need no files.
pub(super) fn process(path: &Path, text: String, standard: bool) -> Result<Process> {
    let process = Document::read(path, &text, |root| sections(root, path, standard))?;
    Ok(Process { text, ..process })
}

/// The keys of a process file.
pub(super) fn keys() -> KeyTable {
    explore(&[], |root, path| sections(root, path, false))
}

fn sections(root: &Section<'_, '_>, path: &Path, standard: bool) -> Process {
    root.integer("schema", SCHEMA..=SCHEMA, "");
    let name = root.text("name");
    Process {
        title: root.optional_text("title").unwrap_or_else(|| name.clone()),
        name,
        writer: table(root, "writer", writer),
        resist: table(root, "resist", resist),
        transfer: table(root, "transfer", transfer),
        proximity: table(root, "proximity", proximity),
        apertures: table(root, "apertures", apertures),
        dose_matrix: table(root, "dose_matrix", dose_matrix),
        tests: table(root, "tests", tests),
        metrology: table(root, "metrology", metrology),
        checks: table(root, "checks", |s| checks(s, standard)),
        job: table(root, "job", job),
        path: path.to_owned(),
        text: String::new(),
        standard,
    }
}

/// One table of the file; keys that `read` does not ask for are mistakes.
fn table<T>(root: &Section<'_, '_>, key: &str, read: impl FnOnce(&Section<'_, '_>) -> T) -> T {
    let section = root.section(key);
    let value = read(&section);
    section.finish();
    value
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

/// Names of materials; at least one.
fn films(s: &Section<'_, '_>) -> Vec<String> {
    let films = s.texts("films");
    if films.is_empty() {
        s.fault(
            "films",
            "the list is missing or empty",
            "list the materials that the etch is for, as designs name them in `pillar_material`",
        );
    }
    films
}

/// Two numbers, the smaller first.
fn range(s: &Section<'_, '_>, key: &str, low: f64, high: f64, unit: &'static str) -> [f64; 2] {
    let pair = s.array::<2>(key, Limits::new(low..=high, unit));
    if pair[0] > pair[1] {
        s.fault(key, "the range ends before it begins", "write the smaller number first");
    }
    pair
}

fn writer(s: &Section<'_, '_>) -> Writer {
    let field_um = within(s, "field_um", 1.0, 10_000.0, "um");
    let field_used_um = within(s, "field_used_um", 1.0, 10_000.0, "um");
    if s.has("field_used_um") && field_used_um > field_um {
        s.fault(
            "field_used_um",
            "the field in use is larger than the field of the writer",
            format!("use at most {field_um} um"),
        );
    }
    Writer {
        name: s.text("name"),
        acceleration_kv: within(s, "acceleration_kv", 1.0, 300.0, "kV"),
        mode: s.text("mode"),
        field_um,
        field_used_um,
        grid_nm: within(s, "grid_nm", 0.01, 100.0, "nm"),
        clock_max_mhz: within(s, "clock_max_mhz", 0.001, 1000.0, "MHz"),
        currents_na: some(s, "currents_na", 0.001, 10_000.0, "nA"),
        stitching_nm: within(s, "stitching_nm", 0.0, 10_000.0, "nm"),
        shape_overhead_us: within(s, "shape_overhead_us", 0.0, 1e6, "us"),
        field_overhead_s: within(s, "field_overhead_s", 0.0, 1e4, "s"),
        job_overhead_s: within(s, "job_overhead_s", 0.0, 1e6, "s"),
    }
}

fn resist(s: &Section<'_, '_>) -> Resist {
    let tones = [("positive", Tone::Positive), ("negative", Tone::Negative)];
    Resist {
        name: s.text("name"),
        tone: s.choice("tone", &tones, None),
        thickness_nm: within(s, "thickness_nm", 1.0, 100_000.0, "nm"),
        developer: s.text("developer"),
        dose_uc_cm2: within(s, "dose_uc_cm2", 0.1, 1e6, "uC/cm2"),
        dose_range_uc_cm2: range(s, "dose_range_uc_cm2", 0.1, 1e6, "uC/cm2"),
    }
}

fn transfer(s: &Section<'_, '_>) -> PatternTransfer {
    let methods = [("lift_off", Method::LiftOff), ("direct_etch", Method::DirectEtch)];
    PatternTransfer {
        method: s.choice("method", &methods, None),
        mask: s.text("mask"),
        mask_thickness_nm: within(s, "mask_thickness_nm", 0.0, 10_000.0, "nm"),
        etch: s.text("etch"),
        films: films(s),
        film_nm: s.has("film_nm").then(|| range(s, "film_nm", 1.0, 1e6, "nm")),
    }
}

fn proximity(s: &Section<'_, '_>) -> Proximity {
    Proximity {
        range_um: within(s, "range_um", 0.01, 1000.0, "um"),
        range_limits_um: range(s, "range_limits_um", 0.01, 1000.0, "um"),
        ratio: within(s, "ratio", 0.0, 10.0, ""),
        ratio_limits: range(s, "ratio_limits", 0.0, 10.0, ""),
        source: s.text("source"),
    }
}

fn apertures(s: &Section<'_, '_>) -> ApertureStep {
    ApertureStep {
        writer: s.text("writer"),
        tone: s.text("tone"),
        resist: s.text("resist"),
        metal: s.text("metal"),
        metal_thickness_nm: within(s, "metal_thickness_nm", 1.0, 100_000.0, "nm"),
        overlay_nm: within(s, "overlay_nm", 0.0, 100_000.0, "nm"),
        max_references: s.integer("max_references", 0..=i64::from(u32::MAX), "references"),
    }
}

fn dose_matrix(s: &Section<'_, '_>) -> DoseMatrixSpec {
    DoseMatrixSpec {
        factors: s.array::<DOSES>("factors", Limits::new(0.05..=20.0, "of the dose")),
        layer: s.integer("layer", 0..=255, "") as i16,
        lens_diameter_um: within(s, "lens_diameter_um", 5.0, 200.0, "um"),
        pad_um: within(s, "pad_um", 5.0, 1000.0, "um"),
        pad_widths_nm: some(s, "pad_widths_nm", 10.0, 20_000.0, "nm"),
        gap_um: within(s, "gap_um", 0.0, 10_000.0, "um"),
    }
}

fn tests(s: &Section<'_, '_>) -> TestSpec {
    let pad_unit = "um, of which the beam of an ellipsometer needs 100";
    TestSpec {
        pad_um: within(s, "pad_um", 100.0, 1000.0, pad_unit),
        pad_width_step_nm: within(s, "pad_width_step_nm", 2.0, 1000.0, "nm"),
        sparse_pitches: s.integer("sparse_pitches", 2..=100, "pitches"),
        cd_widths_nm: some(s, "cd_widths_nm", 10.0, 20_000.0, "nm"),
        cd_length_um: within(s, "cd_length_um", 5.0, 1000.0, "um"),
        vernier_pitch_um: within(s, "vernier_pitch_um", 0.5, 100.0, "um"),
        vernier_step_nm: within(s, "vernier_step_nm", 1.0, 1000.0, "nm"),
        overlay_vernier_pitch_um: within(s, "overlay_vernier_pitch_um", 0.5, 100.0, "um"),
        overlay_vernier_step_nm: within(s, "overlay_vernier_step_nm", 1.0, 5000.0, "nm"),
        etch_pad_um: within(s, "etch_pad_um", 10.0, 2000.0, "um"),
        film_witness_um: within(s, "film_witness_um", 50.0, 5000.0, "um"),
        reference_wavelength_nm: s.optional_float("reference_wavelength_nm", Limits::new(150.0..=20_000.0, "nm")),
    }
}

fn metrology(s: &Section<'_, '_>) -> MetrologySpec {
    MetrologySpec {
        sites_per_width: s.integer("sites_per_width", 1..=100, "sites"),
        width_tolerance_nm: within(s, "width_tolerance_nm", 0.1, 1000.0, "nm"),
    }
}

/// The decks: those for squares in the section itself, those for other shapes in separate sections.
fn checks(s: &Section<'_, '_>, standard: bool) -> CheckSpec {
    let file = |s: &Section<'_, '_>, key: &str| {
        if standard {
            PathBuf::from(s.text(key))
        } else {
            s.file(key)
        }
    };
    let rules = |s: &Section<'_, '_>| ShapeRules {
        pillar_rules: file(s, "pillar_rules"),
        dose_rules: file(s, "dose_rules"),
        test_rules: file(s, "test_rules"),
    };
    let of_shape = |key: &str| {
        let section = s.optional_section(key)?;
        let rules = rules(&section);
        section.finish();
        Some(rules)
    };
    let (circles, rectangles) = (of_shape("circles"), of_shape("rectangles"));
    // Who has decks for another shape alone makes no squares.
    let some = ["pillar_rules", "dose_rules", "test_rules"]
        .iter()
        .any(|key| s.has(key));
    let squares = (some || (circles.is_none() && rectangles.is_none())).then(|| rules(s));
    CheckSpec {
        squares,
        circles,
        rectangles,
        aperture_rules: file(s, "aperture_rules"),
        test_opening_rules: file(s, "test_opening_rules"),
        limits: s.has("limits").then(|| {
            let origins = [("assumed", LimitOrigin::Assumed), ("confirmed", LimitOrigin::Confirmed)];
            s.choice("limits", &origins, None)
        }),
    }
}

fn job(s: &Section<'_, '_>) -> JobSpec {
    if s.choice("format", &[("jeol", false), ("raith", true)], Some(false)) {
        return JobSpec::Raith(RaithJob { format: "raith" });
    }
    JobSpec::Jeol(JeolJob {
        substrate_inch: within(s, "substrate_inch", 0.1, 12.0, "inch"),
        cassette_slot: s.text("cassette_slot"),
        path: s.text("path"),
        layer_step1: s.integer("layer_step1", 1..=99, ""),
    })
}
