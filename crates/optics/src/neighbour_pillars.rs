//! The pillars of an element, each among its own neighbours.

use num_complex::{Complex32, Complex64};

use metalith_cell::{NEIGHBOURS, NeighbourResponse, Orientation, SiteResponse};
use metalith_core::{Error, Result};
use metalith_pillars::{Lattice, PillarMap};
use metalith_wave::Aperture;

/// Rows and columns around a site that hold its neighbours.
const REACH: usize = 2;

/// Most widths of an element: tables of their pairs take 100 MB.
const MOST_WIDTHS: usize = 1000;

/// Pillars as they stand in a layout, which transmit by their own width and those around them. Where there is no
/// pillar nothing passes, and a missing neighbour counts with the mean over all widths.
#[derive(Clone, Debug)]
pub struct NeighbourPillars<'a> {
    widths: &'a PillarMap,
    radius_um: f64,
    /// Column of each drawn width (nm); that after the last stands for no pillar.
    columns: Vec<u16>,
    count: usize,
    /// Terms by own column.
    own: Vec<Complex32>,
    /// Terms by offset, own column and neighbour's.
    pairs: Vec<Complex32>,
}

impl<'a> NeighbourPillars<'a> {
    /// Pillars in light of one polarisation, 0 for s and 1 for p: as [`NeighbourPillars::new`], with responses for s
    /// and p.
    ///
    /// # Errors
    /// As [`NeighbourPillars::new`].
    pub fn polarised(
        widths: &'a PillarMap,
        responses: &[NeighbourResponse; 2],
        sines: [f64; 2],
        polarisation: usize,
    ) -> Result<Self> {
        let orientation = Orientation::of(sines, [0.0; 2]);
        Self::new(widths, &responses[orientation.polarisation(polarisation)], sines)
    }

    /// `sines` is the direction of arrival at the element; the response is that of the direction that [`Orientation`] turns
    /// it to.
    ///
    /// # Errors
    /// If there are too many widths to make a table of their pairs.
    pub fn new(widths: &'a PillarMap, response: &impl SiteResponse, sines: [f64; 2]) -> Result<Self> {
        let orientation = Orientation::of(sines, [0.0; 2]);
        let counts = widths.histogram().into_iter().enumerate().skip(1);
        let drawn: Vec<u16> = counts.filter(|(_, n)| *n > 0).map(|(w, _)| w as u16).collect();
        let count = drawn.len();
        if count > MOST_WIDTHS {
            return Err(Error::refused(
                "neighbours/too-many-widths",
                format!("the element has pillars of {count} widths, more than {MOST_WIDTHS}"),
                format!("simulate it with another `fidelity`: the coupled model supports {MOST_WIDTHS} widths"),
            ));
        }
        let last = drawn.last().copied().unwrap_or(0);
        let mut columns = vec![count as u16; usize::from(last) + 1];
        for (column, width) in drawn.iter().enumerate() {
            columns[usize::from(*width)] = column as u16;
        }
        let numbers = NEIGHBOURS.map(|offset| {
            let turned = orientation.turned(offset.map(f64::from)).map(|v| v as i32);
            let found = NEIGHBOURS.iter().position(|other| *other == turned);
            found.expect("the neighbours are symmetric")
        });
        let width = |column: &u16| f64::from(*column);
        let mut pairs = Vec::with_capacity(NEIGHBOURS.len() * count * (count + 1));
        for number in numbers {
            for own in &drawn {
                let with = |other: &u16| single(response.pair(number, width(own), width(other)));
                pairs.extend(drawn.iter().map(with).chain([Complex32::ZERO]));
            }
        }
        Ok(Self {
            widths,
            radius_um: widths.circle_um(),
            columns,
            count,
            own: drawn.iter().map(|w| single(response.own(width(w)))).collect(),
            pairs,
        })
    }

    /// Columns of a row of sites with `REACH` more on either side; of none if there is no such row.
    fn columns_of(&self, iy: Option<usize>) -> Vec<u16> {
        let n = self.widths.lattice.sites();
        let mut all = vec![self.count as u16; n + 2 * REACH];
        if let Some(iy) = iy.filter(|iy| *iy < n) {
            for (to, width) in all[REACH..].iter_mut().zip(self.widths.number.row(iy)) {
                *to = self.columns[usize::from(*width)];
            }
        }
        all
    }
}

