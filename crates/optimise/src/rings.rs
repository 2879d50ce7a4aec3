//! The rings of a lens: what the phases are optimised over.

use metalith_core::{Error, Result};
use metalith_core::{Lattice, WidthMap};

/// Points at which a ring is sampled along r^2. The kernels turn by at most 1.2 rad across a ring of
/// one pitch (400 nm, NA 0.2); Chebyshev interpolation at eight points then errs by 1e-9.
const NODES: usize = 8;

/// The lattice sites of a round lens, ring by ring.
///
/// Ring `k` is the set of sites with floor(r / pitch) = k, r from the centre of the lens. On a lattice
/// with an even number of sites no site lies on a boundary, since 4 r^2 / pitch^2 is 2 modulo 8. Sites
/// next to one another are in the same ring or in neighbouring ones.
///
/// The sum over the sites of a ring of a function smooth in r^2 is a weighted sum over eight radii,
/// whose weights reproduce the sum over the real sites of every polynomial in r^2 of degree seven.
#[derive(Clone, Debug)]
pub struct Rings {
    lattice: Lattice,
    diameter_nm: u32,
    /// Number of sites at half_radius2 = 8 i + 2.
    counts: Vec<u32>,
    sites: Vec<u32>,
    nodes: Vec<[Node; NODES]>,
}

/// One radius that stands for a part of a ring.
#[derive(Clone, Copy, Debug, Default)]
pub struct Node {
    /// Distance from the centre (um).
    pub radius_um: f64,
    /// Number of sites it stands for; not whole, and a few are below zero.
    pub weight: f64,
}

impl Rings {
    /// The rings of a lens of this diameter: all sites with their centre within it.
    ///
    /// # Errors
    /// If the lattice has an odd number of sites, or is smaller than the lens.
    pub fn new(lattice: Lattice, diameter_nm: u32) -> Result<Self> {
        if !lattice.sites().is_multiple_of(2) || diameter_nm / lattice.pitch_nm() < 2 {
            return Err(Error::invalid(
                format!(
                    "a lens of {diameter_nm} nm on a lattice of {} sites has no rings",
                    lattice.sites()
                ),
                "use an even number of sites and a lens of several pitches",
            ));
        }
        if (lattice.sites() as u64) * u64::from(lattice.pitch_nm()) < u64::from(diameter_nm) {
            return Err(Error::invalid(
                format!("{} sites do not hold a lens of {diameter_nm} nm", lattice.sites()),
                "use more sites or a smaller lens",
            ));
        }
        let largest = half_radius2_within(diameter_nm, lattice.pitch_nm());
        let half = lattice.sites() / 2;
        let mut counts = vec![0u32; (largest.max(2) as usize - 2) / 8 + 1];
        for ix in half..lattice.sites() {
            for iy in half..=ix {
                let r2 = lattice.half_radius2(ix, iy);
                if r2 > largest {
                    break;
                }
                counts[(r2 as usize - 2) / 8] += if ix == iy { 4 } else { 8 };
            }
        }
        let mut rings = Self {
            lattice,
            diameter_nm,
            counts,
            sites: Vec::new(),
            nodes: Vec::new(),
        };
        let count = ring_of(rings.half_radius2_of(rings.counts.len() - 1)) + 1;
        (rings.sites, rings.nodes) = (0..count).map(|k| rings.sample(k)).unzip();
        Ok(rings)
    }

    /// Number of rings: 1429 for 1 mm at 350 nm.
    pub fn len(&self) -> usize {
        self.sites.len()
    }

    /// Whether there are no rings; a lens has at least one.
    pub fn is_empty(&self) -> bool {
        self.sites.is_empty()
    }

    /// The lattice that the lens stands on.
    pub fn lattice(&self) -> Lattice {
        self.lattice
    }

    /// Diameter of the lens (nm).
    pub fn diameter_nm(&self) -> u32 {
        self.diameter_nm
    }

    /// Number of sites of a ring.
    pub fn sites_of(&self, ring: usize) -> u32 {
        self.sites[ring]
    }

    /// Number of sites of the lens.
    pub fn sites(&self) -> u64 {
        self.sites.iter().map(|&n| u64::from(n)).sum()
    }

    /// Radius in the middle of a ring (um), (k + 1/2) pitch: where a table of the phase has its rows.
    pub fn middle_um(&self, ring: usize) -> f64 {
        (ring as f64 + 0.5) * self.lattice.pitch_um()
    }

    /// The ring of a site.
    pub fn ring_at(&self, ix: usize, iy: usize) -> Option<usize> {
        let r2 = self.lattice.half_radius2(ix, iy);
        (r2 <= half_radius2_within(self.diameter_nm, self.lattice.pitch_nm())).then(|| ring_of(r2))
    }

    /// Pillars of one width a ring. The array that a layout of this lens alone would hold.
    pub fn width_map(&self, width_of_ring_nm: &[u16]) -> WidthMap {
        let mut map = WidthMap::empty(self.lattice);
        for ((iy, ix), width) in map.width_nm.indexed_iter_mut() {
            if let Some(ring) = self.ring_at(ix, iy) {
                *width = width_of_ring_nm[ring];
            }
        }
        map
    }

