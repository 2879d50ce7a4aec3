//! The PSF of a lens as a differentiable function of the phases or the widths of its pillars.

use std::f64::consts::TAU;

use metalith_core::{Error, Result};
use metalith_pillars::Lattice;
use metalith_wave::kernels::cis_all;
use metalith_wave::psf::phase_cotangent;
use metalith_wave::{Accuracy, DifferentiablePsf, PsfPullback, Scratch, TransmissionMap, Window};
use ndarray::{Array2, Zip};
use num_complex::Complex32;

use crate::TransmissionCurve;

/// The quantity that a lens is given by, site by site.
#[derive(Clone, Debug)]
pub enum PillarVariable {
    /// Phase of the transmission (rad), whose modulus is one.
    Phase,
    /// Width of the pillar (nm), with what pillars transmit.
    Width(TransmissionCurve),
}

/// The PSF of lenses on one lattice, at one wavelength and on one window.
pub struct LensPsf {
    psf: DifferentiablePsf,
    variable: PillarVariable,
    /// Factor of the transmission of each site, zero where nothing passes.
    amplitude: Array2<f32>,
    radius_um: f64,
}

/// A PSF with what its derivatives are computed from.
pub struct LensPullback {
    lens: TransmissionMap,
    /// Widths that the PSF is of, where lenses are given by them.
    widths_nm: Option<Array2<f64>>,
    pullback: PsfPullback,
}

/// Derivatives of a merit of a PSF.
#[derive(Clone, Debug)]
pub struct LensGradient {
    /// Derivatives by the phases (1/rad) or the widths (1/nm); zero where nothing passes. Shape `[sites, sites]`.
    pub map: Array2<f64>,
    /// Derivatives by the sines of the wedge along x and along y.
    pub wedge_sin: [f64; 2],
    /// Derivative by the distance (1/um), if it was asked for.
    pub distance_um: Option<f64>,
}

impl LensPsf {
    /// The PSF of lenses on `lattice` on a window. `amplitude` multiplies the transmission of each site, shape `[sites, sites]`.
    ///
    /// # Errors
    /// If `amplitude` has another shape, passes nothing, or is not finite, and as
    /// [`FoldedPropagator::plan`](metalith_wave::FoldedPropagator::plan).
    pub fn new(
        lattice: Lattice,
        amplitude: Array2<f32>,
        variable: PillarVariable,
        (wavelength_um, window): (f64, Window),
        accuracy: Accuracy,
    ) -> Result<Self> {
        let open = TransmissionMap::new(lattice, amplitude.mapv(Complex32::from))?;
        let radius_um = metalith_wave::Aperture::radius_um(&open);
        if !amplitude.iter().all(|a| a.is_finite()) || amplitude.iter().all(|a| *a == 0.0) {
            return Err(Error::refused(
                "aperture/not-numbers",
                "an amplitude that is zero everywhere, or no number somewhere",
                "give finite numbers, some of which pass light",
            ));
        }
        Ok(Self {
            psf: DifferentiablePsf::new(lattice, radius_um, wavelength_um, window, accuracy)?,
            variable,
            amplitude,
            radius_um,
        })
    }

    /// Window of the samples.
    pub fn window(&self) -> &Window {
        self.psf.window()
    }

    /// The PSF of the lens with these phases (rad) or widths (nm), shape `[sites, sites]`; those of sites that pass nothing do not
    /// count. `wedge_sin` are the sines of the linear phase of the wedge and of the light that arrives, summed. Without
    /// `along_z` the derivative by the distance is not computed.
    ///
    /// # Errors
    /// If the shape differs, a width is outside of the curve, a phase is not finite, and as [`DifferentiablePsf::at`].
    pub fn at(
        &self,
        given: Array2<f64>,
        wedge_sin: [f64; 2],
        distance_um: f64,
        along_z: bool,
        scratch: &mut Scratch,
    ) -> Result<LensPullback> {
        if given.dim() != self.amplitude.dim() {
            return Err(Error::refused(
                "lens/shape-differs",
                format!("a lens of shape {:?}", given.dim()),
                format!(
                    "give one of shape {:?}, as the sites of the lattice",
                    self.amplitude.dim()
                ),
            ));
        }
        let lens = TransmissionMap::within(self.psf.lattice(), self.radius_um, self.transmissions(&given)?)?;
        let pullback = self.psf.at(&lens, wedge_sin, distance_um, along_z, scratch)?;
        let by_width = matches!(self.variable, PillarVariable::Width(_));
        Ok(LensPullback {
            lens,
            widths_nm: by_width.then_some(given),
            pullback,
        })
    }

    /// Derivatives of a merit by what the PSF is a function of, from those by the PSF, shape `[samples, samples]`.
    ///
    /// # Errors
    /// If `cotangents` have another shape.
    pub fn pull(&self, at: &LensPullback, cotangents: &Array2<f64>, scratch: &mut Scratch) -> Result<LensGradient> {
        // In single precision numbers of any size have to be near one.
        let largest = cotangents.iter().fold(0.0, |most: f64, c| most.max(c.abs()));
        let scale = if largest > 0.0 { largest } else { 1.0 };
        let found = at.pullback.pull(&at.lens, &(cotangents / scale), scratch)?;
        let mut map = Array2::zeros(self.amplitude.dim());
        let sites = Zip::from(&mut map).and(&found.transmission);
        match (&self.variable, &at.widths_nm) {
            (PillarVariable::Width(curve), Some(widths_nm)) => {
                sites
                    .and(widths_nm)
                    .and(&self.amplitude)
                    .for_each(|by, g, width, amplitude| {
                        // A width that passes nothing may be any.
                        let (_, slope) = curve.at(*width).unwrap_or_default();
                        let along = f64::from(g.re) * slope.re + f64::from(g.im) * slope.im;
                        *by = scale * f64::from(*amplitude) * along;
                    });
            }
            _ => sites
                .and(at.lens.values())
                .for_each(|by, g, t| *by = scale * phase_cotangent(*g, *t)),
        }
        Ok(LensGradient {
            map,
            wedge_sin: found.wedge_sin.map(|by| scale * by),
            distance_um: found.distance_um.map(|by| scale * by),
        })
    }

