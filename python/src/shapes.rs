//! What pillars are, between Python and the library.

use metalith::{Error, PillarShape, Rectangles, Result};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;

use crate::work::error;

/// Word, width and length (nm), rotations in half a turn; the numbers are of rectangles and zero of others.
pub type ToldShape = (String, u16, u16, u16);

/// Most rotations in half a turn.
const MOST_STEPS: u16 = 3600;

/// A shape as Python has it.
pub fn told(shape: PillarShape) -> ToldShape {
    let (width, length, steps) = shape
        .rectangles()
        .map_or((0, 0, 0), |p| (p.width_nm, p.length_nm, p.steps));
    (shape.to_string(), width, length, steps)
}

/// A shape that Python named.
///
/// # Errors
/// If there is none of this name, or rectangles cannot be drawn.
pub fn shape_of((word, width_nm, length_nm, steps): ToldShape) -> Result<PillarShape> {
    if word == "rectangle" {
        return rectangles(width_nm, length_nm, steps).map(PillarShape::Rectangle);
    }
    let known = PillarShape::CHOICES.iter().find(|(name, _)| *name == word);
    known.map(|(_, shape)| *shape).ok_or_else(|| {
        Error::invalid(
            format!("there is no shape `{word}`"),
            "use square, circle, or metalith.Rectangles",
        )
    })
}

fn rectangles(width_nm: u16, length_nm: u16, steps: u16) -> Result<Rectangles> {
    let even = |edge: u16| edge > 0 && edge.is_multiple_of(2);
    if !even(width_nm) || !even(length_nm) || width_nm >= length_nm {
        return Err(Error::invalid(
            format!("rectangles of {width_nm} x {length_nm} nm"),
            "give even edges, so that the corners of an upright pillar are on the 1 nm grid, the width below the length",
        ));
    }
    if !(1..=MOST_STEPS).contains(&steps) {
        return Err(Error::invalid(
            format!("{steps} rotations in half a turn"),
            format!("give 1 to {MOST_STEPS} steps"),
        ));
    }
    Ok(Rectangles {
        width_nm,
        length_nm,
        steps,
    })
}

/// Numbers of the rotations nearest to angles (degrees), zero where there is none.
#[pyfunction]
pub fn rotation_numbers<'py>(
    py: Python<'py>,
    rotations_deg: PyReadonlyArray1<'py, f64>,
    width_nm: u16,
    length_nm: u16,
    steps: u16,
) -> PyResult<Bound<'py, PyArray1<u16>>> {
    let pillars = rectangles(width_nm, length_nm, steps).map_err(error)?;
    let rotations = rotations_deg.as_array();
    if rotations.iter().any(|deg| deg.is_infinite()) {
        return Err(error(Error::invalid(
            "a rotation that is infinite",
            "give degrees, or NaN where there is no pillar",
        )));
    }
    let number = |deg: &f64| {
        if deg.is_nan() {
            0
        } else {
            pillars.number(deg.to_radians())
        }
    };
    Ok(PyArray1::from_iter(py, rotations.iter().map(number)))
}

/// Rotations of numbers (degrees), NaN where there is no pillar.
#[pyfunction]
pub fn rotations_deg<'py>(
    py: Python<'py>,
    numbers: PyReadonlyArray1<'py, u16>,
    width_nm: u16,
    length_nm: u16,
    steps: u16,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let pillars = rectangles(width_nm, length_nm, steps).map_err(error)?;
    let rotation = |n: &u16| {
        if *n == 0 {
            f64::NAN
        } else {
            pillars.rotation(*n).to_degrees()
        }
    };
    let numbers = numbers.as_array();
    Ok(PyArray1::from_iter(py, numbers.iter().map(rotation)))
}
