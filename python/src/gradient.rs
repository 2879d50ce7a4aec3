//! PSFs with their derivatives, and the mapping of a design between phases and pillars.

use std::f64::consts::TAU;
use std::sync::Mutex;

use metalith::array::PillarRule;
use metalith::optics::{LensPsf, LensPullback, PillarVariable, TransmissionCurve};
use metalith::optimise::Mapping;
use metalith::wave::{Scratch, Window};
use metalith::{Accuracy, Error, Fidelity, Result, cell_models};
use num_complex::Complex64;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::arrays::Design;
use crate::lattices::{check_places, kind_of, lattice_of};
use crate::work::{error, work};

/// The PSF of lenses on one lattice as a function of their phases or widths, of their wedge and of the distance.
#[pyclass(frozen, module = "metalith._native")]
pub struct PsfModel {
    lens: LensPsf,
    /// Working memory of the last call. The lock is never waited for: whoever holds it may have stayed in the parent of a fork.
    scratch: Mutex<Scratch>,
}

/// A PSF with what its derivatives are computed from.
#[pyclass(frozen, module = "metalith._native")]
pub struct PsfPullback {
    at: LensPullback,
}

/// Derivatives by the phases or widths, by the sines of the wedge, and by the distance (1/um), if asked for.
type Pulled<'py> = (Bound<'py, PyArray2<f64>>, [f64; 2], Option<f64>);

#[pymethods]
impl PsfModel {
    /// Plan for lenses of a lattice on a window about `at_um`, whose samples are `step_um` apart. With `curve`, widths (nm) and
    /// what they transmit, lenses are given by widths, else by phases.
    #[staticmethod]
    #[allow(clippy::too_many_arguments)]
    fn plan(
        py: Python<'_>,
        amplitude: PyReadonlyArray2<'_, f32>,
        pitch_nm: u32,
        lattice: &str,
        wavelength_nm: f64,
        distance_um: f64,
        at_um: [f64; 2],
        samples: usize,
        step_um: f64,
        fast: bool,
        curve: Option<(PyReadonlyArray1<'_, f64>, PyReadonlyArray1<'_, Complex64>)>,
    ) -> PyResult<Self> {
        let amplitude = amplitude.as_array().to_owned();
        let kind = kind_of(lattice).map_err(error)?;
        let lattice = lattice_of(kind, pitch_nm, amplitude.dim(), "amplitude").map_err(error)?;
        check_places(lattice, &amplitude, |a| *a != 0.0).map_err(error)?;
        let variable = match curve {
            Some((widths, t)) => {
                let (widths, t) = (widths.as_array().to_vec(), t.as_array().to_vec());
                PillarVariable::Width(TransmissionCurve::new(widths, t).map_err(error)?)
            }
            None => PillarVariable::Phase,
        };
        let light = (
            wavelength_nm * 1e-3,
            Window::about(at_um, step_um, samples, distance_um),
        );
        let accuracy = if fast { Accuracy::Fast } else { Accuracy::Accurate };
        let lens = work(py, None, |_| {
            LensPsf::new(lattice, amplitude, variable, light, accuracy)
        })?;
        Ok(Self {
            lens,
            scratch: Mutex::default(),
        })
    }

    /// Places of the columns and rows of the window (um).
    fn places<'py>(&self, py: Python<'py>) -> (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>) {
        let window = self.lens.window();
        let along = |axis: usize| PyArray1::from_iter(py, (0..window.samples).map(|i| window.coordinate_um(axis, i)));
        (along(0), along(1))
    }

    /// The PSF of phases (rad) or widths (nm), and what its derivatives are computed from.
    fn psf<'py>(
        &self,
        py: Python<'py>,
        given: PyReadonlyArray2<'py, f64>,
        wedge_sin: [f64; 2],
        distance_um: f64,
        along_z: bool,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, PsfPullback)> {
        let given = given.as_array().to_owned();
        let at = work(py, None, |_| {
            self.with_scratch(|scratch| self.lens.at(given, wedge_sin, distance_um, along_z, scratch))
        })?;
        Ok((PyArray2::from_array(py, at.psf()), PsfPullback { at }))
    }

    /// Derivatives of a merit from its derivatives by the PSF.
    fn pull<'py>(
        &self,
        py: Python<'py>,
        pullback: &PsfPullback,
        cotangents: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Pulled<'py>> {
        let cotangents = cotangents.as_array().to_owned();
        let found = work(py, None, |_| {
            self.with_scratch(|scratch| self.lens.pull(&pullback.at, &cotangents, scratch))
        })?;
        Ok((
            PyArray2::from_owned_array(py, found.map),
            found.wedge_sin,
            found.distance_um,
        ))
    }
}

