//! The PSFs of one element: of its unrounded design phase, and of its pillars in each case.

mod orders;

use ndarray::Array2;
use rayon::prelude::*;

use super::FocusRequest;
use super::case::SimulationCases;
use super::distinct_elements::{Chosen, CopyAngle};
use super::psf_metrics::{PsfImages, PsfPair, PsfResult};
use metalith_cell::{Illumination, Incidence};
use metalith_core::{Progress, Result, Steps};
use metalith_design::phase::ElementPhase;
use metalith_design::{CellIncidence, Design, Element, FieldAngle, LensSpec};
use metalith_optics::{CaseOptics, ElementOptics, IncoherentFields, Placement, SimulationCase};
use metalith_pillars::{Lattice, PillarRows};
use metalith_wave::propagation::{incident, landing_um};
use metalith_wave::psf::{FocusPlanes, PixelFrequencies, ThroughFocus};
use metalith_wave::{
    Accuracy, Aperture, FoldedPropagator, IdealPsf, PhaseFunction, PhaseMap, PhaseSites, PlaneWave, Psf, Scratch,
    Window,
};

/// Viewing direction of an element in the middle of its field.
pub(super) const MIDDLE: FieldAngle = FieldAngle { x_deg: 0.0, y_deg: 0.0 };

/// Simulator of the elements of a design.
pub(super) struct ElementSimulator<'a> {
    design: &'a Design,
    lattice: Lattice,
    /// The case that judges first.
    cases: Vec<CaseOptics<'a>>,
    accuracy: Accuracy,
    /// Spectra that a thread may hold at a time, if not all (bytes): see [`FoldedPropagator::within`].
    part_bytes: Option<usize>,
}

/// An element as read from a layout, in each case.
pub(super) struct ReadElement<'r> {
    pub widths: &'r dyn PillarRows,
    pub cases: Vec<Box<dyn ElementOptics + 'r>>,
}

impl<'a> ElementSimulator<'a> {
    /// Simulator for these cases.
    pub(crate) fn new(
        design: &'a Design,
        lattice: Lattice,
        cases: &SimulationCases<'a>,
        accuracy: Accuracy,
        part_bytes: Option<usize>,
    ) -> Self {
        let optics = |case: SimulationCase<'a>| case.optics(lattice.kind(), design.cell.most()).within(part_bytes);
        Self {
            design,
            lattice,
            cases: cases.iter().map(optics).collect(),
            accuracy,
            part_bytes,
        }
    }

