//! Lattices whose places were rounded to the grid one by one, as loops of other programs draw them: any pitch, rows of hexagonal
//! lattices half the root of three of the pitch apart, a centre anywhere.

use super::lattices::{AXES, Cluster, FoundElement, SHARE_OF_SITES, few_are_off};
use super::places::PlaceFit;
use super::turned::typical_distance;
use crate::{CORNER_STEPS, ExtractionError, Point};
use metalith_pillars::{DatabaseUnit, ElementSite, Lattice, LatticeKind, Pitch};

/// Tiles whose samples are fitted, at most: those of an element of 0.7 mm, and of larger ones as many in equal steps.
const MOST_FITTED: usize = 4096;
/// Places of one column or row are no farther apart than so many grid steps: the rounding of two edges each, twice.
const ONE_PLACE: f64 = 2.0;
/// Share of a step by which a place may be off in a fit before its number is known.
const NUMBERED: f64 = 0.25;
/// Steps on either side of the middle that the first fit takes in.
const FIRST_REACH: f64 = 12.0;
/// Pitch over the distance of neighbouring pillars, at least: 0.71 where every other site has a pillar.
const SHARE_OF_DISTANCE: f64 = 0.6;
/// Steps in a nanometre of pitches that people choose, the coarsest first.
const DECIMALS: [f64; 7] = [1.0, 2.0, 10.0, 20.0, 100.0, 1e3, 1e4];
/// Steps of the grid by which a rounder pitch or angle may move the outermost places of a lattice: half of what their tolerance leaves beside
/// the rounding of corners.
pub(super) const ROOM: f64 = 0.5 * CORNER_STEPS;
/// Half the root of three: the distance of rows of a hexagonal lattice over its pitch.
const ROW: f64 = 0.866_025_403_784_438_6;

/// Places along an axis: the first, and the distance of two (half steps).
#[derive(Clone, Copy)]
pub(super) struct Comb {
    first: f64,
    pub(super) step: f64,
}

impl Comb {
    /// Number of the nearest place, and the distance from it.
    pub(super) fn nearest(&self, v: f64) -> (f64, f64) {
        let k = ((v - self.first) / self.step).round();
        (k, v - self.first - k * self.step)
    }
}

/// A lattice that most samples stand on.
pub(super) struct Fit {
    kind: LatticeKind,
    pitch: Pitch,
    combs: [Comb; 2],
    /// Parity of column and row of the sites of a hexagonal lattice.
    parity: i64,
    /// Samples on sites.
    pub count: usize,
    /// True if nearly all of them are on every other site of a square lattice, as those of a wider one are that is turned by 45
    /// degrees.
    pub is_half_empty: bool,
}

