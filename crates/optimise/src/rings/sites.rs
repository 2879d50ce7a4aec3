//! The rings of a lens: what the phases are optimised over.

use std::sync::OnceLock;

use metalith_core::{Error, Result, lagrange_weight};
use metalith_pillars::{Lattice, PillarMap};

use super::neighbour_links::{Link, Links, distance_of, neighbour};
use super::ring_radii::{NODES, Node};
use metalith_cell::NEIGHBOURS;

/// The lattice sites of a round lens, ring by ring.
///
/// Ring `k` is the set of sites with floor(r / pitch) = k, r from the centre of the lens, formed from exact squares. On a square
/// lattice with an even number of sites no site lies on a boundary, since 4 r^2 / pitch^2 is 2 modulo 8; on a hexagonal one
/// the sites of its rows through the centre do, and are of the outer ring, as they are of the outer row of a table of phases.
/// Sites next to one another are in the same ring or in neighbouring ones.
///
/// The sum over the sites of a ring of a function smooth in r^2 is a weighted sum over eight radii,
/// whose weights reproduce the sum over the real sites of every polynomial in r^2 of degree seven.
#[derive(Clone, Debug)]
pub struct Rings {
    lattice: Lattice,
    diameter_nm: u32,
    /// Squares of the distances of sites in units of the lattice ([`Lattice::units2`]), rising, and the number of sites at each.
    counts: Vec<(i64, u32)>,
    sites: Vec<u32>,
    nodes: Vec<[Node; NODES]>,
    /// Made when they are first asked for.
    links: OnceLock<Links>,
}

impl Rings {
    /// The rings of a lens of this diameter: all sites with their centre within it.
    ///
    /// # Errors
    /// If a square lattice has an odd number of sites, or the lattice is smaller than the lens.
    pub fn new(lattice: Lattice, diameter_nm: u32) -> Result<Self> {
        let odd = lattice.is_square() && !lattice.sites().is_multiple_of(2);
        if odd || f64::from(diameter_nm) < 2.0 * lattice.pitch_nm().nm() {
            return Err(Error::refused(
                "optimise/no-rings",
                format!(
                    "a lens of {diameter_nm} nm on a lattice of {} sites has no rings",
                    lattice.sites()
                ),
                "use an even number of sites, by a `database_unit_nm` of which half the pitch is a multiple, and a lens of several pitches",
            ));
        }
        if lattice.sites() as f64 * lattice.steps_nm()[0] < f64::from(diameter_nm) {
            return Err(Error::refused(
                "optimise/lattice-too-small",
                format!("{} sites do not hold a lens of {diameter_nm} nm", lattice.sites()),
                "use more sites or a smaller lens",
            ));
        }
        let mut rings = Self {
            lattice,
            diameter_nm,
            counts: counts(lattice, diameter_nm),
            sites: Vec::new(),
            nodes: Vec::new(),
            links: OnceLock::new(),
        };
        let (largest, _) = *rings.counts.last().expect("a lens of several pitches has sites");
        let count = rings.ring_of(largest) + 1;
        (rings.sites, rings.nodes) = (0..count).map(|k| rings.sample(k)).unzip();
        Ok(rings)
    }

    /// Number of rings: 1429 for 1 mm at 350 nm.
    pub fn len(&self) -> usize {
        self.sites.len()
    }

