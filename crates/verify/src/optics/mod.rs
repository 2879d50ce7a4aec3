//! The PSFs of one element: of its unrounded design phase, and of its pillars in each case.

mod orders;

use ndarray::Array2;
use rayon::prelude::*;

use super::case::{SimulationCases, TransmissionTables, not_held};
use super::copies::{Chosen, CopyAngle};
use super::psf_metrics::{PsfImages, PsfPair, PsfResult};
use metalith_cell::Fidelity;
use metalith_core::Progress;
use metalith_core::{Error, Result};
use metalith_design::phase::ElementPhase;
use metalith_design::{CellIncidence, Design, Element, FieldAngle};
use metalith_optics::{AsBuiltElement, AsBuiltOptics, DrawnElement, SimulationCase};
use metalith_pillars::{Lattice, PillarRows};
use metalith_wave::propagation::{incident, landing_um};
use metalith_wave::psf::PixelFrequencies;
use metalith_wave::{
    Accuracy, Aperture, FoldedPropagator, IdealPsf, PhaseFunction, PhaseMap, PhaseSites, PlaneWave, Psf, Scratch,
    Window,
};

/// Where an element looks.
const MIDDLE: FieldAngle = FieldAngle { x_deg: 0.0, y_deg: 0.0 };

/// One wavelength, with what all elements and angles share.
struct Colour {
    wavelength_um: f64,
    /// Of each case.
    cases: Vec<CaseAt>,
}

/// One case at one wavelength.
struct CaseAt {
    fidelity: Fidelity,
    /// |t| of a cell that passes everything.
    full: f64,
    /// Of a cell, by drawn width; a chip as made has its own by site.
    tables: Option<TransmissionTables>,
}

/// What the elements of a design are simulated with.
pub(super) struct ElementSimulator<'a> {
    design: &'a Design,
    lattice: Lattice,
    cases: Vec<SimulationCase<'a>>,
    accuracy: Accuracy,
    /// Spectra that a thread may hold at a time, if not all (bytes): see [`FoldedPropagator::within`].
    part_bytes: Option<usize>,
    colours: Vec<Colour>,
}

/// An element as read from a layout, and as made in each case that is a made chip.
pub(super) struct ReadElement<'a> {
    pub widths: &'a dyn PillarRows,
    /// What chips are made of, if the pillars are held as a map.
    drawn: Option<DrawnElement<'a>>,
    pub made: Vec<Option<AsBuiltElement>>,
}

