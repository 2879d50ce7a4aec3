//! The visitor that fills the width maps.

use super::oddity::{Oddities, Oddity, Why};
use super::plan::{ExtractedElement, ExtractionPlan};
use super::sites::{Scale, Sites, Standing};
use super::survey::{Survey, Surveyor};
use crate::error::Result;
use crate::gds::{Cell, LayerNumber, Point, Rect, Shape, Text, Transform, Visitor, rectangle_of, simplified};

/// Fills width maps from the shapes of a layout.
pub(super) struct Pillars<'a> {
    layer: LayerNumber,
    listed: usize,
    scale: Scale,
    sites: Sites,
    elements: &'a mut [ExtractedElement],
    /// Element that each placement of the current cell met last.
    guesses: Vec<u32>,
    oddities: Oddities,
    surveyor: Surveyor,
    pillars: u64,
}

impl<'a> Pillars<'a> {
    pub fn new(plan: &ExtractionPlan, scale: Scale, sites: Sites, elements: &'a mut [ExtractedElement]) -> Self {
        Self {
            layer: plan.pillar_layer,
            listed: plan.listed,
            scale,
            sites,
            elements,
            guesses: Vec::new(),
            oddities: Oddities::default(),
            surveyor: Surveyor::default(),
            pillars: 0,
        }
    }

    pub fn finish(self) -> (Oddities, Survey, u64) {
        (self.oddities, self.surveyor.finish(self.scale), self.pillars)
    }

    /// An upright rectangle of the layout.
    #[inline]
    fn rectangle(&mut self, r: &Rect, placement: usize, offset: u64) {
        if let Err(why) = self.pillar(r, placement) {
            self.odd(why, r, offset);
        }
    }

    #[inline]
    fn pillar(&mut self, r: &Rect, placement: usize) -> Result<(), Why> {
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
        let place = &mut self.elements[element as usize].widths.width_nm[[row, column]];
        if *place != 0 {
            return Err(Why::DuplicateSite);
        }
        *place = width_nm as u16;
        self.pillars += 1;
        Ok(())
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

impl Visitor for Pillars<'_> {
    fn cell(&mut self, _cell: &Cell, placements: &[Transform]) -> Result<()> {
        self.surveyor.begin(placements);
        self.guesses.clear();
        self.guesses.resize(placements.len(), 0);
        Ok(())
    }

    #[inline]
    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> Result<()> {
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

    fn text(&mut self, text: &Text<'_>, placements: &[Transform]) -> Result<()> {
        self.surveyor.text(text, placements, self.scale, self.listed);
        Ok(())
    }
}
