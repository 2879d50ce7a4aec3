//! A point of the scene in white light: all wavelengths of a channel arrive from one direction.
//!
//! A wedge sends each wavelength to another place of the sensor, so a point becomes a line. The direction is the one
//! in which the element looks at the wavelength of its wedge. What is reported is for a channel of a camera: photons
//! of the illuminant, times quantum efficiency, times what the element passes.

use rayon::prelude::*;
use serde::Serialize;

use super::case::TransmissionTables;
use super::optics::ReadElement;
use super::white_channels::{Channels, Point, WhiteChannel, per_light};
use metalith_core::{Error, Progress, Result};
use metalith_design::phase::ElementPhase;
use metalith_design::{CellIncidence, Design, Element};
use metalith_optics::{AsBuiltOptics, SimulationCase};
use metalith_pillars::Lattice;
use metalith_sensor::{Camera, Sampling, WavelengthSteps};
use metalith_wave::psf::{BandSample, PixelFrequencies};
use metalith_wave::{Accuracy, FoldedPropagator, PlaneWave, Scratch, Window};

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

/// One wavelength, with what all elements share.
struct Colour {
    wavelength_um: f64,
    /// |t| of a cell that passes everything.
    full: f64,
    /// Transmissions of a cell, by drawn width; a chip as fabricated has its own by site.
    tables: Option<TransmissionTables>,
}

/// Simulator of the elements of a design in white light.
pub(super) struct WhiteSimulator<'a> {
    design: &'a Design,
    lattice: Lattice,
    judge: SimulationCase<'a>,
    /// Spectra that a thread may hold at a time, if not all (bytes): see [`FoldedPropagator::within`].
    part_bytes: Option<usize>,
    camera: Camera,
    sampling: Sampling,
    colours: Vec<Colour>,
    lp_mm: Vec<f64>,
}

impl<'a> WhiteSimulator<'a> {
    /// Solve the cells along the normal at the wavelengths of the camera; nothing if there is no camera to be had.
    ///
    /// # Errors
    /// As [`camera_of`]; also if a cell cannot be solved.
    pub fn new(
        design: &'a Design,
        lattice: Lattice,
        judge: SimulationCase<'a>,
        part_bytes: Option<usize>,
    ) -> Result<Option<Self>> {
        let Some((camera, sampling)) = camera_of(design)? else {
            return Ok(None);
        };
        let largest_number = design.cell.most();
        let colour = |nm: &f64| {
            let wavelength_um = nm * 1e-3;
            let tables = match judge {
                SimulationCase::Made(_) => None,
                SimulationCase::Cell(cell) => {
                    let light = design.verify.light();
                    Some(TransmissionTables::in_band(
                        cell,
                        lattice.kind(),
                        wavelength_um,
                        largest_number,
                        light,
                    )?)
                }
            };
            Ok(Colour {
                wavelength_um,
                full: judge.full_transmission(wavelength_um)?,
                tables,
            })
        };
        let mut lp_mm = PixelFrequencies::of(camera.sensor.pixel_um).drawn().to_vec();
        lp_mm.extend(design.verify.limits.white_mtf_lp_mm);
        lp_mm.sort_by(f64::total_cmp);
        lp_mm.dedup();
        Ok(Some(Self {
            colours: sampling.wavelengths_nm.iter().map(colour).collect::<Result<_>>()?,
            design,
            lattice,
            judge,
            part_bytes,
            camera,
            sampling,
            lp_mm,
        }))
    }

    /// Obtain what pillars transmit among unlike neighbours, from a cell that knows, in light from where these elements look at each
    /// wavelength; if the design asks for light as it arrives, in that of the point, which other cells are solved for then.
    ///
    /// # Errors
    /// If a cell has no answer, or the user stopped it.
    pub fn add_directions(&mut self, elements: &[Element], progress: &dyn Progress) -> Result<()> {
        let SimulationCase::Cell(cell) = self.judge else {
            return Ok(());
        };
        let (design, as_lit) = (self.design, self.as_lit());
        let lit = |element: &Element, um: f64| lit(design, element, um);
        for colour in &mut self.colours {
            if let Some(tables) = &mut colour.tables {
                for element in elements {
                    tables.add_neighbours_in_band(cell, colour.wavelength_um, &|um| lit(element, um), progress)?;
                }
            }
        }
        if !as_lit {
            return Ok(());
        }
        progress.begin(
            "solving cells as they are lit by white light",
            (elements.len() * self.colours.len()) as u64,
        );
        for colour in &mut self.colours {
            if let Some(tables) = &mut colour.tables {
                let waves: Vec<_> = elements.iter().map(|e| lit(e, colour.wavelength_um)).collect();
                tables.add_directions(cell, &waves, design.cell.most(), progress)?;
            }
        }
        Ok(())
    }

