//! Metrics of the PSFs of one element: designed beside extracted, and where light goes.

use ndarray::Array2;
use num_complex::Complex64;
use serde::Serialize;

use super::distinct_elements::CopyAngle;
use metalith_cell::{Fidelity, PolarisedLight, PolarisedTables};
use metalith_design::array::PillarRule;
use metalith_design::{Element, FieldAngle};
use metalith_wave::psf::{IdealPsf, Psf, PsfMetrics, order_shares, pixel_mtf};

/// Samples of the phase that the orders of a mapping are computed from: many times the number of widths.
const ORDER_SAMPLES: usize = 4096;

/// Metrics of one PSF on the sensor.
#[derive(Clone, Debug, Serialize)]
pub struct PsfResult {
    #[serde(flatten)]
    pub metrics: PsfMetrics,
    /// Line pairs a millimetre and MTF, pixel included, mean of x and y, for pictures.
    #[serde(skip)]
    pub mtf_curve: Vec<(f64, f64)>,
}

impl PsfResult {
    pub fn of(psf: &Psf, matched: &IdealPsf, pixel_um: f64) -> Self {
        let mean = |f: f64| 0.5 * (psf.contrast(0, f) + psf.contrast(1, f)) * pixel_mtf(pixel_um, f);
        let known = psf.otf.iter().flat_map(|otf| otf.lp_mm.iter().copied());
        Self {
            metrics: psf.metrics(matched, pixel_um),
            mtf_curve: std::iter::once((0.0, 1.0)).chain(known.map(|f| (f, mean(f)))).collect(),
        }
    }

    /// MTF with the pixel at half and at all of the finest frequency that it tells, mean of x and y.
    pub fn mtf(&self) -> [f64; 2] {
        [self.metrics.mtf_half_nyquist_pixel, self.metrics.mtf_nyquist_pixel].map(|m| 0.5 * (m[0] + m[1]))
    }
}

/// Design and layout side by side, for one wavelength and field angle.
#[derive(Clone, Debug, Serialize)]
pub struct PsfPair {
    pub wavelength_um: f64,
    /// Counted from where the element looks.
    pub field: FieldAngle,
    /// First copy of the element, and its field angle, where the design asks copies alone for this light. The figures
    /// are of the element that is simulated, turned as the copy is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub copy: Option<CopyAngle>,
    /// Direction sines of the light as it arrives at the chip.
    pub incidence_sin: [f64; 2],
    /// Place where the chief ray meets the sensor, from the element's axis (um).
    pub chief_ray_um: [f64; 2],
    /// Frequency bins that had to be relabelled towards the mean ray.
    pub relabelled: u64,
    /// Figures of the target phase.
    pub designed: PsfResult,
    /// Figures of the pillars that were read back, in each case; the first case judges.
    pub extracted: Vec<(Fidelity, PsfResult)>,
    /// Rms difference of the judged PSF from the designed one, both of the same energy in the window, over the
    /// rms of the designed one.
    pub psf_difference: f64,
    #[serde(skip)]
    pub(super) images: Option<Box<PsfImages>>,
}

/// Two PSFs on the window about the chief ray, per unit of arriving power, so that cells with and without amplitude
/// share one scale. Row index along +y.
#[derive(Clone, Debug)]
pub struct PsfImages {
    /// PSF of the target phase.
    pub designed: Array2<f32>,
    /// PSF of the layout, in the case that judges.
    pub extracted: Array2<f32>,
    /// Distance of the samples (um).
    pub step_um: f64,
}

impl PsfPair {
    /// Wavelength and field angle of the element that is simulated, in words.
    pub fn place(&self) -> String {
        light_words(self.wavelength_um, self.field)
    }

    /// The field angle of the design that it is for: of a copy, if the design asks copies alone for this light.
    pub fn asked(&self) -> FieldAngle {
        self.copy.map_or(self.field, |copy| copy.field)
    }

    /// Element, wavelength and field angle as the design asks for them, in words; `element` is that which is simulated.
    pub fn label(&self, element: &Element) -> String {
        asked_words(element, self.copy.as_ref(), self.wavelength_um, self.field)
    }

    /// The metrics of the case that judges.
    pub fn judged(&self) -> &PsfResult {
        &self.extracted[0].1
    }

    /// Strehl of the layout over that of the design phase.
    pub fn strehl_ratio(&self) -> f64 {
        self.judged().metrics.strehl / self.designed.metrics.strehl
    }