impl Aperture for NeighbourPillars<'_> {
    fn lattice(&self) -> Lattice {
        self.widths.lattice
    }

    fn radius_um(&self) -> f64 {
        self.radius_um
    }

    fn fill_row(&self, iy: usize, row: &mut [Complex32]) {
        let rows: Vec<Vec<u16>> = (0..=2 * REACH)
            .map(|step| self.columns_of((iy + step).checked_sub(REACH)))
            .collect();
        let (own, none) = (&rows[REACH], self.count);
        for (t, column) in row.iter_mut().zip(&own[REACH..]) {
            let column = usize::from(*column);
            *t = if column < none {
                self.own[column]
            } else {
                Complex32::ZERO
            };
        }
        for (pairs, offset) in self.pairs.chunks_exact((none * (none + 1)).max(1)).zip(NEIGHBOURS) {
            let [x, y] = offset.map(|v| (v + REACH as i32) as usize);
            for ((t, column), neighbour) in row.iter_mut().zip(&own[REACH..]).zip(&rows[y][x..]) {
                let column = usize::from(*column);
                if column < none {
                    *t += pairs[column * (none + 1) + usize::from(*neighbour)];
                }
            }
        }
    }
}

fn single(t: Complex64) -> Complex32 {
    Complex32::new(t.re as f32, t.im as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_cell::{NEIGHBOUR_TERMS, NeighbourBasis};

    /// Twelve numbers of single precision.
    const SINGLE: f32 = 1e-5;

    fn response(seed: usize) -> NeighbourResponse {
        let weight = |i: usize| Complex64::cis((i * seed) as f64) / (1.0 + i as f64);
        NeighbourResponse {
            basis: NeighbourBasis::new([100.0, 150.0, 300.0].into_iter()),
            weights: (0..NEIGHBOUR_TERMS).map(weight).collect(),
        }
    }

    fn widths() -> PillarMap {
        let mut widths = PillarMap::empty(Lattice::new(350, 9).unwrap());
        for ((iy, ix), w) in widths.number.indexed_iter_mut() {
            *w = if (ix * iy) % 7 == 3 {
                0
            } else {
                100 + 2 * ((ix * 31 + iy * 17) % 100) as u16
            };
        }
        widths
    }

    #[test]
    fn sites_transmit_the_sum_over_their_neighbours() {
        let (widths, responses) = (widths(), [response(3), response(5)]);
        // Arriving from -y: the table is for light along +x, so that (0, -1) there is (1, 0).
        let pillars = NeighbourPillars::polarised(&widths, &responses, [0.0, -0.3], 1).unwrap();
        let mut row = vec![Complex32::ZERO; 9];
        for iy in 0..9_usize {
            pillars.fill_row(iy, &mut row);
            for (ix, t) in row.iter().enumerate() {
                let own = widths.number[(iy, ix)];
                let mut wanted = Complex64::ZERO;
                if own > 0 {
                    wanted = responses[1].own(f64::from(own));
                    for (number, [dx, dy]) in NEIGHBOURS.into_iter().enumerate() {
                        // In the table's frame x is -y of the element.
                        let (x, y) = (ix as i32 + dy, iy as i32 - dx);
                        if (0..9).contains(&x) && (0..9).contains(&y) {
                            let other = widths.number[(y as usize, x as usize)];
                            if other > 0 {
                                wanted += responses[1].pair(number, f64::from(own), f64::from(other));
                            }
                        }
                    }
                }
                assert!((single(wanted) - t).norm() < SINGLE, "{ix} {iy}: {wanted} {t}");
            }
        }
    }

    #[test]
    fn nothing_passes_without_pillars() {
        let widths = PillarMap::empty(Lattice::new(350, 4).unwrap());
        let pillars = NeighbourPillars::new(&widths, &response(3), [0.0; 2]).unwrap();
        let mut row = vec![Complex32::ONE; 4];
        pillars.fill_row(2, &mut row);
        assert_eq!(row, vec![Complex32::ZERO; 4]);
    }
}
