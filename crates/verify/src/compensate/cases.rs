//! The chips that a compensation is judged by: intended, made without it, made with it.

use std::path::Path;

use serde::Serialize;

use super::Compensated;
use super::line::Line;
use crate::optics::incidence;
use crate::{PsfResult, open_matched};
use metalith_cell::{Illumination, Incidence, PolarisationAxis, PolarisedLight};
use metalith_core::{Progress, Result, Steps};
use metalith_design::array::PillarArray;
use metalith_design::phase::{ElementPhase, LensPhase};
use metalith_design::{Design, Element};
use metalith_layout::read_pillars;
use metalith_optics::{AsBuiltChip, AsBuiltElement};
use metalith_pillars::PillarMap;
use metalith_wave::propagation::{incident, landing_um};
use metalith_wave::psf::{PixelFrequencies, Psf};
use metalith_wave::{Accuracy, Scratch, Window};

/// Chips that are compared.
pub(super) const CHIPS: usize = 3;

/// One element of one chip at one wavelength, in the middle of its field; of upright rectangles in one polarisation.
#[derive(Clone, Debug, Serialize)]
pub struct CompensationCase {
    pub element: String,
    pub wavelength_um: f64,
    /// Axis that the light is polarised along, for upright rectangles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis: Option<PolarisationAxis>,
    /// `intended` as stated, `made, uncorrected` and `made, corrected`.
    pub pillars: &'static str,
    /// Metrics of the PSF.
    pub spot: PsfResult,
    /// The PSF on the design's window about the chief ray.
    #[serde(skip)]
    pub psf: Psf,
}

/// Read the compensated layout at `layout` back and simulate it as it would be made, beside the intended pillars as
/// stated and as they would be made. For the first element of each class at each wavelength and polarisation, three cases.
///
/// # Errors
/// If the layout cannot be read, a cell cannot be solved, or the user stopped it.
pub fn compensation_cases(
    design: &Design,
    intended: &PillarArray,
    compensated: &Compensated,
    layout: &Path,
    progress: &dyn Progress,
) -> Result<Vec<CompensationCase>> {
    let line = &compensated.line;
    let found = read_pillars(design, layout, progress)?;
    let lens = LensPhase::of(design);
    let work = intended.classes.len() * line.colours.len();
    let steps = Steps::begin(progress, "simulating elements", work as u64);
    let mut cases = Vec::new();
    for class in 0..intended.classes.len() {
        let place = intended.placed.iter().position(|p| p.class == class).unwrap_or(0);
        let plain = intended.widths(&intended.placed[place]);
        let corrected = &found.elements[place].widths;
        let element = intended.placed[place].element;
        let phase = ElementPhase::of(&lens, &element);
        let drawn = [plain.as_ref(), corrected];
        cases.extend(of_element(design, line, (&element, &phase), drawn, &steps)?);
    }
    Ok(cases)
}

/// One element at all wavelengths, drawn as intended and corrected.
fn of_element(
    design: &Design,
    line: &Line,
    (element, phase): (&Element, &ElementPhase<'_>),
    [plain, corrected]: [&PillarMap; 2],
    steps: &Steps<'_>,
) -> Result<Vec<CompensationCase>> {
    let (focal_um, opening_um) = (
        design.lens_of(element).focal_length_um,
        design.aperture_radius_of_um(element),
    );
    let chips: [(&'static str, &AsBuiltChip, &PillarMap); CHIPS] = [
        ("intended", &line.stated, plain),
        ("made, uncorrected", &line.chip, plain),
        ("made, corrected", &line.chip, corrected),
    ];
    let made: Vec<AsBuiltElement> = chips
        .iter()
        .map(|(_, chip, widths)| chip.element(&chip.drawn(widths, opening_um).placed(element.centre_um())))
        .collect::<Result<_>>()?;
    let drawn = PixelFrequencies::of(design.verify.pixel_um).drawn();
    let mut scratch = Scratch::default();
    let mut cases = Vec::new();
    for colour in &line.colours {
        steps.check_stopped()?;
        let um = colour.wavelength_um;
        let wave = incident(&element.wedge, um, [0.0, 0.0])?;
        let light = Illumination {
            polarised: colour.axis.map_or(design.verify.light(), PolarisedLight::along),
            incidence: colour.axis.map_or(incidence(design), |_| Incidence::Normal),
            ..Illumination::from_direction(um, [wave.sin_x, wave.sin_y])
        };
        let chief = landing_um(&element.wedge, &wave, focal_um)?;
        let pitches = (plain.lattice.pitch_um(), design.verify.window_samples);
        let window = Window::of_psf(chief, pitches, (design.lens_of(element).radius_um(), focal_um), um);
        let matched = open_matched(design, element, phase, [chief[0], chief[1], focal_um], um).scaled(colour.full);
        for ((pillars, chip, _), made) in chips.iter().zip(&made) {
            let psf = chip
                .view(made, &light, steps)?
                .psf(window, Accuracy::Accurate, &drawn, &mut scratch)?;
            cases.push(CompensationCase {
                element: element.label(),
                wavelength_um: um,
                axis: colour.axis,
                pillars,
                spot: PsfResult::of(&psf, &matched, design.verify.pixel_um),
                psf,
            });
        }
        steps.done();
    }
    Ok(cases)
}