impl Cluster<'_> {
    /// Samples of all shapes in some of the tiles.
    pub(super) fn sampled(&self) -> Vec<Vec<Point>> {
        let every = self.members.len().div_ceil(MOST_FITTED).max(1);
        let tiles = self.members.iter().step_by(every);
        tiles.map(|&k| self.tiles.all_samples(k).collect()).collect()
    }

    /// Places of the lattice of an element along x and y, whose middle is so far from its centre (nm).
    pub(super) fn combs(&self, site: &ElementSite, offset_nm: [f64; 2]) -> [Comb; 2] {
        let (lattice, nanometre) = (site.lattice, self.steps_per_nm as f64 * 2.0);
        [0, 1].map(|axis| Comb {
            first: (site.centre_nm[axis] as f64 + offset_nm[axis] + lattice.place_nm(axis, 0)) * nanometre,
            step: lattice.steps_nm()[axis] * nanometre,
        })
    }

    /// Distance along an axis at which a shape stands on a place of an element as it was found (half steps).
    pub(super) fn slack_of(&self, found: &FoundElement) -> f64 {
        let nanometre = self.steps_per_nm as f64 * 2.0;
        let rounding = found.site.lattice.rounding_nm() * nanometre + CORNER_STEPS * self.unit_halves;
        rounding.max(found.fit.slack_nm * nanometre)
    }

    /// Number of samples on the sites of a lattice whose places are as they should be: shapes of odd width half a unit beside.
    pub(super) fn count_on(&self, site: &ElementSite, tiles: &[Vec<Point>]) -> usize {
        let (lattice, nanometre) = (site.lattice, self.steps_per_nm as f64 * 2.0);
        let rounding = lattice.rounding_nm() * nanometre;
        let combs = self.combs(site, [0.0; 2]);
        let is_on = |p: &&Point| {
            let [(column, x), (row, y)] = [0, 1].map(|axis| {
                let place = AXES[axis](**p) as f64;
                let odd = if place % self.unit_halves == 0.0 {
                    0.0
                } else {
                    CORNER_STEPS * self.unit_halves
                };
                let (k, off) = combs[axis].nearest(place);
                (k, off.abs() <= rounding + odd)
            });
            x && y && (lattice.is_square() || (column + row).rem_euclid(2.0) == 0.0)
        };
        tiles.iter().flatten().filter(is_on).count()
    }

    /// The lattice that most shapes stand on when their places are rounded to the grid, and this grid: that of the file, or that
    /// of 1 nm (half steps).
    pub(super) fn rounded(&self, tiles: &[Vec<Point>]) -> Option<(Fit, f64)> {
        let nanometre = 2.0 * self.steps_per_nm as f64;
        let coarser = nanometre * self.rounding_halves / self.unit_halves;
        let coarser = (self.rounding_halves < coarser).then_some(coarser);
        // A lattice much closer than pillars are is one of their superlattices, turned.
        let least = SHARE_OF_DISTANCE * typical_distance(tiles)?;
        [self.rounding_halves].into_iter().chain(coarser).find_map(|grid| {
            let fits = self.fits(tiles, grid).into_iter();
            let fits = fits.filter(|fit| fit.pitch.nm() * nanometre >= least);
            fits.reduce(|best, fit| if fit.count > best.count { fit } else { best })
                .map(|fit| (fit, grid))
        })
    }

    /// Lattices on which enough samples stand, each to a step of this grid (half steps).
    fn fits(&self, tiles: &[Vec<Point>], grid: f64) -> Vec<Fit> {
        let mut found = Vec::new();
        for axis in 0..2 {
            let Some(step) = refined_step(tiles, axis, grid) else {
                continue;
            };
            let of_row = if axis == 0 { 1.0 } else { 1.0 / (2.0 * ROW) };
            let kinds = [
                (LatticeKind::Square, step),
                (LatticeKind::Hexagonal, 2.0 * step * of_row),
                (
                    LatticeKind::Hexagonal,
                    step * if axis == 0 { 1.0 } else { 2.0 * of_row },
                ),
            ];
            let fits = (kinds.into_iter())
                .filter_map(|(kind, pitch)| self.fit(tiles, kind, self.roundest(pitch, grid)?, grid));
            found.extend(fits);
        }
        found
    }

    /// The roundest pitch that puts no place farther from where a fitted one (half steps) has it than rounding leaves room for.
    fn roundest(&self, fitted: f64, grid: f64) -> Option<Pitch> {
        let (nm, bounds) = (self.nm_of(fitted), self.bounds());
        let steps = 0.5 * bounds.width().max(bounds.height()) as f64 / fitted;
        let room_nm = self.nm_of(ROOM * grid) / steps.max(1.0);
        let rounded = |per_nm: &f64| (nm * per_nm).round() / per_nm;
        let nearest = DECIMALS.iter().map(rounded).find(|round| (round - nm).abs() <= room_nm);
        Pitch::nearest(nearest.unwrap_or(nm)).filter(|pitch| pitch.nm() > 0.0)
    }

    fn fit(&self, tiles: &[Vec<Point>], kind: LatticeKind, pitch: Pitch, grid: f64) -> Option<Fit> {
        let halves = pitch.nm() * 2.0 * self.steps_per_nm as f64;
        let steps = match kind {
            LatticeKind::Square => [halves; 2],
            LatticeKind::Hexagonal => [halves / 2.0, halves * ROW],
        };
        let all = || tiles.iter().flatten();
        let combs = [0, 1].map(|axis| {
            let first = phase(all().map(|p| AXES[axis](*p) as f64), steps[axis], grid);
            Comb {
                first,
                step: steps[axis],
            }
        });
        let mut counts = [0usize; 2];
        for p in all() {
            let [(column, dx), (row, dy)] = [0, 1].map(|axis| combs[axis].nearest(AXES[axis](*p) as f64));
            if dx.abs().max(dy.abs()) <= place_slack(grid) {
                counts[(column + row).rem_euclid(2.0) as usize] += 1;
            }
        }
        let (parity, count) = match kind {
            LatticeKind::Square => (0, counts[0] + counts[1]),
            LatticeKind::Hexagonal if counts[1] > counts[0] => (1, counts[1]),
            LatticeKind::Hexagonal => (0, counts[0]),
        };
        let enough = SHARE_OF_SITES as usize * count >= (SHARE_OF_SITES as usize - 1) * all().count();
        enough.then_some(Fit {
            kind,
            pitch,
            combs,
            parity,
            count,
            is_half_empty: kind.is_square() && few_are_off(counts[0].max(counts[1]), count),
        })
    }

    pub(super) fn nm_of(&self, halves: f64) -> f64 {
        halves / (2 * self.steps_per_nm) as f64
    }

    /// The element on a lattice, with the distance of the middle from a whole nanometre.
    pub(super) fn fitted_site(
        &self,
        fit: &Fit,
        grid: f64,
        pillars: u64,
    ) -> Result<(ElementSite, PlaceFit), ExtractionError> {
        let bounds = self.bounds();
        let ends = [[bounds.x0, bounds.x1], [bounds.y0, bounds.y1]];
        let slack = place_slack(grid);
        let reach = [0, 1].map(|axis| {
            let Comb { first, step } = fit.combs[axis];
            let [low, high] = ends[axis].map(|v| v as f64 - first);
            [
                ((low - slack) / step).ceil() as i64,
                ((high + slack) / step).floor() as i64,
            ]
        });
        let counts = reach.map(|[low, high]| (high - low).max(0) + 1);
        let steps = fit.combs.map(|comb| comb.step);
        let unit = DatabaseUnit::of_per_nm(self.steps_per_nm).unwrap_or_default();
        // Twice the number of the middle along each axis, and places along an axis.
        let (twice_middle, sites) = match fit.kind {
            LatticeKind::Square => {
                let sites = counts[0].max(counts[1]);
                // One more to the right and above where an axis has not as many, or half of it.
                let middle = |axis: usize| 2 * reach[axis][0] - (sites - counts[axis]) / 2 * 2 + sites - 1;
                ([middle(0), middle(1)], sites)
            }
            LatticeKind::Hexagonal => {
                let [row, column] = [1, 0].map(|axis: usize| reach[axis][0] + counts[axis] / 2);
                let column = column + (column + row + fit.parity).rem_euclid(2);
                let across = (column - reach[0][0]).max(reach[0][1] - column);
                let high = (row - reach[1][0]).max(reach[1][1] - row) as f64;
                let sites = 2 * across.max((high * steps[1] / steps[0]).ceil() as i64) + 1;
                ([2 * column, 2 * row], sites)
            }
        };
        let middle_nm =
            [0, 1].map(|axis| self.nm_of(fit.combs[axis].first + twice_middle[axis] as f64 / 2.0 * steps[axis]));
        self.dense_enough(
            pillars,
            sites,
            &bounds,
            counts,
            (fit.pitch.nm() * 2.0 * self.steps_per_nm as f64) as i64,
        )?;
        let lattice = match fit.kind {
            LatticeKind::Square => Lattice::on_grid(LatticeKind::Square, fit.pitch, unit, sites as usize),
            LatticeKind::Hexagonal => Lattice::hexagonal_by_place(fit.pitch, unit, sites as usize),
        };
        let lattice = lattice.map_err(|_| ExtractionError::Lattice {
            pitch_nm: fit.pitch.nm(),
            centre_nm: middle_nm,
        })?;
        let centre_nm = middle_nm.map(|nm| nm.round() as i64);
        let within = |axis: usize| {
            let [low, high] =
                reach[axis].map(|k| (k as f64 - twice_middle[axis] as f64 / 2.0) * self.nm_of(steps[axis]));
            [low.floor() as i64, high.ceil() as i64]
        };
        let site = ElementSite {
            name: String::new(),
            centre_nm,
            lattice,
            within_nm: Some([within(0), within(1)]),
        };
        let fit = PlaceFit {
            offset_nm: [0, 1].map(|axis| middle_nm[axis] - centre_nm[axis] as f64),
            slack_nm: self.nm_of(slack),
        };
        Ok((site, fit))
    }
}