impl<'a> ElementSimulator<'a> {
    /// Look up the cells at all wavelengths.
    pub fn new(
        design: &'a Design,
        lattice: Lattice,
        cases: &SimulationCases<'a>,
        accuracy: Accuracy,
        part_bytes: Option<usize>,
    ) -> Result<Self> {
        let cases: Vec<_> = cases.iter().collect();
        let colour = |&wavelength_um: &f64| {
            let at = |case: &SimulationCase<'_>| {
                Ok(CaseAt {
                    fidelity: case.fidelity(),
                    full: case.full_transmission(wavelength_um)?,
                    tables: match case {
                        SimulationCase::Made(_) => None,
                        SimulationCase::Cell(cell) => {
                            let (largest_number, light) = (largest_number(design), design.verify.light());
                            let kind = lattice.kind();
                            Some(TransmissionTables::new(
                                *cell,
                                kind,
                                wavelength_um,
                                largest_number,
                                light,
                            )?)
                        }
                    },
                })
            };
            Ok(Colour {
                wavelength_um,
                cases: cases.iter().map(at).collect::<Result<_>>()?,
            })
        };
        Ok(Self {
            design,
            lattice,
            accuracy,
            part_bytes,
            colours: design.verify.wavelengths_um.iter().map(colour).collect::<Result<_>>()?,
            cases,
        })
    }

    /// Solve the cells for light as it arrives at these elements, if the design asks for it.
    ///
    /// # Errors
    /// If a cell has no answer, or the user stopped it.
    pub fn add_directions(&mut self, chosen: &[Chosen], progress: &dyn Progress) -> Result<()> {
        self.add_neighbours(chosen, progress)?;
        let cells = self
            .cases
            .iter()
            .filter(|c| matches!(c, SimulationCase::Cell(_)))
            .count();
        if !self.as_lit() || cells == 0 {
            return Ok(());
        }
        let lit: Vec<(&Element, FieldAngle)> = chosen.iter().flat_map(all_angles).collect();
        progress.begin(
            "solving cells as they are lit",
            (lit.len() * self.colours.len() * cells) as u64,
        );
        for colour in &mut self.colours {
            let waves = all_arriving(&lit, colour.wavelength_um)?;
            for (at, case) in colour.cases.iter_mut().zip(&self.cases) {
                if let (Some(tables), SimulationCase::Cell(cell)) = (&mut at.tables, case) {
                    tables.add_directions(*cell, &waves, largest_number(self.design), progress)?;
                }
            }
        }
        Ok(())
    }

    /// Obtain what pillars transmit among unlike neighbours, from the cells that know: in light from the middle of an
    /// element's field, where orders are told, and from each of its field angles if the design asks for cells as they are lit.
    fn add_neighbours(&mut self, chosen: &[Chosen], progress: &dyn Progress) -> Result<()> {
        let mut lit: Vec<(&Element, FieldAngle)> = chosen.iter().map(|one| (&one.element, MIDDLE)).collect();
        if self.as_lit() {
            lit.extend(chosen.iter().flat_map(all_angles));
        }
        for colour in &mut self.colours {
            let waves = all_arriving(&lit, colour.wavelength_um)?;
            for (at, case) in colour.cases.iter_mut().zip(&self.cases) {
                if let (Some(tables), SimulationCase::Cell(cell)) = (&mut at.tables, case) {
                    tables.add_neighbours(*cell, &waves, progress)?;
                }
            }
        }
        Ok(())
    }

    /// The light that cells with unlike neighbours are solved for where this wave arrives.
    fn lit(&self, element: &Element, wave: &PlaneWave) -> Result<PlaneWave> {
        if self.as_lit() {
            return Ok(*wave);
        }
        arriving(element, wave.wavelength_um, MIDDLE)
    }

    /// The lens with the perfect phase for the place where a chief ray lands, all sites of modulus one: what Strehl ratios
    /// are against.
    fn perfect(&self, element: &Element, phase: &ElementPhase<'_>, chief_um: [f64; 2], wavelength_um: f64) -> IdealPsf {
        let [x, y] = chief_um;
        let focus = [x, y, self.design.lens_of(element).focal_length_um];
        open_matched(self.design, element, phase, focus, wavelength_um)
    }

    /// Number of wavelengths and angles of one element.
    pub fn psfs(&self, one: &Chosen) -> usize {
        self.colours.len() * one.angles.len()
    }

    fn as_lit(&self) -> bool {
        self.design.verify.incidence == CellIncidence::AsLit
    }

    /// An element as read, with what each made chip makes of it.
    ///
    /// # Errors
    /// As [`AsBuiltElement::new`]; also if a chip is to be made of pillars that are not held as a map.
    pub fn read<'w>(&self, element: &Element, widths: &'w dyn PillarRows) -> Result<ReadElement<'w>> {
        let drawn = widths.held().map(|map| {
            let drawn = DrawnElement::new(map, self.design.aperture_radius_of_um(element));
            drawn.of_shape(self.design.cell.shape).placed(element.centre_um())
        });
        let made = |case: &SimulationCase<'_>| match (case, &drawn) {
            (SimulationCase::Cell(_), _) => Ok(None),
            (SimulationCase::Made(chip), Some(drawn)) => chip.element(drawn).map(Some),
            (SimulationCase::Made(_), None) => Err(not_held()),
        };
        Ok(ReadElement {
            widths,
            made: self.cases.iter().map(made).collect::<Result<_>>()?,
            drawn,
        })
    }

    /// All wavelengths and field angles of one element, those of the design first.
    ///
    /// # Errors
    /// If a cell cannot be solved, a direction is too steep, or the user stopped it.
    pub fn simulate(
        &self,
        one: &Chosen,
        phase: &ElementPhase<'_>,
        read: &ReadElement<'_>,
        progress: &dyn Progress,
    ) -> Result<Vec<PsfPair>> {
        let element = &one.element;
        let (own, of_copies) = one.angles.split_at(self.design.verify.field_angles.len());
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
        let mut tasks = Vec::new();
        for angles in [own, of_copies] {
            for colour in &self.colours {
                for &(field, copy) in angles {
                    let wave = arriving(element, colour.wavelength_um, field)?;
                    let views = self.views(read, &wave, progress)?;
                    tasks.push(Task {
                        colour,
                        field,
                        copy,
                        wave,
                        views,
                    });
                }
            }
        }
        tasks
            .into_par_iter()
            .map_init(Scratch::default, |scratch, task| {
                if progress.stopped() {
                    return Err(Error::Interrupted);
                }
                let pair = self.pair(&task, (element, phase), designed, read.widths, scratch);
                progress.advance(1);
                pair
            })
            .collect()
    }

    /// A read element as each made chip has it in the light of a wave; nothing for the cells.
    fn views<'r>(
        &self,
        read: &'r ReadElement<'_>,
        wave: &PlaneWave,
        progress: &dyn Progress,
    ) -> Result<Vec<Option<AsBuiltOptics<'r>>>> {
        let pairs = self.cases.iter().zip(&read.made);
        pairs
            .map(|(case, made)| match (case, made) {
                (SimulationCase::Made(chip), Some(made)) => chip.view(made, wave, self.as_lit(), progress).map(Some),
                _ => Ok(None),
            })
            .collect()
    }

    fn pair(
        &self,
        task: &Task<'_>,
        (element, phase): (&Element, &ElementPhase<'_>),
        designed: &dyn Aperture,
        widths: &dyn PillarRows,
        scratch: &mut Scratch,
    ) -> Result<PsfPair> {
        let (lens, spec) = (self.design.lens_of(element), &self.design.verify);
        let Task {
            colour, field, wave, ..
        } = task;
        let wavelength_um = colour.wavelength_um;
        let lit = self.lit(element, wave)?;
        let chief = landing_um(&element.wedge, wave, lens.focal_length_um)?;
        let window = Window::about(
            chief,
            self.lattice.pitch_um(),
            spec.window_samples,
            lens.focal_length_um,
        );
        let fold = FoldedPropagator::plan(self.lattice, lens.radius_um(), wavelength_um, window, self.accuracy)?;
        let fold = match self.part_bytes {
            Some(bytes) => fold.within(bytes),
            None => fold,
        };
        let frequencies = PixelFrequencies::of(spec.pixel_um);
        let (drawn, reported) = (frequencies.drawn(), frequencies.reported());
        let designed = Psf::formed(&fold, designed, wave, &drawn, scratch)?;
        let perfect = self.perfect(element, phase, chief, wavelength_um);
        let mut extracted = Vec::new();
        let mut judged = None;
        for (at, view) in colour.cases.iter().zip(&task.views) {
            // Curves are drawn of the case that judges alone.
            let lp_mm: &[f64] = if judged.is_none() { &drawn } else { &reported };
            let found = match (&at.tables, view) {
                (_, Some(view)) => view.psf(window, self.accuracy, lp_mm, scratch)?,
                (Some(tables), None) => tables.psf(widths, wave, &lit, &fold, lp_mm, scratch)?,
                (None, None) => unreachable!("a case is a cell or a made chip"),
            };
            let matched = perfect.scaled(at.full);
            extracted.push((at.fidelity, PsfResult::of(&found, &matched, spec.pixel_um)));
            judged.get_or_insert(found);
        }
        let judged = judged.expect("the case that judges is the first");
        let images = (field.x_deg == 0.0 && field.y_deg == 0.0).then(|| {
            Box::new(PsfImages {
                designed: picture(&designed, 1.0),
                extracted: picture(&judged, colour.cases[0].full),
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
    colour: &'a Colour,
    field: FieldAngle,
    copy: Option<CopyAngle>,
    wave: PlaneWave,
    /// Of each case that is a made chip.
    views: Vec<Option<AsBuiltOptics<'a>>>,
}

/// The light of some elements from some field angles.
fn all_arriving(lit: &[(&Element, FieldAngle)], wavelength_um: f64) -> Result<Vec<PlaneWave>> {
    let waves = lit.iter();
    waves
        .map(|(element, field)| arriving(element, wavelength_um, *field))
        .collect()
}

/// An element with each of its field angles.
fn all_angles(one: &Chosen) -> impl Iterator<Item = (&Element, FieldAngle)> {
    one.angles.iter().map(|(field, _)| (&one.element, *field))
}

/// Where the chief ray of an element lands from one of its field angles, from the element's axis (um).
///
/// # Errors
/// If it does not reach the sensor.
pub(super) fn landing(element: &Element, wavelength_um: f64, field: FieldAngle, distance_um: f64) -> Result<[f64; 2]> {
    let wave = arriving(element, wavelength_um, field)?;
    Ok(landing_um(&element.wedge, &wave, distance_um)?)
}

/// The wave that arrives at an element from one of its field angles.
fn arriving(element: &Element, wavelength_um: f64, field: FieldAngle) -> Result<PlaneWave> {
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

/// Widths that tables go to.
fn largest_number(design: &Design) -> u16 {
    design.cell.most()
}

/// A PSF per unit of arriving power, so that cells with and without amplitude share one scale.
fn picture(psf: &Psf, full_transmission: f64) -> Array2<f32> {
    let power = full_transmission * full_transmission;
    psf.values.mapv(|v| (v / power) as f32)
}