    /// The case that judges.
    pub(crate) fn judge(&self) -> &CaseOptics<'a> {
        &self.cases[0]
    }

    /// Solve the cells for light as it arrives at these elements.
    ///
    /// # Errors
    /// If a cell has no answer, or the user stopped it.
    pub(crate) fn solve(&self, chosen: &[Chosen], progress: &dyn Progress) -> Result<()> {
        let lit: Vec<(&Element, FieldAngle)> = chosen.iter().flat_map(all_angles).collect();
        let colours = &self.design.verify.wavelengths_um;
        let all = lit.len() * colours.len() * self.cases.len();
        let steps = Steps::begin(progress, "solving cells", all as u64);
        for &um in colours {
            for (element, field) in &lit {
                let wave = arriving(element, um, *field)?;
                for case in &self.cases {
                    self.in_middle(element, um, |light| case.response(light, &steps))?;
                    self.in_light(element, &wave, |light| case.response(light, &steps))?;
                    steps.done();
                }
            }
        }
        Ok(())
    }

    /// Result of `with` for an element's light from one of its field angles.
    pub(crate) fn in_light<T>(
        &self,
        element: &Element,
        wave: &PlaneWave,
        with: impl FnOnce(&Illumination<'_>) -> Result<T>,
    ) -> Result<T> {
        let light = Illumination {
            incidence: incidence(self.design),
            polarised: self.design.verify.light(),
            ..Illumination::from_direction(wave.wavelength_um, [wave.sin_x, wave.sin_y])
        };
        if light.incidence == Incidence::Oblique {
            return with(&light);
        }
        let middle = arriving(element, wave.wavelength_um, MIDDLE)?;
        with(&Illumination {
            viewing: Some(&|_| [middle.sin_x, middle.sin_y]),
            ..light
        })
    }

    /// Result of `with` for light from the middle of an element's field, on cells that are solved along the normal:
    /// orders are reported in it.
    fn in_middle<T>(&self, element: &Element, um: f64, with: impl FnOnce(&Illumination<'_>) -> Result<T>) -> Result<T> {
        let middle = arriving(element, um, MIDDLE)?;
        with(&Illumination {
            polarised: self.design.verify.light(),
            ..Illumination::from_direction(um, [middle.sin_x, middle.sin_y])
        })
    }

    /// The lens with the perfect phase for the place where a chief ray lands, all sites of modulus one: what Strehl ratios
    /// are against.
    fn perfect(&self, element: &Element, phase: &ElementPhase<'_>, chief_um: [f64; 2], wavelength_um: f64) -> IdealPsf {
        let [x, y] = chief_um;
        let focus = [x, y, self.design.lens_of(element).focal_length_um];
        open_matched(self.design, element, phase, focus, wavelength_um)
    }

    /// Number of wavelengths and angles of one element.
    pub(crate) fn psfs(&self, one: &Chosen) -> usize {
        self.design.verify.wavelengths_um.len() * one.angles.len()
    }

    /// An element as read, in each case.
    ///
    /// # Errors
    /// As [`CaseOptics::element`].
    pub(crate) fn read<'r>(&'r self, element: &Element, widths: &'r dyn PillarRows) -> Result<ReadElement<'r>> {
        let placement = Placement {
            radius_um: self.design.lens_of(element).radius_um(),
            aperture_radius_um: self.design.aperture_radius_of_um(element),
            centre_um: element.centre_um(),
        };
        let cases = self.cases.iter().map(|case| case.element(widths, &placement));
        Ok(ReadElement {
            widths,
            cases: cases.collect::<Result<_>>()?,
        })
    }

    /// All wavelengths and field angles of one element, those of the design first.
    ///
    /// # Errors
    /// If a cell cannot be solved, a direction is too steep, or the user stopped it.
    pub(crate) fn simulate(
        &self,
        one: &Chosen,
        phase: &ElementPhase<'_>,
        read: &ReadElement<'_>,
        progress: &Steps<'_>,
    ) -> Result<Vec<PsfPair>> {
        let element = &one.element;
        // The phase before mapping and rounding, once for all colours and angles.
        let radius_um = self.design.lens_of(element).radius_um();
        let turns = |ix, iy| phase.turns(ix, iy);
        let (held, computed);
        let designed: &dyn Aperture = if self.part_bytes.is_none() {
            held = PhaseMap::new(self.lattice, radius_um, turns);
            &held
        } else {
            computed = PhaseSites {
                lattice: self.lattice,
                radius_um,
                turns,
            };
            &computed
        };
        let task = |wavelength_um: f64, &(field, copy): &(FieldAngle, Option<CopyAngle>)| -> Result<Task<'_>> {
            let wave = arriving(element, wavelength_um, field)?;
            let all = |light: &Illumination<'_>| {
                let cases = read.cases.iter().map(|case| case.in_light(light, progress));
                cases.collect::<Result<_>>()
            };
            Ok(Task {
                field,
                copy,
                wave,
                cases: self.in_light(element, &wave, all)?,
            })
        };
        let (mut of_design, mut of_others) = (Vec::new(), Vec::new());
        // What sites transmit is held of a few colours at a time, so many that there is work for each thread.
        let colours = rayon::current_num_threads().div_ceil(one.angles.len().max(1));
        for colours in self.design.verify.wavelengths_um.chunks(colours) {
            let tasks = colours
                .iter()
                .flat_map(|um| one.angles.iter().map(|angle| task(*um, angle)));
            let mut tasks = tasks.collect::<Result<Vec<_>>>()?;
            if self.part_bytes.is_none() {
                IncoherentFields::share_rows(tasks.iter_mut().flat_map(|task| &mut task.cases).collect())?;
            }
            let pairs = tasks.into_par_iter().map_init(Scratch::default, |scratch, task| {
                progress.check_stopped()?;
                let pair = self.pair(&task, (element, phase), designed, (scratch, progress));
                progress.done();
                pair
            });
            let pairs = pairs.collect::<Result<Vec<_>>>()?.into_iter();
            let (own, copies): (Vec<_>, Vec<_>) = pairs.partition(|pair| pair.copy.is_none());
            of_design.extend(own);
            of_others.extend(copies);
        }
        of_design.append(&mut of_others);
        Ok(of_design)
    }

    /// Through-focus series of an element in the middle of its field, in the case that judges, at each wavelength of the design.
    ///
    /// # Errors
    /// As [`Self::simulate`].
    pub(crate) fn through_focus(
        &self,
        element: &Element,
        phase: &ElementPhase<'_>,
        read: &ReadElement<'_>,
        progress: &Steps<'_>,
    ) -> Result<Vec<ThroughFocus>> {
        let (lens, spec) = (self.design.lens_of(element), &self.design.verify);
        let sensor_um = lens.focal_length_um;
        let series = |&wavelength_um: &f64| {
            progress.check_stopped()?;
            let wave = arriving(element, wavelength_um, MIDDLE)?;
            let fields = self.in_light(element, &wave, |light| read.cases[0].in_light(light, progress))?;
            let chief = landing_um(&element.wedge, &wave, sensor_um)?;
            let planes = FocusPlanes::usual(wavelength_um, lens.radius_um(), sensor_um);
            let whole = self.window(chief, lens, wavelength_um);
            // A part of a large window, so that the planes fit into memory.
            let most = (FocusRequest::MOST_SAMPLES / planes.planes).isqrt();
            let window = Window::about(chief, whole.step_um, whole.samples.min(most), sensor_um);
            let psfs = fields.psfs_at(
                window,
                &planes.distances_um(sensor_um),
                self.accuracy,
                &mut Scratch::default(),
            )?;
            let full = self.judge().case().full_transmission(wavelength_um)?;
            let perfect = self.perfect(element, phase, chief, wavelength_um).scaled(full);
            progress.done();
            Ok(ThroughFocus::of(
                psfs,
                &perfect,
                wavelength_um,
                [lens.radius_um(), sensor_um],
            ))
        };
        spec.wavelengths_um.par_iter().map(series).collect()
    }

    /// Window of the PSFs of a lens about the place where a chief ray lands.
    pub(crate) fn window(&self, chief_um: [f64; 2], lens: &LensSpec, wavelength_um: f64) -> Window {
        let pitches = (self.lattice.pitch_um(), self.design.verify.window_samples);
        Window::of_psf(
            chief_um,
            pitches,
            (lens.radius_um(), lens.focal_length_um),
            wavelength_um,
        )
    }

    fn pair(
        &self,
        task: &Task<'_>,
        (element, phase): (&Element, &ElementPhase<'_>),
        designed: &dyn Aperture,
        (scratch, progress): (&mut Scratch, &Steps<'_>),
    ) -> Result<PsfPair> {
        let (lens, spec) = (self.design.lens_of(element), &self.design.verify);
        let Task { field, wave, .. } = task;
        let wavelength_um = wave.wavelength_um;
        let chief = landing_um(&element.wedge, wave, lens.focal_length_um)?;
        let window = self.window(chief, lens, wavelength_um);
        let fold = FoldedPropagator::plan(self.lattice, lens.radius_um(), wavelength_um, window, self.accuracy)?;
        let fold = match self.part_bytes {
            Some(bytes) => fold.within(bytes),
            None => fold,
        };
        let frequencies = PixelFrequencies::of(spec.pixel_um);
        let (drawn, reported) = (frequencies.drawn(), frequencies.reported());
        // Each field of a large element takes minutes.
        let fields = 1 + task.cases.len() as u64;
        progress.begin("fields", fields);
        let formed = || {
            progress.advance(1);
            progress.check_stopped()
        };
        let designed = Psf::formed(&fold, designed, wave, &drawn, scratch)?;
        formed()?;
        let perfect = self.perfect(element, phase, chief, wavelength_um);
        let mut extracted = Vec::new();
        let mut judged = None;
        for (case, fields) in self.cases.iter().map(CaseOptics::case).zip(&task.cases) {
            // Curves are drawn of the case that judges alone.
            let lp_mm: &[f64] = if judged.is_none() { &drawn } else { &reported };
            let found = fields.psf(window, self.accuracy, lp_mm, scratch)?;
            let matched = perfect.scaled(case.full_transmission(wavelength_um)?);
            extracted.push((case.fidelity(), PsfResult::of(&found, &matched, spec.pixel_um)));
            judged.get_or_insert(found);
            formed()?;
        }
        let judged = judged.expect("the case that judges is the first");
        let full = self.judge().case().full_transmission(wavelength_um)?;
        let images = (field.x_deg == 0.0 && field.y_deg == 0.0).then(|| {
            Box::new(PsfImages {
                designed: picture(&designed, 1.0),
                extracted: picture(&judged, full),
                step_um: window.step_um,
            })
        });
        Ok(PsfPair {
            wavelength_um,
            field: *field,
            copy: task.copy,
            incidence_sin: [wave.sin_x, wave.sin_y],
            chief_ray_um: chief,
            relabelled: fold.fade().relabelled,
            psf_difference: judged.shape_difference(&designed)?,
            designed: PsfResult::of(&designed, &perfect, spec.pixel_um),
            extracted,
            images,
        })
    }
}

/// One wavelength and field angle of one element.
struct Task<'a> {
    field: FieldAngle,
    copy: Option<CopyAngle>,
    wave: PlaneWave,
    /// Fields of the element in the light of each case.
    cases: Vec<IncoherentFields<'a>>,
}

