//! Occupied places of a layout or a cell, tile by tile.

use std::collections::HashMap;

use crate::{Point, Rect, Transform};

/// Side of a tile, two to this power half nanometres: 8.2 um; all places here are in half steps of the scale. Two elements with an empty tile
/// between them are two. Wider than pitches are, so that sparse places of a lens hold together.
pub(super) const FINE: u32 = 14;
/// Bits of the side of a tile for pitches up to 20 um: 33 um, the widest whose places the numbers of
/// [`TileMap::samples`] can hold.
pub(super) const COARSE: u32 = 16;
/// Tiles of a map at most: 5 x 5 lenses of 1 mm occupy 300,000, one of 10 mm 1.2 million. Of larger lenses they are made [`COARSE`], of
/// which a lens of 54 mm occupies as many.
pub(super) const MOST_TILES: usize = 1 << 21;
/// Bits of the place of a tile along an axis by which it is looked up first: 128 x 128 tiles are 1 mm.
const LATELY: u32 = 7;
/// Centres remembered a tile, to tell pitch and phase from.
const SAMPLES: usize = 24;
/// Parts of a tile along an axis that are known to be occupied or not: 1 um of a fine one. Tiles of a cell that is placed between tiles
/// occupy tiles to this accuracy.
const PARTS: i64 = 8;

/// Pillars in one tile; places from the tile's corner. Small, because every pillar comes here.
#[derive(Clone, Debug)]
struct Tile {
    pillars: u64,
    /// Box around all centres; beyond the tile if those of a placed cell are counted here together.
    low: (i32, i32),
    high: (i32, i32),
    /// Parts that are occupied, row by row; not known of what was placed.
    parts: u64,
    /// Number of its samples.
    sampled: u8,
    /// Number of samples of shapes of odd width, which are off their places by half a step: from the last sample backwards, where there
    /// is room.
    odd: u8,
}

impl Tile {
    const EMPTY: Self = Self {
        pillars: 0,
        low: (i32::MAX, i32::MAX),
        high: (i32::MIN, i32::MIN),
        parts: 0,
        sampled: 0,
        odd: 0,
    };

    #[inline]
    fn include(&mut self, x: i32, y: i32) {
        self.low = (self.low.0.min(x), self.low.1.min(y));
        self.high = (self.high.0.max(x), self.high.1.max(y));
    }
}

/// Centres of pillars by tile.
pub(super) struct TileMap {
    /// Bits of the side of a tile: [`FINE`] or [`COARSE`], with those of the steps of the scale.
    bits: u32,
    numbers: HashMap<(i64, i64), u32>,
    tiles: Vec<((i64, i64), Tile)>,
    /// Some centres in each tile, as in the tile.
    samples: Vec<[(u16, u16); SAMPLES]>,
    /// The last centre of each tile that could have been a sample, alike: rows that are drawn after others are in no sample.
    last: Vec<(u16, u16)>,
    /// Tiles met lately, by the low bits of their place: most pillars are looked up here, without a hash.
    lately: Vec<u32>,
}

impl TileMap {
    /// Map of tiles whose side is two to the power of `bits` (half steps).
    pub(crate) fn new(bits: u32) -> Self {
        Self {
            bits,
            numbers: HashMap::new(),
            tiles: Vec::new(),
            samples: Vec::new(),
            last: Vec::new(),
            lately: vec![0; 1 << (2 * LATELY)],
        }
    }

    /// Bits of the side of a tile.
    pub(crate) fn bits(&self) -> u32 {
        self.bits
    }

