//! The transmission of an element, row by row.

use metalith_pillars::{Lattice, PillarRows};
use ndarray::{Array2, ArrayView1, ArrayViewMut1};
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

use crate::error::{Result, WaveError};

/// The complex transmission of one element on its lattice.
///
/// Rows are asked for one at a time and in any order, so that an element never has to be held as
/// complex numbers: 8.2 million sites of a 1 mm lens are 16 MB of widths or nothing at all. Nothing passes where the lattice
/// has no site, nor in rows that it does not reach ([`Lattice::has`], [`Lattice::reach`]): nothing in this crate asks for those
/// rows.
pub trait Aperture: Sync {
    /// Lattice of the samples.
    fn lattice(&self) -> Lattice;

    /// Radius of a circle about the element's centre outside of which nothing passes (um). Half the
    /// diagonal of the lattice unless better is known; a tight one makes every propagation cheaper.
    fn radius_um(&self) -> f64 {
        let lattice = self.lattice();
        // Rows of a hexagonal lattice with sites on them reach no farther than columns.
        let outermost = lattice.place_um(0, lattice.sites() - 1);
        outermost * std::f64::consts::SQRT_2
    }

    /// Transmission of the sites of row `iy`, along +x; zero where nothing passes.
    ///
    /// # Panics
    /// May panic if `row` has not one entry a site, or `iy` is no row.
    fn fill_row(&self, iy: usize, row: &mut [Complex32]);
}

/// Apertures on one lattice whose rows are cheaper to form together than each on its own, such as one element in light of
/// two polarisations.
pub trait ApertureSet: Sync {
    /// Lattice of the samples.
    fn lattice(&self) -> Lattice;

    /// Number of apertures.
    fn count(&self) -> usize;

    /// Transmissions of the sites of row `iy` along +x, a row of each aperture one after the other; zero where nothing passes.
    ///
    /// # Panics
    /// May panic if `rows` has not one entry a site and aperture, or `iy` is no row.
    fn fill_rows(&self, iy: usize, rows: &mut [Complex32]);
}

/// Apertures on one lattice as a set: rows are formed one by one, and what sends light to a window is worked out once.
pub struct Together<'a>(pub Vec<&'a dyn Aperture>);

impl ApertureSet for Together<'_> {
    fn lattice(&self) -> Lattice {
        self.0[0].lattice()
    }

    fn count(&self) -> usize {
        self.0.len()
    }

    fn fill_rows(&self, iy: usize, rows: &mut [Complex32]) {
        let sites = self.lattice().sites();
        for (aperture, row) in self.0.iter().zip(rows.chunks_exact_mut(sites)) {
            aperture.fill_row(iy, row);
        }
    }
}

/// An aperture of a set, by its number.
pub(super) struct Member<'a> {
    pub set: &'a dyn ApertureSet,
    pub number: usize,
}

impl Aperture for Member<'_> {
    fn lattice(&self) -> Lattice {
        self.set.lattice()
    }

    fn fill_row(&self, iy: usize, row: &mut [Complex32]) {
        let mut rows = vec![Complex32::ZERO; self.set.count() * row.len()];
        self.set.fill_rows(iy, &mut rows);
        row.copy_from_slice(&rows[self.number * row.len()..][..row.len()]);
    }
}

/// A complex transmission that is known at each site.
#[derive(Clone, Debug)]
pub struct TransmissionMap {
    lattice: Lattice,
    radius_um: f64,
    values: Array2<Complex32>,
}

impl TransmissionMap {
    /// Transmissions on a lattice, zero where nothing passes, of shape `[sites, sites]`, row index along +y.
    ///
    /// # Errors
    /// If they have another shape.
    pub fn new(lattice: Lattice, values: Array2<Complex32>) -> Result<Self> {
        let open = values.indexed_iter().filter(|(_, t)| **t != Complex32::ZERO);
        let farthest2 = open.map(|((iy, ix), _)| lattice.units2(ix, iy)).max().unwrap_or(0);
        Self::within(lattice, (farthest2 as f64).sqrt() * lattice.unit_um(), values)
    }

