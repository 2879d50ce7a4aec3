//! Lattice on which the shapes of a group of tiles stand.

use std::collections::BTreeMap;

use super::places::PlaceFit;
use super::rounded::place_slack;
use super::tiles::TileMap;
use crate::{CORNER_STEPS, ExtractionError, Point, Rect};
use metalith_pillars::{DatabaseUnit, ElementSite, Lattice, LatticeKind, Pitch};

/// Fewer pillars together are no element.
pub(super) const FEWEST: u64 = 16;
/// One in so many tiles at least shows a row between those of its samples, where two arrays make a hexagonal lattice: all do but
/// those that pillars reach by their rims.
const ROWS_BETWEEN: usize = 4;
/// All centres but one in so many at most are sites of a lattice.
pub(super) const SHARE_OF_SITES: u64 = 4;
/// Lattice sites for each pillar found: a lens fills 0.79 of its lattice.
const SITES_PER_PILLAR: u64 = 64;

/// Tiles next to one another, which may be an element.
pub(super) struct Cluster<'a> {
    /// Steps of places in a nanometre.
    pub steps_per_nm: i64,
    /// Database unit (half steps).
    pub unit_halves: f64,
    /// Step of a grid on which rounding moves places as far as they were moved (half steps): the unit, but where they were turned.
    pub rounding_halves: f64,
    pub tiles: &'a TileMap,
    /// Numbers of its tiles.
    pub members: &'a [usize],
}

/// An element as it was found.
pub(super) struct FoundElement {
    pub site: ElementSite,
    pub fit: PlaceFit,
    /// True if a good part of its centres are not on the lattice, or half of its sites have none.
    pub is_poor: bool,
    /// True if nearly all centres are on the lattice.
    pub is_whole: bool,
}