/// Distance of neighbouring places along an axis, fitted from the middle outwards: none where tiles have one place each.
fn refined_step(tiles: &[Vec<Point>], axis: usize, grid: f64) -> Option<f64> {
    let mut steps = Vec::new();
    for tile in tiles {
        let mut places: Vec<i64> = tile.iter().map(|p| AXES[axis](*p)).collect();
        places.sort_unstable();
        let mut means: Vec<(f64, f64, i64)> = Vec::new();
        for v in places {
            match means.last_mut() {
                Some((sum, count, last)) if (v - *last) as f64 <= ONE_PLACE * grid => {
                    (*sum, *count, *last) = (*sum + v as f64, *count + 1.0, v);
                }
                _ => means.push((v as f64, 1.0, v)),
            }
        }
        let mean = |m: &(f64, f64, i64)| m.0 / m.1;
        steps.extend(means.windows(2).map(|pair| mean(&pair[1]) - mean(&pair[0])));
    }
    steps.sort_unstable_by(f64::total_cmp);
    // The densest group of steps that rounding makes of one.
    let within = |from: usize| steps[from..].partition_point(|s| *s <= steps[from] + ONE_PLACE * grid);
    let (from, count) = (0..steps.len())
        .map(|k| (k, within(k)))
        .max_by_key(|(k, n)| (*n, std::cmp::Reverse(*k)))?;
    let step = steps[from..from + count].iter().sum::<f64>() / count as f64;
    let mut places: Vec<f64> = tiles.iter().flatten().map(|p| AXES[axis](*p) as f64).collect();
    places.sort_unstable_by(f64::total_cmp);
    let middle = places[places.len() / 2];
    let mut comb = Comb { first: middle, step };
    let last = (places[places.len() - 1] - middle).max(middle - places[0]);
    let mut reach = FIRST_REACH * step;
    loop {
        let from = places.partition_point(|v| *v < middle - reach);
        let to = places.partition_point(|v| *v <= middle + reach);
        comb = least_squares(&places[from..to], comb)?;
        if reach > last {
            return Some(comb.step);
        }
        reach *= 2.0;
    }
}

