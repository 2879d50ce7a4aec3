//! Where the elements of a layout from anywhere are, and on which lattice they stand.

use std::collections::{BTreeMap, HashMap};

use super::sites::Scale;
use crate::{
    Error, ExtractionError, LayerNumber, Layout, LayoutCell, Point, Rect, Result, Selection, Shape, Transform, Visitor,
};
use metalith_core::ElementSite;
use metalith_core::{Lattice, Progress};

/// Tiles of the map of occupied places (nm): two elements with an empty tile between them are two. Wider
/// than any pitch, so that sparse places of a lens hold together.
const TILE_NM: i64 = 1 << 13;
/// Tiles of the map: 5 x 5 lenses of 1 mm occupy 300,000.
const MOST_TILES: usize = 1 << 21;
/// Bits of the place of a tile along an axis by which it is looked up first: 128 x 128 tiles are 1 mm.
const LATELY: u32 = 7;
/// Centres remembered a tile, to tell pitch and phase from.
const SAMPLES: usize = 24;
/// Wider squares are pads or marks (nm).
const WIDEST_NM: i64 = 4000;
/// Fewer squares together are no element.
const FEWEST: u64 = 16;
/// Elements found at most.
const MOST_ELEMENTS: usize = 4096;
/// Lattice sites for each square found: a lens fills 0.79 of its lattice.
const SITES_PER_PILLAR: u64 = 64;

/// Squares in one tile; centres from the tile's corner, doubled (half nm). Small, because every square comes here.
#[derive(Clone, Debug)]
struct Tile {
    squares: u64,
    low: (u16, u16),
    high: (u16, u16),
    /// Number of its samples.
    sampled: u8,
}

impl Tile {
    const EMPTY: Self = Self {
        squares: 0,
        low: (u16::MAX, u16::MAX),
        high: (0, 0),
        sampled: 0,
    };
}

struct Map {
    scale: Scale,
    numbers: HashMap<(i64, i64), u32>,
    tiles: Vec<((i64, i64), Tile)>,
    /// Some centres in each tile, as in the tile.
    samples: Vec<[(u16, u16); SAMPLES]>,
    /// Tiles met lately, by the low bits of their place: most squares are looked up here, without a hash.
    lately: Vec<u32>,
    /// Tile that each placement of the current cell met last.
    guesses: Vec<u32>,
    /// There are more tiles than are held.
    scattered: bool,
}

/// Find the elements of a layout whose pillars are on these layers.
pub fn discover(
    layout: &Layout,
    from: &Selection,
    layers: &[LayerNumber],
    scale: Scale,
    progress: &dyn Progress,
) -> Result<Vec<ElementSite>> {
    let mut map = Map {
        scale,
        numbers: HashMap::new(),
        tiles: Vec::new(),
        samples: Vec::new(),
        lately: vec![0; 1 << (2 * LATELY)],
        guesses: Vec::new(),
        scattered: false,
    };
    let selection = Selection {
        layers: Some(layers.to_vec()),
        ..from.clone()
    };
    let fail = |cause| Error::Extraction {
        path: layout.path().to_owned(),
        cause,
    };
    layout.visit(&selection, &mut map, progress)?;
    if map.scattered {
        return Err(fail(ExtractionError::Scattered { most: MOST_TILES }));
    }
    let layers = || layers.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    let mut sites = Vec::new();
    for cluster in map.clusters() {
        if let Some(site) = map.element(&cluster).map_err(fail)? {
            sites.push(site);
        }
    }
    if sites.is_empty() {
        return Err(fail(ExtractionError::NoElements { layers: layers() }));
    }
    if sites.len() > MOST_ELEMENTS {
        return Err(fail(ExtractionError::Groups {
            groups: sites.len(),
            layers: layers(),
            most: MOST_ELEMENTS,
        }));
    }
    sites.sort_by_key(|s| (s.centre_nm[1], s.centre_nm[0]));
    for (k, site) in sites.iter_mut().enumerate() {
        site.name = format!("element {}", k + 1);
    }
    Ok(sites)
}

impl Map {
    fn add(&mut self, r: &Rect, placement: usize) {
        if !self.scale.reaches(r) || r.width() != r.height() {
            return;
        }
        let (Some(width), Some(x), Some(y)) = (
            self.scale.whole_nm(r.width()),
            self.scale.whole_nm(r.x0 + r.x1),
            self.scale.whole_nm(r.y0 + r.y1),
        ) else {
            return;
        };
        if width > WIDEST_NM {
            return;
        }
        let key = (x.div_euclid(2 * TILE_NM), y.div_euclid(2 * TILE_NM));
        let guess = &mut self.guesses[placement];
        if self.tiles.get(*guess as usize).is_none_or(|(k, _)| *k != key) {
            let low = |v: i64| (v & ((1 << LATELY) - 1)) as usize;
            let lately = &mut self.lately[low(key.1) << LATELY | low(key.0)];
            if self.tiles.get(*lately as usize).is_none_or(|(k, _)| *k != key) {
                let next = self.tiles.len() as u32;
                *lately = *self.numbers.entry(key).or_insert(next);
                if *lately == next {
                    self.tiles.push((key, Tile::EMPTY));
                    self.samples.push([(0, 0); SAMPLES]);
                }
            }
            *guess = *lately;
        }
        let from_corner = |v: i64| v.rem_euclid(2 * TILE_NM) as u16;
        let (x, y) = (from_corner(x), from_corner(y));
        let tile = &mut self.tiles[*guess as usize].1;
        tile.squares += 1;
        tile.low = (tile.low.0.min(x), tile.low.1.min(y));
        tile.high = (tile.high.0.max(x), tile.high.1.max(y));
        if usize::from(tile.sampled) < SAMPLES && width % 2 == 0 {
            self.samples[*guess as usize][usize::from(tile.sampled)] = (x, y);
            tile.sampled += 1;
        }
    }

