//! Verification of a layout, from its bytes to a verdict: the file is read back, compared with the design, and
//! simulated.

mod assumptions;
mod birefringence;
mod case;
mod check;
pub mod compensate;
mod distinct_elements;
mod large_layouts;
mod lens_figures;
mod lens_outline;
mod media;
mod memory;
mod model_page;
mod netcdf;
mod optics;
mod page;
mod phase;
mod polychromatic;
mod polychromatic_channels;
mod polychromatic_page;
mod psf_metrics;
mod rotations;
mod sampled_zones;
mod single;
mod single_memory;
mod single_stack;
mod single_white;
mod site_orders;
mod steep_phase_errors;
mod through_focus;

use std::path::Path;

use serde::Serialize;

use metalith_cell::{Fidelity, SolvedMapping};
use metalith_core::text::printable;
use metalith_core::{Progress, Result, Steps, Warning};
use metalith_design::array::{PillarArray, PillarRule, PlacedElement, Symmetry};
use metalith_design::phase::{ElementPhase, LensPhase};
use metalith_design::{AskedLight, Design, Element, FieldAngle, LatticeOrders};
use metalith_gds::extract::{ExtractedElement, Extraction, Survey, UnrecognisedShapes, extract};
use metalith_gds::{self, Layout};
use metalith_layout::extraction_plan;
use metalith_optics::ModelStatement;
use metalith_pillars::PillarRows;
use metalith_wave::Accuracy;
use metalith_wave::propagation::Steepness;
use metalith_wave::psf::ThroughFocus;

pub use case::SimulationCases;
pub use check::{Check, Sense, verdict_words};
pub use distinct_elements::CopyAngle;
pub use large_layouts::{verify_in_parts, verify_sampled};
pub use lens_figures::{focus_words, lens_figures, plane_words};
pub use lens_outline::outline_warnings;
pub use memory::Simulation;
pub use metalith_optics::SimulationCase;
pub use metalith_pillars::PillarCheck;
pub use optics::open_matched;
pub use page::write_report;
pub use phase::{PhaseError, PhaseErrors, PillarResponse, SitePhase};
pub use polychromatic::CameraStatement;
pub use polychromatic_channels::{Contrast, WhiteChannel};
pub use psf_metrics::{OrderEfficiencies, PsfImages, PsfPair, PsfResult};
pub use rotations::EqualRotations;
pub use sampled_zones::{Estimate, NotSimulated, Sample, SampledElement, SampledSpot, SampledStrehl, SampledZones};
pub use single::{Lighting, STREHL_AGAINST, SinglePsf, SinglePsfReport, single_psfs, write_single_psf_report};
pub use single_memory::FocusRequest;
pub use single_white::{SingleWhite, single_white, white_sampling};
pub use through_focus::focal_length_words;

/// Facts of the file, in numbers.
#[derive(Clone, Debug, Serialize)]
pub struct LayoutFacts {
    pub file: String,
    pub bytes: u64,
    pub top_cell: String,
    pub cells: usize,
    pub depth: u32,
    /// Shapes with all references followed.
    pub shapes: u64,
    pub pillars: u64,
    pub survey: Survey,
}

/// The pillars of one element of the array.
#[derive(Clone, Debug, Serialize)]
pub struct ElementCheck {
    pub element: Element,
    pub widths: PillarCheck,
    /// Index into [`Verification::distinct`], or into the elements of a sample, of the element that it is simulated as, itself or one
    /// that it is a copy of, if it is as intended.
    pub copy_of: Option<usize>,
    /// Symmetry that turns that element into this one: pillars, field angles, and the places where light lands.
    pub turned: Option<Symmetry>,
}

/// One element that differs from all before it by more than a symmetry, simulated.
#[derive(Clone, Debug, Serialize)]
pub struct DistinctElement {
    pub element: Element,
    /// Number of elements that it stands for.
    pub copies: usize,
    pub phase: PhaseErrors,
    /// Places where the design phase is too steep for the lattice.
    pub steepness: Steepness,
    /// Orders that the mapping sends light into by its own transmission, one entry a wavelength.
    pub orders: Vec<OrderEfficiencies>,
    /// One entry for each wavelength and field angle of the design; then for each wavelength those that are asked of copies
    /// and come from other sides than these.
    pub spots: Vec<PsfPair>,
    /// Planes along z in the middle of the field, one entry for each wavelength of the design; of the central element alone.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub through_focus: Vec<ThroughFocus>,
    /// A point of the scene in white light, one entry for each channel of the camera.
    pub white: Vec<WhiteChannel>,
    /// Number of pillars of each width that were read back; index is the width (nm), the first entry counts empty sites.
    #[serde(skip)]
    pub histogram: Vec<u64>,
}

