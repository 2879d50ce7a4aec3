//! Elements that are nearer to one another than tiles can show, told apart by the phases of their lattices: arrays of lenses whose
//! distance is no multiple of the pitch.

use std::cmp::Reverse;
use std::collections::BTreeSet;

use super::discover::square_about;
use super::lattices::{Cluster, FoundElement};
use super::places::Centre;
use super::rounded::Comb;
use super::sites::Scale;
use super::tiles::TileMap;
use crate::{ExtractionError, PillarFinder, Point, Rect, Shape, Transform, Visitor};
use metalith_pillars::PillarShape;

/// Elements that one group of tiles is parted into, at most.
const MOST_PARTS: usize = 1024;
/// Sites with a pillar, at least, of all in the fullest tile of an element: rows of which every other one is missing fill half of a
/// hexagonal lattice, and 0.58 of a square one.
const FILLED: f64 = 0.6;
/// Tiles that show no lattice, at most, before a group is left as one.
const MOST_FAILED: usize = 64;
/// Times that a lattice is fitted anew to all tiles that it was found in: each time they reach twice as far, or all are found.
const MOST_REFINED: usize = 12;

/// One of several elements in a group of tiles: its lattice, and the box that its pillars are looked for in.
pub(super) struct Part {
    combs: [Comb; 2],
    /// True if columns and rows whose sum is odd are no sites.
    is_staggered: bool,
    slack: f64,
    within: Rect,
}

impl Part {
    fn of(found: &FoundElement, cluster: &Cluster<'_>) -> Self {
        Self {
            combs: cluster.combs(&found.site, found.fit.offset_nm),
            is_staggered: !found.site.lattice.is_square(),
            slack: cluster.slack_of(found),
            within: Rect::EMPTY,
        }
    }

    /// True if a place (half steps) is a site of the lattice.
    fn holds(&self, place: Point) -> bool {
        let [(column, dx), (row, dy)] =
            [(0, place.x), (1, place.y)].map(|(axis, v)| self.combs[axis].nearest(v as f64));
        dx.abs().max(dy.abs()) <= self.slack && (!self.is_staggered || (column + row).rem_euclid(2.0) == 0.0)
    }

    /// Number of sites in a box whose edges go through sites (half steps).
    fn sites_in(&self, r: &Rect) -> f64 {
        let [x, y] = self.combs.map(|comb| comb.step);
        let places = (r.width() as f64 / x + 1.0) * (r.height() as f64 / y + 1.0);
        if self.is_staggered { places / 2.0 } else { places }
    }

    fn takes(&self, place: Point) -> bool {
        let r = &self.within;
        (r.x0..=r.x1).contains(&place.x) && (r.y0..=r.y1).contains(&place.y) && self.holds(place)
    }
}