/// Distance along an axis at which a shape still stands on a place (half steps): half a step of the grid for the corners, and as much
/// for the middle of a lattice or of a circle, which are found from rounded corners.
pub(super) fn place_slack(grid: f64) -> f64 {
    2.0 * CORNER_STEPS * grid
}

/// A place of the comb with this step that most of these are on: in the middle of those that are near.
fn phase(places: impl Iterator<Item = f64> + Clone, step: f64, grid: f64) -> f64 {
    let turns = |v: f64| std::f64::consts::TAU * (v / step);
    let (mut sin, mut cos) = (0.0, 0.0);
    for v in places.clone() {
        let (s, c) = turns(v).sin_cos();
        (sin, cos) = (sin + s, cos + c);
    }
    let first = sin.atan2(cos) / std::f64::consts::TAU * step;
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for v in places {
        let (_, off) = Comb { first, step }.nearest(v);
        if off.abs() <= place_slack(grid) {
            (low, high) = (low.min(off), high.max(off));
        }
    }
    if low <= high { first + 0.5 * (low + high) } else { first }
}

/// The comb nearest to places, numbered by another.
fn least_squares(places: &[f64], by: Comb) -> Option<Comb> {
    let numbered = places.iter().filter_map(|v| {
        let (k, off) = by.nearest(*v);
        (off.abs() <= NUMBERED * by.step).then_some((k, off))
    });
    let (mut n, mut k1, mut k2, mut r, mut kr) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (k, off) in numbered {
        (n, k1, k2, r, kr) = (n + 1.0, k1 + k, k2 + k * k, r + off, kr + k * off);
    }
    let det = n * k2 - k1 * k1;
    if det <= 0.0 {
        return None;
    }
    let slope = (n * kr - k1 * r) / det;
    let comb = Comb {
        first: by.first + (r - slope * k1) / n,
        step: by.step + slope,
    };
    (comb.step > 0.0).then_some(comb)
}