/// The direction that the cells of a design are solved for.
pub(super) fn incidence(design: &Design) -> Incidence {
    match design.verify.incidence {
        CellIncidence::Oblique => Incidence::Oblique,
        CellIncidence::Normal => Incidence::Normal,
    }
}

/// An element with each of its field angles.
fn all_angles(one: &Chosen) -> impl Iterator<Item = (&Element, FieldAngle)> {
    one.angles.iter().map(|(field, _)| (&one.element, *field))
}

/// Place where the chief ray of an element lands from one of its field angles, from the element's axis (um).
///
/// # Errors
/// If it does not reach the sensor.
pub(super) fn landing(element: &Element, wavelength_um: f64, field: FieldAngle, distance_um: f64) -> Result<[f64; 2]> {
    let wave = arriving(element, wavelength_um, field)?;
    Ok(landing_um(&element.wedge, &wave, distance_um)?)
}

/// The wave that arrives at an element from one of its field angles.
pub(super) fn arriving(element: &Element, wavelength_um: f64, field: FieldAngle) -> Result<PlaneWave> {
    let field_rad = [field.x_deg, field.y_deg].map(f64::to_radians);
    Ok(incident(&element.wedge, wavelength_um, field_rad)?)
}

/// The sites of an element, all of modulus one, with the perfect phase for a focus (um from its middle), whatever the outline of
/// its lens: what Strehl ratios are against.
pub fn open_matched(
    design: &Design,
    element: &Element,
    phase: &ElementPhase<'_>,
    focus_um: [f64; 3],
    wavelength_um: f64,
) -> IdealPsf {
    let (lattice, lens) = (phase.lattice(), design.lens_of(element));
    let radius_um = lens.radius_um();
    if lens.outline.is_some() {
        let turns = |ix, iy| phase.holds(ix, iy).then_some(0.0);
        let open = PhaseSites {
            lattice,
            radius_um,
            turns,
        };
        return IdealPsf::of(&open, focus_um, wavelength_um, 1.0);
    }
    let open = PhaseFunction {
        lattice,
        radius_um,
        amplitude: 1.0,
        phase_rad: |_, _| 0.0,
    };
    IdealPsf::of(&open, focus_um, wavelength_um, 1.0)
}

/// A PSF per unit of arriving power, so that cells with and without amplitude share one scale.
fn picture(psf: &Psf, full_transmission: f64) -> Array2<f32> {
    let power = full_transmission * full_transmission;
    psf.values.mapv(|v| (v / power) as f32)
}