impl Cluster<'_> {
    /// Lattice, and how far its pillars reach; none if it is too small to be an element. Where most places are on no lattice of
    /// whole steps, they may be places that were rounded one by one.
    pub(crate) fn element(&self) -> Result<Option<FoundElement>, ExtractionError> {
        let pillars: u64 = self.members.iter().map(|&k| self.tiles.pillars(k)).sum();
        if pillars < FEWEST {
            return Ok(None);
        }
        let exact = self.exact(pillars);
        let tiles = self.sampled();
        let all = tiles.iter().map(Vec::len).sum();
        let on = match &exact {
            Ok(Some(site)) => self.count_on(site, &tiles),
            _ => 0,
        };
        let exactly = |site: ElementSite| FoundElement {
            is_poor: SHARE_OF_SITES as usize * on < (SHARE_OF_SITES as usize - 1) * all,
            is_whole: few_are_off(on, all),
            site,
            fit: PlaceFit {
                slack_nm: if self.is_turned() {
                    self.nm_of(place_slack(self.rounding_halves))
                } else {
                    0.0
                },
                ..PlaceFit::default()
            },
        };
        if few_are_off(on, all)
            && let Ok(Some(site)) = exact
        {
            return Ok(Some(exactly(site)));
        }
        match self.rounded(&tiles).filter(|(fit, _)| !few_are_off(on, fit.count)) {
            Some((fit, grid)) => {
                let (is_poor, is_whole) = (fit.is_half_empty, few_are_off(fit.count, all));
                let (site, fit) = self.fitted_site(&fit, grid, pillars)?;
                Ok(Some(FoundElement {
                    site,
                    fit,
                    is_poor,
                    is_whole,
                }))
            }
            None => Ok(exact?.map(exactly)),
        }
    }

    /// True if places were turned back and rounded.
    fn is_turned(&self) -> bool {
        self.rounding_halves > self.unit_halves
    }

    /// The lattice of whole steps that most samples are on.
    fn exact(&self, pillars: u64) -> Result<Option<ElementSite>, ExtractionError> {
        let mut steps = [BTreeMap::<i64, u64>::new(), BTreeMap::new()];
        for &k in self.members {
            for (axis, steps) in AXES.into_iter().zip(&mut steps) {
                let mut places: Vec<i64> = self.tiles.samples(k).map(axis).collect();
                places.sort_unstable();
                places.dedup();
                for pair in places.windows(2) {
                    *steps.entry(pair[1] - pair[0]).or_default() += 1;
                }
            }
        }
        if let Some(element) = self.hexagonal(pillars, &steps)? {
            return Ok(Some(element));
        }
        let [mut steps, along_y] = steps;
        along_y
            .into_iter()
            .for_each(|(step, count)| *steps.entry(step).or_default() += count);
        let Some(step) = most_common(steps) else {
            return Ok(None);
        };
        let bounds = self.bounds();
        let (x, columns) = self.places(0, step, [bounds.x0, bounds.x1]);
        let (y, rows) = self.places(1, step, [bounds.y0, bounds.y1]);
        let sites = columns.max(rows);
        self.dense_enough(pillars, sites, &bounds, [columns, rows], step)?;
        let centres = |sites: i64| {
            let centre = |first: i64, count: i64| 2 * first - (sites - count) / 2 * 2 * step + (sites - 1) * step;
            [centre(x, columns), centre(y, rows)]
        };
        // In half steps, doubled. Where the centre between two sites is no whole nanometre, a site is.
        let whole = 4 * self.steps_per_nm;
        let is_whole = |sites: &i64| centres(*sites).iter().all(|c| c % whole == 0);
        let sites = [sites, sites + 1].into_iter().find(is_whole).unwrap_or(sites);
        let centre = centres(sites);
        let lattice = self
            .pitch(step)
            .and_then(|pitch| Lattice::on_grid(LatticeKind::Square, pitch, self.unit(pitch), sites as usize).ok());
        match lattice {
            Some(lattice) if is_whole(&sites) => Ok(Some(ElementSite {
                name: String::new(),
                centre_nm: centre.map(|c| c / whole),
                lattice,
                within_nm: Some([(0, x, columns), (1, y, rows)].map(|(axis, first, count)| {
                    let from = first - centre[axis] / 2;
                    self.ends_nm(from, from + (count - 1) * step)
                })),
            })),
            _ => Err(ExtractionError::Lattice {
                pitch_nm: self.nm(step),
                centre_nm: centre.map(|c| c as f64 / whole as f64),
            }),
        }
    }

    /// A length in half steps (nm).
    fn nm(&self, halves: i64) -> f64 {
        halves as f64 / (2 * self.steps_per_nm) as f64
    }

    /// A length in half steps as a pitch, if it may be one.
    fn pitch(&self, halves: i64) -> Option<Pitch> {
        Pitch::of_nm(self.nm(halves)).filter(|pitch| pitch.nm() > 0.0)
    }

    /// The grid of the file; that of 1 nm where a lattice with such a pitch stands on it, whatever the file has.
    fn unit(&self, pitch: Pitch) -> DatabaseUnit {
        if DatabaseUnit::Nanometre.divides_half(pitch) {
            DatabaseUnit::Nanometre
        } else {
            DatabaseUnit::of_per_nm(self.steps_per_nm).unwrap_or_default()
        }
    }

    /// Two places from the centre in half steps, outwards to whole nanometres.
    fn ends_nm(&self, first: i64, last: i64) -> [i64; 2] {
        let whole = 2 * self.steps_per_nm;
        [first.div_euclid(whole), -(-last).div_euclid(whole)]
    }

    /// Box around all centres (half steps).
    pub(super) fn bounds(&self) -> Rect {
        let mut bounds = Rect::EMPTY;
        self.members.iter().for_each(|&k| bounds.unite(&self.tiles.bounds(k)));
        bounds
    }

    /// The first place of a lattice with this step along an axis, between two ends, and the number of its places (half steps).
    fn places(&self, axis: usize, step: i64, [from, to]: [i64; 2]) -> (i64, i64) {
        let mut phases: BTreeMap<i64, u64> = BTreeMap::new();
        for s in self.members.iter().flat_map(|&k| self.tiles.samples(k)) {
            *phases.entry(AXES[axis](s).rem_euclid(step)).or_default() += 1;
        }
        let phase = most_common(phases).unwrap_or(0);
        // Outermost places on the lattice: what is off it does not widen it, but for pillars of odd width, by half a unit.
        let odd = (CORNER_STEPS * self.unit_halves) as i64;
        let (from, to) = (from - odd, to + odd);
        let first = from + (phase - from).rem_euclid(step);
        let last = to - (to - phase).rem_euclid(step);
        (first, (last - first).max(0) / step + 1)
    }

    /// True if enough of the last centres of its tiles are in rows between the rows of its samples, and shifted as on a
    /// hexagonal lattice with this half pitch and distance of rows (half steps).
    fn has_rows_between(&self, half_pitch: i64, row: i64) -> bool {
        let between = |&&k: &&usize| {
            let (Some(first), Some(last)) = (self.tiles.samples(k).next(), self.tiles.last(k)) else {
                return false;
            };
            let [x, y] = [last.x - first.x, last.y - first.y];
            let whole = x % half_pitch == 0 && y % row == 0;
            whole && x / half_pitch % 2 != 0 && y / row % 2 != 0
        };
        self.members.iter().filter(between).count() * ROWS_BETWEEN >= self.members.len()
    }

    /// Hexagonal lattice, if most centres are a pitch or half of one apart along x, and along y as far as its
    /// rows, or twice as far with rows between them. Samples of a tile may be of one row alone, or of every other one where two
    /// arrays make the lattice.
    fn hexagonal(&self, pillars: u64, steps: &[BTreeMap<i64, u64>; 2]) -> Result<Option<ElementSite>, ExtractionError> {
        let [Some(step_x), Some(step_y)] = [0, 1].map(|axis: usize| most_common(steps[axis].clone())) else {
            return Ok(None);
        };
        // Half a pitch along x, and the distance of rows on the grid of the file or on that of 1 nm.
        let units = [DatabaseUnit::Nanometre]
            .into_iter()
            .chain(DatabaseUnit::of_per_nm(self.steps_per_nm));
        let steps = [step_x / 2, step_x]
            .into_iter()
            .flat_map(|half| units.clone().map(move |unit| (half, unit)));
        let mut lattices = steps.filter_map(|(half, unit)| {
            let pitch = self
                .pitch(2 * half)
                .filter(|pitch| half % 2 == 0 && unit.divides(*pitch))?;
            let row = (LatticeKind::Hexagonal.row_nm(pitch, unit) * 2.0 * self.steps_per_nm as f64).round() as i64;
            let fits = step_y == row || (step_y == 2 * row && self.has_rows_between(half, row));
            fits.then_some((pitch, unit, half, row))
        });
        let Some((pitch, unit, step_x, step_y)) = lattices.next() else {
            return Ok(None);
        };
        let bounds = self.bounds();
        let (x, columns) = self.places(0, step_x, [bounds.x0, bounds.x1]);
        let (y, rows) = self.places(1, step_y, [bounds.y0, bounds.y1]);
        let staggered = |s: Point| ((s.x - x).div_euclid(step_x) + (s.y - y).div_euclid(step_y)).rem_euclid(2);
        let mut parities: BTreeMap<i64, u64> = BTreeMap::new();
        for s in self.members.iter().flat_map(|&k| self.tiles.samples(k)) {
            *parities.entry(staggered(s)).or_default() += 1;
        }
        // Where as many centres are on the other places of the grid it is no lattice of such rows.
        let most = most_common_count(&parities);
        if SHARE_OF_SITES * most < (SHARE_OF_SITES - 1) * parities.values().sum::<u64>() {
            return Ok(None);
        }
        // A site in the middle, or beside it.
        let row = rows / 2;
        let column = columns / 2;
        let column = column + (column + row + most_common(parities).unwrap_or(0)).rem_euclid(2);
        let reach = column.max(columns - 1 - column);
        let high = row.max(rows - 1 - row);
        let sites = 2 * reach.max((high * step_y + step_x - 1) / step_x) + 1;
        let centre = [x + column * step_x, y + row * step_y];
        let ends = |step: i64, before: i64, count: i64| self.ends_nm(-before * step, (count - 1 - before) * step);
        self.dense_enough(pillars, sites, &bounds, [columns, rows], 2 * step_x)?;
        let lattice = Lattice::on_grid(LatticeKind::Hexagonal, pitch, unit, sites as usize);
        let whole = 2 * self.steps_per_nm;
        match lattice {
            Ok(lattice) if centre.iter().all(|c| c % whole == 0) => Ok(Some(ElementSite {
                name: String::new(),
                centre_nm: centre.map(|c| c / whole),
                lattice,
                within_nm: Some([ends(step_x, column, columns), ends(step_y, row, rows)]),
            })),
            _ => Err(ExtractionError::Lattice {
                pitch_nm: pitch.nm(),
                centre_nm: centre.map(|c| self.nm(c)),
            }),
        }
    }

    /// Succeeds if so many pillars fill a lattice of so many places an axis well enough to be one.
    pub(super) fn dense_enough(
        &self,
        pillars: u64,
        sites: i64,
        bounds: &Rect,
        [columns, rows]: [i64; 2],
        pitch: i64,
    ) -> Result<(), ExtractionError> {
        if (sites as u64).saturating_pow(2) <= pillars.saturating_mul(SITES_PER_PILLAR) + (1 << 16) {
            return Ok(());
        }
        Err(ExtractionError::Sparse {
            pillars,
            at_nm: [bounds.x0, bounds.y0].map(|c| c / (2 * self.steps_per_nm)),
            columns,
            rows,
            pitch_nm: self.nm(pitch),
        })
    }
}

/// True if nearly all of some places are on a lattice: a few may be faults.
pub(super) fn few_are_off(on: usize, all: usize) -> bool {
    /// One in so many may be off.
    const FEW: usize = 50;
    FEW * on >= (FEW - 1) * all
}

/// Coordinates of a place along x and along y.
pub(super) const AXES: [fn(Point) -> i64; 2] = [|s| s.x, |s| s.y];

/// Count of the key counted most often.
fn most_common_count(counts: &BTreeMap<i64, u64>) -> u64 {
    counts.values().copied().max().unwrap_or(0)
}

/// The key counted most often, the smallest of equals.
fn most_common(counts: BTreeMap<i64, u64>) -> Option<i64> {
    counts
        .into_iter()
        .max_by_key(|&(key, count)| (count, std::cmp::Reverse(key)))
        .map(|(key, _)| key)
}