impl PsfModel {
    /// Work with the memory of this model, or with new memory where another thread has it.
    fn with_scratch<T>(&self, work: impl FnOnce(&mut Scratch) -> T) -> T {
        match self.scratch.try_lock() {
            Ok(mut scratch) => work(&mut scratch),
            Err(_) => work(&mut Scratch::default()),
        }
    }
}

/// Widths (nm) of a design's cell, and their transmissions at a wavelength.
#[pyfunction]
#[pyo3(signature = (design, wavelength_nm, fidelity, progress=None))]
#[allow(clippy::type_complexity, reason = "two arrays of Python")]
pub fn curve_of<'py>(
    py: Python<'py>,
    design: &Design,
    wavelength_nm: f64,
    fidelity: &str,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<Complex64>>)> {
    let mut design = design.design.clone();
    if !design.cell.shape.has_width() {
        return Err(error(Error::refused(
            "cell/rectangles-unsupported",
            "the PSF of rectangles by their width",
            "take a design of squares or circles, or give phases",
        )));
    }
    let fidelity: Fidelity = fidelity.parse().map_err(error)?;
    // Tables span the wavelengths that a design names.
    design.verify.wavelengths_um.push(wavelength_nm * 1e-3);
    let widths: Vec<u16> = design.cell.widths_nm().collect();
    let t = work(py, progress, |_| {
        let cells = cell_models(&design, &[fidelity.of_width_alone()])?;
        let widest = widths.last().copied().unwrap_or_default();
        let all = cells[0].transmissions(wavelength_nm * 1e-3, widest)?;
        Ok(widths.iter().map(|w| all[usize::from(*w)]).collect::<Vec<_>>())
    })?;
    Ok((
        PyArray1::from_iter(py, widths.iter().map(|w| f64::from(*w))),
        PyArray1::from_vec(py, t),
    ))
}

/// The rule of one element of a design, or the one that elements without their own follow.
fn rule_of(design: &Design, element: Option<usize>) -> Result<PillarRule> {
    let design = &design.design;
    let Some(k) = element else {
        return Ok(PillarRule::new(&design.cell, &design.mapping));
    };
    let elements = design.elements();
    let element = elements.get(k).ok_or_else(|| {
        Error::refused(
            "array/unknown-element",
            format!("there is no element {k}"),
            format!("this design has elements 0 to {}", elements.len() - 1),
        )
    })?;
    Ok(PillarRule::of_element(design, element.index))
}

/// Widths (nm), or numbers of rectangles, that the mapping of a design has for phases (rad); zero where a phase is NaN.
#[pyfunction]
#[pyo3(signature = (phases_rad, design, element=None))]
pub fn widths_of<'py>(
    py: Python<'py>,
    phases_rad: PyReadonlyArray1<'py, f64>,
    design: &Design,
    element: Option<usize>,
) -> PyResult<Bound<'py, PyArray1<u16>>> {
    let rule = rule_of(design, element).map_err(error)?;
    let width = |phase: &f64| {
        // A phase just below zero is one wave when it is rounded.
        let turns = (phase / TAU).rem_euclid(1.0);
        let turns = if turns < 1.0 { turns } else { 0.0 };
        if phase.is_nan() { 0 } else { rule.width_nm(turns) }
    };
    Ok(PyArray1::from_iter(py, phases_rad.as_array().iter().map(width)))
}

/// Phases (rad) from 0 to 2 pi for which the mapping of a design has these widths (nm) or numbers, NaN of zero; the place of the first
/// width that it does not have, if any; and the widths that it has, rising.
#[pyfunction]
#[pyo3(signature = (widths, design, element=None))]
#[allow(clippy::type_complexity, reason = "an array of Python and what is missing")]
pub fn phases_of<'py>(
    py: Python<'py>,
    widths: PyReadonlyArray1<'py, u16>,
    design: &Design,
    element: Option<usize>,
) -> PyResult<(Bound<'py, PyArray1<f64>>, Option<usize>, Vec<u16>)> {
    let mapping = Mapping::new(&rule_of(design, element).map_err(error)?);
    let mut by_width = vec![f64::NAN; usize::from(mapping.max_width_nm()) + 1];
    for choice in mapping.choices() {
        by_width[usize::from(choice.width_nm)] = choice.waves * TAU;
    }
    let phase = |width: &u16| by_width.get(usize::from(*width)).copied().unwrap_or(f64::NAN);
    let widths = widths.as_array();
    let missing = widths.iter().position(|width| *width != 0 && phase(width).is_nan());
    let mut known: Vec<u16> = mapping.choices().iter().map(|choice| choice.width_nm).collect();
    known.sort_unstable();
    Ok((
        PyArray1::from_iter(py, widths.iter().map(|w| if *w == 0 { f64::NAN } else { phase(w) })),
        missing,
        known,
    ))
}
