//! A sample of zones in place of a lens that is too large to be simulated.
//!
//! Rings of equal area are the strata, and each has the same number of small patches of neighbouring sites. The light of all
//! patches is added up coherently near the place where the chief ray lands.

mod estimate;
mod light;
mod patches;

use rayon::prelude::*;
use serde::Serialize;

use super::distinct_elements::{self, Chosen, CopyAngle};
use super::optics::{ElementSimulator, arriving};
use super::psf_metrics::asked_words;
use super::{ElementCheck, PhaseErrors, SimulationCases, phase_errors};
use light::{Lit, Sums};
use metalith_cell::Illumination;
use metalith_core::{Progress, Result, Steps, numerical_aperture};
use metalith_design::array::{PillarArray, PillarRule};
use metalith_design::phase::{ElementPhase, LensPhase};
use metalith_design::{Design, Element, FieldAngle};
use metalith_pillars::PillarRows;
use metalith_wave::propagation::landing_um;
use metalith_wave::psf::FocusMetrics;
use metalith_wave::{Accuracy, Window};
use patches::{PATCH, PATCHES, Tiles};

pub use estimate::Estimate;

/// Samples along the side of the window about the chief ray: with steps of an eighth of the wavelength over the numerical
/// aperture or more, it holds the circle of three full widths.
const WINDOW_SAMPLES: usize = 32;
/// Largest number of window steps in a wavelength over the numerical aperture.
const MOST_STEPS: f64 = 8.0;
/// Smallest Strehl ratio that is distinguished from chance, in means of as many patches without any relation: one in 500 000
/// windows has a sample above it.
const ABOVE_CHANCE: f64 = 20.0;

/// Reason why a layout is not simulated in full, and the sample of zones in its place.
#[derive(Clone, Debug, Serialize)]
pub struct NotSimulated {
    /// Reason why the elements were not simulated in full.
    pub why: String,
    #[serde(flatten)]
    pub sample: Sample,
}

/// Sample of zones, or the reason why there is none.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Sample {
    Sampled(SampledZones),
    NotSampled(String),
}

/// Figures of a sample of zones of each distinct element.
#[derive(Clone, Debug, Serialize)]
pub struct SampledZones {
    /// What the sample says nothing about.
    pub not_covered: &'static str,
    /// Way in which the sites were chosen.
    pub chosen: &'static str,
    /// Patches of each zone.
    pub patches_per_zone: usize,
    /// Sites along the side of a patch.
    pub patch_sites: usize,
    pub elements: Vec<SampledElement>,
}

/// Sample of one distinct element.
#[derive(Clone, Debug, Serialize)]
pub struct SampledElement {
    pub element: Element,
    /// Number of elements that it stands for.
    pub copies: usize,
    /// Rings of equal area that the lens was divided into.
    pub zones: usize,
    /// Sites inside the lens that were simulated.
    pub sites: u64,
    /// Share of the sites of the lens.
    pub share: f64,
    /// Root mean square of the phase error of rounding at the wavelength of the mapping (rad).
    pub rounding_rms_rad: Estimate,
    /// Root mean square of the phase error of the mapping (rad).
    pub mapping_rms_rad: Estimate,
    /// One entry for each wavelength and field angle of the design, and of copies that are lit from other sides.
    pub spots: Vec<SampledSpot>,
}

/// Figures of a sample for one wavelength and field angle.
#[derive(Clone, Debug, Serialize)]
pub struct SampledSpot {
    pub wavelength_um: f64,
    /// Counted from where the element looks.
    pub field: FieldAngle,
    /// First copy of the element, and its field angle, where the design asks copies alone for this light.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub copy: Option<CopyAngle>,
    /// Place where the chief ray meets the sensor, from the element's axis (um).
    pub chief_ray_um: [f64; 2],
    /// Side of the square about it in which the peak was looked for (um).
    pub window_um: f64,
    /// Strehl ratio of the layout.
    pub strehl: SampledStrehl,
    /// Strehl ratio of the target phase at the same sites.
    pub target_strehl: SampledStrehl,
    /// Strehl ratio of the layout over the Strehl ratio of the target; none unless both are above chance.
    pub strehl_ratio: Option<Estimate>,
    /// Focusing efficiency of the layout; none without a focus of a known width in the window.
    pub focusing_efficiency: Option<Estimate>,
}

