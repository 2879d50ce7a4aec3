//! Lattices between Python and the library: their kinds by name, and where their sites are.

use metalith::cell::CellStack;
use metalith::rcwa::CellLattice;
use metalith::{DatabaseUnit, Error, Lattice, LatticeKind, PillarShape, Pitch, Result};
use ndarray::Array2;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;

use crate::work::error;

/// The kind that a word names.
pub fn kind_of(word: &str) -> Result<LatticeKind> {
    let known = LatticeKind::CHOICES.iter().find(|(name, _)| *name == word);
    known.map(|(_, kind)| *kind).ok_or_else(|| {
        Error::refused(
            "lattice/unknown-kind",
            format!("there is no lattice `{word}`"),
            "use square or hexagonal",
        )
    })
}

/// The lattice of a square grid of so many rows and columns; `what` says whose it is.
pub fn lattice_of(kind: LatticeKind, pitch_nm: u32, (rows, columns): (usize, usize), what: &str) -> Result<Lattice> {
    if rows != columns {
        return Err(Error::refused(
            "lattice/not-square",
            format!("a {what} of {rows} x {columns} places"),
            "give a square one: pad it with zeros, which are places without pillars",
        ));
    }
    exact(kind, pitch_nm, rows)
}

/// Succeeds if pillars of such a shape can stand on a lattice of the kind.
pub fn check_shape(kind: LatticeKind, shape: PillarShape) -> Result<()> {
    match kind.refusal(shape) {
        Some(what) => Err(Error::refused(
            "lattice/squares-on-hexagonal",
            what,
            "say that they are circles (`shape=\"circle\"`), or use the square lattice",
        )),
        None => Ok(()),
    }
}

/// True if a place of the grid is a site that light passes and a pillar can stand on.
fn is_site(lattice: Lattice, ix: usize, iy: usize) -> bool {
    let [columns, rows] = lattice.reach();
    columns.contains(&ix) && rows.contains(&iy) && lattice.has(ix, iy)
}

/// Succeeds if all places that something stands at are sites.
pub fn check_places<T>(lattice: Lattice, of: &Array2<T>, stands: impl Fn(&T) -> bool) -> Result<()> {
    let wrong = of
        .indexed_iter()
        .find(|((iy, ix), value)| stands(value) && !is_site(lattice, *ix, *iy));
    let Some(((iy, ix), _)) = wrong else {
        return Ok(());
    };
    Err(Error::refused(
        "lattice/not-a-site",
        format!("something at row {iy}, column {ix}, which is no site of the hexagonal lattice"),
        "leave zero where `is_site` of `metalith.places` is false: sites have an even sum of row and column, and rows end where \
         the columns do",
    ))
}

/// A cell of pillars of a shape on a lattice of a kind, as it is drawn.
pub fn stack_on(stack: CellStack, kind: LatticeKind, shape: PillarShape) -> Result<CellStack> {
    check_shape(kind, shape)?;
    // Rows of a hexagonal lattice are drawn whole nanometres apart.
    if !kind.is_square() && stack.pitch_nm.fract() != 0.0 {
        return Err(Error::refused(
            "lattice/off-grid",
            format!("a hexagonal lattice with a pitch of {} nm", stack.pitch_nm),
            "give a whole number of nanometres",
        ));
    }
    Ok(CellStack {
        lattice: CellLattice::drawn(kind, (stack.pitch_nm as u32).into(), DatabaseUnit::Nanometre),
        shape,
        ..stack
    })
}

/// Pitch of a lattice: an integer where it is whole (nm).
#[derive(IntoPyObject)]
pub enum PitchNm {
    Whole(u32),
    Fraction(f64),
}

impl From<Pitch> for PitchNm {
    fn from(pitch: Pitch) -> Self {
        pitch.whole_nm().map_or_else(|| Self::Fraction(pitch.nm()), Self::Whole)
    }
}

/// The lattice of a kind whose places are all whole nanometres.
fn exact(kind: LatticeKind, pitch_nm: u32, sites: usize) -> Result<Lattice> {
    let lattice = Lattice::of_kind(kind, pitch_nm, sites)?;
    if lattice.rounding_nm() > 0.0 {
        return Err(Error::refused(
            "lattice/off-grid",
            format!("a pitch of {pitch_nm} nm and {sites} sites put pillar centres off the 1 nm grid"),
            "use an even number of nanometres, or on a square lattice an odd number of sites",
        ));
    }
    Ok(lattice)
}

/// Places of columns and rows from the middle of an element (nm), and which places of the grid are sites, `[row, column]`.
pub type Places<'py> = (
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray2<bool>>,
);

/// The places of a grid of `sites` along an axis.
#[pyfunction]
pub fn places<'py>(py: Python<'py>, sites: usize, pitch_nm: u32, lattice: &str) -> PyResult<Places<'py>> {
    let kind = kind_of(lattice).map_err(error)?;
    let lattice = exact(kind, pitch_nm, sites).map_err(error)?;
    let along = |axis: usize| PyArray1::from_iter(py, (0..sites).map(|i| lattice.place_units(axis, i)));
    let is_site = Array2::from_shape_fn((sites, sites), |(iy, ix)| is_site(lattice, ix, iy));
    Ok((along(0), along(1), PyArray2::from_owned_array(py, is_site)))
}
