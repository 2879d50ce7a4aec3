//! A point of the scene in white light: all wavelengths of a channel arrive from one direction.
//!
//! A wedge sends each wavelength to another place of the sensor, so a point becomes a line. The direction is the one
//! in which the element looks at the wavelength of its wedge. What is reported is for a channel of a camera: photons
//! of the illuminant, times quantum efficiency, times what the element passes.

use rayon::prelude::*;
use serde::Serialize;

use super::optics::{ReadElement, incidence};
use super::polychromatic_channels::{Channels, Point, WhiteChannel, per_light};
use metalith_cell::{Illumination, Incidence};
use metalith_core::{Progress, Result, Steps};
use metalith_design::phase::ElementPhase;
use metalith_design::{Design, Element};
use metalith_optics::{CaseOptics, IncoherentFields, SimulationCase};
use metalith_pillars::Lattice;
use metalith_sensor::{Camera, Sampling, WavelengthSteps};
use metalith_wave::psf::{BandSample, PixelFrequencies};
use metalith_wave::{Accuracy, Scratch, Window};

/// Steps that the visible has.
const MOST_STEPS: f64 = 24.0;

/// The camera and the light that figures are for.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CameraStatement {
    pub name: String,
    pub illuminant: &'static str,
    /// Edge of a pixel (um).
    pub pixel_um: f64,
    /// Wavelengths that were simulated (nm), common to all channels.
    pub wavelengths_nm: Vec<f64>,
}

impl CameraStatement {
    pub(super) fn of(camera: &Camera, sampling: &Sampling) -> Self {
        Self {
            name: camera.name.clone(),
            illuminant: camera.illuminant.name(),
            pixel_um: camera.sensor.pixel_um,
            wavelengths_nm: sampling.wavelengths_nm.clone(),
        }
    }

    /// Frequencies at which the contrast of its channels is stated.
    pub fn frequencies(&self) -> PixelFrequencies {
        PixelFrequencies::of(self.pixel_um)
    }
}

/// The camera of a design, and the wavelengths that it is simulated at. Nothing if the design names no camera and its
/// materials are not known for visible light.
///
/// # Errors
/// If the camera file cannot be used, or one of its channels counts no light at which the design's materials are known.
pub(super) fn camera_of(design: &Design) -> Result<Option<(Camera, Sampling)>> {
    let (short, long) = design.band_um()?;
    let range_nm = [short * 1e3, long * 1e3];
    let steps = |camera: &Camera| {
        WavelengthSteps::from(step_nm(range_nm)).behind(design.lens_sizes_um(), camera.sensor.pixel_um)
    };
    if let Some(file) = &design.verify.camera {
        let camera = Camera::read(file)?;
        let sampling = camera.sampling(range_nm, steps(&camera))?;
        return Ok(Some((camera, sampling)));
    }
    let camera = Camera::assumed(design.verify.pixel_um, range_nm);
    let sampling = camera.sampling(range_nm, steps(&camera)).ok();
    Ok(sampling.map(|sampling| (camera, sampling)))
}

/// The wavelengths that white light is simulated at (um); none if there is no camera to be had.
///
/// # Errors
/// As [`camera_of`].
pub(super) fn wavelengths_um(design: &Design) -> Result<Vec<f64>> {
    let sampling = camera_of(design)?.map(|(_, sampling)| sampling);
    Ok(sampling.map_or_else(Vec::new, |s| s.wavelengths_nm.iter().map(|nm| nm * 1e-3).collect()))
}

/// Place where the light of one wavelength lands from a point in the viewing direction of an element (um).
///
/// # Errors
/// As [`Point::landing_um`].
pub(super) fn landing_um(element: &Element, wavelength_um: f64, distance_um: f64) -> Result<[f64; 2]> {
    Point::of(element, distance_um).landing_um(wavelength_um)
}

/// Distance of the wavelengths (nm): a band that is much wider than the visible has as many as that.
pub(super) fn step_nm([short, long]: [f64; 2]) -> f64 {
    WavelengthSteps::USUAL_NM.max((long - short) / MOST_STEPS)
}

/// Simulator of the elements of a design in white light.
pub(super) struct WhiteSimulator<'a> {
    design: &'a Design,
    lattice: Lattice,
    camera: Camera,
    sampling: Sampling,
    /// Wavelength (um) and |t| of a cell that passes everything.
    colours: Vec<(f64, f64)>,
    lp_mm: Vec<f64>,
}