    /// The pillars of this map by tiles of a larger side.
    pub(crate) fn coarser(&self, bits: u32) -> Self {
        let (mut coarse, mut guess) = (Self::new(bits), 0);
        let shift = bits - self.bits;
        for (number, (key, tile)) in self.tiles.iter().enumerate() {
            let corner = self.corner(*key);
            let at = coarse.at(Point::new(corner.0, corner.1), &mut guess);
            let from = coarse.corner(coarse.tiles[at].0);
            let (dx, dy) = ((corner.0 - from.0) as i32, (corner.1 - from.1) as i32);
            let sum = &mut coarse.tiles[at].1;
            sum.pillars += tile.pillars;
            if tile.low.0 <= tile.high.0 {
                sum.include(tile.low.0 + dx, tile.low.1 + dy);
                sum.include(tile.high.0 + dx, tile.high.1 + dy);
            }
            let part = |place: i32, k: i64| (i64::from(place >> self.bits) * PARTS + k) >> shift;
            for k in (0..PARTS * PARTS).filter(|k| tile.parts >> k & 1 == 1) {
                sum.parts |= 1 << (part(dy, k / PARTS) * PARTS + part(dx, k % PARTS));
            }
            for place in self.samples(number).chain(self.last(number)) {
                let (x, y) = coarse.within(place);
                coarse.sample(at, x, y);
            }
            for place in self.odd_samples(number) {
                let (x, y) = coarse.within(place);
                coarse.sample_odd(at, x, y);
            }
        }
        coarse
    }

    /// Column and row of the tile that holds a place.
    #[inline]
    fn key_of(&self, place: Point) -> (i64, i64) {
        (place.x >> self.bits, place.y >> self.bits)
    }

    /// A place from the corner of its tile.
    #[inline]
    fn within(&self, place: Point) -> (i64, i64) {
        let mask = (1 << self.bits) - 1;
        (place.x & mask, place.y & mask)
    }

    /// The corner of a tile.
    fn corner(&self, (column, row): (i64, i64)) -> (i64, i64) {
        (column << self.bits, row << self.bits)
    }

    pub(crate) fn clear(&mut self) {
        self.numbers.clear();
        self.tiles.clear();
        self.samples.clear();
        self.last.clear();
    }

    /// Number of tiles.
    pub(crate) fn len(&self) -> usize {
        self.tiles.len()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.tiles.is_empty()
    }

    /// Pillars in a tile.
    pub(crate) fn pillars(&self, tile: usize) -> u64 {
        self.tiles[tile].1.pillars
    }

    /// Box around the centres in a tile (half steps).
    pub(crate) fn bounds(&self, tile: usize) -> Rect {
        let (key, tile) = &self.tiles[tile];
        let corner = self.corner(*key);
        let place = |(x, y): (i32, i32)| (corner.0 + i64::from(x), corner.1 + i64::from(y));
        let ((x0, y0), (x1, y1)) = (place(tile.low), place(tile.high));
        if tile.low.0 > tile.high.0 {
            return Rect::EMPTY;
        }
        Rect { x0, y0, x1, y1 }
    }

