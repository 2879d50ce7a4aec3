//! Shapes of pillars, between Python and the library.

use metalith::{Error, PillarId, PillarShape, Rectangles, Result, RotatedRectangles, UprightRectangles};
use numpy::ndarray::ArrayView1;
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;

use crate::work::error;

/// Word and three numbers: of rotated rectangles width and length (nm) and rotations in half a turn; of upright ones the shortest
/// width and the step (nm) and how many widths there are; zero of others.
pub type ToldShape = (String, u16, u16, u16);

const ROTATED: &str = "rectangle";
const UPRIGHT: &str = "upright_rectangle";
const MIXED: &str = "mixed";

/// Most rotations in half a turn.
const MOST_STEPS: u16 = 3600;

/// Largest rotation (degrees): a double resolves a millionth of a degree there.
const MOST_DEG: f64 = 1e9;

/// Numbers of rectangles, of which each is there.
fn known<'a>(numbers: &'a PyReadonlyArray1<'_, u16>, shape: PillarShape) -> Result<ArrayView1<'a, u16>> {
    let numbers = numbers.as_array();
    check_numbers(shape, numbers)?;
    Ok(numbers)
}

/// Succeeds if rectangles of a shape have all these numbers; of other shapes they are widths.
pub fn check_numbers<'a>(shape: PillarShape, numbers: impl IntoIterator<Item = &'a u16>) -> Result<()> {
    let Some(PillarId(last)) = shape.last() else {
        return Ok(());
    };
    match numbers.into_iter().find(|n| **n > last) {
        Some(wrong) => Err(Error::refused(
            "array/unknown-pillar",
            format!("a rectangle of number {wrong}"),
            format!("numbers go from 1 to {last}: the steps of half a turn, or the pairs of widths"),
        )),
        None => Ok(()),
    }
}

/// A shape as Python has it.
pub fn told(shape: PillarShape) -> ToldShape {
    let [a, b, c] = match shape {
        PillarShape::Rectangle(Rectangles::Rotated(p)) => [p.width_nm, p.length_nm, p.steps],
        PillarShape::Rectangle(Rectangles::Upright(p)) => [p.shortest_nm, p.step_nm, p.lengths],
        PillarShape::Square | PillarShape::Circle | PillarShape::Mixed => [0; 3],
    };
    (shape.design_name().into(), a, b, c)
}

/// A shape that Python named.
///
/// # Errors
/// If there is none of this name, or rectangles cannot be drawn.
pub fn shape_of((word, width_nm, length_nm, steps): ToldShape) -> Result<PillarShape> {
    match word.as_str() {
        ROTATED => return Ok(rectangles(width_nm, length_nm, steps)?.into()),
        UPRIGHT => return Ok(upright(width_nm, length_nm, steps)?.into()),
        MIXED => return Ok(PillarShape::Mixed),
        _ => {}
    }
    let known = PillarShape::CHOICES.iter().find(|(name, _)| *name == word);
    known.map(|(_, shape)| *shape).ok_or_else(|| {
        Error::refused(
            "pillars/unknown-kind",
            format!("there is no shape `{word}`"),
            "use square, circle, metalith.Rectangles or metalith.UprightRectangles",
        )
    })
}

/// True if an edge so long has its ends on the grid of 1 nm about its middle.
fn even(nm: u16) -> bool {
    nm > 0 && nm.is_multiple_of(2)
}

fn upright(shortest_nm: u16, step_nm: u16, lengths: u16) -> Result<UprightRectangles> {
    let most = UprightRectangles::MOST_LENGTHS;
    if !even(shortest_nm) || !even(step_nm) || !(1..=most).contains(&lengths) {
        return Err(Error::refused(
            "pillars/widths-out-of-range",
            format!("upright rectangles of {lengths} widths from {shortest_nm} nm in steps of {step_nm} nm"),
            format!("give an even width and step, so that edges are on the 1 nm grid, and 1 to {most} widths"),
        ));
    }
    Ok(UprightRectangles {
        shortest_nm,
        step_nm,
        lengths,
    })
}

/// Numbers of upright rectangles with these widths along x and y (nm), zero where both are.
#[pyfunction]
pub fn upright_numbers<'py>(
    py: Python<'py>,
    widths_x: PyReadonlyArray1<'py, u16>,
    widths_y: PyReadonlyArray1<'py, u16>,
    shortest_nm: u16,
    step_nm: u16,
    lengths: u16,
) -> PyResult<Bound<'py, PyArray1<u16>>> {
    let pillars = upright(shortest_nm, step_nm, lengths).map_err(error)?;
    let pairs = widths_x
        .as_array()
        .to_vec()
        .into_iter()
        .zip(widths_y.as_array().to_vec());
    let number = |(x, y): (u16, u16)| match (x, y) {
        (0, 0) => Ok(0),
        _ => pillars.number([x, y]).ok_or_else(|| {
            Error::refused(
                "array/unknown-pillar",
                format!("a pillar of {x} x {y} nm"),
                format!(
                    "widths go from {} to {} nm in steps of {} nm; zero along both axes where there is none",
                    pillars.shortest_nm,
                    pillars.longest_nm(),
                    pillars.step_nm
                ),
            )
        }),
    };
    let numbers = pairs.map(number).collect::<Result<Vec<_>>>().map_err(error)?;
    Ok(PyArray1::from_vec(py, numbers))
}

/// Widths along x and y of numbers (nm), zero where there is no pillar.
#[pyfunction]
#[allow(clippy::type_complexity, reason = "two arrays of Python")]
pub fn upright_widths<'py>(
    py: Python<'py>,
    numbers: PyReadonlyArray1<'py, u16>,
    shortest_nm: u16,
    step_nm: u16,
    lengths: u16,
) -> PyResult<(Bound<'py, PyArray1<u16>>, Bound<'py, PyArray1<u16>>)> {
    let pillars = upright(shortest_nm, step_nm, lengths).map_err(error)?;
    let numbers = known(&numbers, pillars.into()).map_err(error)?;
    let along = |axis: usize| {
        numbers
            .iter()
            .map(move |n| if *n == 0 { 0 } else { pillars.edges_nm(*n)[axis] })
    };
    Ok((PyArray1::from_iter(py, along(0)), PyArray1::from_iter(py, along(1))))
}

fn rectangles(width_nm: u16, length_nm: u16, steps: u16) -> Result<RotatedRectangles> {
    if !even(width_nm) || !even(length_nm) || width_nm >= length_nm {
        return Err(Error::refused(
            "pillars/edges-out-of-range",
            format!("rectangles of {width_nm} x {length_nm} nm"),
            "give even edges, so that the corners of an upright pillar are on the 1 nm grid, the width below the length",
        ));
    }
    if !(1..=MOST_STEPS).contains(&steps) {
        return Err(Error::refused(
            "pillars/rotations-out-of-range",
            format!("{steps} rotations in half a turn"),
            format!("give 1 to {MOST_STEPS} steps"),
        ));
    }
    Ok(RotatedRectangles {
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
    if let Some(wrong) = rotations.iter().find(|deg| deg.abs() > MOST_DEG) {
        return Err(error(Error::refused(
            "array/not-numbers",
            format!("a rotation of {wrong:e} degrees"),
            format!("give degrees from -{MOST_DEG:e} to {MOST_DEG:e}, or NaN where there is no pillar"),
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
    let numbers = known(&numbers, pillars.into()).map_err(error)?;
    Ok(PyArray1::from_iter(py, numbers.iter().map(rotation)))
}