/// Strehl ratio of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SampledStrehl {
    Found(Estimate),
    /// No peak in the window above what as many patches without any relation may have: the Strehl ratio there is at most this.
    Below(f64),
}

impl SampledStrehl {
    /// The lower end of its interval.
    pub fn least(&self) -> f64 {
        match self {
            Self::Found(estimate) => estimate.least(),
            Self::Below(_) => 0.0,
        }
    }
}

impl SampledSpot {
    /// Element, wavelength and field angle as the design asks for them, in words; `element` is that which is simulated.
    pub fn label(&self, element: &Element) -> String {
        asked_words(element, self.copy.as_ref(), self.wavelength_um, self.field)
    }
}

impl SampledZones {
    /// Sample of the distinct elements of a layout as read, by the case that judges; `checks` gets the element that stands for each.
    ///
    /// # Errors
    /// If a cell has no answer at a wavelength, a direction is too steep, or the user stopped it.
    pub(super) fn of(
        design: &Design,
        array: &PillarArray,
        checks: &mut [ElementCheck],
        widths: &[&dyn PillarRows],
        cases: &SimulationCases<'_>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let lens = LensPhase::of(&design.as_verified());
        let simulator = ElementSimulator::new(design, array.lattice, cases, Accuracy::Accurate, None);
        let symmetric = cases.judge.perturbation().keeps_symmetry();
        let chosen = distinct_elements::choose(design, array, checks, symmetric);
        simulator.solve(&chosen, progress)?;
        let psfs: usize = chosen.iter().map(|one| simulator.psfs(one)).sum();
        let steps = Steps::begin(progress, "sampling zones", (psfs * PATCHES) as u64);
        let element = |one: &Chosen| {
            let phase = ElementPhase::of(&lens, &one.element);
            Sampler {
                design,
                simulator: &simulator,
                phase: &phase,
                progress: &steps,
            }
            .element(one, widths[one.index])
        };
        Ok(Self {
            not_covered: "Zones between the patches, stray light, the shape of the PSF, MTF, centroid, energy in pixels, light of \
                          several wavelengths, planes out of focus, and light that lands outside of the window about the chief ray.",
            chosen: "Rings of equal area. In each the same number of square patches of sites, by an additive sequence that spreads \
                     them evenly over radius and direction; the same sites in each run. Standard errors are from the spread of \
                     samples with one patch of each ring (jackknife).",
            patches_per_zone: PATCHES,
            patch_sites: PATCH,
            elements: chosen.iter().map(element).collect::<Result<_>>()?,
        })
    }
}

/// Sampler of one element.
struct Sampler<'a> {
    design: &'a Design,
    simulator: &'a ElementSimulator<'a>,
    phase: &'a ElementPhase<'a>,
    progress: &'a Steps<'a>,
}