    fn transmissions(&self, given: &Array2<f64>) -> Result<Array2<Complex32>> {
        let mut t = Array2::zeros(given.dim());
        let mut turns = Vec::new();
        let rows = t.rows_mut().into_iter().zip(given.rows()).zip(self.amplitude.rows());
        for (iy, ((mut row, given), amplitude)) in rows.enumerate() {
            let row = row.as_slice_mut().expect("a new array is contiguous");
            match &self.variable {
                PillarVariable::Phase => {
                    turns.clear();
                    turns.extend(
                        given
                            .iter()
                            .zip(amplitude)
                            .map(|(phase, a)| if *a == 0.0 { 0.0 } else { phase / TAU }),
                    );
                    // A sum that is finite is one of finite numbers, but for sums beyond all numbers.
                    if !turns.iter().sum::<f64>().is_finite() {
                        return Err(refused_phase(iy, &turns));
                    }
                    cis_all(&turns, row);
                    row.iter_mut().zip(amplitude).for_each(|(t, a)| *t *= *a);
                }
                PillarVariable::Width(curve) => {
                    for ((ix, t), (width, a)) in row.iter_mut().enumerate().zip(given.iter().zip(amplitude)) {
                        if *a == 0.0 {
                            continue;
                        }
                        let (found, _) = curve.at(*width).ok_or_else(|| refused_width(curve, *width, iy, ix))?;
                        *t = Complex32::new(found.re as f32, found.im as f32) * *a;
                    }
                }
            }
        }
        Ok(t)
    }
}

impl LensPullback {
    /// Intensity over that of the light that arrives. Shape `[samples, samples]`, row index along +y.
    pub fn psf(&self) -> &Array2<f64> {
        &self.pullback.psf
    }
}

/// The refusal of a row with a phase that is no number.
fn refused_phase(iy: usize, turns: &[f64]) -> Error {
    let ix = turns.iter().position(|turns| !turns.is_finite()).unwrap_or(0);
    Error::refused(
        "lens/not-numbers",
        format!("a phase of {} rad at row {iy}, column {ix}", turns[ix] * TAU),
        "give finite phases where light passes",
    )
}

fn refused_width(curve: &TransmissionCurve, width_nm: f64, iy: usize, ix: usize) -> Error {
    let [least, greatest] = curve.range_nm();
    Error::refused(
        "lens/width-out-of-range",
        format!("a pillar {width_nm} nm wide at row {iy}, column {ix}"),
        format!("the transmissions are of {least} to {greatest} nm: clip widths to this range"),
    )
}

#[cfg(test)]
mod tests {
    use num_complex::Complex64;

    use super::*;

    /// Agreement of a derivative with a difference quotient, over its size.
    const QUOTIENT: f64 = 1e-4;

    /// By the widths of a small lens, along their gradient; the other derivatives are tested in the crate `wave`.
    #[test]
    fn derivatives_by_widths_are_difference_quotients() {
        let lattice = Lattice::new(350, 20).unwrap();
        let window = Window::about([0.0; 2], 0.3, 16, 20.0);
        let widths: Vec<f64> = (0..=20).map(|k| 100.0 + 10.0 * f64::from(k)).collect();
        let t = widths
            .iter()
            .map(|w| Complex64::from_polar(0.9 - 1e-3 * w, 0.03 * w))
            .collect();
        let curve = PillarVariable::Width(TransmissionCurve::new(widths, t).unwrap());
        let mut amplitude = Array2::ones([20; 2]);
        amplitude[[0, 0]] = 0.0;
        let lens = LensPsf::new(lattice, amplitude, curve, (0.55, window), Accuracy::Accurate).unwrap();
        let given = Array2::from_shape_fn([20; 2], |(iy, ix)| 150.0 + ((iy * 37 + ix * 91) % 100) as f64);
        let weights = Array2::from_shape_fn([16; 2], |(iy, ix)| ((iy * 5 + ix * 3) % 7) as f64);
        let scratch = &mut Scratch::default();
        let at = lens.at(given.clone(), [0.0; 2], 20.0, false, scratch).unwrap();
        let found = lens.pull(&at, &weights, scratch).unwrap();
        assert_eq!((found.map[[0, 0]], found.distance_um), (0.0, None));
        let norm = found.map.mapv(|g| g * g).sum().sqrt();
        let mut difference = |h: f64| {
            let mut merit = |h: f64| {
                let moved = &given + &(&found.map * (h / norm));
                (lens.at(moved, [0.0; 2], 20.0, false, scratch).unwrap().psf() * &weights).sum()
            };
            (merit(h) - merit(-h)) / (2.0 * h)
        };
        let quotient = (4.0 * difference(2.0) - difference(4.0)) / 3.0;
        assert!((quotient - norm).abs() < QUOTIENT * norm, "{quotient} is not {norm}");

        for (wrong, id) in [(99.0, "lens/width-out-of-range"), (f64::NAN, "lens/width-out-of-range")] {
            let mut widths = given.clone();
            widths[[3, 4]] = wrong;
            let refused = lens.at(widths, [0.0; 2], 20.0, false, scratch);
            assert_eq!(refused.err().map(|e| e.ids()), Some(vec![id.into()]));
        }
    }
}
