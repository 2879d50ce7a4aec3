//! Content of a layout, in an order that does not depend on its hierarchy.

use std::collections::{BTreeMap, HashMap};

use super::super::polygon::twice_area;
use super::super::work::Allowance;
use metalith_core::{Error, Progress, Result};
use metalith_gds::extract::{ElementSite, ExtractedElement, Filler, Scale, StoredPillars, Why};
use metalith_gds::{
    DrawnPillar, LayerNumber, Layout, LayoutCell, PillarFinder, Point, Rect, Shape, Text, Transform, Visitor,
    drawn_corners, rectangle_of, simplified,
};
use metalith_pillars::{OutlineForm, PillarShape};

/// Vertices that may be placed for each that may be held: most corners of rectangles are not.
const PLACED: u64 = 8;

/// Corners of an outline, in order, not closed.
pub(super) type Ring = Box<[Point]>;

/// Everything on one layer but pillars on lattices, in the common unit, sorted.
#[derive(Default)]
pub(super) struct Outlines {
    pub rects: Vec<[i32; 4]>,
    /// Rings from their smallest corner, counter-clockwise, not closed.
    pub rings: Vec<Ring>,
}

/// Pillars that are looked for: what is a pillar, and where.
#[derive(Clone, Copy)]
pub(super) struct WantedPillars<'a> {
    pub layer: LayerNumber,
    pub shape: PillarShape,
    pub sites: &'a [ElementSite],
}

/// One layout.
pub(super) struct Content {
    /// Shape of the pillars.
    pub shape: PillarShape,
    pub elements: Vec<ExtractedElement<StoredPillars>>,
    pub outlines: BTreeMap<LayerNumber, Outlines>,
    pub counts: BTreeMap<LayerNumber, u64>,
    /// Sorted.
    pub texts: Vec<TextCopy>,
}

/// One copy of a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct TextCopy {
    pub layer: LayerNumber,
    /// String, by its number in [`Strings`].
    pub string: u32,
    /// Place in the common unit.
    pub at: Point,
}

/// The strings of both layouts, each stored once.
#[derive(Default)]
pub(super) struct Strings(HashMap<Box<[u8]>, u32>);

impl Strings {
    fn number(&mut self, string: &[u8]) -> u32 {
        if let Some(&number) = self.0.get(string) {
            return number;
        }
        let number = self.0.len() as u32;
        self.0.insert(string.into(), number);
        number
    }

    /// The strings in order, the texts of all layouts numbered and sorted by it.
    pub(crate) fn sorted<'c>(self, contents: impl Iterator<Item = &'c mut Content>) -> Vec<Box<[u8]>> {
        let mut strings: Vec<(Box<[u8]>, u32)> = self.0.into_iter().collect();
        strings.sort_unstable();
        let mut place = vec![0; strings.len()];
        for (new, (_, old)) in strings.iter().enumerate() {
            place[*old as usize] = new as u32;
        }
        for content in contents {
            content
                .texts
                .iter_mut()
                .for_each(|t| t.string = place[t.string as usize]);
            content.texts.sort_unstable();
        }
        strings.into_iter().map(|(string, _)| string).collect()
    }
}

impl Content {
    /// Read a layout; its coordinates times `factor` are in the common unit. Memory is spared where its elements are mostly like
    /// others.
    pub(crate) fn read(
        layout: &Layout,
        factor: i64,
        wanted: WantedPillars<'_>,
        strings: &mut Strings,
        like: &mut [ExtractedElement<StoredPillars>],
        progress: &dyn Progress,
    ) -> Result<Self> {
        let allowance = Allowance::of([layout]);
        let pillars = wanted.layer;
        let mut reader = ContentReader {
            pillars,
            shape: wanted.shape,
            finder: PillarFinder::new(wanted.shape, layout.unit_nm()),
            factor,
            unit_nm: layout.unit_nm(),
            filler: Filler::new(wanted.sites.to_vec(), Scale::of(layout)?).like(like),
            outlines: BTreeMap::new(),
            held: 0,
            most: allowance.rects,
            strings,
            moved: 0,
            pillar_shapes: 0,
            counts: BTreeMap::new(),
            texts: Vec::new(),
        };
        layout.visit(&super::everything(), &mut reader, progress)?;
        for outlines in reader.outlines.values_mut() {
            outlines.rects.sort_unstable();
            outlines.rings.sort_unstable();
        }
        if reader.pillar_shapes > 0 {
            *reader.counts.entry(pillars).or_default() += reader.pillar_shapes;
        }
        let elements = reader.filler.finish().map_err(|cause| {
            let what = format!("{}: {cause}", layout.path().display());
            Error::refused("diff/unreadable", what, cause.remedy())
        })?;
        Ok(Self {
            shape: wanted.shape,
            elements,
            outlines: reader.outlines,
            counts: reader.counts,
            texts: reader.texts,
        })
    }
}