impl Sampler<'_> {
    fn element(&self, one: &Chosen, widths: &dyn PillarRows) -> Result<SampledElement> {
        let lens = self.design.lens_of(&one.element);
        let lattice = self.phase.lattice();
        let in_circle = std::f64::consts::PI * lens.radius_um().powi(2) / lattice.cell_um2();
        let zones = patches::zones(in_circle);
        let parts = (0..PATCHES).into_par_iter();
        let parts = parts.map(|part| Tiles::of(widths, lens.radius_um(), zones, part));
        let parts: Vec<Tiles> = parts.collect::<Result<_>>()?;
        let errors: Vec<PhaseErrors> = parts
            .par_iter()
            .map(|tiles| self.phase_errors(&one.element, tiles))
            .collect::<Result<_>>()?;
        let rms = |of: fn(&PhaseErrors) -> f64| Estimate::rms(&errors.iter().map(of).collect::<Vec<_>>());
        let (mut spots, mut sampled) = (Vec::new(), (0, 0.0));
        for &wavelength_um in &self.design.verify.wavelengths_um {
            for &(field, copy) in &one.angles {
                let (lit, sums) = self.lit(&one.element, wavelength_um, field, &parts)?;
                let Some(all) = Sums::without(&sums, None) else {
                    continue;
                };
                sampled = (all.sites(), all.sites() as f64 / (in_circle * all.open_share()));
                spots.push(spot(&lit, &sums, &all, field, copy));
            }
        }
        Ok(SampledElement {
            element: one.element,
            copies: one.copies,
            zones,
            sites: sampled.0,
            share: sampled.1,
            rounding_rms_rad: rms(|e| e.rounding.rms_rad),
            mapping_rms_rad: rms(|e| e.mapping.rms_rad),
            spots,
        })
    }

    fn phase_errors(&self, element: &Element, tiles: &Tiles) -> Result<PhaseErrors> {
        let rule = PillarRule::of_element(self.design, element.index);
        let read = self.simulator.read(element, &tiles.map)?;
        let phase = |column, row| {
            let [ix, iy] = tiles.site([column, row])?;
            self.phase.wrapped(ix, iy)
        };
        phase_errors(self.design, &read, &phase, &rule, self.progress)
    }

    /// A light of an element, and the sums of each part of its sample in it.
    fn lit(
        &self,
        element: &Element,
        wavelength_um: f64,
        field: FieldAngle,
        parts: &[Tiles],
    ) -> Result<(Lit<'_>, Vec<Sums>)> {
        let lens = self.design.lens_of(element);
        let wave = arriving(element, wavelength_um, field)?;
        let chief_um = landing_um(&element.wedge, &wave, lens.focal_length_um)?;
        let aperture = numerical_aperture(lens.radius_um(), lens.focal_length_um);
        // As fine as in a simulation, unless that is finer than the PSF needs.
        let usual_um = self.simulator.window(chief_um, lens, wavelength_um).step_um;
        let step_um = usual_um.max(wavelength_um / (MOST_STEPS * aperture));
        let lit = Lit {
            phase: self.phase,
            diameter_nm: lens.diameter_nm,
            wave,
            window: Window::about(chief_um, step_um, WINDOW_SAMPLES, lens.focal_length_um),
            chief_um,
            full: self.simulator.judge().case().full_transmission(wavelength_um)?,
        };
        let sums = |tiles: &Tiles| {
            self.progress.check_stopped()?;
            let read = self.simulator.read(element, &tiles.map)?;
            let fields = |light: &Illumination<'_>| read.cases[0].in_light(light, self.progress);
            let sums = Sums::of(tiles, &self.simulator.in_light(element, &wave, fields)?, &lit)?;
            self.progress.done();
            Ok(sums)
        };
        let sums = parts.par_iter().map(sums).collect::<Result<_>>()?;
        Ok((lit, sums))
    }
}

/// Figures of a light by the sums of the parts of the sample, and of all of it.
fn spot(lit: &Lit<'_>, parts: &[Sums], all: &Sums, field: FieldAngle, copy: Option<CopyAngle>) -> SampledSpot {
    let whole = all.focus(lit);
    let without: Vec<[FocusMetrics; 2]> = (0..parts.len())
        .filter_map(|k| Some(Sums::without(parts, Some(k))?.focus(lit)))
        .collect();
    let estimate = |of: &dyn Fn(&[FocusMetrics; 2]) -> Option<f64>| {
        let each: Option<Vec<f64>> = without.iter().map(of).collect();
        Some(Estimate::jackknife(of(&whole)?, &each?))
    };
    let chance = all.by_chance(lit);
    let strehl = |k: usize| {
        let told = ABOVE_CHANCE * chance[k];
        let found = estimate(&|of| Some(of[k].strehl)).filter(|_| whole[k].strehl > told);
        found.map_or(SampledStrehl::Below(told), SampledStrehl::Found)
    };
    let (layout, target) = (strehl(0), strehl(1));
    let found = |strehl: &SampledStrehl| matches!(strehl, SampledStrehl::Found(_));
    let both = found(&layout) && found(&target);
    SampledSpot {
        wavelength_um: lit.wave.wavelength_um,
        field,
        copy,
        chief_ray_um: lit.chief_um,
        window_um: lit.window.step_um * WINDOW_SAMPLES as f64,
        strehl_ratio: estimate(&|of| Some(of[0].strehl / of[1].strehl)).filter(|_| both),
        focusing_efficiency: estimate(&|of| of[0].focusing_efficiency).filter(|_| found(&layout)),
        strehl: layout,
        target_strehl: target,
    }
}
