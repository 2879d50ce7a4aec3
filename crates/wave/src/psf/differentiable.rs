//! The PSF of one lens as a differentiable function of its transmissions, of its wedge, and of the distance.
//!
//! The field E on the window is linear in the transmissions t: E = P t. For a merit of the PSF |E|^2 with the derivatives c
//! (the cotangents of the PSF), the derivatives by the transmissions are 2 P*(c E), with the adjoint P* of the propagator. A
//! wedge is a linear phase, so its derivatives are sums over the same values. The derivative by the distance is
//! sum 2 c Re(conj(E) dE/dz) over the window.

use std::f64::consts::TAU;
use std::sync::{Arc, Mutex};

use metalith_pillars::Lattice;
use ndarray::{Array2, Zip};
use num_complex::Complex32;

use crate::error::Result;
use crate::propagation::{
    Accuracy, Aperture, FoldedPropagator, PlaneWave, Propagator, Scratch, TransmissionMap, Window, check_shape,
};

/// The PSF of lenses on one lattice, at one wavelength and on one window.
///
/// It is a smooth function of all that it is given, but for the distance: the plan of the propagator changes at distances half a
/// percent apart, and the PSF changes there by what the propagator may err.
pub struct DifferentiablePsf {
    lattice: Lattice,
    radius_um: f64,
    wavelength_um: f64,
    window: Window,
    accuracy: Accuracy,
    /// The plan that was used last, with the number of its distance.
    plan: Mutex<Option<(i32, Arc<FoldedPropagator>)>>,
}

/// Distances that have one plan are less than this share apart: it is made for the nearest of them.
const SAME_PLAN: f64 = 0.005;

/// A PSF, with what its derivatives are computed from.
pub struct PsfPullback {
    /// Intensity over that of the light that arrives. Shape `[samples, samples]`, row index along +y.
    pub psf: Array2<f64>,
    plan: Arc<FoldedPropagator>,
    wave: PlaneWave,
    distance_um: f64,
    field: Array2<Complex32>,
    slope: Option<Array2<Complex32>>,
}

/// Derivatives of a merit of a PSF.
#[derive(Clone, Debug)]
pub struct PsfCotangents {
    /// Derivatives by the transmissions: a change dt changes the merit by Re(conj(this) dt), summed over sites. Shape `[sites, sites]`.
    pub transmission: Array2<Complex32>,
    /// Derivatives by the sines of the wedge along x and along y.
    pub wedge_sin: [f64; 2],
    /// Derivative by the distance (1/um), if it was asked for.
    pub distance_um: Option<f64>,
}

impl DifferentiablePsf {
    /// The PSF of lenses on `lattice` that pass nothing outside of `radius_um`, on `window` or on its like at another distance.
    ///
    /// # Errors
    /// As [`FoldedPropagator::plan`].
    pub fn new(
        lattice: Lattice,
        radius_um: f64,
        wavelength_um: f64,
        window: Window,
        accuracy: Accuracy,
    ) -> Result<Self> {
        let psf = Self {
            lattice,
            radius_um,
            wavelength_um,
            window,
            accuracy,
            plan: Mutex::new(None),
        };
        psf.plan(window.distance_um)?;
        Ok(psf)
    }

    /// Lattice of the transmissions.
    pub fn lattice(&self) -> Lattice {
        self.lattice
    }

    /// Window of the samples.
    pub fn window(&self) -> &Window {
        &self.window
    }

