//! A layout as rules see it, with all references followed.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::body::Body;
use super::work::Work;
use metalith_design::Design;
use metalith_design::array::PillarArray;
use metalith_gds::extract::{ExtractedElement, StoredPillars};
use metalith_gds::{LayerNumber, Layout, Point, Rect};
use metalith_pillars::{OutlineForm, PillarId, PillarRows, PillarShape};

/// Everything on one layer that is not a pillar on the lattice of an element.
#[derive(Default)]
pub(super) struct LooseShapes {
    /// Upright rectangles: left, bottom, right, top (database units).
    pub rects: Vec<[i32; 4]>,
    /// Other closed outlines, without corners that are none.
    pub polygons: Vec<Box<[Point]>>,
}

impl LooseShapes {
    /// Shapes.
    pub(crate) fn len(&self) -> u64 {
        (self.rects.len() + self.polygons.len()) as u64
    }

    pub(crate) fn rect(&self, k: usize) -> Rect {
        let [x0, y0, x1, y1] = self.rects[k].map(i64::from);
        Rect { x0, y0, x1, y1 }
    }

    /// One shape, rectangles first.
    pub(crate) fn body(&self, k: usize) -> Body<'_> {
        match self.rects.len() {
            n if k < n => Body::Rect(self.rect(k)),
            n => Body::Ring(&self.polygons[k - n]),
        }
    }

    /// All shapes, rectangles first.
    pub(crate) fn bodies(&self) -> impl Iterator<Item = Body<'_>> {
        (0..self.rects.len() + self.polygons.len()).map(|k| self.body(k))
    }

    /// Bounding boxes of all, rectangles first.
    pub(crate) fn bounds(&self) -> impl Iterator<Item = Rect> + '_ {
        (0..self.rects.len())
            .map(|k| self.rect(k))
            .chain(self.polygons.iter().map(|p| Rect::around(p)))
    }
}

/// One text.
pub(super) struct PlacedText {
    pub layer: LayerNumber,
    /// One for all copies of a text.
    pub string: Arc<str>,
    pub at: Point,
}

/// The flattened layout that rules check.
pub(super) struct FlatLayout<'a> {
    /// Remaining work budget of the rules.
    pub work: &'a Work<'a>,
    pub layout: &'a Layout,
    pub with: Vec<&'a Layout>,
    pub design: Option<&'a Design>,
    /// The pillars of the design.
    pub array: Option<&'a PillarArray>,
    pub unit_nm: f64,
    pub pillars: LayerNumber,
    /// Shape of the pillars.
    pub shape: PillarShape,
    /// Elements with the pillars on their lattices.
    pub elements: Vec<ExtractedElement<StoredPillars>>,
    /// Largest distance of a pillar from its site along an axis (nm); zero where places are exact.
    pub slack_nm: f64,
    /// Reason why there are no elements, if there are none.
    pub no_elements: String,
    pub loose: BTreeMap<LayerNumber, LooseShapes>,
    /// Squares inside an element that are not on its sites.
    pub off_lattice: Vec<Rect>,
    /// Squares of odd width on a site: kept with the loose ones, because their edges are not symmetric.
    pub odd_on_lattice: u64,
    pub texts: Vec<PlacedText>,
    /// Areas by layer, references followed.
    pub counts: BTreeMap<LayerNumber, u64>,
    /// Reason why the layout was not read to its end, if it was not.
    pub unread: Option<String>,
    /// Reason why not all geometry is here, if it is not.
    pub incomplete: Option<String>,
}

impl FlatLayout<'_> {
    /// A length in database units.
    pub(crate) fn units(&self, nm: f64) -> f64 {
        nm / self.unit_nm
    }

    /// The pillar at a site, in database units.
    pub(crate) fn body(&self, element: usize, row: usize, column: usize) -> Body<'static> {
        let around = self.pillar(element, row, column);
        let number = self.elements[element].widths.number(column, row);
        match self.shape.of_pillar(PillarId(number)).0.outline() {
            OutlineForm::Square => Body::Rect(around),
            OutlineForm::Circle => Body::Disc(around),
            OutlineForm::Polygon | OutlineForm::Mixed => {
                let (e, unit) = (&self.elements[element], |nm: f64| self.units(nm).round() as i64);
                let x = e.site.centre_nm[0] as f64 + e.site.lattice.drawn_nm(0, column);
                let y = e.site.centre_nm[1] as f64 + e.site.lattice.drawn_nm(1, row);
                let corner = |(dx, dy): (i64, i64)| Point::new(unit(x + dx as f64), unit(y + dy as f64));
                let corners = self.shape.four_corners(PillarId(e.widths.number(column, row)));
                let [a, b, c, d] = corners
                    .expect("pillars that are polygons have four corners")
                    .map(corner);
                Body::Tilted([a, b, c, d, a])
            }
        }
    }

    /// Half of what the pillar with a width or number takes along x and y (nm).
    pub(crate) fn half_nm(&self, number: u16) -> [f64; 2] {
        self.shape.half_nm(PillarId(number))
    }

    /// The box around the pillar at a site, in database units.
    pub(crate) fn pillar(&self, element: usize, row: usize, column: usize) -> Rect {
        let e = &self.elements[element];
        let [half_x, half_y] = self.half_nm(e.widths.number(column, row));
        let x = e.site.centre_nm[0] as f64 + e.site.lattice.drawn_nm(0, column);
        let y = e.site.centre_nm[1] as f64 + e.site.lattice.drawn_nm(1, row);
        let unit = |nm: f64| self.units(nm).round() as i64;
        Rect {
            x0: unit(x - half_x),
            y0: unit(y - half_y),
            x1: unit(x + half_x),
            y1: unit(y + half_y),
        }
    }

    /// Pillars on lattices.
    pub(crate) fn pillars_on_lattices(&self) -> u64 {
        self.elements.iter().map(|e| e.widths.pillars()).sum::<u64>() + self.odd_on_lattice
    }

    pub(crate) fn loose(&self, layer: LayerNumber) -> Option<&LooseShapes> {
        self.loose.get(&layer)
    }
}