impl<'a> WhiteSimulator<'a> {
    /// Simulator at the wavelengths of the camera; `None` if there is no camera to be had.
    ///
    /// # Errors
    /// As [`camera_of`]; also if a wavelength is outside what the cell covers.
    pub(crate) fn new(design: &'a Design, lattice: Lattice, judge: SimulationCase<'_>) -> Result<Option<Self>> {
        let Some((camera, sampling)) = camera_of(design)? else {
            return Ok(None);
        };
        let colour = |nm: &f64| Ok((nm * 1e-3, judge.full_transmission(nm * 1e-3)?));
        let mut lp_mm = PixelFrequencies::of(camera.sensor.pixel_um).drawn().to_vec();
        lp_mm.extend(design.verify.limits.polychromatic_mtf_lp_mm);
        lp_mm.sort_by(f64::total_cmp);
        lp_mm.dedup();
        Ok(Some(Self {
            colours: sampling.wavelengths_nm.iter().map(colour).collect::<Result<_>>()?,
            design,
            lattice,
            camera,
            sampling,
            lp_mm,
        }))
    }

    /// Solve the cells for the light of a point, at which these elements look.
    ///
    /// # Errors
    /// If a cell has no answer, or the user stopped it.
    pub(crate) fn solve(&self, judge: &CaseOptics<'_>, elements: &[Element], progress: &dyn Progress) -> Result<()> {
        let all = elements.len() * self.colours.len();
        let steps = Steps::begin(progress, "solving cells for polychromatic light", all as u64);
        for (um, _) in &self.colours {
            for element in elements {
                self.in_light(element, *um, |light| judge.response(light, &steps))?;
                steps.done();
            }
        }
        Ok(())
    }

    /// Result of `with` for the light of a point at a wavelength (um). Coupled cells are solved for it in oblique
    /// incidence, else for light from where the element looks at the wavelength.
    fn in_light<T>(&self, element: &Element, um: f64, with: impl FnOnce(&Illumination<'_>) -> Result<T>) -> Result<T> {
        let looks = |um| <[f64; 2]>::from(element.wedge.looks_at(um));
        let light = Illumination {
            incidence: incidence(self.design),
            polarised: self.design.verify.light(),
            ..Illumination::from_direction(um, self.point(element).sines).in_band()
        };
        with(&match light.incidence {
            Incidence::Oblique => light,
            Incidence::Normal => Illumination {
                viewing: Some(&looks),
                ..light
            },
        })
    }

    /// Number of PSFs of one element.
    pub(crate) fn psfs(&self) -> usize {
        self.colours.len()
    }

    /// Statement of the camera that the figures are for.
    pub(crate) fn statement(&self) -> CameraStatement {
        CameraStatement::of(&self.camera, &self.sampling)
    }

    /// All channels of one element, in the case that judges.
    ///
    /// # Errors
    /// If a cell cannot be solved, a wavelength does not reach the sensor, or the user stopped it.
    pub(crate) fn simulate(
        &self,
        element: &Element,
        phase: &ElementPhase<'_>,
        read: &ReadElement<'_>,
        progress: &Steps<'_>,
    ) -> Result<Vec<WhiteChannel>> {
        let fields =
            |(um, _): &(f64, f64)| self.in_light(element, *um, |light| read.cases[0].in_light(light, progress));
        let fields = self.colours.iter().map(fields).collect::<Result<Vec<_>>>()?;
        let area_um2 = phase.open_um2();
        let samples = self
            .colours
            .par_iter()
            .zip(fields)
            .map_init(Scratch::default, |scratch, ((um, full), fields)| {
                progress.check_stopped()?;
                let sample = self.sample(element, (*um, full * full * area_um2), &fields, scratch);
                progress.done();
                sample
            })
            .collect::<Result<Vec<_>>>()?;
        let shown = Channels {
            point: self.point(element),
            samples: &samples,
            lp_mm: &self.lp_mm,
            pixel_um: self.camera.sensor.pixel_um,
        };
        let channels = self.sampling.channels.par_iter();
        channels.map(|channel| shown.channel(channel)).collect()
    }

    /// The PSF of one wavelength about its own chief ray, per unit of light that arrives at the element.
    fn sample(
        &self,
        element: &Element,
        (um, arriving_um2): (f64, f64),
        fields: &IncoherentFields<'_>,
        scratch: &mut Scratch,
    ) -> Result<BandSample> {
        let (lens, spec) = (self.design.lens_of(element), &self.design.verify);
        let landing = self.point(element).landing_um(um)?;
        let pitches = (self.lattice.pitch_um(), spec.window_samples);
        // The PSFs of a band have one step.
        let shortest_um = self.colours.iter().fold(um, |least, colour| least.min(colour.0));
        let window = Window::of_psf(landing, pitches, (lens.radius_um(), lens.focal_length_um), shortest_um);
        let psf = fields.psf(window, Accuracy::Fast, &self.lp_mm, scratch)?;
        Ok(per_light(landing, psf, arriving_um2))
    }

    fn point(&self, element: &Element) -> Point {
        Point::of(element, self.design.lens_of(element).focal_length_um)
    }
}