    /// The radii that stand for a ring.
    pub fn nodes(&self, ring: usize) -> &[Node] {
        &self.nodes[ring]
    }

    /// Every distinct distance of a ring's sites (um) with its number of sites: the oracle of [`Node`].
    #[cfg(test)]
    pub fn distances(&self, ring: usize) -> impl Iterator<Item = (f64, u32)> {
        let half_pitch = 0.5 * self.lattice.pitch_um();
        self.bins(ring)
            .filter(|&i| self.counts[i] > 0)
            .map(move |i| ((self.half_radius2_of(i) as f64).sqrt() * half_pitch, self.counts[i]))
    }

    fn half_radius2_of(&self, bin: usize) -> i64 {
        8 * bin as i64 + 2
    }

    /// Bins of `counts` with 4 k^2 <= half_radius2 < 4 (k + 1)^2.
    fn bins(&self, ring: usize) -> std::ops::Range<usize> {
        let first = |k: usize| (4 * k * k).saturating_sub(2).div_ceil(8);
        first(ring)..first(ring + 1).min(self.counts.len())
    }

    fn sample(&self, ring: usize) -> (u32, [Node; NODES]) {
        let (low, high) = (4.0 * (ring * ring) as f64, 4.0 * ((ring + 1) * (ring + 1)) as f64);
        let mut at = [0.0; NODES];
        let mut nodes = [Node::default(); NODES];
        for (j, (at, node)) in at.iter_mut().zip(&mut nodes).enumerate() {
            let angle = std::f64::consts::PI * (j as f64 + 0.5) / NODES as f64;
            *at = 0.5 * (low + high) + 0.5 * (high - low) * angle.cos();
            node.radius_um = 0.5 * self.lattice.pitch_um() * at.sqrt();
        }
        let mut sites = 0;
        for bin in self.bins(ring) {
            let count = self.counts[bin];
            if count == 0 {
                continue;
            }
            sites += count;
            let s = self.half_radius2_of(bin) as f64;
            for (j, node) in nodes.iter_mut().enumerate() {
                let mut lagrange = f64::from(count);
                for (i, other) in at.iter().enumerate() {
                    if i != j {
                        lagrange *= (s - other) / (at[j] - other);
                    }
                }
                node.weight += lagrange;
            }
        }
        (sites, nodes)
    }
}

/// Largest square of a distance, in half pitches, within a diameter.
fn half_radius2_within(diameter_nm: u32, pitch_nm: u32) -> i64 {
    let (d, p) = (i64::from(diameter_nm), i64::from(pitch_nm));
    d * d / (p * p)
}

/// floor(r / pitch) from 4 r^2 / pitch^2, exactly.
pub fn ring_of(half_radius2: i64) -> usize {
    (half_radius2 as u64).isqrt() as usize / 2
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lens() -> Rings {
        Rings::new(Lattice::covering(1_000_000, 350).unwrap(), 1_000_000).unwrap()
    }

    #[test]
    fn a_lens_of_1_mm_has_1429_rings_and_all_its_sites() {
        let rings = lens();
        assert_eq!(rings.len(), 1429);
        assert_eq!(rings.sites(), 6_411_448);
        assert_eq!(rings.sites_of(0), 4);
    }

    #[test]
    fn every_site_is_in_the_ring_of_its_radius() {
        let rings = Rings::new(Lattice::covering(40_000, 350).unwrap(), 40_000).unwrap();
        let n = rings.lattice().sites();
        let mut sites = vec![0; rings.len()];
        for ix in 0..n {
            for iy in 0..n {
                let r = rings
                    .lattice()
                    .coordinate_um(ix)
                    .hypot(rings.lattice().coordinate_um(iy));
                let ring = rings.ring_at(ix, iy);
                assert_eq!(ring, (r <= 20.0).then(|| (r / 0.35).floor() as usize));
                if let Some(k) = ring {
                    sites[k] += 1;
                }
            }
        }
        assert_eq!(sites, rings.sites);
    }

    /// Sums over a ring of the fastest function the kernels hold, against all of its sites.
    #[test]
    fn nodes_stand_for_the_sites() {
        /// Error of Chebyshev interpolation, `NODES`, times a margin of ten for the sum.
        const TOLERANCE: f64 = 1e-8;
        let rings = lens();
        let k = std::f64::consts::TAU / 0.4;
        for ring in [0, 1, 2, 10, 700, 1427, 1428] {
            let wave = |r: f64| num_complex::Complex64::cis(k * (r.hypot(2000.0) - 2000.0));
            let exact = rings
                .distances(ring)
                .map(|(r, n)| wave(r) * f64::from(n))
                .sum::<num_complex::Complex64>();
            let quick = rings
                .nodes(ring)
                .iter()
                .map(|n| wave(n.radius_um) * n.weight)
                .sum::<num_complex::Complex64>();
            let error = (quick - exact).norm() / f64::from(rings.sites_of(ring));
            assert!(error < TOLERANCE, "ring {ring}: {error:e}");
        }
    }
}
