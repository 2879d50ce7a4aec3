//! Conversion of a place in the layout to a site of an element, in whole numbers.

use std::collections::HashMap;

use super::places::PlaceFit;
use crate::shape::{are_of_square, grid_step};
use crate::{CORNER_STEPS, Layout, Rect, Result};
use metalith_pillars::ElementSite;

/// Database unit as `num / den` nanometres: lengths are compared as `database units * num` and `nm * den`.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    pub num: i64,
    pub den: i64,
}

/// Farthest coordinate at which a pillar is looked for (database units): products with [`Scale`] fit.
const REACH: i64 = 1 << 35;

/// Steps of pitches of designs in a nanometre: see [`Pitch`](metalith_pillars::Pitch).
pub(super) const PITCHES_PER_NM: i64 = 20;

/// Half steps of pitches in a nanometre: places of all lattices are whole numbers of them.
const PLACES_PER_NM: i64 = 2 * PITCHES_PER_NM;

impl Scale {
    /// Scale of the database unit of a layout.
    ///
    /// # Errors
    /// If the unit is no ratio of whole numbers to a nanometre, as with units of an inch.
    pub fn of(layout: &Layout) -> Result<Self> {
        let (num, den) = layout.unit_ratio_nm()?;
        Ok(Self { num, den })
    }

    /// Database units as nanometres.
    pub fn nm(self, value: f64) -> f64 {
        value * self.num as f64 / self.den as f64
    }

    /// Steps of a nanometre in which places are looked for: database units where pitches are multiples of these, else one.
    pub fn steps_per_nm(self) -> i64 {
        if PITCHES_PER_NM % self.den == 0 { self.den } else { 1 }
    }

    /// A length in the steps of [`Scale::steps_per_nm`], if it is a whole number of them.
    #[inline]
    pub fn whole_steps(self, value: i64) -> Option<i64> {
        if PITCHES_PER_NM % self.den == 0 {
            return Some(value * self.num);
        }
        self.whole_nm(value)
    }

    /// A length in whole nanometres, rounded up.
    #[inline]
    pub fn at_least_nm(self, value: i64) -> i64 {
        if self.den == 1 {
            return value * self.num;
        }
        (value * self.num + self.den - 1).div_euclid(self.den)
    }

    /// A length in whole nanometres, if it is one.
    #[inline]
    pub fn whole_nm(self, value: i64) -> Option<i64> {
        if self.den == 1 {
            return Some(value * self.num);
        }
        let scaled = value * self.num;
        (scaled % self.den == 0).then_some(scaled / self.den)
    }

    /// Step of the grid that a rectangle is drawn on (database units): the unit, or a nanometre if both edges are whole ones.
    pub(super) fn step_of(self, r: &Rect) -> f64 {
        let is_whole = [r.width(), r.height()]
            .iter()
            .all(|edge| self.whole_nm(*edge).is_some());
        if is_whole { grid_step(self.nm(1.0)) } else { 1.0 }
    }

    /// Width of a rectangle that may be a square to the rounding of its corners, to a whole nanometre: of two the even one. None if
    /// an edge differs from it by more than a step of the grid.
    pub fn rounded_width_nm(self, r: &Rect) -> Option<i64> {
        let (width, height) = (r.width(), r.height());
        let step = self.step_of(r);
        let width_nm = self.nm((width + height) as f64 / 2.0).round_ties_even() as i64;
        (are_of_square([width, height], step) && width_nm > 0).then_some(width_nm)
    }

    /// True if a rectangle is near enough for arithmetic.
    #[inline]
    pub fn reaches(self, r: &Rect) -> bool {
        r.x0 > -REACH && r.y0 > -REACH && r.x1 < REACH && r.y1 < REACH
    }
}

/// Place of a pillar on the sites.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum SitePlace {
    /// Site (row, column) of an element.
    Site(u32, usize, usize),
    /// Place between sites, in this element.
    Between(u32),
    Outside,
}