    /// The PSF of a lens whose wedge, with the light that arrives, adds the phase 2 pi (x sin_x + y sin_y) / wavelength.
    /// Without `along_z` the derivative by the distance cannot be asked for.
    ///
    /// # Errors
    /// If lattice or wedge do not fit, or the distance is not positive.
    pub fn at(
        &self,
        lens: &TransmissionMap,
        [sin_x, sin_y]: [f64; 2],
        distance_um: f64,
        along_z: bool,
        scratch: &mut Scratch,
    ) -> Result<PsfPullback> {
        let wave = PlaneWave {
            wavelength_um: self.wavelength_um,
            sin_x,
            sin_y,
        };
        let plan = self.plan(distance_um)?;
        let (field, slope) = plan.field_and_slope(lens, &wave, distance_um, along_z, scratch)?;
        Ok(PsfPullback {
            psf: field.values.map(|e| f64::from(e.re).powi(2) + f64::from(e.im).powi(2)),
            plan,
            wave,
            distance_um,
            field: field.values,
            slope,
        })
    }

    /// The plan for a distance. A plan that another thread holds, or held when this process was forked, is made anew.
    fn plan(&self, distance_um: f64) -> Result<Arc<FoldedPropagator>> {
        let window = self.window.at_distance(distance_um);
        window.check(self.wavelength_um)?;
        let ratio: f64 = 1.0 + SAME_PLAN;
        let number = distance_um.log(ratio).floor();
        let number_of_last = number as i32;
        if let Ok(last) = self.plan.try_lock()
            && let Some((same, plan)) = &*last
            && *same == number_of_last
        {
            return Ok(Arc::clone(plan));
        }
        let plan = Arc::new(FoldedPropagator::plan(
            self.lattice,
            self.radius_um,
            self.wavelength_um,
            window.at_distance(ratio.powf(number)),
            self.accuracy,
        )?);
        if let Ok(mut last) = self.plan.try_lock() {
            *last = Some((number_of_last, Arc::clone(&plan)));
        }
        Ok(plan)
    }
}

impl PsfPullback {
    /// Derivatives of a merit by what the PSF of `lens` is a function of, from those by the PSF: shape `[samples, samples]`.
    ///
    /// # Errors
    /// If `cotangents` have another shape.
    pub fn pull(
        &self,
        lens: &TransmissionMap,
        cotangents: &Array2<f64>,
        scratch: &mut Scratch,
    ) -> Result<PsfCotangents> {
        check_shape(cotangents, self.plan.window())?;
        let weighted = Zip::from(&self.field)
            .and(cotangents)
            .map_collect(|e, c| e * (2.0 * c) as f32);
        let transmission = self.plan.adjoint_at(&weighted, &self.wave, self.distance_um, scratch)?;
        let distance_um = self.slope.as_ref().map(|slope| {
            let products = weighted.iter().zip(slope);
            products
                .map(|(w, s)| f64::from(w.re) * f64::from(s.re) + f64::from(w.im) * f64::from(s.im))
                .sum()
        });
        Ok(PsfCotangents {
            wedge_sin: self.by_wedge(lens, &transmission),
            transmission,
            distance_um,
        })
    }

    /// A wedge is a phase: by a phase of each site the derivatives are those of [`phase_cotangent`].
    fn by_wedge(&self, lens: &TransmissionMap, transmission: &Array2<Complex32>) -> [f64; 2] {
        let lattice = lens.lattice();
        let mut sums = [0.0; 2];
        for (iy, (row, t)) in transmission.rows().into_iter().zip(lens.values().rows()).enumerate() {
            let mut along_row = [0.0; 2];
            for (ix, (g, t)) in row.iter().zip(t).enumerate() {
                let by_phase = phase_cotangent(*g, *t);
                along_row[0] += lattice.place_um(0, ix) * by_phase;
                along_row[1] += by_phase;
            }
            sums[0] += along_row[0];
            sums[1] += lattice.place_um(1, iy) * along_row[1];
        }
        sums.map(|sum| TAU / self.wave.wavelength_um * sum)
    }
}

/// Derivative by the phase of a transmission (rad), from the one by the transmission: Re(conj(g) i t).
pub fn phase_cotangent(g: Complex32, t: Complex32) -> f64 {
    f64::from(g.im) * f64::from(t.re) - f64::from(g.re) * f64::from(t.im)
}
