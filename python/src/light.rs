//! Light: cells, materials, and the propagation of any aperture.

use std::path::Path;

use metalith::cell::CellStack;
use metalith::rcwa::{Material, Orders};
use metalith::wave::{Aperture, Direct, FoldedPropagator, PlaneWave, Propagator, Scratch, TransmissionMap, Window};
use metalith::{Accuracy, Error, Lattice, Result};
use ndarray::Array2;
use num_complex::{Complex32, Complex64};
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::lattices::{check_places, kind_of, lattice_of, stack_on};
use crate::shapes::{ToldShape, shape_of};
use crate::work::{error, work};

/// Stack of the pillars, where no design gives it.
pub(crate) fn stack(pitch_nm: f64, height_nm: f64, pillar: &str, substrate: &str) -> Result<CellStack> {
    let here = Path::new("");
    Ok(CellStack {
        film: Material::resolve(pillar, here)?,
        substrate: Material::resolve(substrate, here)?,
        ..CellStack::paper(pitch_nm, height_nm)?
    })
}

/// An aperture of such transmissions on a lattice.
///
/// # Errors
/// If one is no number, or stands where there is no site.
fn aperture_of(values: Array2<Complex32>, lattice: Lattice) -> Result<TransmissionMap> {
    if values.iter().any(|v| !v.re.is_finite() || !v.im.is_finite()) {
        return Err(Error::refused(
            "aperture/not-numbers",
            "an aperture with values that are no numbers",
            "give finite values",
        ));
    }
    check_places(lattice, &values, |v| *v != Complex32::ZERO)?;
    Ok(TransmissionMap::new(lattice, values)?)
}

/// A field, and the places of its columns and rows (um).
type FieldOnGrid<'py> = (
    Bound<'py, PyArray2<Complex32>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
);

/// The field behind a complex aperture, on a window: `direct` by the Rayleigh-Sommerfeld sum over all sites, else folded.
#[pyfunction]
#[pyo3(signature = (aperture, pitch_nm, lattice, wavelength_nm, distance_um, at_um, samples, step_um, incidence_deg, fast,
    direct, progress=None))]
#[allow(clippy::too_many_arguments)]
pub fn propagate<'py>(
    py: Python<'py>,
    aperture: PyReadonlyArray2<'py, Complex64>,
    pitch_nm: u32,
    lattice: &str,
    wavelength_nm: f64,
    distance_um: f64,
    at_um: [f64; 2],
    samples: usize,
    step_um: Option<f64>,
    incidence_deg: [f64; 2],
    fast: bool,
    direct: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<FieldOnGrid<'py>> {
    let single = aperture.as_array().mapv(|v| Complex32::new(v.re as f32, v.im as f32));
    drop(aperture);
    let kind = kind_of(lattice).map_err(error)?;
    let lattice = lattice_of(kind, pitch_nm, single.dim(), "aperture").map_err(error)?;
    let given = aperture_of(single, lattice).map_err(error)?;
    let um = wavelength_nm * 1e-3;
    let window = Window::about(at_um, step_um.unwrap_or(lattice.pitch_um()), samples, distance_um);
    let [sin_x, sin_y] = incidence_deg.map(|deg| deg.to_radians().sin());
    let wave = PlaneWave {
        wavelength_um: um,
        sin_x,
        sin_y,
    };
    let field = work(py, progress, |_| {
        let accuracy = if fast { Accuracy::Fast } else { Accuracy::Accurate };
        let mut scratch = Scratch::default();
        if direct {
            let sum = Direct::plan(lattice, um, window)?;
            return Ok(sum.field(&given, &wave, &mut scratch)?);
        }
        let fold = FoldedPropagator::plan(lattice, given.radius_um(), um, window, accuracy)?;
        Ok(fold.field(&given, &wave, &mut scratch)?)
    })?;
    let along = |axis: usize| (0..window.samples).map(move |i| window.coordinate_um(axis, i));
    Ok((
        PyArray2::from_owned_array(py, field.values),
        PyArray1::from_iter(py, along(0)),
        PyArray1::from_iter(py, along(1)),
    ))
}

/// Zero-order transmission of pillars along the normal, shape `[widths, wavelengths]`.
#[pyfunction]
#[pyo3(signature = (widths_nm, wavelengths_nm, pitch_nm, lattice, shape, height_nm, pillar, substrate, orders, progress=None))]
#[allow(clippy::too_many_arguments)]
pub fn cell<'py>(
    py: Python<'py>,
    widths_nm: PyReadonlyArray1<'py, f64>,
    wavelengths_nm: PyReadonlyArray1<'py, f64>,
    pitch_nm: f64,
    lattice: &str,
    shape: ToldShape,
    height_nm: f64,
    pillar: &str,
    substrate: &str,
    orders: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyArray2<Complex64>>> {
    let (widths, wavelengths) = (widths_nm.as_array().to_vec(), wavelengths_nm.as_array().to_vec());
    drop((widths_nm, wavelengths_nm));
    let shape = shape_of(shape).map_err(error)?;
    if !shape.has_width() {
        return Err(error(Error::refused(
            "cell/rectangles-unsupported",
            "the transmission of rectangles by their width",
            "give squares or circles: rectangles are told by numbers, and `metalith.psf` simulates them",
        )));
    }
    let stack = stack(pitch_nm, height_nm, pillar, substrate)
        .and_then(|stack| stack_on(stack, kind_of(lattice)?, shape))
        .map_err(error)?;
    let orders = Orders::new(orders).map_err(|e| error(e.into()))?;
    let (rows, columns) = (widths.len(), wavelengths.len());
    let t = work(py, progress, |p| {
        p.begin("solving cells", (rows * columns) as u64);
        let one = |k: usize| {
            p.check_stopped()?;
            let t = stack.transmission(widths[k / columns], wavelengths[k % columns] * 1e-3, orders);
            p.advance(1);
            t
        };
        (0..rows * columns).into_par_iter().map(one).collect::<Result<Vec<_>>>()
    })?;
    let t = Array2::from_shape_vec((rows, columns), t).expect("one for each");
    Ok(PyArray2::from_owned_array(py, t))
}

/// Complex index of a material, absorption positive.
#[pyfunction]
pub fn index<'py>(
    py: Python<'py>,
    material: &str,
    wavelengths_nm: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<Complex64>>> {
    let material = Material::resolve(material, Path::new("")).map_err(|e| error(e.into()))?;
    let wavelengths = wavelengths_nm.as_array();
    let found = wavelengths.iter().map(|nm| material.index(nm * 1e-3));
    let found = found
        .collect::<std::result::Result<Vec<_>, _>>()
        .map_err(|e| error(e.into()))?;
    Ok(PyArray1::from_vec(py, found))
}
