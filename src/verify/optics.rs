//! The PSFs of one element: of its unrounded design phase, and of its pillars by each cell.

use ndarray::Array2;
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;
use serde::Serialize;

use crate::array::WidthRule;
use crate::cell::{CellModel, Fidelity};
use crate::design::{Design, Element, FieldAngle};
use crate::error::{Error, Result};
use crate::image::{Matched, Psf, PsfMeasures, incident, landing_um, order_shares, pixel_mtf};
use crate::lattice::{Lattice, WidthMap};
use crate::phase::ElementPhase;
use crate::progress::Progress;
use crate::wave::{Accuracy, Aperture, Fold, PhaseFunction, Pillars, Propagator, Scratch, Window};

/// Greatest frequency of an MTF curve [line pairs a millimetre], and its points.
const CURVE_END_LP_MM: f64 = 120.0;
const CURVE_POINTS: u32 = 60;
/// Samples of the phase that the orders of a mapping are computed from: many times the number of widths.
const ORDER_SAMPLES: usize = 4096;

/// What one PSF is worth to the sensor.
#[derive(Clone, Debug, Serialize)]
pub struct Spot {
    #[serde(flatten)]
    pub measures: PsfMeasures,
    /// Line pairs a millimetre and MTF, pixel included, mean of x and y, for pictures.
    #[serde(skip)]
    pub mtf_curve: Vec<(f64, f64)>,
}

impl Spot {
    fn of(psf: &Psf, matched: &Matched, pixel_um: f64) -> Self {
        let frequencies = (0..=CURVE_POINTS)
            .map(|k| CURVE_END_LP_MM * f64::from(k) / f64::from(CURVE_POINTS))
            .collect::<Vec<_>>();
        let [x, y] = [0, 1].map(|axis| psf.mtf_curve(axis, &frequencies));
        let mean = |k: usize| 0.5 * (x[k] + y[k]) * pixel_mtf(pixel_um, frequencies[k]);
        Self {
            measures: psf.measures(matched, pixel_um),
            mtf_curve: frequencies.iter().enumerate().map(|(k, f)| (*f, mean(k))).collect(),
        }
    }

    /// MTF with the pixel at 42.7 and at 85.3 line pairs a millimetre, mean of x and y.
    pub fn mtf(&self) -> [f64; 2] {
        [self.measures.mtf_half_nyquist_pixel, self.measures.mtf_nyquist_pixel].map(|m| 0.5 * (m[0] + m[1]))
    }
}

/// Design and layout side by side, for one wavelength and field angle.
#[derive(Clone, Debug, Serialize)]
pub struct SpotPair {
    pub wavelength_um: f64,
    /// Counted from where the element looks.
    pub field: FieldAngle,
    /// Direction sines of the light as it arrives at the chip.
    pub incidence_sin: [f64; 2],
    /// Where the chief ray meets the sensor, from the element's axis [um].
    pub chief_ray_um: [f64; 2],
    /// Frequency bins that had to be relabelled towards the mean ray.
    pub relabelled: u64,
    /// Of the unrounded design phase.
    pub designed: Spot,
    /// Of the pillars that were read back, by each cell; the first one judges.
    pub extracted: Vec<(Fidelity, Spot)>,
    /// Rms difference of the judged PSF from the designed one, both of the same energy in the window, over the
    /// rms of the designed one.
    pub psf_difference: f64,
    #[serde(skip)]
    images: Option<Box<Images>>,
}

#[derive(Clone, Debug)]
struct Images {
    designed: Array2<f32>,
    extracted: Array2<f32>,
    step_um: f64,
}

impl SpotPair {
    /// Wavelength and field angle in words.
    pub fn place(&self) -> String {
        let nm = self.wavelength_um * 1e3;
        match self.field {
            FieldAngle { x_deg, y_deg: 0.0 } => format!("{nm:.0} nm, {x_deg}°"),
            FieldAngle { x_deg, y_deg } => format!("{nm:.0} nm, ({x_deg}, {y_deg})°"),
        }
    }

    pub(super) fn label(&self, element: &Element) -> String {
        format!("element {}, {}", element.label(), self.place())
    }

    /// The spot of the cell that judges.
    pub fn judged(&self) -> &Spot {
        &self.extracted[0].1
    }

    /// Strehl of the layout over that of the design phase.
    pub fn strehl_ratio(&self) -> f64 {
        self.judged().measures.strehl / self.designed.measures.strehl
    }

    /// Distance of the two centroids [um].
    pub fn centroid_shift_um(&self) -> f64 {
        let (a, b) = (self.judged().measures.centroid_um, self.designed.measures.centroid_um);
        (a[0] - b[0]).hypot(a[1] - b[1])
    }

    /// Largest difference of the MTF at the two frequencies.
    pub fn mtf_difference(&self) -> f64 {
        let (a, b) = (self.judged().mtf(), self.designed.mtf());
        (a[0] - b[0]).abs().max((a[1] - b[1]).abs())
    }

