//! The pillars of an element, each among its own neighbours.

use std::ops::Range;

use ndarray::{Array2, ArrayView1};
use num_complex::{Complex32, Complex64};
use pulp::{Arch, Simd, WithSimd};

use metalith_cell::{NEIGHBOUR_DEGREE, NEIGHBOURS, NeighbourResponse, Orientation, SiteResponse};
use metalith_pillars::{Lattice, PillarMap};
use metalith_wave::{Aperture, ApertureSet};

/// Rows and columns around a site that hold its neighbours.
const REACH: usize = 2;

/// Factors of the term of a pair, for its real and its imaginary part.
const FACTORS: usize = 2 * NEIGHBOUR_DEGREE;

/// The widths of an element in the form that sums over neighbours take them: once for light of all wavelengths and directions.
#[derive(Clone, Debug)]
pub struct NeighbourSites {
    lattice: Lattice,
    radius_um: f64,
    /// Widths that are drawn (nm), rising.
    drawn: Vec<u16>,
    /// Number of each site's width among those drawn, and their count where there is no pillar; with `REACH` places more on each
    /// side.
    columns: Array2<u16>,
    /// Places of each row between which all its pillars stand.
    filled: Vec<Range<usize>>,
}

impl NeighbourSites {
    /// Sites of an element with pillars of these widths.
    pub fn of(widths: &PillarMap) -> Self {
        let counts = widths.histogram().into_iter().enumerate().skip(1);
        let drawn: Vec<u16> = counts.filter(|(_, n)| *n > 0).map(|(w, _)| w as u16).collect();
        let none = drawn.len() as u16;
        let mut column_of = vec![none; usize::from(drawn.last().copied().unwrap_or(0)) + 1];
        for (column, width) in drawn.iter().enumerate() {
            column_of[usize::from(*width)] = column as u16;
        }
        let n = widths.lattice.sites();
        let mut columns = Array2::from_elem([n + 2 * REACH; 2], none);
        let inner = columns.rows_mut().into_iter().skip(REACH);
        for (mut to, widths) in inner.zip(widths.number.rows()) {
            for (to, width) in to.iter_mut().skip(REACH).zip(widths) {
                *to = column_of[usize::from(*width)];
            }
        }
        let filled = |row: ArrayView1<'_, u16>| {
            let first = row.iter().position(|width| *width > 0).unwrap_or(0);
            let end = row.iter().rposition(|width| *width > 0).map_or(0, |last| last + 1);
            first..end
        };
        Self {
            lattice: widths.lattice,
            radius_um: widths.circle_um(),
            filled: widths.number.rows().into_iter().map(filled).collect(),
            drawn,
            columns,
        }
    }

    /// Places of a row of sites that is `y` rows above row `iy`, with `REACH` more on either side.
    fn row(&self, iy: usize, y: i32) -> &[u16] {
        let row = self.columns.row((iy as i32 + y) as usize + REACH);
        row.to_slice().expect("rows are contiguous")
    }
}

/// Pillars as they stand in a layout, which transmit by their own width and those around them, in each of `P` polarisations. Where
/// there is no pillar nothing passes, and a missing neighbour counts with the mean over all widths.
#[derive(Clone, Debug)]
pub struct NeighbourPillars<'a, const P: usize> {
    sites: &'a NeighbourSites,
    /// Terms by own column; zero for no pillar.
    own: Vec<[Complex32; P]>,
    /// Factors of the terms of pairs by own column and offset, those of the real before those of the imaginary part; zero for no
    /// pillar. All pairs of widths would be a table larger than a processor's own memory.
    factors: Vec<[[[f32; FACTORS]; P]; NEIGHBOURS.len()]>,
    /// The other factors, by the neighbour's column, for both parts; zero for no pillar.
    neighbours: Vec<[f32; FACTORS]>,
}

impl<'a> NeighbourPillars<'a, 2> {
    /// Pillars in light of both polarisations, s and p: as [`NeighbourPillars::new`], with responses for s and p.
    pub fn polarised(sites: &'a NeighbourSites, responses: &[NeighbourResponse; 2], sines: [f64; 2]) -> Self {
        let orientation = Orientation::of(sines, [0.0; 2]);
        Self::new(sites, [0, 1].map(|p| &responses[orientation.polarisation(p)]), sines)
    }
}

impl<'a, const P: usize> NeighbourPillars<'a, P> {
    /// `sines` is the direction of arrival at the element; the responses are those of the direction that [`Orientation`] turns
    /// it to.
    pub fn new(sites: &'a NeighbourSites, responses: [&impl SiteResponse; P], sines: [f64; 2]) -> Self {
        let orientation = Orientation::of(sines, [0.0; 2]);
        let numbers = NEIGHBOURS.map(|offset| {
            let turned = orientation.turned(offset.map(f64::from)).map(|v| v as i32);
            let found = NEIGHBOURS.iter().position(|other| *other == turned);
            found.expect("the neighbours are symmetric")
        });
        let widths = || sites.drawn.iter().map(|width| f64::from(*width));
        let of_pair = |number: usize, own: f64| {
            responses.map(|response| {
                let factors = response.pair_factors(number, own);
                std::array::from_fn(|k| {
                    let factor = factors[k % NEIGHBOUR_DEGREE];
                    (if k < NEIGHBOUR_DEGREE { factor.re } else { factor.im }) as f32
                })
            })
        };
        let of_pairs = widths().map(|own| numbers.map(|number| of_pair(number, own)));
        let of_neighbour = |width: f64| {
            let factors = responses[0].neighbour_factors(width);
            std::array::from_fn(|k| factors[k % NEIGHBOUR_DEGREE] as f32)
        };
        let own = widths().map(|own| responses.map(|response| single(response.own(own))));
        Self {
            own: own.chain([[Complex32::ZERO; P]]).collect(),
            factors: of_pairs.chain([[[[0.0; FACTORS]; P]; NEIGHBOURS.len()]]).collect(),
            neighbours: widths().map(of_neighbour).chain([[0.0; FACTORS]]).collect(),
            sites,
        }
    }

