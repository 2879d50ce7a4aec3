//! The visitor that fills the width maps.

use super::discover::Discovered;
use super::filler::Filler;
use super::named_shapes::name_of;
use super::plan::{Elements, Extraction, ExtractionPlan, turned};
use super::sites::Scale;
use super::stored_pillars::StoredPillars;
use super::survey::Surveyor;
use super::unrecognised_shapes::{UnrecognisedShape, UnrecognisedShapes, Why};
use crate::{
    Error, ExtractionError, LayerNumber, LayoutCell, OutlineMemo, PillarFinder, Rect, Shape, Text, Transform, Visitor,
    pillar_of,
};
use metalith_pillars::PillarShape;
use std::path::{Path, PathBuf};

/// Fills width maps from the shapes of a layout, and lists what is no pillar.
pub(super) struct PillarCollector {
    /// The layout that is read, for errors.
    path: PathBuf,
    /// True for elements that a design gives.
    given: bool,
    layer: LayerNumber,
    shape: PillarShape,
    turned_deg: Option<f64>,
    listed: usize,
    scale: Scale,
    finder: PillarFinder,
    filler: Filler,
    oddities: UnrecognisedShapes,
    /// Memory of the names of outlines that are no pillars.
    names: OutlineMemo<Why>,
    surveyor: Surveyor,
}

impl PillarCollector {
    /// Holds sites of at most so many bytes.
    pub(crate) fn new(path: &Path, plan: &ExtractionPlan, found: Discovered, scale: Scale, most: u64) -> Self {
        let turned_deg = found.turned_deg();
        let Discovered { sites, shape, fits, .. } = found;
        Self {
            path: path.to_owned(),
            given: matches!(plan.elements, Elements::Given(_)),
            layer: plan.pillar_layer,
            shape,
            turned_deg,
            listed: plan.listed,
            scale,
            finder: PillarFinder::new(shape, scale.nm(1.0)),
            filler: Filler::new(sites, scale).fitted(&fits).holding(most).tolerant(),
            oddities: UnrecognisedShapes::default(),
            names: OutlineMemo::default(),
            surveyor: Surveyor::turned(turned_deg),
        }
    }

    pub(crate) fn finish(self, top: String) -> Result<Extraction<StoredPillars>, ExtractionError> {
        Ok(Extraction {
            top,
            shape: self.shape,
            pillars: self.filler.pillars(),
            elements: self.filler.finish()?,
            turned_deg: self.turned_deg,
            oddities: self.oddities,
            survey: self.surveyor.finish(self.scale),
        })
    }

    /// The square around a shape that may be a pillar.
    #[inline]
    fn candidate(&mut self, r: &Rect, placement: usize, offset: u64) -> metalith_core::Result<()> {
        match self.filler.put(r, placement, |_| true) {
            Ok(_) => Ok(()),
            Err(why) => self.odd(why, r, offset),
        }
    }

    #[cold]
    fn odd(&mut self, why: Why, r: &Rect, offset: u64) -> metalith_core::Result<()> {
        let nm = |v: i64| self.scale.nm(v as f64);
        let oddity = UnrecognisedShape {
            why,
            centre_nm: turned([nm(r.x0 + r.x1) / 2.0, nm(r.y0 + r.y1) / 2.0], self.turned_deg),
            size_nm: [nm(r.width()), nm(r.height())],
            offset,
        };
        let in_element = self.filler.may_be_of_element(r);
        self.oddities.add(oddity, in_element, self.listed);
        if self.given
            && let Err(cause) = self.filler.check_of_design(self.oddities.by_why)
        {
            let path = self.path.clone();
            return Err(Error::Extraction { path, cause }.into());
        }
        Ok(())
    }

    /// An outline that is no pillar by its box alone: it may be a rectangle with more vertices than it needs, become one where it
    /// is placed, or be told by its corners.
    fn polygon(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> metalith_core::Result<()> {
        let unit_nm = self.scale.nm(1.0);
        for (k, placement) in placements.iter().enumerate() {
            if let Some(pillar) = self.finder.placed(shape, placement) {
                if let Err(why) = self.filler.put_drawn(&pillar, k, |_| true) {
                    self.odd(why, &pillar.around, shape.offset)?;
                }
                continue;
            }
            let placed = shape.outline.placed(placement);
            let is_other = PillarShape::CHOICES
                .iter()
                .any(|(_, s)| pillar_of(&placed, *s, unit_nm).is_some());
            let why = if is_other {
                Why::OtherShape
            } else {
                self.names
                    .placed(shape.outline, &Transform::IDENTITY, || name_of(&placed))
            };
            self.odd(why, &Rect::around(&placed), shape.offset)?;
        }
        Ok(())
    }
}

impl Visitor for PillarCollector {
    fn cell(&mut self, _cell: &LayoutCell, placements: &[Transform]) -> metalith_core::Result<()> {
        self.surveyor.begin(placements);
        self.filler.begin(placements);
        Ok(())
    }

    #[inline]
    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> metalith_core::Result<()> {
        self.surveyor.shape(shape, placements);
        if shape.layer != self.layer {
            return Ok(());
        }
        match shape.pillar(self.shape) {
            Some(rect) if placements.iter().all(Transform::is_square) => {
                if self.filler.put_orbits(rect, placements, |_| true) {
                    return Ok(());
                }
                for (k, placement) in placements.iter().enumerate() {
                    // Not copied: this is the innermost loop of reading.
                    match placement.apply_rect(rect) {
                        Some(placed) => self.candidate(&placed, k, shape.offset)?,
                        None => self.candidate(rect, k, shape.offset)?,
                    }
                }
                Ok(())
            }
            _ => self.polygon(shape, placements),
        }
    }

    fn text(&mut self, text: &Text<'_>, placements: &[Transform]) -> metalith_core::Result<()> {
        self.surveyor.text(text, placements, self.scale, self.listed);
        Ok(())
    }
}