    /// Variant of [`TransmissionMap::new`] for transmissions of which none that passes light is farther from the centre than
    /// `radius_um`, which are not searched for the farthest.
    ///
    /// # Errors
    /// As [`TransmissionMap::new`].
    pub fn within(lattice: Lattice, radius_um: f64, values: Array2<Complex32>) -> Result<Self> {
        let n = lattice.sites();
        if values.dim() != (n, n) {
            return Err(WaveError::Shape {
                what: "transmissions",
                given: values.dim().into(),
                wanted: [n; 2],
            });
        }
        Ok(Self {
            lattice,
            radius_um,
            values,
        })
    }

    /// The transmissions of the apertures of a set, which pass nothing outside `radius_um` of their centre: formed on all threads.
    pub fn of_set(set: &dyn ApertureSet, radius_um: f64) -> Vec<Self> {
        let lattice = set.lattice();
        let (sites, [_, reach]) = (lattice.sites(), lattice.reach());
        let mut all = vec![Array2::zeros([sites; 2]); set.count()];
        let mut by_row: Vec<Vec<ArrayViewMut1<'_, Complex32>>> = (0..sites).map(|_| Vec::new()).collect();
        for values in &mut all {
            by_row
                .iter_mut()
                .zip(values.rows_mut())
                .for_each(|(of_row, row)| of_row.push(row));
        }
        let rows = by_row.into_par_iter().enumerate().filter(|(iy, _)| reach.contains(iy));
        rows.for_each_init(
            || vec![Complex32::ZERO; set.count() * sites],
            |formed, (iy, to)| {
                set.fill_rows(iy, formed);
                for (mut to, from) in to.into_iter().zip(formed.chunks_exact(sites)) {
                    to.assign(&ArrayView1::from(from));
                }
            },
        );
        let map = |values| Self {
            lattice,
            radius_um,
            values,
        };
        all.into_iter().map(map).collect()
    }

    /// Transmission of each site.
    pub fn values(&self) -> &Array2<Complex32> {
        &self.values
    }
}

impl<A: Aperture + ?Sized> Aperture for &A {
    fn lattice(&self) -> Lattice {
        (**self).lattice()
    }

    fn radius_um(&self) -> f64 {
        (**self).radius_um()
    }

    fn fill_row(&self, iy: usize, row: &mut [Complex32]) {
        (**self).fill_row(iy, row);
    }
}

impl Aperture for TransmissionMap {
    fn lattice(&self) -> Lattice {
        self.lattice
    }

    fn radius_um(&self) -> f64 {
        self.radius_um
    }

    fn fill_row(&self, iy: usize, row: &mut [Complex32]) {
        match self.values.row(iy).to_slice() {
            Some(values) => row.copy_from_slice(values),
            None => row
                .iter_mut()
                .zip(self.values.row(iy))
                .for_each(|(to, from)| *to = *from),
        }
    }
}

/// Pillars as they stand in a layout, through a table of what each width transmits.
#[derive(Clone)]
pub struct Pillars<'a> {
    widths: &'a dyn PillarRows,
    table: Vec<Complex32>,
    radius_um: f64,
}

impl<'a> Pillars<'a> {
    /// `table[w]` is the transmission of a pillar `w` nm wide, as `CellModel::transmissions` gives it.
    /// Sites without a pillar are blocked, whatever entry 0 says.
    ///
    /// # Errors
    /// If a width is beyond the table.
    pub fn new(widths: &'a dyn PillarRows, table: &[Complex64]) -> Result<Self> {
        let largest = usize::from(widths.largest_number());
        if largest >= table.len() {
            return Err(WaveError::Width {
                width_nm: largest,
                last_nm: table.len().saturating_sub(1),
            });
        }
        Ok(Self {
            widths,
            table: by_width(table),
            radius_um: widths.circle_um(),
        })
    }
}

impl Aperture for Pillars<'_> {
    fn lattice(&self) -> Lattice {
        self.widths.lattice()
    }

    fn radius_um(&self) -> f64 {
        self.radius_um
    }

    fn fill_row(&self, iy: usize, row: &mut [Complex32]) {
        let mut room = Vec::new();
        for (t, &w) in row
            .iter_mut()
            .zip(self.widths.row(iy, 0..self.widths.lattice().sites(), &mut room))
        {
            *t = self.table[usize::from(w)];
        }
    }
}