    pub(super) fn images(&self) -> Option<(&Array2<f32>, &Array2<f32>, f64)> {
        self.images.as_ref().map(|i| (&i.designed, &i.extracted, i.step_um))
    }
}

/// Where light goes by the mapping's own account, at one wavelength, by one cell.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Orders {
    pub wavelength_um: f64,
    pub fidelity: Fidelity,
    /// Share of the arriving light in the first order, which makes the image.
    pub first: f64,
    /// Share in the zero order, which passes as if there were no phase.
    pub zero: f64,
    /// Share in the second order.
    pub second: f64,
    /// Share in all orders of the mapping: the rest is reflected, absorbed or diffracted by the lattice itself.
    pub transmitted: f64,
}

/// One wavelength, with what all elements and angles share.
struct Colour {
    wavelength_um: f64,
    /// The lens with the perfect phase, all sites of modulus one.
    perfect: Matched,
    /// |t| of a cell that passes everything, and the table by width, of each cell.
    cells: Vec<(Fidelity, f64, Vec<Complex64>)>,
}

/// What the elements of a design are simulated with.
pub(super) struct Bench<'a> {
    design: &'a Design,
    lattice: Lattice,
    accuracy: Accuracy,
    colours: Vec<Colour>,
}

impl<'a> Bench<'a> {
    /// Look up the cells at all wavelengths.
    pub fn new(design: &'a Design, lattice: Lattice, cells: &[&dyn CellModel], accuracy: Accuracy) -> Result<Self> {
        let widest = design.cell.pitch_nm as u16;
        let open = PhaseFunction {
            lattice,
            radius_um: design.lens.radius_um(),
            amplitude: 1.0,
            phase_rad: |_, _| 0.0,
        };
        let colour = |&wavelength_um: &f64| {
            let of = |cell: &&dyn CellModel| {
                let table = cell.transmissions(wavelength_um, widest)?;
                Ok((cell.fidelity(), cell.full_transmission(wavelength_um)?, table))
            };
            Ok(Colour {
                wavelength_um,
                perfect: Matched::of(&open, [0.0, 0.0, design.lens.focal_length_um], wavelength_um, 1.0),
                cells: cells.iter().map(of).collect::<Result<_>>()?,
            })
        };
        Ok(Self {
            design,
            lattice,
            accuracy,
            colours: design.verify.wavelengths_um.iter().map(colour).collect::<Result<_>>()?,
        })
    }

    /// Number of wavelengths and angles of one element.
    pub fn spots(&self) -> usize {
        self.colours.len() * self.design.verify.field_angles.len()
    }

    /// Where light goes, at each wavelength by each cell.
    pub fn orders(&self, rule: &WidthRule) -> Vec<Orders> {
        let of = |colour: &Colour| {
            let at = |(fidelity, full, table): &(Fidelity, f64, Vec<Complex64>)| {
                let u = |i: usize| (i as f64 + 0.5) / ORDER_SAMPLES as f64;
                let t = (0..ORDER_SAMPLES)
                    .map(|i| table[usize::from(rule.width_nm(u(i)))])
                    .collect::<Vec<_>>();
                let shares = order_shares(&t, *full, &[0, 1, 2]);
                Orders {
                    wavelength_um: colour.wavelength_um,
                    fidelity: *fidelity,
                    zero: shares[0],
                    first: shares[1],
                    second: shares[2],
                    transmitted: t.iter().map(Complex64::norm_sqr).sum::<f64>() / (full * full * t.len() as f64),
                }
            };
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
        let wave = incident(
            &element.wedge,
            wavelength_um,
            [field.x_deg, field.y_deg].map(f64::to_radians),
        )?;
        let chief = landing_um(&element.wedge, &wave, lens.focal_length_um)?;
        let window = Window::about(
            chief,
            self.lattice.pitch_um(),
            spec.window_samples,
            lens.focal_length_um,
        );
        let fold = Fold::plan(self.lattice, lens.radius_um(), wavelength_um, window, self.accuracy)?;
        let mut psf = |aperture: &dyn Aperture| Ok::<_, Error>(Psf::of(&fold.field(aperture, &wave, scratch)?));
        let design = DesignPhase(phase, lens.radius_um());
        let designed = psf(&design)?;
        let mut extracted = Vec::new();
        let mut judged = None;
        for (fidelity, full, table) in &colour.cells {
            let found = psf(&Pillars::new(widths, table)?)?;
            extracted.push((
                *fidelity,
                Spot::of(&found, &scaled(&colour.perfect, *full), spec.pixel_um),
            ));
            judged.get_or_insert(found);
        }
        let judged = judged.expect("there is a cell that judges");
        let images = (field.x_deg == 0.0 && field.y_deg == 0.0).then(|| {
            Box::new(Images {
                designed: picture(&designed, 1.0),
                extracted: picture(&judged, colour.cells[0].1),
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
