//! Light that an element sends into each order of its design phase, by the transmission of its sites.

use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

use metalith_design::phase::ElementPhase;
use metalith_wave::Aperture;
use metalith_wave::kernels::cis;

/// Edge of the blocks over which the field of a site is added up with the phase of an order: over it an order is nearly
/// one wave, and what belongs to other orders adds one part in a thousand.
const BLOCK: usize = 32;

/// Every so many rows of blocks are looked at, which is enough for a mean over an element.
const EVERY: usize = 4;

/// Shares of the arriving light.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct SiteShares {
    /// Shares in the orders 0, 1 and 2 of the phase.
    pub orders: [f64; 3],
    /// Share transmitted in all.
    pub transmitted: f64,
}

#[derive(Clone, Copy, Default)]
struct Sums {
    orders: [f64; 3],
    transmitted: f64,
    sites: f64,
}

/// Shares of an element's light, mean over its polarisations; `full` is |t| of a site that passes everything.
pub(super) fn site_shares(apertures: &[&dyn Aperture], phase: &ElementPhase<'_>, full: f64) -> SiteShares {
    let n = phase.lattice().sites();
    let rows: Vec<usize> = (0..n.div_ceil(BLOCK)).step_by(EVERY).collect();
    let of_rows: Vec<Sums> = rows.par_iter().map(|by| row_of_blocks(apertures, phase, *by)).collect();
    // In the order of the rows, so that the sum does not depend on threads.
    let all = of_rows.iter().fold(Sums::default(), |a, b| Sums {
        orders: std::array::from_fn(|m| a.orders[m] + b.orders[m]),
        transmitted: a.transmitted + b.transmitted,
        sites: a.sites + b.sites,
    });
    let arriving = (all.sites * full * full).max(f64::MIN_POSITIVE);
    SiteShares {
        orders: all.orders.map(|power| power / arriving),
        transmitted: all.transmitted / arriving,
    }
}

fn row_of_blocks(apertures: &[&dyn Aperture], phase: &ElementPhase<'_>, by: usize) -> Sums {
    let n = phase.lattice().sites();
    let blocks = n.div_ceil(BLOCK);
    let mut amplitudes = vec![[Complex64::ZERO; 3]; blocks * apertures.len()];
    let mut sites = vec![0.0; blocks];
    let mut transmitted = 0.0;
    let mut row = vec![Complex32::ZERO; n];
    for iy in by * BLOCK..((by + 1) * BLOCK).min(n) {
        let back: Vec<Option<Complex32>> = (0..n).map(|ix| Some(cis(-phase.wrapped(ix, iy)?))).collect();
        for (ix, _) in back.iter().enumerate().filter(|(_, back)| back.is_some()) {
            sites[ix / BLOCK] += 1.0;
        }
        for (aperture, amplitudes) in apertures.iter().zip(amplitudes.chunks_exact_mut(blocks)) {
            aperture.fill_row(iy, &mut row);
            for (ix, (t, back)) in row.iter().zip(&back).enumerate() {
                let Some(back) = back else { continue };
                let mut turned = *t;
                for amplitude in &mut amplitudes[ix / BLOCK] {
                    *amplitude += Complex64::new(f64::from(turned.re), f64::from(turned.im));
                    turned *= back;
                }
                transmitted += f64::from(t.norm_sqr());
            }
        }
    }
    let share = 1.0 / apertures.len().max(1) as f64;
    let mut sums = Sums {
        transmitted: transmitted * share,
        sites: sites.iter().sum(),
        ..Sums::default()
    };
    for amplitudes in amplitudes.chunks_exact(blocks) {
        for (amplitudes, sites) in amplitudes.iter().zip(&sites).filter(|(_, sites)| **sites > 0.0) {
            for (sum, amplitude) in sums.orders.iter_mut().zip(amplitudes) {
                *sum += share * amplitude.norm_sqr() / sites;
            }
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_core::Wedge;
    use metalith_design::phase::{LensPhase, RadialPhase};
    use metalith_pillars::Lattice;
    use metalith_wave::PhaseMap;

    /// Share that other orders add, of a block's thousand sites.
    const OTHERS: f64 = 0.01;

    struct Mixed<'a>(&'a ElementPhase<'a>, [f64; 3]);

    impl Aperture for Mixed<'_> {
        fn lattice(&self) -> Lattice {
            self.0.lattice()
        }

        fn fill_row(&self, iy: usize, row: &mut [Complex32]) {
            for (ix, t) in row.iter_mut().enumerate() {
                *t = self.0.wrapped(ix, iy).map_or(Complex32::ZERO, |u| {
                    (0..3).map(|m| cis(m as f64 * u) * self.1[m] as f32).sum()
                });
            }
        }
    }

    #[test]
    fn orders_that_are_put_in_are_found() {
        let lattice = Lattice::new(350, 300).unwrap();
        let lens = LensPhase::new(
            lattice,
            100_000,
            &RadialPhase::Hyperbola {
                focal_length_um: 200.0,
                wavelength_um: 0.5,
            },
        );
        let wedge = Wedge {
            wavelength_um: 0.55,
            sin_x: 0.25,
            sin_y: 0.1,
        };
        let phase = ElementPhase::new(&lens, &wedge);
        let mixed = Mixed(&phase, [0.3, 1.2, 0.5]);
        let found = site_shares(&[&mixed], &phase, 2.0);
        for (found, amplitude) in found.orders.iter().zip(mixed.1) {
            let wanted = amplitude * amplitude / 4.0;
            assert!((found - wanted).abs() < OTHERS, "{found} {wanted}");
        }
        let whole: f64 = mixed.1.iter().map(|a| a * a / 4.0).sum();
        assert!((found.transmitted - whole).abs() < OTHERS, "{}", found.transmitted);
        // The phase itself is all first order.
        let pure = PhaseMap::new(lattice, 50.0, |ix, iy| phase.turns(ix, iy));
        let found = site_shares(&[&pure, &pure], &phase, 1.0);
        assert!((found.orders[1] - 1.0).abs() < OTHERS && (found.transmitted - 1.0).abs() < 1e-6);
    }
}
