//! The PSFs of one element: of its unrounded design phase, and of its pillars by each cell.

use ndarray::Array2;
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

use super::premise::{Cells, Premise};
use super::spot::{Images, Orders, Spot, SpotPair};
use metalith_core::Progress;
use metalith_core::{Error, Result};
use metalith_core::{Lattice, WidthMap};
use metalith_design::array::WidthRule;
use metalith_design::phase::ElementPhase;
use metalith_design::{CellIncidence, Design, Element, FieldAngle};
use metalith_wave::propagation::{incident, landing_um};
use metalith_wave::{
    Accuracy, Aperture, Fold, Matched, PhaseFunction, Pillars, PlaneWave, Propagator, Psf, Scratch, Window,
};

/// One wavelength, with what all elements and angles share.
struct Colour {
    wavelength_um: f64,
    /// The lens with the perfect phase, all sites of modulus one.
    perfect: Matched,
    /// Of each premise.
    cells: Vec<Cells>,
}

/// What the elements of a design are simulated with.
pub(super) struct Bench<'a> {
    design: &'a Design,
    lattice: Lattice,
    premises: &'a [Premise<'a>],
    accuracy: Accuracy,
    colours: Vec<Colour>,
}

impl<'a> Bench<'a> {
    /// Look up the cells at all wavelengths.
    pub fn new(design: &'a Design, lattice: Lattice, premises: &'a [Premise<'a>], accuracy: Accuracy) -> Result<Self> {
        let open = PhaseFunction {
            lattice,
            radius_um: design.lens.radius_um(),
            amplitude: 1.0,
            phase_rad: |_, _| 0.0,
        };
        let colour = |&wavelength_um: &f64| {
            Ok(Colour {
                wavelength_um,
                perfect: Matched::of(&open, [0.0, 0.0, design.lens.focal_length_um], wavelength_um, 1.0),
                cells: premises
                    .iter()
                    .map(|p| Cells::new(p.cell, wavelength_um, widest_nm(design)))
                    .collect::<Result<_>>()?,
            })
        };
        Ok(Self {
            design,
            lattice,
            premises,
            accuracy,
            colours: design.verify.wavelengths_um.iter().map(colour).collect::<Result<_>>()?,
        })
    }

    /// Solve the cells for light as it arrives at these elements, if the design asks for it.
    ///
    /// # Errors
    /// If a cell has no answer, or the user stopped it.
    pub fn look_along(&mut self, elements: &[Element], progress: &dyn Progress) -> Result<()> {
        let spec = &self.design.verify;
        if spec.incidence == CellIncidence::Normal {
            return Ok(());
        }
        let solves = elements.len() * spec.field_angles.len() * self.colours.len() * self.premises.len();
        progress.begin("solving cells as they are lit", solves as u64);
        for colour in &mut self.colours {
            let wavelength_um = colour.wavelength_um;
            let waves = elements
                .iter()
                .flat_map(|e| spec.field_angles.iter().map(move |a| arriving(e, wavelength_um, *a)))
                .collect::<Result<Vec<_>>>()?;
            for (cells, premise) in colour.cells.iter_mut().zip(self.premises) {
                let seen = waves.iter().map(|w| premise.tilted(w)).collect::<Vec<_>>();
                cells.look_along(premise.cell, &seen, widest_nm(self.design), progress)?;
            }
        }
        Ok(())
    }

    /// Number of wavelengths and angles of one element.
    pub fn spots(&self) -> usize {
        self.colours.len() * self.design.verify.field_angles.len()
    }

    /// Where light goes, at each wavelength by each cell, along the normal.
    pub fn orders(&self, rule: &WidthRule) -> Vec<Orders> {
        let of = |colour: &Colour| {
            let at = |c: &Cells| Orders::of(rule, colour.wavelength_um, c.fidelity, c.full, &c.normal);
            colour.cells.iter().map(at).collect::<Vec<_>>()
        };
        self.colours.iter().flat_map(of).collect()
    }

    /// All wavelengths and field angles of one element.
    pub fn simulate(
        &self,
        element: &Element,
        phase: &ElementPhase<'_>,
        widths: &WidthMap,
        progress: &dyn Progress,
    ) -> Result<Vec<SpotPair>> {
        let angles = &self.design.verify.field_angles;
        let tasks = self
            .colours
            .iter()
            .flat_map(|c| angles.iter().map(move |a| (c, *a)))
            .collect::<Vec<_>>();
        tasks
            .into_par_iter()
            .map_init(Scratch::default, |scratch, (colour, angle)| {
                if progress.stopped() {
                    return Err(Error::Interrupted);
                }
                let pair = self.pair(colour, angle, element, phase, widths, scratch);
                progress.advance(1);
                pair
            })
            .collect()
    }

    fn pair(
        &self,
        colour: &Colour,
        field: FieldAngle,
        element: &Element,
        phase: &ElementPhase<'_>,
        widths: &WidthMap,
        scratch: &mut Scratch,
    ) -> Result<SpotPair> {
        let (lens, spec) = (&self.design.lens, &self.design.verify);
        let wavelength_um = colour.wavelength_um;
        let wave = arriving(element, wavelength_um, field)?;
        let chief = landing_um(&element.wedge, &wave, lens.focal_length_um)?;
        let plan = |distance_um| {
            let window = Window::about(chief, self.lattice.pitch_um(), spec.window_samples, distance_um);
            Fold::plan(self.lattice, lens.radius_um(), wavelength_um, window, self.accuracy)
        };
        let fold = plan(lens.focal_length_um)?;
        let window = *fold.window();
        let designed = Psf::of(&fold.field(&DesignPhase(phase, lens.radius_um()), &wave, scratch)?);
        let mut extracted = Vec::new();
        let mut judged = None;
        for (premise, cells) in self.premises.iter().zip(&colour.cells) {
            let moved = if premise.in_place() {
                None
            } else {
                Some(plan(lens.focal_length_um + premise.gap_um)?)
            };
            let (fold, wave) = (moved.as_ref().unwrap_or(&fold), premise.tilted(&wave));
            let mut of = |table: &Vec<Complex64>| {
                Ok::<_, Error>(Psf::of(&fold.field(&Pillars::new(widths, table)?, &wave, scratch)?))
            };
            // The sensor's samples are where they were; only how far it is has changed.
            let found = Psf {
                window,
                ..Psf::mean(cells.tables(&wave).iter().map(&mut of).collect::<Result<_>>()?)
            };
            let matched = scaled(&colour.perfect, cells.full);
            extracted.push((cells.fidelity, Spot::of(&found, &matched, spec.pixel_um)));
            judged.get_or_insert(found);
        }
        let judged = judged.expect("there is a cell that judges");
        let images = (field.x_deg == 0.0 && field.y_deg == 0.0).then(|| {
            Box::new(Images {
                designed: picture(&designed, 1.0),
                extracted: picture(&judged, colour.cells[0].full),
                step_um: window.step_um,
            })
        });
        Ok(SpotPair {
            wavelength_um,
            field,
            incidence_sin: [wave.sin_x, wave.sin_y],
            chief_ray_um: chief,
            relabelled: fold.fade().relabelled,
            psf_difference: judged.shape_difference(&designed)?,
            designed: Spot::of(&designed, &colour.perfect, spec.pixel_um),
            extracted,
            images,
        })
    }
}

/// The wave that arrives at an element from one of its field angles.
fn arriving(element: &Element, wavelength_um: f64, field: FieldAngle) -> Result<PlaneWave> {
    let field_rad = [field.x_deg, field.y_deg].map(f64::to_radians);
    Ok(incident(&element.wedge, wavelength_um, field_rad)?)
}

/// Widths that tables go to: no pillar is wider than the pitch.
fn widest_nm(design: &Design) -> u16 {
    design.cell.pitch_nm as u16
}

/// The same with sites of another modulus.
fn scaled(matched: &Matched, full_transmission: f64) -> Matched {
    let power = full_transmission * full_transmission;
    Matched {
        peak: matched.peak * power,
        power_um2: matched.power_um2 * power,
    }
}

/// A PSF per unit of arriving power, so that cells with and without amplitude share one scale.
fn picture(psf: &Psf, full_transmission: f64) -> Array2<f32> {
    let power = full_transmission * full_transmission;
    psf.values.mapv(|v| (v / power) as f32)
}

/// The phase of an element before mapping and rounding, as an aperture of modulus one.
struct DesignPhase<'a>(&'a ElementPhase<'a>, f64);

impl Aperture for DesignPhase<'_> {
    fn lattice(&self) -> Lattice {
        self.0.lattice()
    }

    fn radius_um(&self) -> f64 {
        self.1
    }

    fn fill_row(&self, iy: usize, row: &mut [Complex32]) {
        for (ix, t) in row.iter_mut().enumerate() {
            *t = self.0.wrapped(ix, iy).map_or(Complex32::ZERO, |u| {
                let (sin, cos) = (std::f64::consts::TAU * u).sin_cos();
                Complex32::new(cos as f32, sin as f32)
            });
        }
    }
}
