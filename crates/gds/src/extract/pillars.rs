//! The visitor that fills the width maps.

use super::oddity::{Oddities, Oddity, Why};
use super::plan::{ExtractedElement, Extraction, ExtractionPlan};
use super::sites::{Scale, Sites, Standing};
use super::survey::Surveyor;
use crate::{LayerNumber, LayoutCell, Point, Rect, Shape, Text, Transform, Visitor, rectangle_of, simplified};
use metalith_core::ElementSite;
use metalith_core::WidthMap;

/// Puts squares on the sites of elements.
pub struct Filler {
    scale: Scale,
    sites: Sites,
    pub elements: Vec<ExtractedElement>,
    /// Element that each placement of the current cell met last.
    guesses: Vec<u32>,
    pub pillars: u64,
}

impl Filler {
    pub fn new(sites: Vec<ElementSite>, scale: Scale) -> Self {
        let index = Sites::new(&sites, scale);
        let empty = |site: ElementSite| ExtractedElement {
            widths: WidthMap::empty(site.lattice),
            site,
        };
        Self {
            scale,
            sites: index,
            elements: sites.into_iter().map(empty).collect(),
            guesses: Vec::new(),
            pillars: 0,
        }
    }

    /// A cell with so many placements begins.
    pub fn begin(&mut self, placements: usize) {
        self.guesses.clear();
        self.guesses.resize(placements, 0);
    }

    /// Put an upright rectangle of the layout on its site if `takes` its width in database units, and say
    /// whether it was taken, or why it has no site.
    #[inline]
    pub fn put(&mut self, r: &Rect, placement: usize, takes: impl Fn(i64) -> bool) -> Result<bool, Why> {
        if !self.scale.reaches(r) {
            return Err(Why::OutsideElements);
        }
        if r.width() != r.height() {
            return Err(Why::NotSquare);
        }
        let width_nm = self.scale.whole_nm(r.width()).ok_or(Why::OddShape)?;
        let (element, row, column) = match self.sites.stand(r, &mut self.guesses[placement]) {
            Standing::Site(element, row, column) => (element, row, column),
            Standing::Between(element) if width_nm > self.sites.pitch_nm(element) => return Err(Why::TooWide),
            Standing::Between(_) => return Err(Why::OffLattice),
            Standing::Outside => return Err(Why::OutsideElements),
        };
        if width_nm > self.sites.pitch_nm(element) || width_nm > i64::from(u16::MAX) {
            return Err(Why::TooWide);
        }
        if !takes(r.width()) {
            return Ok(false);
        }
        let place = &mut self.elements[element as usize].widths.width_nm[[row, column]];
        if *place != 0 {
            return Err(Why::DuplicateSite);
        }
        *place = width_nm as u16;
        self.pillars += 1;
        Ok(true)
    }
}

impl Filler {
    /// Of a square and the one that is on its site already, leave the wider there; the other, as a
    /// rectangle about the same site. Both have even widths.
    pub fn keep_wider(&mut self, r: &Rect, placement: usize) -> Rect {
        let Standing::Site(element, row, column) = self.sites.stand(r, &mut self.guesses[placement]) else {
            return *r;
        };
        let Some(width_nm) = self.scale.whole_nm(r.width()) else {
            return *r;
        };
        let place = &mut self.elements[element as usize].widths.width_nm[[row, column]];
        let there = i64::from(*place);
        if width_nm <= there {
            return *r;
        }
        *place = width_nm as u16;
        let less = r.width() - there * r.width() / width_nm;
        Rect {
            x0: r.x0 + less / 2,
            y0: r.y0 + less / 2,
            x1: r.x1 - less / 2,
            y1: r.y1 - less / 2,
        }
    }
}

/// Fills width maps from the shapes of a layout, and lists what is no pillar.
pub(super) struct PillarCollector {
    layer: LayerNumber,
    listed: usize,
    scale: Scale,
    filler: Filler,
    oddities: Oddities,
    surveyor: Surveyor,
}

impl PillarCollector {
    pub fn new(plan: &ExtractionPlan, sites: Vec<ElementSite>, scale: Scale) -> Self {
        Self {
            layer: plan.pillar_layer,
            listed: plan.listed,
            scale,
            filler: Filler::new(sites, scale),
            oddities: Oddities::default(),
            surveyor: Surveyor::default(),
        }
    }

    pub fn finish(self, top: String) -> Extraction {
        Extraction {
            top,
            elements: self.filler.elements,
            pillars: self.filler.pillars,
            oddities: self.oddities,
            survey: self.surveyor.finish(self.scale),
        }
    }

    /// An upright rectangle of the layout.
    #[inline]
    fn rectangle(&mut self, r: &Rect, placement: usize, offset: u64) {
        if let Err(why) = self.filler.put(r, placement, |_| true) {
            self.odd(why, r, offset);
        }
    }

    #[cold]
    fn odd(&mut self, why: Why, r: &Rect, offset: u64) {
        let nm = |v: i64| self.scale.nm(v as f64);
        let oddity = Oddity {
            why,
            centre_nm: [nm(r.x0 + r.x1) / 2.0, nm(r.y0 + r.y1) / 2.0],
            size_nm: [nm(r.width()), nm(r.height())],
            offset,
        };
        self.oddities.add(oddity, self.listed);
    }

    /// An outline that is no rectangle as it stands: it may be one with more vertices than it needs, or
    /// become one where it is placed.
    #[cold]
    fn polygon(&mut self, shape: &Shape<'_>, placements: &[Transform]) {
        for (k, placement) in placements.iter().enumerate() {
            let placed: Vec<Point> = shape.points.iter().map(|&p| placement.apply(p)).collect();
            match rectangle_of(&simplified(&placed)) {
                Some(r) => self.rectangle(&r, k, shape.offset),
                None => self.odd(Why::OddShape, &Rect::around(&placed), shape.offset),
            }
        }
    }
}

impl Visitor for PillarCollector {
    fn cell(&mut self, _cell: &LayoutCell, placements: &[Transform]) -> metalith_core::Result<()> {
        self.surveyor.begin(placements);
        self.filler.begin(placements.len());
        Ok(())
    }

    #[inline]
    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> metalith_core::Result<()> {
        self.surveyor.shape(shape, placements);
        if shape.layer != self.layer {
            return Ok(());
        }
        match &shape.rect {
            Some(rect) if placements.iter().all(Transform::is_square) => {
                for (k, placement) in placements.iter().enumerate() {
                    let placed = placement.apply_rect(rect).unwrap_or(*rect);
                    self.rectangle(&placed, k, shape.offset);
                }
            }
            _ => self.polygon(shape, placements),
        }
        Ok(())
    }

    fn text(&mut self, text: &Text<'_>, placements: &[Transform]) -> metalith_core::Result<()> {
        self.surveyor.text(text, placements, self.scale, self.listed);
        Ok(())
    }
}
