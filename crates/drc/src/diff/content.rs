//! What a layout holds, in an order that does not depend on how it is nested.

use std::collections::BTreeMap;

use metalith_core::Progress;
use metalith_core::{Error, Result};
use metalith_gds::extract::{ElementSite, ExtractedElement, Filler, Scale, Why};
use metalith_gds::{
    Cell, LayerNumber, Layout, Point, Rect, Selection, Shape, Text, Transform, Visitor, rectangle_of, simplified,
};

/// Vertices of outlines and rectangles that are held: 57.7 million squares off every lattice, and a fifth more.
const MOST: usize = 70_000_000;

/// Corners of an outline, in order, not closed.
pub(super) type Ring = Box<[Point]>;

/// Everything on one layer but pillars on lattices, in the common unit, sorted.
#[derive(Default)]
pub(super) struct Outlines {
    pub rects: Vec<[i32; 4]>,
    /// Rings from their smallest corner, counter-clockwise, not closed.
    pub rings: Vec<Ring>,
}

/// One layout.
pub(super) struct Content {
    pub elements: Vec<ExtractedElement>,
    pub outlines: BTreeMap<LayerNumber, Outlines>,
    pub counts: BTreeMap<LayerNumber, u64>,
    /// Layer, string and place in the common unit, sorted.
    pub texts: Vec<(LayerNumber, String, Point)>,
}

impl Content {
    /// Read a layout; its coordinates times `factor` are in the common unit.
    pub fn read(
        layout: &Layout,
        factor: i64,
        sites: &[ElementSite],
        pillars: LayerNumber,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let mut reader = ContentReader {
            pillars,
            factor,
            filler: Filler::new(sites.to_vec(), Scale::of(layout)?),
            outlines: BTreeMap::new(),
            held: 0,
            pillar_shapes: 0,
            counts: BTreeMap::new(),
            texts: Vec::new(),
        };
        layout.visit(&Selection::default(), &mut reader, progress)?;
        for outlines in reader.outlines.values_mut() {
            outlines.rects.sort_unstable();
            outlines.rings.sort_unstable();
        }
        reader.texts.sort_unstable();
        if reader.pillar_shapes > 0 {
            *reader.counts.entry(pillars).or_default() += reader.pillar_shapes;
        }
        Ok(Self {
            elements: reader.filler.elements,
            outlines: reader.outlines,
            counts: reader.counts,
            texts: reader.texts,
        })
    }
}

struct ContentReader {
    pillars: LayerNumber,
    factor: i64,
    filler: Filler,
    outlines: BTreeMap<LayerNumber, Outlines>,
    held: usize,
    pillar_shapes: u64,
    counts: BTreeMap<LayerNumber, u64>,
    texts: Vec<(LayerNumber, String, Point)>,
}

impl ContentReader {
    /// A rectangle of the pillar layer. Of two squares on one site the wider counts, in whatever order
    /// they come; odd widths are off the site by half a unit and are kept as they stand.
    #[inline]
    fn pillar(&mut self, r: &Rect, placement: usize) -> Result<()> {
        match self.filler.put(r, placement, |width| width % 2 == 0) {
            Ok(true) => Ok(()),
            Err(Why::DuplicateSite) => {
                let rest = self.filler.keep_wider(r, placement);
                self.rect(self.pillars, &rest)
            }
            _ => self.rect(self.pillars, r),
        }
    }

    fn room(&mut self, count: usize) -> Result<()> {
        self.held += count;
        if self.held > MOST {
            return Err(Error::invalid(
                format!("more than {MOST} rectangles and vertices off every lattice"),
                "compare the layouts in parts",
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

    fn outline(&mut self, layer: LayerNumber, placed: &[Point], placement: usize) -> Result<()> {
        let corners = simplified(placed);
        match rectangle_of(&corners) {
            Some(r) if layer == self.pillars => return self.pillar(&r, placement),
            Some(r) => return self.rect(layer, &r),
            None => {}
        }
        let mut ring: Vec<Point> = corners
            .iter()
            .map(|p| Point::new(p.x.saturating_mul(self.factor), p.y.saturating_mul(self.factor)))
            .collect();
        ring.pop();
        if area2(&ring) < 0 {
            ring.reverse();
        }
        let start = (0..ring.len()).min_by_key(|&k| ring[k]).unwrap_or(0);
        ring.rotate_left(start);
        self.room(ring.len())?;
        self.outlines.entry(layer).or_default().rings.push(ring.into());
        Ok(())
    }
}

/// Twice the area of a ring, positive if counter-clockwise.
pub(super) fn area2(ring: &[Point]) -> i128 {
    let next = |k: usize| ring[(k + 1) % ring.len()];
    let part = |(k, p): (usize, &Point)| {
        let q = next(k);
        i128::from(p.x) * i128::from(q.y) - i128::from(q.x) * i128::from(p.y)
    };
    ring.iter().enumerate().map(part).sum()
}

impl Visitor for ContentReader {
    fn cell(&mut self, _cell: &Cell, placements: &[Transform]) -> Result<()> {
        self.filler.begin(placements.len());
        Ok(())
    }

    #[inline]
    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> Result<()> {
        let square = placements.iter().all(Transform::is_square);
        match &shape.rect {
            Some(rect) if square && shape.layer == self.pillars => {
                self.pillar_shapes += placements.len() as u64;
                for (k, placement) in placements.iter().enumerate() {
                    let placed = placement.apply_rect(rect).unwrap_or(*rect);
                    self.pillar(&placed, k)?;
                }
            }
            _ => {
                *self.counts.entry(shape.layer).or_default() += placements.len() as u64;
                for (k, placement) in placements.iter().enumerate() {
                    let placed: Vec<Point> = shape.points.iter().map(|&p| placement.apply(p)).collect();
                    self.outline(shape.layer, &placed, k)?;
                }
            }
        }
        Ok(())
    }

    fn text(&mut self, text: &Text<'_>, placements: &[Transform]) -> Result<()> {
        for placement in placements {
            self.room(1)?;
            let at = placement.apply(text.at);
            let at = Point::new(at.x.saturating_mul(self.factor), at.y.saturating_mul(self.factor));
            let string = String::from_utf8_lossy(text.string).into_owned();
            self.texts.push((text.layer, string, at));
        }
        Ok(())
    }
}