    /// Tiles that touch, corners included.
    fn clusters(&self) -> Vec<Vec<usize>> {
        let mut seen = vec![false; self.tiles.len()];
        let mut clusters = Vec::new();
        for start in 0..self.tiles.len() {
            if std::mem::replace(&mut seen[start], true) {
                continue;
            }
            let mut cluster = vec![start];
            let mut next = 0;
            while next < cluster.len() {
                let (x, y) = self.tiles[cluster[next]].0;
                next += 1;
                for (dx, dy) in [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)] {
                    if let Some(&k) = self.numbers.get(&(x + dx, y + dy))
                        && !std::mem::replace(&mut seen[k as usize], true)
                    {
                        cluster.push(k as usize);
                    }
                }
            }
            clusters.push(cluster);
        }
        clusters
    }

    /// A place in a tile, doubled (half nm).
    fn place(&self, tile: usize, (x, y): (u16, u16)) -> (i64, i64) {
        let (column, row) = self.tiles[tile].0;
        (2 * TILE_NM * column + i64::from(x), 2 * TILE_NM * row + i64::from(y))
    }

    /// Centres remembered of a tile, doubled (half nm).
    fn samples(&self, tile: usize) -> impl Iterator<Item = (i64, i64)> + '_ {
        let sampled = usize::from(self.tiles[tile].1.sampled);
        self.samples[tile][..sampled].iter().map(move |&s| self.place(tile, s))
    }

    /// The lattice of one cluster; none if it is too small to be an element.
    fn element(&self, cluster: &[usize]) -> Result<Option<ElementSite>, ExtractionError> {
        let squares: u64 = cluster.iter().map(|&k| self.tiles[k].1.squares).sum();
        if squares < FEWEST {
            return Ok(None);
        }
        let mut steps: BTreeMap<i64, u64> = BTreeMap::new();
        for &k in cluster {
            for axis in [|s: (i64, i64)| s.0, |s: (i64, i64)| s.1] {
                let mut places: Vec<i64> = self.samples(k).map(axis).collect();
                places.sort_unstable();
                places.dedup();
                for pair in places.windows(2) {
                    *steps.entry(pair[1] - pair[0]).or_default() += 1;
                }
            }
        }
        let Some(step) = most_common(steps) else {
            return Ok(None);
        };
        let bounds = cluster
            .iter()
            .flat_map(|&k| [self.tiles[k].1.low, self.tiles[k].1.high].map(|place| self.place(k, place)))
            .fold(Rect::EMPTY, |mut sum, (x, y)| {
                sum.include(Point::new(x, y));
                sum
            });
        let axis = |of: fn((i64, i64)) -> i64, from: i64, to: i64| {
            let mut phases: BTreeMap<i64, u64> = BTreeMap::new();
            for s in cluster.iter().flat_map(|&k| self.samples(k)) {
                *phases.entry(of(s).rem_euclid(step)).or_default() += 1;
            }
            let phase = most_common(phases).unwrap_or(0);
            // Outermost places on the lattice: what is off it does not widen it.
            let first = from + (phase - from).rem_euclid(step);
            let last = to - (to - phase).rem_euclid(step);
            (first, (last - first).max(0) / step + 1)
        };
        let (x, columns) = axis(|s| s.0, bounds.x0, bounds.x1);
        let (y, rows) = axis(|s| s.1, bounds.y0, bounds.y1);
        let sites = columns.max(rows);
        if (sites as u64).saturating_pow(2) > squares.saturating_mul(SITES_PER_PILLAR) + (1 << 16) {
            return Err(ExtractionError::Sparse {
                squares,
                at_nm: [bounds.x0 / 2, bounds.y0 / 2],
                columns,
                rows,
                pitch_nm: step as f64 / 2.0,
            });
        }
        let centre = |first: i64, count: i64| first - (sites - count) / 2 * step + (sites - 1) * step / 2;
        let (twice_x, twice_y) = (centre(x, columns), centre(y, rows));
        let bad = ExtractionError::Lattice {
            pitch_nm: step as f64 / 2.0,
            centre_nm: [twice_x as f64 / 2.0, twice_y as f64 / 2.0],
        };
        if step % 4 != 0 || twice_x % 2 != 0 || twice_y % 2 != 0 {
            return Err(bad);
        }
        let Ok(lattice) = Lattice::new((step / 2) as u32, sites as usize) else {
            return Err(bad);
        };
        Ok(Some(ElementSite {
            name: String::new(),
            centre_nm: [twice_x / 2, twice_y / 2],
            lattice,
        }))
    }
}

/// The key counted most often, the smallest of equals.
fn most_common(counts: BTreeMap<i64, u64>) -> Option<i64> {
    counts
        .into_iter()
        .max_by_key(|&(key, count)| (count, std::cmp::Reverse(key)))
        .map(|(key, _)| key)
}

impl Visitor for Map {
    fn cell(&mut self, _cell: &LayoutCell, placements: &[Transform]) -> metalith_core::Result<()> {
        self.guesses.clear();
        self.guesses.resize(placements.len(), 0);
        Ok(())
    }

    #[inline]
    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> metalith_core::Result<()> {
        let Some(rect) = &shape.rect else { return Ok(()) };
        for (k, placement) in placements.iter().enumerate() {
            // A tile too many, and no more is looked for.
            self.scattered |= self.tiles.len() > MOST_TILES;
            if self.scattered {
                break;
            }
            if let Some(placed) = placement.apply_rect(rect) {
                self.add(&placed, k);
            }
        }
        Ok(())
    }
}