/// All that was found about a layout.
#[derive(Clone, Debug, Serialize)]
pub struct Verification {
    pub design: String,
    pub design_digest: String,
    /// Warnings on the design.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<Warning>,
    /// The cell that the layout is judged by.
    pub fidelity: Fidelity,
    /// The calibrated model that the layout is judged by, if it is judged as made.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<ModelStatement>,
    /// True if the layout is compared with an array whose widths were moved on purpose.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub compensated: bool,
    /// `accurate` or `fast`.
    pub accuracy: &'static str,
    /// The camera and the light that the figures of white light are for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera: Option<CameraStatement>,
    pub layout: LayoutFacts,
    pub elements: Vec<ElementCheck>,
    pub foreign: UnrecognisedShapes,
    pub distinct: Vec<DistinctElement>,
    /// Mapping of the design, where it was solved from the cell or made from a table of unit cells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mapping: Option<SolvedMapping>,
    /// Error of the lattice of a design of rotated rectangles against the phase that is asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotations: Option<EqualRotations>,
    /// Light of the design of which the lattice of the pillars sends some into oblique orders.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lattice_orders: Vec<LatticeOrders>,
    /// Reason why there is no full simulation, and the sample of zones in its place; none if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub not_simulated: Option<NotSimulated>,
    /// Every limit of the design, held or not.
    pub checks: Vec<Check>,
}

impl Verification {
    /// True if all limits hold.
    pub fn passed(&self) -> bool {
        self.checks.iter().all(Check::passed)
    }

    /// The sample of zones, if that is what was simulated.
    pub fn sampled(&self) -> Option<&SampledZones> {
        match &self.not_simulated.as_ref()?.sample {
            Sample::Sampled(zones) => Some(zones),
            Sample::NotSampled(_) => None,
        }
    }

    /// The element whose simulation or sample stands for an element; none of one that is not as intended.
    fn simulated_as(&self, check: &ElementCheck) -> Option<Element> {
        let k = check.copy_of?;
        match &self.not_simulated {
            None => Some(self.distinct.get(k)?.element),
            Some(_) => Some(self.sampled()?.elements.get(k)?.element),
        }
    }

    /// The field angles of the design that a spot of distinct element `k` is for, those of its copies among them: from where these
    /// are asked, the light of the spot is turned.
    pub fn asked(&self, k: usize, spot: &PsfPair) -> Vec<FieldAngle> {
        let of_design = self.distinct[k].spots.iter().filter(|s| s.copy.is_none());
        let of_design: Vec<FieldAngle> = of_design.map(|s| s.field).collect();
        let mut asked = vec![spot.asked()];
        for copy in self.elements.iter().filter(|e| e.copy_of == Some(k)) {
            let field = copy
                .turned
                .map(|symmetry| distinct_elements::turned(symmetry, spot.field));
            asked.extend(field.filter(|f| of_design.contains(f) && !asked.contains(f)));
        }
        asked
    }
}

/// Checks that a layout of this design, at `path`, can be simulated, before work is spent on one that cannot.
///
/// # Errors
/// If the elements have more lattice sites together than are held at a time, or the camera of the design cannot be
/// used.
pub fn fits(design: &Design, path: &Path) -> Result<()> {
    metalith_gds::extract::fits(path, &design.sites())?;
    polychromatic::camera_of(design)?;
    Ok(())
}

/// Read the layout at `path` back and hold it to its design.
///
/// # Errors
/// If the layout cannot be read, a cell has no answer at a wavelength, or the user stopped it.
pub fn verify(
    design: &Design,
    array: &PillarArray,
    path: &Path,
    cases: &SimulationCases<'_>,
    accuracy: Accuracy,
    progress: &dyn Progress,
) -> Result<Verification> {
    fits(design, path)?;
    let layout = Layout::open_with(path, metalith_gds::ReadLimits::default(), progress)?;
    verify_layout(design, array, &layout, cases, accuracy, progress)
}