    /// Transmissions of the sites of a row between which its pillars stand.
    fn sums(&self, iy: usize, filled: Range<usize>) -> Vec<[Complex32; P]> {
        let mut sums = vec![[Complex32::ZERO; P]; filled.len()];
        let places = |[x, y]: [i32; 2]| {
            let first = filled.start + (REACH as i32 + x) as usize;
            &self.sites.row(iy, y)[first..first + filled.len()]
        };
        Arch::new().dispatch(RowSums {
            pillars: self,
            own: places([0, 0]),
            around: NEIGHBOURS.map(places),
            sums: &mut sums,
        });
        sums
    }
}

/// Sums over the neighbours of each site of a row.
struct RowSums<'a, const P: usize> {
    pillars: &'a NeighbourPillars<'a, P>,
    /// Columns of the sites, and of the neighbour of each at each offset.
    own: &'a [u16],
    around: [&'a [u16]; NEIGHBOURS.len()],
    sums: &'a mut [[Complex32; P]],
}

impl<const P: usize> WithSimd for RowSums<'_, P> {
    type Output = ();

    // Products and sums are rounded one by one, and added in the same order with vectors of any length: all machines get the same bits.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let around = self.around.map(|columns| &columns[..self.sums.len()]);
        for (ix, (column, out)) in self.own.iter().zip(self.sums).enumerate() {
            let column = usize::from(*column);
            let factors = &self.pillars.factors[column];
            let mut sums = [[simd.splat_f32s(0.0); FACTORS]; P];
            let mut rests = [[0.0; FACTORS]; P];
            for (factors, columns) in factors.iter().zip(around) {
                let (neighbour, rest) = S::as_simd_f32s(&self.pillars.neighbours[usize::from(columns[ix])]);
                for p in 0..P {
                    let (own, own_rest) = S::as_simd_f32s(&factors[p]);
                    for k in 0..own.len() {
                        sums[p][k] = simd.add_f32s(sums[p][k], simd.mul_f32s(own[k], neighbour[k]));
                    }
                    // Of vectors that are longer than all factors.
                    for k in 0..own_rest.len() {
                        rests[p][k] += own_rest[k] * rest[k];
                    }
                }
            }
            for p in 0..P {
                let mut all = rests[p];
                let (to, _) = S::as_mut_simd_f32s(&mut all);
                for (to, sum) in to.iter_mut().zip(sums[p]) {
                    *to = sum;
                }
                let [re, im] = [0, NEIGHBOUR_DEGREE].map(|k| all[k..k + NEIGHBOUR_DEGREE].iter().sum::<f32>());
                out[p] = self.pillars.own[column][p] + Complex32::new(re, im);
            }
        }
    }
}

impl<const P: usize> ApertureSet for NeighbourPillars<'_, P> {
    fn lattice(&self) -> Lattice {
        self.sites.lattice
    }

    fn count(&self) -> usize {
        P
    }

    fn fill_rows(&self, iy: usize, rows: &mut [Complex32]) {
        let filled = self.sites.filled[iy].clone();
        let sums = self.sums(iy, filled.clone());
        rows.fill(Complex32::ZERO);
        for (p, row) in rows.chunks_exact_mut(self.sites.lattice.sites()).enumerate() {
            for (t, sum) in row[filled.clone()].iter_mut().zip(&sums) {
                *t = sum[p];
            }
        }
    }
}

impl Aperture for NeighbourPillars<'_, 1> {
    fn lattice(&self) -> Lattice {
        self.sites.lattice
    }

    fn radius_um(&self) -> f64 {
        self.sites.radius_um
    }

    fn fill_row(&self, iy: usize, row: &mut [Complex32]) {
        self.fill_rows(iy, row);
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
        let sites = NeighbourSites::of(&widths);
        let pillars = NeighbourPillars::polarised(&sites, &responses, [0.0, -0.3]);
        let mut rows = vec![Complex32::ZERO; 2 * 9];
        for iy in 0..9_usize {
            pillars.fill_rows(iy, &mut rows);
            for (k, t) in rows.iter().enumerate() {
                let (response, ix) = (&responses[k / 9], k % 9);
                let own = widths.number[(iy, ix)];
                let mut wanted = Complex64::ZERO;
                if own > 0 {
                    wanted = response.own(f64::from(own));
                    for (number, [dx, dy]) in NEIGHBOURS.into_iter().enumerate() {
                        // In the table's frame x is -y of the element.
                        let (x, y) = (ix as i32 + dy, iy as i32 - dx);
                        if (0..9).contains(&x) && (0..9).contains(&y) {
                            let other = widths.number[(y as usize, x as usize)];
                            if other > 0 {
                                wanted += response.pair(number, f64::from(own), f64::from(other));
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
        let sites = NeighbourSites::of(&widths);
        let pillars = NeighbourPillars::new(&sites, [&response(3)], [0.0; 2]);
        let mut row = vec![Complex32::ONE; 4];
        pillars.fill_row(2, &mut row);
        assert_eq!(row, vec![Complex32::ZERO; 4]);
    }
}