impl Cluster<'_> {
    /// The elements that a group of tiles is parted into by the phases of their lattices; none if it is no more than one.
    pub(super) fn parts(&self) -> Vec<Part> {
        let mut parts: Vec<Part> = Vec::new();
        let mut left: BTreeSet<usize> = self.members.iter().copied().collect();
        // Full tiles first: those at the rims of two elements hold samples of both.
        let mut seeds = self.members.to_vec();
        seeds.sort_by_key(|&k| Reverse(self.tiles.pillars(k)));
        let mut failed = 0;
        for seed in seeds {
            if failed > MOST_FAILED || parts.len() > MOST_PARTS {
                break;
            }
            if !left.contains(&seed) {
                continue;
            }
            let Some((part, on)) = self.part_about(seed, &left) else {
                failed += 1;
                continue;
            };
            left.retain(|k| !on.contains(k));
            parts.push(part);
        }
        if parts.len() < 2 || parts.len() > MOST_PARTS {
            return Vec::new();
        }
        parts
    }

    /// The part that a tile is of, and its tiles, of those that are left.
    fn part_about(&self, seed: usize, left: &BTreeSet<usize>) -> Option<(Part, BTreeSet<usize>)> {
        let near = self.tiles.neighbours(seed).chain([seed]);
        let about: Vec<usize> = near.filter(|k| left.contains(k)).collect();
        let found_in = |members: &[usize]| {
            let found = Cluster { members, ..*self }.element().ok().flatten();
            found.filter(|found| !found.is_poor)
        };
        let found = found_in(&about).or_else(|| found_in(&[seed]))?;
        let mut part = Part::of(&found, self);
        let box_of_tile = self.tiles.bounds(seed);
        if (self.tiles.pillars(seed) as f64) < FILLED * part.sites_in(&box_of_tile) {
            return None;
        }
        let mut on = self.flood(seed, &part, left);
        // A pitch that few tiles show is too rough for tiles far away.
        for _ in 0..MOST_REFINED {
            let members: Vec<usize> = on.iter().copied().collect();
            let Some(found) = found_in(&members) else { break };
            let finer = Part::of(&found, self);
            let wider = self.flood(seed, &finer, left);
            if wider.len() <= on.len() {
                break;
            }
            (part, on) = (finer, wider);
        }
        on.iter().for_each(|&k| part.within.unite(&self.tiles.bounds(k)));
        // Pillars in tiles that are of another element are no farther out.
        let side = self.tiles.side();
        part.within = Rect {
            x0: part.within.x0 - side,
            y0: part.within.y0 - side,
            x1: part.within.x1 + side,
            y1: part.within.y1 + side,
        };
        Some((part, on))
    }

    /// Tiles that hang together with one, of those that are left, whose samples are on a lattice.
    fn flood(&self, seed: usize, part: &Part, left: &BTreeSet<usize>) -> BTreeSet<usize> {
        let is_on = |k: usize| {
            let (mut on, mut all) = (0usize, 0usize);
            for place in self.tiles.all_samples(k) {
                all += 1;
                on += usize::from(part.holds(place));
            }
            2 * on > all
        };
        let mut found = BTreeSet::from([seed]);
        let mut next = vec![seed];
        while let Some(tile) = next.pop() {
            for k in self.tiles.neighbours(tile) {
                if left.contains(&k) && !found.contains(&k) && is_on(k) {
                    found.insert(k);
                    next.push(k);
                }
            }
        }
        found
    }
}

/// Visitor that gives each pillar of a layout to the part that it is of.
pub(super) struct PartVisitor {
    scale: Scale,
    shape: PillarShape,
    widest_nm: i64,
    finder: PillarFinder,
    parts: Vec<Part>,
    maps: Vec<TileMap>,
    /// Part that was met last.
    guess: usize,
}

impl PartVisitor {
    /// Visitor for pillars of a shape no wider than this (nm), on tiles whose side is two to the power of `bits` (half steps).
    pub(super) fn new(parts: Vec<Part>, shape: PillarShape, scale: Scale, bits: u32, widest_nm: i64) -> Self {
        Self {
            maps: parts.iter().map(|_| TileMap::new(bits)).collect(),
            scale,
            shape,
            widest_nm,
            finder: PillarFinder::new(shape, scale.nm(1.0)),
            parts,
            guess: 0,
        }
    }

    /// Pillars of all parts.
    pub(super) fn pillars(&self) -> u64 {
        let of_map = |map: &TileMap| (0..map.len()).map(|k| map.pillars(k)).sum::<u64>();
        self.maps.iter().map(of_map).sum()
    }

    /// Element of each part.
    ///
    /// # Errors
    /// As [`Cluster::element`].
    pub(super) fn finish(
        self,
        cluster: impl Fn(&TileMap, &[usize]) -> Result<Option<FoundElement>, ExtractionError>,
    ) -> Result<Vec<FoundElement>, ExtractionError> {
        let of_map = |map: &TileMap| {
            let all: Vec<usize> = (0..map.len()).collect();
            cluster(map, &all)
        };
        let found: Result<Vec<_>, _> = self.maps.iter().map(of_map).collect();
        Ok(found?.into_iter().flatten().collect())
    }

    fn add(&mut self, centre: &Centre) {
        let count = self.parts.len();
        let own = (0..count)
            .map(|k| (self.guess + k) % count)
            .find(|&k| self.parts[k].takes(centre.at));
        if let Some(k) = own {
            self.guess = k;
            self.maps[k].add(centre.at, centre.even, &mut 0);
        }
    }
}

impl Visitor for PartVisitor {
    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> metalith_core::Result<()> {
        for placement in placements {
            let seen = match shape.pillar(self.shape) {
                Some(rect) if placement.is_square() => placement.apply_rect(rect),
                _ => self.finder.placed(shape, placement).map(|pillar| pillar.around),
            };
            let Some(around) = seen else { continue };
            let centre = if self.shape.has_width() {
                square_about(&around, self.scale, self.widest_nm)
            } else {
                Centre::of(&around, self.scale)
            };
            if let Some(centre) = centre {
                self.add(&centre);
            }
        }
        Ok(())
    }
}