    /// Centres remembered of a tile (half steps).
    pub(crate) fn samples(&self, tile: usize) -> impl Iterator<Item = Point> + '_ {
        let (key, Tile { sampled, .. }) = &self.tiles[tile];
        let corner = self.corner(*key);
        self.samples[tile][..usize::from(*sampled)]
            .iter()
            .map(move |&(x, y)| Point::new(corner.0 + i64::from(x), corner.1 + i64::from(y)))
    }

    /// Centres remembered of a tile, those of odd shapes too (half steps).
    pub(crate) fn all_samples(&self, tile: usize) -> impl Iterator<Item = Point> + '_ {
        let last = self.last(tile);
        self.samples(tile).chain(last).chain(self.odd_samples(tile))
    }

    /// Centres remembered of odd shapes of a tile (half steps).
    fn odd_samples(&self, tile: usize) -> impl Iterator<Item = Point> + '_ {
        let (key, Tile { sampled, odd, .. }) = &self.tiles[tile];
        let corner = self.corner(*key);
        let first = (SAMPLES - usize::from(*odd)).max(usize::from(*sampled));
        self.samples[tile][first..]
            .iter()
            .map(move |&(x, y)| Point::new(corner.0 + i64::from(x), corner.1 + i64::from(y)))
    }

    /// The last centre met in a tile that has samples (half steps).
    pub(crate) fn last(&self, tile: usize) -> Option<Point> {
        let (key, Tile { sampled, .. }) = &self.tiles[tile];
        let (corner, (x, y)) = (self.corner(*key), self.last[tile]);
        (*sampled > 0).then(|| Point::new(corner.0 + i64::from(x), corner.1 + i64::from(y)))
    }

    /// The tile that holds a place; `guess` is the one to try first, and is set to it.
    #[inline]
    fn at(&mut self, place: Point, guess: &mut u32) -> usize {
        let key = self.key_of(place);
        if self.tiles.get(*guess as usize).is_none_or(|(k, _)| *k != key) {
            let low = |v: i64| (v & ((1 << LATELY) - 1)) as usize;
            let lately = &mut self.lately[low(key.1) << LATELY | low(key.0)];
            if self.tiles.get(*lately as usize).is_none_or(|(k, _)| *k != key) {
                let next = self.tiles.len() as u32;
                *lately = *self.numbers.entry(key).or_insert(next);
                if *lately == next {
                    self.tiles.push((key, Tile::EMPTY));
                    self.samples.push([(0, 0); SAMPLES]);
                    self.last.push((0, 0));
                }
            }
            *guess = *lately;
        }
        *guess as usize
    }

    #[inline]
    fn sample(&mut self, tile: usize, x: i64, y: i64) {
        let sampled = &mut self.tiles[tile].1.sampled;
        if usize::from(*sampled) < SAMPLES {
            self.samples[tile][usize::from(*sampled)] = (x as u16, y as u16);
            *sampled += 1;
        }
        self.last[tile] = (x as u16, y as u16);
    }

    #[inline]
    fn sample_odd(&mut self, tile: usize, x: i64, y: i64) {
        let Tile { sampled, odd, .. } = &mut self.tiles[tile].1;
        if usize::from(*sampled) + usize::from(*odd) < SAMPLES {
            *odd += 1;
            self.samples[tile][SAMPLES - usize::from(*odd)] = (x as u16, y as u16);
        }
    }

    /// Count a pillar by its centre; it serves as a sample of the lattice if it is an `even` number of nm wide.
    #[inline]
    pub(crate) fn add(&mut self, centre: Point, even: bool, guess: &mut u32) {
        let number = self.at(centre, guess);
        let (x, y) = self.within(centre);
        let part = |v: i64| (v * PARTS) >> self.bits;
        let part = part(y) * PARTS + part(x);
        let tile = &mut self.tiles[number].1;
        tile.pillars += 1;
        tile.include(x as i32, y as i32);
        tile.parts |= 1 << part;
        if even {
            self.sample(number, x, y);
        } else {
            self.sample_odd(number, x, y);
        }
    }

    /// Add the tiles of a cell, as large as these, where a placement, which moves by half steps, puts them; whether there is
    /// room.
    pub(crate) fn place(&mut self, cell: &Self, placement: &Transform) -> bool {
        let mut guess = 0;
        for (number, (key, tile)) in cell.tiles.iter().enumerate() {
            let Some(bounds) = placement.apply_rect(&cell.bounds(number)) else {
                continue;
            };
            let corners = [Point::new(bounds.x0, bounds.y0), Point::new(bounds.x1, bounds.y1)];
            let mut counted = 0;
            // What lies in one tile needs no parts.
            if self.key_of(corners[0]) == self.key_of(corners[1]) {
                counted = self.at(corners[0], &mut guess);
            } else {
                let (own, corner) = (cell.bounds(number), cell.corner(*key));
                let middle = |k: i64, from: i64, low: i64, high: i64| {
                    (from + ((2 * k + 1) << cell.bits) / (2 * PARTS)).clamp(low, high)
                };
                for part in (0..PARTS * PARTS).filter(|part| tile.parts >> part & 1 == 1) {
                    let x = middle(part % PARTS, corner.0, own.x0, own.x1);
                    let y = middle(part / PARTS, corner.1, own.y0, own.y1);
                    counted = self.at(placement.apply(Point::new(x, y)), &mut guess);
                }
            }
            for sample in cell.samples(number).chain(cell.last(number)) {
                let sample = placement.apply(sample);
                let tile = self.at(sample, &mut guess);
                let (x, y) = self.within(sample);
                self.sample(tile, x, y);
            }
            for sample in cell.odd_samples(number) {
                let sample = placement.apply(sample);
                let tile = self.at(sample, &mut guess);
                let (x, y) = self.within(sample);
                self.sample_odd(tile, x, y);
            }
            let from = self.corner(self.tiles[counted].0);
            let sum = &mut self.tiles[counted].1;
            sum.pillars += tile.pillars;
            for corner in corners {
                sum.include((corner.x - from.0) as i32, (corner.y - from.1) as i32);
            }
            if self.len() > MOST_TILES {
                return false;
            }
        }
        true
    }

    /// Take in the tiles of a map of other shapes, as large as these; whether there is room.
    pub(crate) fn unite(&mut self, other: &Self) -> bool {
        let mut guess = 0;
        for (number, (key, tile)) in other.tiles.iter().enumerate() {
            let (x, y) = other.corner(*key);
            let own = self.at(Point::new(x, y), &mut guess);
            let sum = &mut self.tiles[own].1;
            sum.pillars += tile.pillars;
            sum.parts |= tile.parts;
            if tile.low.0 <= tile.high.0 {
                sum.include(tile.low.0, tile.low.1);
                sum.include(tile.high.0, tile.high.1);
            }
            // In turn: where each kind stands on separate places, both tell the pitch.
            let (mine, theirs) = (self.samples[own], other.samples[number]);
            let counts = [sum.sampled, tile.sampled].map(usize::from);
            let in_turn =
                (0..SAMPLES).flat_map(|k| [(k < counts[0]).then(|| mine[k]), (k < counts[1]).then(|| theirs[k])]);
            let last = if counts[1] > 0 {
                other.last[number]
            } else {
                self.last[own]
            };
            let odd: Vec<_> = (self.odd_samples(own).chain(other.odd_samples(number)))
                .map(|place| self.within(place))
                .collect();
            let sum = &mut self.tiles[own].1;
            (sum.sampled, sum.odd) = (0, 0);
            for (x, y) in in_turn.flatten() {
                self.sample(own, i64::from(x), i64::from(y));
            }
            odd.into_iter().for_each(|(x, y)| self.sample_odd(own, x, y));
            self.last[own] = last;
            if self.len() > MOST_TILES {
                return false;
            }
        }
        true
    }

    /// Side of a tile (half steps).
    pub(crate) fn side(&self) -> i64 {
        1 << self.bits
    }

    /// Tiles that touch one, corners included.
    pub(crate) fn neighbours(&self, tile: usize) -> impl Iterator<Item = usize> + '_ {
        let (x, y) = self.tiles[tile].0;
        let around = [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];
        around
            .into_iter()
            .filter_map(move |(dx, dy)| self.numbers.get(&(x + dx, y + dy)).map(|&k| k as usize))
    }

    /// Tiles that touch, corners included.
    pub(crate) fn clusters(&self) -> Vec<Vec<usize>> {
        let mut seen = vec![false; self.tiles.len()];
        let mut clusters = Vec::new();
        for start in 0..self.tiles.len() {
            if std::mem::replace(&mut seen[start], true) {
                continue;
            }
            let mut cluster = vec![start];
            let mut next = 0;
            while next < cluster.len() {
                let tile = cluster[next];
                next += 1;
                for k in self.neighbours(tile) {
                    if !std::mem::replace(&mut seen[k], true) {
                        cluster.push(k);
                    }
                }
            }
            clusters.push(cluster);
        }
        clusters
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pillars and bounds of each cluster.
    fn found(map: &TileMap) -> Vec<(u64, Rect)> {
        let sum = |cluster: &Vec<usize>| {
            let mut bounds = Rect::EMPTY;
            cluster.iter().for_each(|&k| bounds.unite(&map.bounds(k)));
            (cluster.iter().map(|&k| map.pillars(k)).sum(), bounds)
        };
        let mut all: Vec<_> = map.clusters().iter().map(sum).collect();
        all.sort_unstable();
        all
    }

    /// A disc of 60 um and a patch beside it, by tiles of either side, placed in all orientations and between tiles.
    #[test]
    fn tiles_of_a_placed_cell_are_those_of_its_pillars() {
        [FINE, COARSE].into_iter().for_each(placed_as_its_pillars);
    }

    /// A disc and a patch by fine tiles that are made coarse: tiles, counts and boxes of coarse ones, whose cells are placed alike.
    #[test]
    fn fine_tiles_that_are_made_coarse_are_coarse_ones() {
        let places = (0..300 * 300).map(|k: i64| Point::new(700 * (k % 300) - 77_777, 700 * (k / 300)));
        let pillars: Vec<Point> = places
            .filter(|p| p.x.pow(2) + p.y.pow(2) < 110_000_i64.pow(2))
            .collect();
        let [mut fine, mut coarse] = [FINE, COARSE].map(TileMap::new);
        for &place in &pillars {
            fine.add(place, place.x % 2 == 0, &mut 0);
            coarse.add(place, place.x % 2 == 0, &mut 0);
        }
        let made = fine.coarser(COARSE);
        assert_eq!((made.bits(), made.len()), (COARSE, coarse.len()));
        assert_eq!(found(&made), found(&coarse));
        let placed = |cell: &TileMap| {
            let mut map = TileMap::new(COARSE);
            let placement = Transform::Square {
                orientation: 5,
                dx: 12_345,
                dy: -777,
            };
            assert!(map.place(cell, &placement));
            map
        };
        assert_eq!(found(&placed(&made)), found(&placed(&coarse)));
        assert_eq!(placed(&made).len(), placed(&coarse).len());
        for tile in 0..made.len() {
            assert!(made.all_samples(tile).count() > 0);
            assert!(made.all_samples(tile).all(|place| pillars.contains(&place)));
        }
    }

    /// A disc whose pillars are of two kinds, in turn or by halves: tiles of each, united, are those of all.
    #[test]
    fn tiles_of_two_kinds_are_those_of_all() {
        let places = (0..200 * 200).map(|k: i64| Point::new(700 * (k % 200), 700 * (k / 200)));
        let disc: Vec<Point> = places
            .filter(|p| (p.x - 70_000).pow(2) + (p.y - 70_000).pow(2) < 70_000_i64.pow(2))
            .collect();
        let in_turn: &dyn Fn(&Point) -> bool = &|p| (p.x + p.y) / 700 % 2 == 0;
        let by_halves: &dyn Fn(&Point) -> bool = &|p| p.x < 50_000;
        for is_first in [in_turn, by_halves] {
            let [mut first, mut second, mut all] = [(); 3].map(|()| TileMap::new(FINE));
            for &place in &disc {
                let kind = if is_first(&place) { &mut first } else { &mut second };
                kind.add(place, true, &mut 0);
                all.add(place, true, &mut 0);
            }
            assert!(first.unite(&second));
            assert_eq!(found(&first), found(&all));
            for tile in 0..first.len() {
                let samples: Vec<Point> = first.samples(tile).collect();
                assert!(samples.iter().all(|p| disc.contains(p)));
                assert_eq!(samples.len() as u64, first.pillars(tile).min(SAMPLES as u64));
            }
        }
    }

    fn placed_as_its_pillars(bits: u32) {
        let lattice = |n: i64, at: i64| {
            (0..n * n)
                .map(move |k| Point::new(at + 700 * (k % n), 700 * (k / n)))
                .filter(move |p| (p.x - at - 350 * n).pow(2) + (p.y - 350 * n).pow(2) < (350 * n).pow(2))
        };
        let pillars: Vec<Point> = lattice(170, -333).chain(lattice(9, 400_001)).collect();
        let mut cell = TileMap::new(bits);
        pillars.iter().for_each(|&p| cell.add(p, true, &mut 0));
        let (mut placed, mut direct) = (TileMap::new(bits), TileMap::new(bits));
        for orientation in 0..8 {
            let placement = Transform::Square {
                orientation,
                dx: 1_000_000 * i64::from(orientation) + 12_345,
                dy: 77_777 * i64::from(orientation),
            };
            assert!(placed.place(&cell, &placement));
            pillars
                .iter()
                .for_each(|&p| direct.add(placement.apply(p), true, &mut 0));
        }
        assert_eq!(found(&placed), found(&direct));
        assert_eq!(found(&placed).len(), 16);
        // Samples are where pillars are.
        let all: std::collections::HashSet<Point> = (0..8)
            .flat_map(|orientation| {
                let placement = Transform::Square {
                    orientation,
                    dx: 1_000_000 * i64::from(orientation) + 12_345,
                    dy: 77_777 * i64::from(orientation),
                };
                pillars.iter().map(move |&p| placement.apply(p)).collect::<Vec<_>>()
            })
            .collect();
        for tile in 0..placed.len() {
            assert!(placed.samples(tile).all(|p| all.contains(&p)));
        }
    }
}