struct ContentReader<'s> {
    pillars: LayerNumber,
    shape: PillarShape,
    finder: PillarFinder,
    factor: i64,
    unit_nm: f64,
    filler: Filler,
    outlines: BTreeMap<LayerNumber, Outlines>,
    /// Rectangles, texts and vertices of other outlines, and how many may be held.
    held: u64,
    most: u64,
    strings: &'s mut Strings,
    moved: u64,
    pillar_shapes: u64,
    counts: BTreeMap<LayerNumber, u64>,
    texts: Vec<TextCopy>,
}

impl ContentReader<'_> {
    /// The box around a shape of the pillar layer that may be a pillar. Of two on one site the wider counts, in whatever
    /// order they come; odd widths are off the site by half a unit and are kept as they stand.
    #[inline]
    fn pillar(&mut self, r: &Rect, placement: usize, corners: impl FnOnce() -> Vec<Point>) -> Result<()> {
        match self.filler.put(r, placement, |width| width % 2 == 0) {
            Ok(true) => Ok(()),
            Err(Why::DuplicateSite) => {
                let rest = self.filler.keep_wider(r, placement);
                self.rect(self.pillars, &rest)
            }
            _ if self.shape.is_square() => self.rect(self.pillars, r),
            _ => self.ring(self.pillars, &simplified(&corners())),
        }
    }

    /// A rotated rectangle. Only one whose corners are those of its rotation, to the unit, is known by that alone; of two on one
    /// site the one of the larger number is.
    fn rotated(&mut self, pillar: &DrawnPillar, placement: usize, corners: impl FnOnce() -> Vec<Point>) -> Result<()> {
        let put = pillar.exact.then(|| self.filler.put_drawn(pillar, placement, |_| true));
        match put {
            Some(Ok(_)) => Ok(()),
            Some(Err(Why::DuplicateSite)) => {
                let other = self.filler.keep_larger_number(pillar, placement);
                let corners = self.corners(pillar, other);
                self.ring(self.pillars, &corners)
            }
            _ => self.ring(self.pillars, &simplified(&corners())),
        }
    }

    /// The corners of the pillar with a number that stands where this one does (database units), closed.
    fn corners(&self, pillar: &DrawnPillar, number: u16) -> Vec<Point> {
        let r = &pillar.around;
        let (x, y) = ((r.x0 + r.x1) / 2, (r.y0 + r.y1) / 2);
        let drawn = drawn_corners(self.shape, number, self.unit_nm);
        let closed = drawn.iter().chain(drawn.first());
        closed.map(|p| Point::new(x + p.x, y + p.y)).collect()
    }

    fn room(&mut self, count: usize) -> Result<()> {
        self.held += count as u64;
        if self.held > self.most {
            return Err(Error::refused(
                "diff/too-many-off-lattice",
                format!("more than {} rectangles and vertices off every lattice", self.most),
                "write the layouts with fewer copies, or compare their cells one by one",
            ));
        }
        Ok(())
    }

    /// Count vertices that are placed, whatever is kept of them.
    fn placed(&mut self, vertices: usize, copies: usize) -> Result<()> {
        self.moved = self
            .moved
            .saturating_add((vertices as u64).saturating_mul(copies as u64));
        if self.moved > PLACED * self.most {
            return Err(Error::refused(
                "diff/too-many-vertices",
                format!("more than {} vertices with all references followed", PLACED * self.most),
                "write the layouts with fewer copies, or compare their cells one by one",
            ));
        }
        Ok(())
    }

    fn rect(&mut self, layer: LayerNumber, r: &Rect) -> Result<()> {
        let corners = [r.x0, r.y0, r.x1, r.y1].map(|v| v.saturating_mul(self.factor));
        self.room(1)?;
        let outlines = self.outlines.entry(layer).or_default();
        if let [Ok(x0), Ok(y0), Ok(x1), Ok(y1)] = corners.map(i32::try_from) {
            outlines.rects.push([x0, y0, x1, y1]);
        } else {
            let [x0, y0, x1, y1] = corners;
            let p = Point::new;
            outlines
                .rings
                .push(Box::new([p(x0, y0), p(x1, y0), p(x1, y1), p(x0, y1)]));
        }
        Ok(())
    }

    /// A shape in one of its placements.
    fn outline(&mut self, shape: &Shape<'_>, placement: &Transform, k: usize) -> Result<()> {
        let placed = || shape.outline.placed(placement);
        if shape.layer == self.pillars
            && let Some(pillar) = self.finder.placed(shape, placement)
        {
            return match pillar.number {
                None => self.pillar(&pillar.around, k, placed),
                Some(_) => self.rotated(&pillar, k, placed),
            };
        }
        let corners = simplified(&placed());
        match rectangle_of(&corners) {
            Some(r) => self.rect(shape.layer, &r),
            None => self.ring(shape.layer, &corners),
        }
    }

    /// A closed outline that is kept as it is, without corners that are none.
    fn ring(&mut self, layer: LayerNumber, corners: &[Point]) -> Result<()> {
        let mut ring: Vec<Point> = corners
            .iter()
            .map(|p| Point::new(p.x.saturating_mul(self.factor), p.y.saturating_mul(self.factor)))
            .collect();
        ring.pop();
        if twice_area(&ring) < 0 {
            ring.reverse();
        }
        let start = (0..ring.len()).min_by_key(|&k| ring[k]).unwrap_or(0);
        ring.rotate_left(start);
        self.room(ring.len())?;
        self.outlines.entry(layer).or_default().rings.push(ring.into());
        Ok(())
    }
}