/// One element in scaled units (nm * den), [`PLACES_PER_NM`] times as fine, so that its places are whole: but for pitches and
/// rows that are fitted.
#[derive(Clone, Copy, Debug)]
struct Grid {
    first: [i64; 2],
    step: [f64; 2],
    /// Largest distance of a place that is rounded to the grid of the file.
    rounding: f64,
    inverse: [f64; 2],
    /// Columns and rows that pillars may be in: the first, and the one after the last.
    reach: [[i64; 2]; 2],
    /// True if columns and rows whose sum is odd are no sites.
    staggered: bool,
    pitch_nm: i64,
}

impl Grid {
    fn new(site: &ElementSite, fit: PlaceFit, scale: Scale) -> Self {
        let lattice = site.lattice;
        let scaled = |nm: f64| (nm * PLACES_PER_NM as f64).round() as i64 * scale.den;
        let step = lattice.steps_nm();
        let step = if lattice.has_whole_steps() {
            step.map(|nm| scaled(nm) as f64)
        } else {
            step.map(|nm| nm * (PLACES_PER_NM * scale.den) as f64)
        };
        let first = |axis: usize| {
            let from_centre = lattice.place_nm(axis, 0) + fit.offset_nm[axis];
            PLACES_PER_NM * site.centre_nm[axis] * scale.den + scaled(from_centre)
        };
        Self {
            first: [first(0), first(1)],
            step,
            rounding: scaled(lattice.rounding_nm().max(fit.slack_nm)) as f64,
            inverse: step.map(|step| 1.0 / step),
            reach: site.reach().map(|reach| [reach.start as i64, reach.end as i64]),
            staggered: !lattice.is_square(),
            pitch_nm: lattice.pitch_nm().at_least_nm(),
        }
    }

    /// Nearest site along an axis and the distance from it.
    #[inline]
    fn nearest(&self, axis: usize, place: i64) -> (i64, f64) {
        let from_first = (place - self.first[axis]) as f64;
        // A conversion cuts off, and needs no call as rounding does: this is the innermost loop of reading.
        let sites = from_first * self.inverse[axis];
        let site = (sites + 0.5f64.copysign(sites)) as i64;
        (site, from_first - site as f64 * self.step[axis])
    }

    #[inline]
    fn holds(&self, axis: usize, site: i64) -> bool {
        let [from, to] = self.reach[axis];
        (from..to).contains(&site)
    }

    /// The first place along both axes that may hold a pillar, and the width of all of them.
    fn extent(&self) -> [[i64; 2]; 2] {
        [0, 1].map(|axis| {
            let [from, to] = self.reach[axis];
            let along = |count: i64| (count as f64 * self.step[axis]).round() as i64;
            [self.first[axis] + along(from), along(to - from)]
        })
    }
}

/// All elements, and which of them is where.
pub(super) struct Sites {
    grids: Vec<Grid>,
    scale: Scale,
    /// Elements by tile, a tile being as large as the largest of them.
    tiles: HashMap<(i64, i64), Vec<u32>>,
    tile: i64,
}

impl Sites {
    /// The sites of elements as designs have them.
    pub(crate) fn new(sites: &[ElementSite], scale: Scale) -> Self {
        Self::fitted(sites, &[], scale)
    }

    /// The sites of elements that were found so; those beyond the last of `fits` are where they say.
    pub(crate) fn fitted(sites: &[ElementSite], fits: &[PlaceFit], scale: Scale) -> Self {
        let fit = |k: usize| fits.get(k).copied().unwrap_or_default();
        let grids: Vec<Grid> = (sites.iter().enumerate().map(|(k, s)| Grid::new(s, fit(k), scale))).collect();
        let widths = grids.iter().flat_map(|g| g.extent().map(|[_, width]| width));
        let tile = widths.max().unwrap_or(1).max(1);
        let mut tiles: HashMap<(i64, i64), Vec<u32>> = HashMap::new();
        for (k, g) in grids.iter().enumerate() {
            let extent = g.extent();
            let from = [0, 1].map(|axis| (extent[axis][0] - g.step[axis] as i64 / 2).div_euclid(tile));
            let to = extent.map(|[first, width]| (first + width).div_euclid(tile));
            for y in from[1]..=to[1] {
                for x in from[0]..=to[0] {
                    tiles.entry((x, y)).or_default().push(k as u32);
                }
            }
        }
        Self {
            grids,
            scale,
            tiles,
            tile,
        }
    }

