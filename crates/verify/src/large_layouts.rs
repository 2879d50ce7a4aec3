//! Layouts that are too large for a simulation of the usual kind: simulated in parts, or compared pillar by pillar, with a sample of
//! zones simulated.

use std::path::Path;

use metalith_cell::Fidelity;
use metalith_core::{Progress, Result};
use metalith_design::array::{PillarArray, PlacedElement};
use metalith_design::{AskedLight, Design};
use metalith_gds::extract::{Extraction, StoredPillars, extract_folded};
use metalith_gds::{Layout, ReadLimits};
use metalith_layout::extraction_plan;
use metalith_pillars::PillarRows;
use metalith_wave::Accuracy;

use super::{
    ElementCheck, LayoutFacts, NotSimulated, PillarCheck, Sample, SampledZones, SimulationCases, Verification, check,
    compare, facts, judge,
};

/// Compare the pillars of an element as they are held: of one that is held as an eighth, and meant to have all eight
/// symmetries, each set of copies once.
fn compare_held(array: &PillarArray, placed: &PlacedElement, found: &StoredPillars) -> PillarCheck {
    match found {
        StoredPillars::Eighth(map) if array.classes[placed.class].group.members().len() == 8 => {
            PillarCheck::compare_eighth(array.rows(placed).as_ref(), map)
        }
        _ => PillarCheck::compare(array.all_rows(placed).as_ref(), found),
    }
}

/// Variant of [`verify`](super::verify) for elements of any size: a thread holds spectra of at most `part_bytes` at a
/// time, and elements that the file folds by all eight symmetries take an eighth of the memory of others. The figures
/// are the same to the last bit. Cells of lattices of equal pillars judge, in `cases`; a chip as fabricated, and
/// pillars among dissimilar neighbours, are for elements that are held in full.
///
/// # Errors
/// As [`verify`](super::verify).
pub fn verify_in_parts(
    design: &Design,
    array: &PillarArray,
    path: &Path,
    cases: &SimulationCases<'_>,
    accuracy: Accuracy,
    part_bytes: usize,
    progress: &dyn Progress,
) -> Result<Verification> {
    let (facts, elements, extraction) = read_folded(design, array, path, progress)?;
    let widths: Vec<&dyn PillarRows> = extraction.elements.iter().map(|e| &e.widths as _).collect();
    let found = super::Found {
        layout: facts,
        foreign: extraction.oddities.clone(),
        elements,
        widths,
    };
    judge(design, array, found, cases, accuracy, Some(part_bytes), progress)
}

/// A layout read back with its elements folded, and compared with its design.
fn read_folded(
    design: &Design,
    array: &PillarArray,
    path: &Path,
    progress: &dyn Progress,
) -> Result<(LayoutFacts, Vec<ElementCheck>, Extraction<StoredPillars>)> {
    let layout = Layout::open_with(path, ReadLimits::default(), progress)?;
    let extraction = extract_folded(&layout, &extraction_plan(design), progress)?;
    let elements = compare(array, &extraction, |placed, found| compare_held(array, placed, found));
    Ok((facts(&layout, &extraction, layout.path()), elements, extraction))
}

/// Read the layout at `path` back, compare every pillar with the design, and simulate a sample of zones of each distinct element, since
/// the whole is too large, for the reason `why`: the limits of the design on what the sample does not tell do not hold. Elements
/// that the file folds by all eight symmetries take an eighth of the memory of others. Without `cases`, or if widths were moved on
/// purpose, nothing is sampled: pillars as fabricated differ by their place on the chip.
///
/// # Errors
/// If the layout cannot be read, an element is too large to be held, a cell has no answer at a wavelength, or the user stopped it.
pub fn verify_sampled(
    design: &Design,
    array: &PillarArray,
    path: &Path,
    (fidelity, cases): (Fidelity, Option<&SimulationCases<'_>>),
    why: String,
    progress: &dyn Progress,
) -> Result<Verification> {
    let (facts, mut elements, extraction) = read_folded(design, array, path, progress)?;
    let sample = match cases.filter(|_| !array.compensated) {
        Some(cases) if extraction.pillars > 0 => {
            let widths: Vec<&dyn PillarRows> = extraction.elements.iter().map(|e| &e.widths as _).collect();
            Sample::Sampled(SampledZones::of(
                design,
                array,
                &mut elements,
                &widths,
                cases,
                progress,
            )?)
        }
        Some(_) => Sample::NotSampled("no pillar was read".into()),
        None => Sample::NotSampled("a chip as fabricated is simulated with all of its pillars in memory".into()),
    };
    let mut verification = Verification {
        design: design.name.clone(),
        design_digest: design.digest(),
        warnings: design.warnings()?,
        fidelity,
        model: None,
        compensated: array.compensated,
        accuracy: "none",
        camera: None,
        layout: facts,
        elements,
        foreign: extraction.oddities,
        distinct: Vec::new(),
        mapping: design.mapping.solved.clone(),
        rotations: None,
        lattice_orders: design.lattice_orders(AskedLight::All)?,
        not_simulated: Some(NotSimulated { why, sample }),
        checks: Vec::new(),
    };
    verification.checks = check::all(&design.verify.limits, &verification);
    Ok(verification)
}
