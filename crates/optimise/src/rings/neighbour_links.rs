//! Links between rings whose pillars stand next to one another.

use super::ring_radii::NODES;

/// Kinds of neighbours by their distance: one pitch, the diagonal, two pitches.
pub(crate) const DISTANCES: usize = 3;

/// Neighbours of the sites of a ring that are in one ring, at one distance.
#[derive(Clone, Debug)]
pub struct Link {
    /// The ring whose sites transmit.
    pub ring: usize,
    /// The ring of their neighbours; it may be the same.
    pub other: usize,
    /// One pitch (0), the diagonal (1) or two pitches (2).
    pub distance: usize,
    /// Number of neighbours of the sites that each radius of [`Rings::nodes`](crate::Rings::nodes) stands for.
    pub weights: [f64; NODES],
}

impl Link {
    /// Number of neighbours.
    pub fn count(&self) -> f64 {
        self.weights.iter().sum()
    }
}

/// All links of the rings of a lens on a square lattice.
#[derive(Clone, Debug)]
pub struct Links {
    all: Vec<Link>,
    /// Index where the links of a ring begin; one more at the end.
    first: Vec<usize>,
    /// Links to a ring from other rings, by their places.
    reverse: Vec<Vec<usize>>,
}

impl Links {
    /// The links of each ring, in any order.
    pub fn new(mut of_ring: Vec<Vec<Link>>) -> Self {
        let mut first = vec![0];
        for links in &mut of_ring {
            links.sort_by_key(|l| (l.other, l.distance));
            first.push(first[first.len() - 1] + links.len());
        }
        let mut reverse = vec![Vec::new(); of_ring.len()];
        let all = of_ring.concat();
        for (k, link) in all.iter().enumerate().filter(|(_, link)| link.other != link.ring) {
            reverse[link.other].push(k);
        }
        Self { all, first, reverse }
    }

    /// All of them, by ring.
    pub fn all(&self) -> &[Link] {
        &self.all
    }

    /// Places among all of those whose sites are of a ring.
    pub fn of_ring(&self, ring: usize) -> std::ops::Range<usize> {
        self.first[ring]..self.first[ring + 1]
    }

    /// Places among all of those of other rings whose neighbours are of a ring.
    pub fn to_ring(&self, ring: usize) -> &[usize] {
        &self.reverse[ring]
    }
}

/// Column and row of the neighbour of a site at an offset, if they are of a lattice of so many.
pub(crate) fn neighbour([ix, iy]: [usize; 2], [dx, dy]: [i32; 2], sites: usize) -> Option<[usize; 2]> {
    let inside = |at: usize, by: i32| at.checked_add_signed(by as isize).filter(|at| *at < sites);
    Some([inside(ix, dx)?, inside(iy, dy)?])
}

/// The kind of a neighbour by its distance.
pub(crate) fn distance_of([x, y]: [i32; 2]) -> usize {
    match x * x + y * y {
        1 => 0,
        2 => 1,
        _ => 2,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rings;
    use metalith_cell::NEIGHBOURS;
    use metalith_pillars::Lattice;

    /// Sums of a hundred polynomials of degree seven.
    const ROUNDING: f64 = 1e-9;

    /// Numbers of neighbours, and means of a function over the sites that have them, counted site by site.
    #[test]
    fn links_count_the_neighbours_of_all_sites() {
        let rings = Rings::new(Lattice::covering(14_000, 350).unwrap(), 14_000).unwrap();
        let links = rings.links();
        let n = rings.lattice().sites() as i32;
        let at = |x: i32, y: i32| {
            let inside = (0..n).contains(&x) && (0..n).contains(&y);
            inside.then(|| rings.ring_at(x as usize, y as usize)).flatten()
        };
        let wave = |ring: usize, x: i32, y: i32| {
            let end = (2 * rings.len() as i64).pow(2) as f64;
            (3.0 * rings.lattice().units2(x as usize, y as usize) as f64 / end + ring as f64).sin()
        };
        let mut found = 0;
        for link in links.all() {
            let (mut count, mut sum) = (0.0, 0.0);
            for (y, x) in (0..n * n)
                .map(|k| (k / n, k % n))
                .filter(|(y, x)| at(*x, *y) == Some(link.ring))
            {
                for [dx, dy] in NEIGHBOURS.into_iter().filter(|o| distance_of(*o) == link.distance) {
                    if at(x + dx, y + dy) == Some(link.other) {
                        count += 1.0;
                        sum += wave(link.ring, x, y);
                    }
                }
            }
            found += count as usize;
            let units = rings.node_units2(link.ring);
            let end = (2 * rings.len() as i64).pow(2) as f64;
            let nodes = units.map(|u| (3.0 * u / end + link.ring as f64).sin());
            let by_nodes: f64 = nodes.iter().zip(link.weights).map(|(v, w)| v * w).sum();
            assert!(
                (link.count() - count).abs() < ROUNDING && (by_nodes - sum).abs() < 1e-6,
                "{link:?}"
            );
        }
        // All of the twelve neighbours but those beyond the rim.
        assert!(found > 11 * rings.sites() as usize && found < 12 * rings.sites() as usize);
        for ring in 0..rings.len() {
            assert!(links.of_ring(ring).all(|k| links.all()[k].ring == ring));
            assert!(links.to_ring(ring).iter().all(|k| links.all()[*k].other == ring));
        }
    }
}
