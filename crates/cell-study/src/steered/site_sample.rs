//! A sample of the sites of an element with their neighbours.

use std::f64::consts::TAU;

use num_complex::Complex64;
use rayon::prelude::*;

use metalith_cell::{NEIGHBOUR_TERMS, NEIGHBOURS, NeighbourResponse, neighbours};
use metalith_core::Wedge;
use metalith_design::phase::{ElementPhase, LensPhase};

/// Sites of a sample: the first order of one is then within 0.005 of that of the element.
const SITES: usize = 4096;

/// Steps of the two-dimensional golden ratio (M. Roberts, 2018): places that fill a square evenly.
const GOLDEN: [f64; 2] = [0.754_877_666_246_693, 0.569_840_290_998_053];

/// Phases (turns, 0 to 1) of a site and of its neighbours, in the order of [`neighbours`].
#[derive(Clone, Copy, Debug)]
struct SitePhases {
    own: f64,
    neighbours: [f64; NEIGHBOURS.len()],
}

/// Sites all over an element.
#[derive(Clone, Debug)]
pub(super) struct SiteSample {
    sites: Vec<SitePhases>,
}

impl SiteSample {
    /// Sites of a lens with a wedge on it that have all their neighbours.
    pub(crate) fn new(lens: &LensPhase, wedge: &Wedge) -> Self {
        let phase = ElementPhase::new(lens, wedge);
        let n = lens.lattice().sites();
        let offsets = neighbours(lens.lattice().kind());
        let at = |k: usize| {
            let [x, y] = GOLDEN.map(|step| ((k as f64 * step).fract() * n as f64) as usize);
            let wrapped = |offset: [i32; 2]| {
                let x = x.checked_add_signed(offset[0] as isize)?;
                let y = y.checked_add_signed(offset[1] as isize)?;
                (x < n && y < n).then(|| phase.wrapped(x, y))?
            };
            let mut neighbours = [0.0; NEIGHBOURS.len()];
            for (to, offset) in neighbours.iter_mut().zip(offsets) {
                *to = wrapped(*offset)?;
            }
            Some(SitePhases {
                own: wrapped([0, 0])?,
                neighbours,
            })
        };
        // A circle fills more than half of its square; on a hexagonal lattice every other place is a site, and rows are farther from one
        // another than columns.
        let places = if lens.lattice().is_square() { 2 } else { 8 };
        Self {
            sites: (0..places * SITES).filter_map(at).take(SITES).collect(),
        }
    }

    /// Share of the light in the first order for each table (responses for s and p, all of one basis), mean of s and p,
    /// where a phase of u turns is drawn with `width_nm(u)`.
    pub(crate) fn shares(&self, width_nm: impl Fn(f64) -> f64 + Sync, tables: &[[NeighbourResponse; 2]]) -> Vec<f64> {
        let Some([first, _]) = tables.first() else {
            return Vec::new();
        };
        // A table weighs terms, so the terms are summed over the sites, once for all tables.
        let sums = self
            .sites
            .par_chunks(256)
            .map(|sites| {
                let mut sums = [Complex64::ZERO; NEIGHBOUR_TERMS];
                for site in sites {
                    let terms = first.basis.terms(width_nm(site.own), &site.neighbours.map(&width_nm));
                    let back = Complex64::cis(-TAU * site.own);
                    sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += back * term);
                }
                sums
            })
            .collect::<Vec<_>>();
        // Chunk by chunk, so that the sum is the same on any number of threads.
        let mut all = [Complex64::ZERO; NEIGHBOUR_TERMS];
        for sums in sums {
            all.iter_mut().zip(sums).for_each(|(all, sum)| *all += sum);
        }
        let count = self.sites.len().max(1) as f64;
        let share = |response: &NeighbourResponse| {
            let sum: Complex64 = response.weights.iter().zip(all).map(|(w, t)| w * t).sum();
            (sum / count).norm_sqr()
        };
        let both = |table: &[NeighbourResponse; 2]| table.iter().map(share).sum::<f64>() / 2.0;
        tables.iter().map(both).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_cell::NeighbourBasis;
    use metalith_cell::SiteResponse;
    use metalith_design::phase::RadialPhase;
    use metalith_pillars::Lattice;

    /// Tolerance that is stated for a sample of so many sites.
    const SAMPLED: f64 = 0.005;

    /// Sites of a sample give what all sites of the element give.
    #[test]
    fn a_sample_stands_for_the_element() {
        let lattice = Lattice::covering(100_000, 350).unwrap();
        let radial = RadialPhase::Hyperbola {
            wavelength_um: 0.55,
            focal_length_um: 240.0,
        };
        let lens = LensPhase::new(lattice, 100_000, &radial);
        let wedge = Wedge {
            wavelength_um: 0.55,
            sin_x: -0.26,
            sin_y: -0.1,
        };
        let basis = NeighbourBasis::new([100.0, 200.0, 300.0].into_iter());
        // A pillar that turns the light by its width, and neighbours of some weight.
        let response = |seed: usize| NeighbourResponse {
            basis,
            weights: (0..NEIGHBOUR_TERMS)
                .map(|i| Complex64::cis((i * seed) as f64) / (1.0 + i as f64))
                .collect(),
        };
        let table = [response(2), response(3)];
        let width_nm = |u: f64| 110.0 + 180.0 * u;
        let found = SiteSample::new(&lens, &wedge).shares(width_nm, std::slice::from_ref(&table))[0];

        let phase = ElementPhase::new(&lens, &wedge);
        let n = lattice.sites() as i32;
        let at = |x: i32, y: i32| {
            let within = (0..n).contains(&x) && (0..n).contains(&y);
            within.then(|| phase.wrapped(x as usize, y as usize))?
        };
        let (mut sums, mut count) = ([Complex64::ZERO; 2], 0.0);
        for (x, y) in (0..n).flat_map(|y| (0..n).map(move |x| (x, y))) {
            let Some(own) = at(x, y) else { continue };
            let around: Option<Vec<f64>> = NEIGHBOURS.iter().map(|[dx, dy]| at(x + dx, y + dy)).collect();
            let Some(around) = around else { continue };
            for (sum, response) in sums.iter_mut().zip(&table) {
                let pairs = around.iter().enumerate();
                let t: Complex64 = pairs.map(|(k, u)| response.pair(k, width_nm(own), width_nm(*u))).sum();
                *sum += (response.own(width_nm(own)) + t) * Complex64::cis(-TAU * own);
            }
            count += 1.0;
        }
        let wanted = sums.map(|sum| (sum / count).norm_sqr()).iter().sum::<f64>() / 2.0;
        assert!(wanted > 0.05 && (found - wanted).abs() < SAMPLED, "{found} {wanted}");
    }
}
