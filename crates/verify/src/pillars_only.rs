//! Layouts that are too large to be simulated: every pillar is compared all the same.

use std::path::Path;

use metalith_cell::Fidelity;
use metalith_core::{Progress, Result};
use metalith_design::array::PillarArray;
use metalith_design::{Design, Element};
use metalith_gds::extract::{Holding, extract_folded};
use metalith_gds::{Layout, ReadLimits};

use super::{Verification, check, compare, facts, plan, sites};

/// Bytes of each site of every element: its width as read.
const READ_BYTES: f64 = 2.0;
/// Bytes of each site of the elements that are not copies: its width as designed.
const DESIGNED_BYTES: f64 = 2.0;
/// Bytes of each site of the element that is being simulated: its width, and single-precision fields of the propagation
/// on all threads. From the peaks of 3 x 3 and 5 x 5 lenses of 1 mm, 438 and 851 MB.
const SIMULATED_BYTES: f64 = 36.0;
/// What a run takes whatever its size (MB).
const BASE_MB: f64 = 60.0;

/// Memory that reading a layout of a design back and simulating it takes, about (MB); the elements are taken to be held
/// in full. No element of a design is taken for a copy of more than one in four others.
pub fn simulation_mb(design: &Design) -> f64 {
    let sites = (design.lattice().sites() as f64).powi(2);
    let elements = design.elements().len() as f64;
    let distinct = 1.0 + (elements - 1.0) / 4.0;
    BASE_MB + 1e-6 * sites * (READ_BYTES * elements + DESIGNED_BYTES * distinct + SIMULATED_BYTES)
}

/// Whether every pillar of a layout of this design, at `path`, can be compared, if it is folded: asked before work is
/// spent on one that cannot.
///
/// # Errors
/// If the elements have more lattice sites together than are held at a time, of those that are not steered an eighth.
pub fn fits_folded(design: &Design, path: &Path) -> Result<()> {
    let held = |element: &Element| match (element.wedge.sin_x, element.wedge.sin_y) {
        (0.0, 0.0) => Holding::Eighth,
        _ => Holding::Whole,
    };
    let holdings: Vec<Holding> = design.elements().iter().map(held).collect();
    Ok(metalith_gds::extract::fits_as(path, &sites(design), &holdings)?)
}

/// Read the layout at `path` back and compare every pillar with the design, without simulating any: the limits of the
/// design on what only a simulation tells do not hold. Elements that the file folds by all eight symmetries take an
/// eighth of the memory of others.
///
/// # Errors
/// If the layout cannot be read, an element is too large to be held, or the user stopped it.
pub fn verify_pillars(
    design: &Design,
    array: &PillarArray,
    path: &Path,
    fidelity: Fidelity,
    why: String,
    progress: &dyn Progress,
) -> Result<Verification> {
    let layout = Layout::open_with(path, ReadLimits::default(), progress)?;
    let extraction = extract_folded(&layout, &plan(design, array), progress)?;
    let mut verification = Verification {
        design: design.name.clone(),
        design_digest: design.digest(),
        fidelity,
        model: None,
        compensated: array.compensated,
        accuracy: "none",
        camera: None,
        layout: facts(&layout, &extraction, layout.path()),
        elements: compare(array, &extraction),
        foreign: extraction.oddities,
        distinct: Vec::new(),
        not_simulated: Some(why),
        checks: Vec::new(),
    };
    verification.checks = check::all(&design.verify.limits, &verification);
    Ok(verification)
}