    /// True if there are no rings; a lens has at least one.
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
        let r2 = self.lattice.units2(ix, iy);
        (self.lattice.has(ix, iy) && r2 <= self.lattice.most_units2(self.diameter_nm)).then(|| self.ring_of(r2))
    }

    /// Pillars of one width a ring. The array that a layout of this lens alone would hold.
    pub fn width_map(&self, width_of_ring_nm: &[u16]) -> PillarMap {
        let mut map = PillarMap::empty(self.lattice);
        for ((iy, ix), width) in map.number.indexed_iter_mut() {
            if let Some(ring) = self.ring_at(ix, iy) {
                *width = width_of_ring_nm[ring];
            }
        }
        map
    }

    /// Links between rings whose pillars stand next to one another. The lattice must be square.
    pub fn links(&self) -> &Links {
        debug_assert!(
            self.lattice.is_square(),
            "links are counted over quarters of a square lattice"
        );
        self.links.get_or_init(|| self.count_links())
    }

    fn count_links(&self) -> Links {
        let lattice = self.lattice;
        let n = lattice.sites();
        let mut of_ring: Vec<Vec<Link>> = vec![Vec::new(); self.len()];
        // A quarter of the sites: the others are their mirror images, and so are neighbours.
        for (iy, ix) in (n / 2..n).flat_map(|iy| (n / 2..n).map(move |ix| (iy, ix))) {
            let Some(ring) = self.ring_at(ix, iy) else { continue };
            let shares = self.shares_of(ring, lattice.units2(ix, iy));
            for offset in NEIGHBOURS {
                let at = neighbour([ix, iy], offset, n);
                let Some(other) = at.and_then(|[x, y]| self.ring_at(x, y)) else {
                    continue;
                };
                let distance = distance_of(offset);
                let links = &mut of_ring[ring];
                let k = links.iter().position(|l| l.other == other && l.distance == distance);
                let k = k.unwrap_or_else(|| {
                    links.push(Link {
                        ring,
                        other,
                        distance,
                        weights: [0.0; NODES],
                    });
                    links.len() - 1
                });
                for (weight, share) in links[k].weights.iter_mut().zip(shares) {
                    *weight += 4.0 * share;
                }
            }
        }
        Links::new(of_ring)
    }

    /// The radii that stand for a ring.
    pub fn nodes(&self, ring: usize) -> &[Node] {
        &self.nodes[ring]
    }

    /// floor(r / pitch) from the square of a distance in units, exactly.
    fn ring_of(&self, units2: i64) -> usize {
        (units2 as u64).isqrt() as usize / self.lattice.units_of_pitch() as usize
    }

    /// Entries of `counts` for a ring.
    fn of_ring(&self, ring: usize) -> &[(i64, u32)] {
        let first = |k: usize| {
            let least = (self.lattice.units_of_pitch() * k as i64).pow(2);
            self.counts.partition_point(|(r2, _)| *r2 < least)
        };
        &self.counts[first(ring)..first(ring + 1)]
    }

    /// Squares of the radii of [`Rings::nodes`], in the units of [`Lattice::units2`].
    pub fn node_units2(&self, ring: usize) -> [f64; NODES] {
        let end = |k: usize| (self.lattice.units_of_pitch() * k as i64).pow(2) as f64;
        let (low, high) = (end(ring), end(ring + 1));
        std::array::from_fn(|j| {
            let angle = std::f64::consts::PI * (j as f64 + 0.5) / NODES as f64;
            0.5 * (low + high) + 0.5 * (high - low) * angle.cos()
        })
    }

    /// Weight with which each radius of [`Rings::nodes`] stands for a site of the ring.
    pub fn shares_of(&self, ring: usize, units2: i64) -> [f64; NODES] {
        lagrange(&self.node_units2(ring), units2)
    }

    fn sample(&self, ring: usize) -> (u32, [Node; NODES]) {
        let at = self.node_units2(ring);
        let mut nodes = at.map(|units2| Node {
            radius_um: self.lattice.unit_um() * units2.sqrt(),
            weight: 0.0,
        });
        let mut sites = 0;
        for &(r2, count) in self.of_ring(ring) {
            sites += count;
            for (node, share) in nodes.iter_mut().zip(lagrange(&at, r2)) {
                node.weight += f64::from(count) * share;
            }
        }
        (sites, nodes)
    }
}

/// Weights of the values at these places in the polynomial through them, at another place.
fn lagrange(at: &[f64; NODES], units2: i64) -> [f64; NODES] {
    let s = units2 as f64;
    std::array::from_fn(|j| {
        let others = at.iter().enumerate().filter(|(i, _)| *i != j);
        lagrange_weight(s, at[j], others.map(|(_, other)| *other))
    })
}

/// Squares of the distances of the sites within a diameter, and how many sites are at each: of the quarter to the upper right, whose
/// sites stand for their mirror images.
fn counts(lattice: Lattice, diameter_nm: u32) -> Vec<(i64, u32)> {
    let largest = lattice.most_units2(diameter_nm);
    let n = lattice.sites();
    let images = |i: usize| if 2 * i + 1 == n { 1 } else { 2 };
    let mut all = Vec::new();
    for iy in n / 2..n {
        for ix in (n / 2..n).filter(|&ix| lattice.has(ix, iy)) {
            let r2 = lattice.units2(ix, iy);
            if r2 > largest {
                break;
            }
            all.push((r2, images(ix) * images(iy)));
        }
    }
    all.sort_unstable();
    all.chunk_by(|a, b| a.0 == b.0)
        .map(|same| (same[0].0, same.iter().map(|(_, sites)| sites).sum()))
        .collect()
}