    /// Width (database units) of the square about a site whose corners were rounded to those of a rectangle: the middle of what is
    /// possible. None if a corner is farther from every such square than rounding moves it.
    pub(crate) fn width_about(&self, pillar: &Rect, [element, row, column]: [usize; 3]) -> Option<f64> {
        let grid = &self.grids[element];
        let per_unit = (PLACES_PER_NM * self.scale.num) as f64;
        let corner = CORNER_STEPS * self.scale.step_of(pillar) + grid.rounding / per_unit;
        let (mut least, mut most) = (0.0f64, f64::INFINITY);
        let edges = [(pillar.x0, pillar.x1, column), (pillar.y0, pillar.y1, row)];
        for (axis, (from, to, site)) in edges.into_iter().enumerate() {
            let place = grid.first[axis] as f64 + site as f64 * grid.step[axis];
            let off = (from + to) as f64 / 2.0 - place / per_unit;
            let either = 2.0 * (corner - off.abs());
            least = least.max((to - from) as f64 - either);
            most = most.min((to - from) as f64 + either);
        }
        (least <= most).then_some(0.5 * (least + most))
    }

    /// Pitch of an element (nm).
    #[inline]
    pub(crate) fn pitch_nm(&self, element: u32) -> i64 {
        self.grids[element as usize].pitch_nm
    }

    /// Place of a pillar on the sites. `guess` is the element to try first, and is set to the one found.
    #[inline]
    pub(crate) fn stand(&self, pillar: &Rect, guess: &mut u32) -> SitePlace {
        let half = PITCHES_PER_NM * self.scale.num;
        let x = (pillar.x0 + pillar.x1) * half;
        let y = (pillar.y0 + pillar.y1) * half;
        // Half a database unit. Asked for only where a pillar is off its site: this is the innermost loop of reading.
        let slack = || [pillar.x1 - pillar.x0, pillar.y1 - pillar.y0].map(|edge| (edge % 2 * half) as f64);
        let first = self.try_element(*guess, x, y, slack);
        if let Some(standing @ SitePlace::Site(..)) = first {
            return standing;
        }
        // Lattices of two elements may reach over one another: a place between the sites of one may be a site of the other.
        let mut between = first;
        let tile = (x.div_euclid(self.tile), y.div_euclid(self.tile));
        for &element in self.tiles.get(&tile).map_or(&[][..], Vec::as_slice) {
            match self.try_element(element, x, y, slack) {
                Some(standing @ SitePlace::Site(..)) => {
                    *guess = element;
                    return standing;
                }
                other => between = between.or(other),
            }
        }
        between.unwrap_or(SitePlace::Outside)
    }