    /// Distance of the two centroids (um).
    pub fn centroid_shift_um(&self) -> f64 {
        let (a, b) = (self.judged().metrics.centroid_um, self.designed.metrics.centroid_um);
        (a[0] - b[0]).hypot(a[1] - b[1])
    }

    /// Largest difference of the MTF at the two frequencies.
    pub fn mtf_difference(&self) -> f64 {
        let (a, b) = (self.judged().mtf(), self.designed.mtf());
        (a[0] - b[0]).abs().max((a[1] - b[1]).abs())
    }

    /// The PSFs themselves, kept for the middle of the field.
    pub fn images(&self) -> Option<&PsfImages> {
        self.images.as_deref()
    }
}

/// Wavelength (um) and field angle in words.
fn light_words(wavelength_um: f64, field: FieldAngle) -> String {
    let nm = wavelength_um * 1e3;
    match field {
        FieldAngle { x_deg, y_deg: 0.0 } => format!("{nm:.0} nm, {x_deg}°"),
        FieldAngle { x_deg, y_deg } => format!("{nm:.0} nm, ({x_deg}, {y_deg})°"),
    }
}

/// Element, wavelength (um) and field angle as the design asks for them, in words: those of a copy, if copies alone are asked.
pub(super) fn asked_words(
    element: &Element,
    copy: Option<&CopyAngle>,
    wavelength_um: f64,
    field: FieldAngle,
) -> String {
    let (element, field) = copy.map_or((element, field), |copy| (&copy.element, copy.field));
    format!("element {}, {}", element.label(), light_words(wavelength_um, field))
}

/// Orders that the mapping sends light into by its own transmission, at one wavelength, by one cell.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OrderEfficiencies {
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
    /// Share, for pillars that change polarisation, that leaves in the hand in which it arrived and reaches the sensor:
    /// it passes the element as if there were no phase. The shares above are what is converted of the hand that is
    /// focused, through an analyser if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unconverted: Option<f64>,
    /// Share of the other hand, where it arrives too, that such pillars convert and that reaches the sensor: it
    /// diverges.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub diverging: Option<f64>,
    /// Share of the light, for the coupled model, that its sum over pairs puts elsewhere, in the light of this element,
    /// than supercells that were left out of its fit. Mean over their sites and both polarisations.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_out: Option<f64>,
}

impl OrderEfficiencies {
    /// The widths that a mapping draws (nm), rising.
    pub(super) fn drawn_nm(rule: &PillarRule) -> Vec<u16> {
        let all: std::collections::BTreeSet<u16> = (0..ORDER_SAMPLES).map(|i| rule.sample(i, ORDER_SAMPLES)).collect();
        all.into_iter().collect()
    }

    /// Orders of a mapping, by the table of a cell at one wavelength; `full` is |t| of a cell that passes everything.
    pub(super) fn of(
        rule: &PillarRule,
        wavelength_um: f64,
        fidelity: Fidelity,
        full: f64,
        table: &[Complex64],
    ) -> Self {
        let t = (0..ORDER_SAMPLES)
            .map(|i| table[usize::from(rule.sample(i, ORDER_SAMPLES))])
            .collect::<Vec<_>>();
        let shares = order_shares(&t, full, &[0, 1, 2]);
        Self {
            wavelength_um,
            fidelity,
            zero: shares[0],
            first: shares[1],
            second: shares[2],
            transmitted: t.iter().map(Complex64::norm_sqr).sum::<f64>() / (full * full * t.len() as f64),
            unconverted: None,
            diverging: None,
            left_out: None,
        }
    }

    /// Orders of pillars that distinguish polarisations, in light of which one or both arrive, as shares of all of it.
    /// Over a whole turn of the phase, light that is converted of one hand does not interfere with what is not of the
    /// other.
    pub(super) fn of_light(
        self,
        tables: &PolarisedTables,
        light: PolarisedLight,
        rule: &PillarRule,
        full: f64,
    ) -> Self {
        let power = |table: Vec<Complex64>| {
            let power = (0..ORDER_SAMPLES).map(|i| table[usize::from(rule.sample(i, ORDER_SAMPLES))].norm_sqr());
            power.sum::<f64>() / (full * full * ORDER_SAMPLES as f64)
        };
        let passed = |order: i32| {
            let passed = tables.passed_in(order, light);
            (!passed.is_empty()).then(|| passed.into_iter().map(power).sum())
        };
        let focused = light.focused_share(tables.focused());
        Self {
            first: self.first * focused,
            zero: self.zero * focused,
            second: self.second * focused,
            transmitted: self.transmitted * focused,
            unconverted: passed(0),
            diverging: passed(-1),
            ..self
        }
    }
}