    fn as_lit(&self) -> bool {
        self.design.verify.incidence == CellIncidence::AsLit
    }

    /// Number of PSFs of one element.
    pub fn psfs(&self) -> usize {
        self.colours.len()
    }

    /// Statement of the camera that the figures are for.
    pub fn statement(&self) -> CameraStatement {
        CameraStatement::of(&self.camera, &self.sampling)
    }

    /// All channels of one element, in the case that judges.
    ///
    /// # Errors
    /// If a cell cannot be solved, a wavelength does not reach the sensor, or the user stopped it.
    pub fn simulate(
        &self,
        element: &Element,
        phase: &ElementPhase<'_>,
        read: &ReadElement<'_>,
        progress: &dyn Progress,
    ) -> Result<Vec<WhiteChannel>> {
        let as_lit = self.as_lit();
        let view = |colour: &Colour| match (self.judge, &read.made[0]) {
            (SimulationCase::Made(chip), Some(made)) => {
                let wave = self.point(element).wave(colour.wavelength_um);
                chip.view_in_band(made, &wave, as_lit, progress).map(Some)
            }
            _ => Ok(None),
        };
        let views = self.colours.iter().map(view).collect::<Result<Vec<_>>>()?;
        let area_um2 = phase.open_um2();
        let samples = self
            .colours
            .par_iter()
            .zip(views)
            .map_init(Scratch::default, |scratch, (colour, view)| {
                if progress.stopped() {
                    return Err(Error::Interrupted);
                }
                let sample = self.sample(element, (colour, area_um2), view.as_ref(), read, scratch);
                progress.advance(1);
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
        (colour, area_um2): (&Colour, f64),
        view: Option<&AsBuiltOptics<'_>>,
        read: &ReadElement<'_>,
        scratch: &mut Scratch,
    ) -> Result<BandSample> {
        let (lens, spec) = (self.design.lens_of(element), &self.design.verify);
        let point = self.point(element);
        let wave = point.wave(colour.wavelength_um);
        let landing = point.landing_um(colour.wavelength_um)?;
        let pitch = self.lattice.pitch_um();
        let window = Window::about(landing, pitch, spec.window_samples, lens.focal_length_um);
        let psf = match (view, &colour.tables) {
            (Some(view), _) => view.psf(window, Accuracy::Fast, &self.lp_mm, scratch)?,
            (None, Some(tables)) => {
                let radius_um = lens.radius_um();
                let fold =
                    FoldedPropagator::plan(self.lattice, radius_um, colour.wavelength_um, window, Accuracy::Fast)?;
                let fold = match self.part_bytes {
                    Some(bytes) => fold.within(bytes),
                    None => fold,
                };
                let lit = lit(self.design, element, colour.wavelength_um);
                tables.psf(read.widths, &wave, &lit, &fold, &self.lp_mm, scratch)?
            }
            (None, None) => unreachable!("a case is a cell or a made chip"),
        };
        Ok(per_light(landing, psf, colour.full * colour.full * area_um2))
    }

    fn point(&self, element: &Element) -> Point {
        Point::of(element, self.design.lens_of(element).focal_length_um)
    }
}

/// The light that cells of an element are solved for: that of the point if the design asks for it, else from where the element looks
/// at the wavelength.
fn lit(design: &Design, element: &Element, wavelength_um: f64) -> PlaneWave {
    match design.verify.incidence {
        CellIncidence::AsLit => Point::of(element, design.lens_of(element).focal_length_um).wave(wavelength_um),
        CellIncidence::Normal => PlaneWave::looked_at(&element.wedge, wavelength_um),
    }
}