impl Visitor for ContentReader<'_> {
    fn cell(&mut self, _cell: &LayoutCell, placements: &[Transform]) -> Result<()> {
        self.filler.begin(placements);
        Ok(())
    }

    #[inline]
    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> Result<()> {
        let square = placements.iter().all(Transform::is_square);
        match shape.pillar(self.shape) {
            Some(rect) if square && shape.layer == self.pillars => {
                self.pillar_shapes += placements.len() as u64;
                if self.filler.put_orbits(rect, placements, |width| width % 2 == 0) {
                    return Ok(());
                }
                for (k, placement) in placements.iter().enumerate() {
                    let corners = || shape.outline.placed(placement);
                    match placement.apply_rect(rect) {
                        Some(placed) => self.pillar(&placed, k, corners)?,
                        None => self.pillar(rect, k, corners)?,
                    }
                }
            }
            _ => {
                let mut put = 0;
                if shape.layer == self.pillars {
                    self.pillar_shapes += placements.len() as u64;
                    if self.shape.outline() == OutlineForm::Polygon {
                        put = self.filler.put_copies(&mut self.finder, shape, placements);
                    }
                } else {
                    *self.counts.entry(shape.layer).or_default() += placements.len() as u64;
                }
                self.placed(shape.outline.len(), placements.len())?;
                for (k, placement) in placements.iter().enumerate().skip(put) {
                    self.outline(shape, placement, k)?;
                }
            }
        }
        Ok(())
    }

    fn text(&mut self, text: &Text<'_>, placements: &[Transform]) -> Result<()> {
        let string = self.strings.number(text.string);
        self.room(placements.len())?;
        for placement in placements {
            let at = placement.apply(text.at);
            let at = Point::new(at.x.saturating_mul(self.factor), at.y.saturating_mul(self.factor));
            self.texts.push(TextCopy {
                layer: text.layer,
                string,
                at,
            });
        }
        Ok(())
    }
}