/// Variant of [`verify`] for a layout that is open.
///
/// # Errors
/// As [`verify`].
pub fn verify_layout(
    design: &Design,
    array: &PillarArray,
    layout: &Layout,
    cases: &SimulationCases<'_>,
    accuracy: Accuracy,
    progress: &dyn Progress,
) -> Result<Verification> {
    ReadLayout::of(design, array, layout, progress)?.judge(design, array, cases, accuracy, progress)
}

/// A layout that was read back and compared with its design, to be judged as often as one likes.
pub struct ReadLayout {
    facts: LayoutFacts,
    elements: Vec<ElementCheck>,
    extraction: Extraction,
}

impl ReadLayout {
    /// Read an open layout back and compare it with its design.
    ///
    /// # Errors
    /// If it is too large to be held, cannot be read, or the user stopped it.
    pub fn of(design: &Design, array: &PillarArray, layout: &Layout, progress: &dyn Progress) -> Result<Self> {
        fits(design, layout.path())?;
        let extraction = extract(layout, &extraction_plan(design), progress)?;
        Ok(Self {
            facts: facts(layout, &extraction, layout.path()),
            elements: compare(array, &extraction, |placed, found| {
                PillarCheck::compare(array.rows(placed).as_ref(), found)
            }),
            extraction,
        })
    }

    /// The pillars that were read.
    pub fn extraction(&self) -> &Extraction {
        &self.extraction
    }

    /// Simulate it and hold it to the limits of its design.
    ///
    /// # Errors
    /// If a cell has no answer at a wavelength, or the user stopped it.
    pub fn judge(
        &self,
        design: &Design,
        array: &PillarArray,
        cases: &SimulationCases<'_>,
        accuracy: Accuracy,
        progress: &dyn Progress,
    ) -> Result<Verification> {
        let found = Found {
            layout: self.facts.clone(),
            elements: self.elements.clone(),
            widths: self.extraction.elements.iter().map(|e| &e.widths as _).collect(),
            foreign: self.extraction.oddities.clone(),
        };
        judge(design, array, found, cases, accuracy, None, progress)
    }
}

/// The files that a camera is read from, the camera file first.
///
/// # Errors
/// If it cannot be used.
pub fn camera_files(camera: &Path) -> Result<Vec<std::path::PathBuf>> {
    Ok(metalith_sensor::Camera::read(camera)?.files)
}

/// Wavelengths at which a design is judged (um): those that single PSFs and the mapping are for, and those of the band
/// of white light.
///
/// # Errors
/// If the camera of the design cannot be used.
pub fn wavelengths_um(design: &Design) -> Result<(Vec<f64>, Vec<f64>)> {
    let mut single = design.verify.wavelengths_um.clone();
    single.push(design.mapping.wavelength_um);
    single.sort_by(f64::total_cmp);
    single.dedup();
    Ok((single, polychromatic::wavelengths_um(design)?))
}

/// Contents read of a layout.
struct Found<'a> {
    layout: LayoutFacts,
    elements: Vec<ElementCheck>,
    /// Pillars of each element.
    widths: Vec<&'a dyn PillarRows>,
    foreign: UnrecognisedShapes,
}