/// A table of what each width transmits in single precision; without a pillar, nothing.
fn by_width(table: &[Complex64]) -> Vec<Complex32> {
    let mut table = table.iter().map(|t| single(*t)).collect::<Vec<_>>();
    if let Some(none) = table.first_mut() {
        *none = Complex32::ZERO;
    }
    table
}

/// Pillars whose width is a function of place, formed as rows are asked for: nothing of the size of the
/// element is held, for sweeps over designs that are never laid out.
#[derive(Clone, Debug)]
pub struct PillarFunction<F> {
    lattice: Lattice,
    radius_um: f64,
    table: Vec<Complex32>,
    width_nm: F,
}

impl<F: Fn(f64, f64) -> u16 + Sync> PillarFunction<F> {
    /// `width_nm` at x, y (um) from the element's centre, asked for within the circle; `table` as in
    /// [`Pillars::new`]. A width beyond the table passes nothing.
    pub fn new(lattice: Lattice, radius_um: f64, table: &[Complex64], width_nm: F) -> Self {
        Self {
            lattice,
            radius_um,
            table: by_width(table),
            width_nm,
        }
    }
}

impl<F: Fn(f64, f64) -> u16 + Sync> Aperture for PillarFunction<F> {
    fn lattice(&self) -> Lattice {
        self.lattice
    }

    fn radius_um(&self) -> f64 {
        self.radius_um
    }

    fn fill_row(&self, iy: usize, row: &mut [Complex32]) {
        let y = self.lattice.place_um(1, iy);
        let inside = sites_inside(&self.lattice, self.radius_um, iy);
        row.fill(Complex32::ZERO);
        for (ix, t) in inside
            .clone()
            .zip(&mut row[inside])
            .filter(|(ix, _)| self.lattice.has(*ix, iy))
        {
            let width = (self.width_nm)(self.lattice.place_um(0, ix), y);
            *t = self.table.get(usize::from(width)).copied().unwrap_or_default();
        }
    }
}

/// Places of row `iy` inside a circle about the centre. Counted in whole half pitches, so that sites related
/// by symmetry agree; on a hexagonal lattice in half nanometres. None in a row that the lattice does not reach.
pub(super) fn sites_inside(lattice: &Lattice, radius_um: f64, iy: usize) -> std::ops::Range<usize> {
    let n = lattice.sites();
    if !lattice.reach()[1].contains(&iy) {
        return 0..0;
    }
    let radius = radius_um * 1e3 / lattice.unit_nm();
    // A radius of whole half pitches must include the sites on it, however its decimals were rounded.
    const ROUNDING: f64 = 1e-12;
    let limit = (radius * radius * (1.0 + ROUNDING)).floor() as i64;
    let first = (0..n.div_ceil(2)).find(|&ix| lattice.units2(ix, iy) <= limit);
    first.map_or(0..0, |first| first..n - first)
}

fn single(t: Complex64) -> Complex32 {
    Complex32::new(t.re as f32, t.im as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_pillars::PillarMap;

    #[test]
    fn circle_counts_its_sites_exactly() {
        // The count that the reference field was summed over.
        let lattice = Lattice::new(350, 2858).unwrap();
        let sites: usize = (0..2858).map(|iy| sites_inside(&lattice, 500.0, iy).len()).sum();
        assert_eq!(sites, 6_411_448);
    }

    #[test]
    fn pillars_know_how_far_out_they_reach() {
        let mut widths = PillarMap::empty(Lattice::new(350, 8).unwrap());
        widths.number[[6, 1]] = 120;
        let mut table = vec![Complex64::new(9.0, 9.0); 121];
        table[120] = Complex64::new(0.5, -0.25);
        let pillars = Pillars::new(&widths, &table).unwrap();
        const ROUNDING_UM: f64 = 1e-12;
        assert!((pillars.radius_um() - 2.5 * 0.35 * 2.0_f64.sqrt()).abs() < ROUNDING_UM);
        let mut row = [Complex32::ONE; 8];
        pillars.fill_row(6, &mut row);
        assert_eq!(row[1], Complex32::new(0.5, -0.25));
        assert_eq!(row[0], Complex32::ZERO);
        assert!(Pillars::new(&widths, &table[..120]).is_err());
    }
}