#[cfg(test)]
mod tests {
    use metalith_design::phase::{Interpolation, LensPhase, RadialPhase};

    use super::*;
    use crate::write_phase_table;
    use metalith_pillars::LatticeKind;

    fn lens() -> Rings {
        Rings::new(Lattice::covering(1_000_000, 350).unwrap(), 1_000_000).unwrap()
    }

    impl Rings {
        /// Every distinct distance of a ring's sites (um) with its number of sites: the oracle of [`Node`].
        fn distances(&self, ring: usize) -> impl Iterator<Item = (f64, u32)> {
            let unit_um = self.lattice.unit_um();
            self.of_ring(ring)
                .iter()
                .map(move |&(r2, n)| ((r2 as f64).sqrt() * unit_um, n))
        }
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
        for kind in [LatticeKind::Square, LatticeKind::Hexagonal] {
            let rings = Rings::new(Lattice::of_kind_covering(kind, 40_000, 350).unwrap(), 40_000).unwrap();
            let lattice = rings.lattice();
            let n = lattice.sites();
            let mut sites = vec![0; rings.len()];
            for (iy, ix) in (0..n * n).map(|k| (k / n, k % n)) {
                // Squares in nanometres are exact.
                let r2 = if lattice.is_square() {
                    lattice.half_radius2(ix, iy) * 175 * 175
                } else {
                    lattice.radius2_nm2(ix, iy) as i64
                };
                let ring = (lattice.has(ix, iy) && r2 <= 20_000 * 20_000).then(|| (r2 as u64).isqrt() as usize / 350);
                assert_eq!(rings.ring_at(ix, iy), ring);
                if let Some(k) = ring {
                    sites[k] += 1;
                }
            }
            assert_eq!(sites, rings.sites);
        }
    }

    /// Layouts are what is optimised: the table of a phase, one row a ring, gives every site its own ring, those on the
    /// borders of rings as well, which are many on a hexagonal lattice.
    #[test]
    fn a_layout_gives_every_site_its_ring() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("phase.csv");
        let diameter_nm = 160_000;
        for (kind, pitch_nm) in [
            (LatticeKind::Square, 350),
            (LatticeKind::Hexagonal, 350),
            (LatticeKind::Hexagonal, 480),
            (LatticeKind::Hexagonal, 652),
        ] {
            let lattice = Lattice::of_kind_covering(kind, diameter_nm, pitch_nm).unwrap();
            let rings = Rings::new(lattice, diameter_nm).unwrap();
            let count = rings.len() as f64;
            let waves: Vec<f64> = (0..rings.len()).map(|k| k as f64 / count).collect();
            write_phase_table(&file, &rings, &waves, &[]).unwrap();
            let radius_um = 0.5e-3 * f64::from(diameter_nm);
            let table = RadialPhase::read_table(&file, Interpolation::Nearest, radius_um).unwrap();
            let written = LensPhase::new(lattice, diameter_nm, &table);
            let n = lattice.sites();
            let mut borders = 0;
            for (iy, ix) in (0..n * n).map(|k| (k / n, k % n)) {
                let ring = written.turns(ix, iy).map(|waves| (waves * count).round() as usize);
                assert_eq!(rings.ring_at(ix, iy), ring, "{kind:?}, {pitch_nm} nm: {ix} {iy}");
                let units = lattice.units_of_pitch() * ring.unwrap_or(0) as i64;
                borders += usize::from(units > 0 && lattice.units2(ix, iy) == units.pow(2));
            }
            assert_eq!(kind.is_square(), borders == 0);
        }
    }

    /// Sums over a ring of the fastest function the kernels hold, against all of its sites.
    #[test]
    fn nodes_stand_for_the_sites() {
        /// Error of Chebyshev interpolation, `NODES`, times a margin of ten for the sum.
        const TOLERANCE: f64 = 1e-8;
        let hexagonal = Lattice::of_kind_covering(LatticeKind::Hexagonal, 1_000_000, 350).unwrap();
        let hexagonal = Rings::new(hexagonal, 1_000_000).unwrap();
        let k = std::f64::consts::TAU / 0.4;
        let rings = [lens(), hexagonal];
        for (rings, ring) in rings
            .iter()
            .flat_map(|r| [0, 1, 2, 10, 700, 1427, 1428].map(|ring| (r, ring)))
        {
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