/// Simulate what was read of a layout and hold it to the limits of its design; a thread holds spectra of at most
/// `part_bytes` at a time, if that is given.
fn judge(
    design: &Design,
    array: &PillarArray,
    found: Found<'_>,
    cases: &SimulationCases<'_>,
    accuracy: Accuracy,
    part_bytes: Option<usize>,
    progress: &dyn Progress,
) -> Result<Verification> {
    let mut elements = found.elements;
    let lens = LensPhase::of(&design.as_verified());
    let simulator = optics::ElementSimulator::new(design, array.lattice, cases, accuracy, part_bytes);
    let chosen = distinct_elements::choose(
        design,
        array,
        &mut elements,
        cases.judge.perturbation().keeps_symmetry(),
    );
    simulator.solve(&chosen, progress)?;
    let white = polychromatic::WhiteSimulator::new(design, array.lattice, cases.judge)?;
    if let Some(white) = &white {
        let shown: Vec<Element> = chosen.iter().map(|one| one.element).collect();
        white.solve(simulator.judge(), &shown, progress)?;
    }
    let in_white = white.as_ref().map_or(0, polychromatic::WhiteSimulator::psfs);
    // Spectra of many planes are not held in parts.
    let central = if cases.through_focus && part_bytes.is_none() {
        central(&chosen)
    } else {
        None
    };
    let series = central.map_or(0, |_| design.verify.wavelengths_um.len());
    let psfs: usize = chosen.iter().map(|one| simulator.psfs(one) + in_white).sum();
    let steps = Steps::begin(progress, "simulating elements", (psfs + series) as u64);
    let mut simulated = Vec::new();
    for (k, one) in chosen.into_iter().enumerate() {
        let element = one.element;
        let widths = found.widths[one.index];
        let phase = ElementPhase::of(&lens, &element);
        let rule = PillarRule::of_element(design, element.index);
        let read = simulator.read(&element, widths)?;
        simulated.push(DistinctElement {
            element,
            copies: one.copies,
            phase: phase_errors(design, &read, &|ix, iy| phase.wrapped(ix, iy), &rule, &steps)?,
            steepness: Steepness::of(&array.lattice, |ix, iy| phase.turns(ix, iy)),
            orders: simulator.orders(&element, &phase, &rule, &read, &steps)?,
            spots: simulator.simulate(&one, &phase, &read, &steps)?,
            through_focus: if central == Some(k) {
                simulator.through_focus(&element, &phase, &read, &steps)?
            } else {
                Vec::new()
            },
            white: match &white {
                Some(white) => white.simulate(&element, &phase, &read, &steps)?,
                None => Vec::new(),
            },
            histogram: widths.histogram(),
        });
    }
    let mut verification = Verification {
        design: design.name.clone(),
        design_digest: design.digest(),
        warnings: design.warnings()?,
        fidelity: cases.judge.fidelity(),
        model: cases.judge.statement(),
        compensated: array.compensated,
        accuracy: match accuracy {
            Accuracy::Accurate => "accurate",
            Accuracy::Fast => "fast",
        },
        camera: white.as_ref().map(polychromatic::WhiteSimulator::statement),
        layout: found.layout,
        elements,
        foreign: found.foreign,
        distinct: simulated,
        mapping: design.mapping.solved.clone(),
        rotations: EqualRotations::of(design, simulator.judge(), progress)?,
        lattice_orders: design.lattice_orders(AskedLight::All)?,
        not_simulated: None,
        checks: Vec::new(),
    };
    verification.checks = check::all(&design.verify.limits, &verification);
    Ok(verification)
}

/// The element nearest to the middle of the array, by its number; none where its cells are solved for other light than from the
/// middle of the field.
fn central(chosen: &[distinct_elements::Chosen]) -> Option<usize> {
    let middle = |one: &&distinct_elements::Chosen| one.angles.iter().any(|(field, _)| *field == optics::MIDDLE);
    let of = |one: &distinct_elements::Chosen| one.element.index.0.abs() + one.element.index.1.abs();
    let all = chosen.iter().enumerate().filter(|(_, one)| middle(one));
    all.min_by_key(|(_, one)| of(one)).map(|(k, _)| k)
}

/// Phase errors of an element's pillars at the wavelength of the mapping, in the case that judges.
fn phase_errors(
    design: &Design,
    read: &optics::ReadElement<'_>,
    phase: phase::SitePhase<'_>,
    rule: &PillarRule,
    progress: &dyn Progress,
) -> Result<PhaseErrors> {
    let sites = read.cases[0].focused(design.mapping.wavelength_um, progress)?;
    let response = PillarResponse {
        table: &sites.table,
        class: &|site, number| sites.class(site, number),
    };
    Ok(PhaseErrors::of(read.widths, phase, rule, &response))
}

fn compare<W>(
    array: &PillarArray,
    extraction: &Extraction<W>,
    widths: impl Fn(&PlacedElement, &W) -> PillarCheck,
) -> Vec<ElementCheck> {
    let check = |(placed, found): (&PlacedElement, &ExtractedElement<W>)| ElementCheck {
        element: placed.element,
        widths: widths(placed, &found.widths).of_shape(extraction.shape),
        copy_of: None,
        turned: None,
    };
    array.placed.iter().zip(&extraction.elements).map(check).collect()
}

fn facts<W>(layout: &Layout, extraction: &Extraction<W>, path: &Path) -> LayoutFacts {
    LayoutFacts {
        file: path
            .file_name()
            .map_or_else(String::new, |n| printable(&n.to_string_lossy()).into_owned()),
        bytes: layout.bytes(),
        top_cell: extraction.top.clone(),
        cells: layout.cells().len(),
        depth: layout.depth(),
        shapes: layout.flat_shapes(),
        pillars: extraction.pillars,
        survey: extraction.survey.clone(),
    }
}