    #[inline]
    fn try_element(&self, element: u32, x: i64, y: i64, slack: impl Fn() -> [f64; 2]) -> Option<SitePlace> {
        let grid = self.grids.get(element as usize)?;
        let (column, dx) = grid.nearest(0, x);
        let (row, dy) = grid.nearest(1, y);
        if !grid.holds(0, column) || !grid.holds(1, row) {
            return None;
        }
        let is_site = !grid.staggered || (column + row) % 2 == 0;
        let is_near = |slack: [f64; 2]| dx.abs() <= slack[0] + grid.rounding && dy.abs() <= slack[1] + grid.rounding;
        Some(if is_site && (is_near([0.0; 2]) || is_near(slack())) {
            SitePlace::Site(element, row as usize, column as usize)
        } else {
            SitePlace::Between(element)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_pillars::{Lattice, LatticeKind};

    fn square(x: i64, y: i64, w: i64) -> Rect {
        Rect {
            x0: x - w / 2,
            y0: y - w / 2,
            x1: x - w / 2 + w,
            y1: y - w / 2 + w,
        }
    }

    #[test]
    fn sites_of_two_elements() {
        let lattice = Lattice::new(350, 4).unwrap();
        let site = |x| ElementSite {
            name: String::new(),
            centre_nm: [x, 0],
            lattice,
            within_nm: None,
        };
        let sites = Sites::new(&[site(0), site(10_000)], Scale { num: 1, den: 1 });
        let mut guess = 0;
        assert_eq!(
            sites.stand(&square(175, -525, 100), &mut guess),
            SitePlace::Site(0, 0, 2)
        );
        assert_eq!(
            sites.stand(&square(10_525, 175, 100), &mut guess),
            SitePlace::Site(1, 2, 3)
        );
        assert_eq!(guess, 1);
        assert_eq!(sites.stand(&square(176, 175, 100), &mut guess), SitePlace::Between(0));
        assert_eq!(sites.stand(&square(5_000, 175, 100), &mut guess), SitePlace::Outside);
        // An edge of odd length is half a unit off along its own axis alone.
        let odd = |dx: i64, dy: i64| Rect {
            x1: 225 + dx,
            y1: 225 + dy,
            ..square(175, 175, 100)
        };
        assert_eq!(sites.stand(&odd(1, 0), &mut guess), SitePlace::Site(0, 2, 2));
        assert_eq!(sites.stand(&odd(0, 1), &mut guess), SitePlace::Site(0, 2, 2));
        assert_eq!(sites.stand(&odd(2, 1), &mut guess), SitePlace::Between(0));
        // 101 nm about a whole centre cannot be nearer than half a unit.
        assert_eq!(
            sites.stand(&square(175, 175, 101), &mut guess),
            SitePlace::Site(0, 2, 2)
        );
    }

    /// Two strips one above the other, nearer than their lattices are wide and in step with one another: each pillar is of the strip
    /// that it is in, whichever was met before.
    #[test]
    fn sites_of_elements_whose_lattices_overlap() {
        let strip = |y| ElementSite {
            name: String::new(),
            centre_nm: [0, y],
            lattice: Lattice::new(400, 100).unwrap(),
            within_nm: Some([[-19_800, 19_800], [-3_800, 3_800]]),
        };
        let sites = Sites::new(&[strip(0), strip(8_000)], Scale { num: 1, den: 1 });
        for before in [0, 1] {
            let stand = |y| {
                let mut guess = before;
                sites.stand(&square(200, y, 100), &mut guess)
            };
            assert_eq!(stand(3_800), SitePlace::Site(0, 59, 50));
            assert_eq!(stand(4_200), SitePlace::Site(1, 40, 50));
            assert_eq!(stand(-4_200), SitePlace::Outside);
            assert_eq!(stand(11_800), SitePlace::Site(1, 59, 50));
        }
    }

    /// Every other place of the grid of a hexagonal lattice, and rows no farther than columns.
    #[test]
    fn sites_of_a_hexagonal_lattice() {
        let lattice = Lattice::of_kind(LatticeKind::Hexagonal, 400, 9).unwrap();
        let site = ElementSite {
            name: String::new(),
            centre_nm: [1000, 0],
            lattice,
            within_nm: None,
        };
        let sites = Sites::new(&[site], Scale { num: 1, den: 1 });
        let mut guess = 0;
        let mut stand = |x, y| sites.stand(&square(x, y, 100), &mut guess);
        assert_eq!(stand(1000, 0), SitePlace::Site(0, 4, 4));
        assert_eq!(stand(1400, 0), SitePlace::Site(0, 4, 6));
        assert_eq!(stand(1200, 346), SitePlace::Site(0, 5, 5));
        assert_eq!(stand(1000, -692), SitePlace::Site(0, 2, 4));
        assert_eq!(stand(1200, 0), SitePlace::Between(0));
        assert_eq!(stand(1200, 347), SitePlace::Between(0));
        // Three rows above the middle is beyond a square about it.
        assert_eq!(stand(1200, 1038), SitePlace::Outside);
    }

    /// A database unit of 0.5 nm and one of 5 nm see the same sites.
    #[test]
    fn other_units() {
        let site = ElementSite {
            name: String::new(),
            centre_nm: [0, 0],
            lattice: Lattice::new(350, 4).unwrap(),
            within_nm: None,
        };
        let mut guess = 0;
        let fine = Sites::new(std::slice::from_ref(&site), Scale { num: 1, den: 2 });
        assert_eq!(fine.stand(&square(350, 350, 200), &mut guess), SitePlace::Site(0, 2, 2));
        let coarse = Sites::new(&[site], Scale { num: 5, den: 1 });
        assert_eq!(coarse.stand(&square(35, 35, 20), &mut guess), SitePlace::Site(0, 2, 2));
        assert_eq!(coarse.stand(&square(36, 35, 20), &mut guess), SitePlace::Between(0));
    }
}
