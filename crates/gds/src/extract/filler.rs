//! Pillars onto the sites of elements.

mod copies;

use std::collections::HashMap;

use copies::Images;

use super::places::PlaceFit;
use super::plan::ExtractedElement;
use super::sites::{Scale, SitePlace, Sites};
use super::stored_pillars::StoredPillars;
use super::unrecognised_shapes::{ReasonCounts, Why};
use super::{MOST_BYTES, WHOLE_SITE_BYTES, too_many_sites};
use crate::{DrawnPillar, ExtractionError, Rect, Transform};
use metalith_pillars::{EighthMap, ElementSite, PillarRows};

/// Shapes before the first pillar of a design, after which the layout is taken for another design's: lenses of 1 mm have fewer, and
/// seconds pass.
const MOST_BEFORE_A_PILLAR: u64 = 10_000_000;

/// Puts pillars on the sites of elements.
///
/// A cell that is placed by all symmetries of the square about the middle of an element, as folded layouts have it, is
/// put there once: of an element with no other pillars an eighth is held.
pub struct Filler {
    scale: Scale,
    sites: Sites,
    elements: Vec<ExtractedElement<StoredPillars>>,
    /// Element that each placement of the current cell met last.
    guesses: Vec<u32>,
    /// Placements of the current cell about the middles of elements, if all of them are.
    orbits: Vec<Orbit>,
    /// Site (row, column) and width (nm) of the present pillar in each of these.
    orbit_sites: Vec<(usize, usize, u16)>,
    /// Images of the first placement that the placements of the current cell are, if they are.
    images: Option<Images>,
    /// The first placement that these were found with.
    first: Transform,
    /// Eighths to begin with, by element.
    prepared: Vec<Option<EighthMap>>,
    pillars: u64,
    /// Memory of the sites that are held, and of those that may be (bytes).
    held: u64,
    most: u64,
    /// More is to be held than may be.
    refused: bool,
    /// True if shapes count that are pillars to the rounding of their corners.
    tolerant: bool,
    /// Placements of shapes that were put to that.
    rounded: u64,
}

/// Placements that symmetry takes into one another, eight or four.
struct Orbit {
    element: u32,
    placements: Vec<usize>,
}

impl Filler {
    pub fn new(sites: Vec<ElementSite>, scale: Scale) -> Self {
        let index = Sites::new(&sites, scale);
        let empty = |site: ElementSite| ExtractedElement {
            widths: StoredPillars::Empty(site.lattice),
            site,
        };
        Self {
            scale,
            sites: index,
            elements: sites.into_iter().map(empty).collect(),
            guesses: Vec::new(),
            orbits: Vec::new(),
            orbit_sites: Vec::new(),
            images: None,
            first: Transform::IDENTITY,
            prepared: Vec::new(),
            pillars: 0,
            held: 0,
            most: MOST_BYTES,
            refused: false,
            tolerant: false,
            rounded: 0,
        }
    }

    /// This filler for elements whose places were found so.
    #[must_use]
    pub fn fitted(mut self, fits: &[PlaceFit]) -> Self {
        let sites: Vec<ElementSite> = self.elements.iter().map(|e| e.site.clone()).collect();
        self.sites = Sites::fitted(&sites, fits, self.scale);
        self
    }

    /// This filler, which takes shapes for pillars that are such to the rounding of their corners: [`crate::CORNER_STEPS`]. Their
    /// widths are whole nanometres.
    #[must_use]
    pub fn tolerant(mut self) -> Self {
        self.tolerant = true;
        self
    }

    /// Pillars whose width was rounded to a whole nanometre.
    pub fn rounded(&self) -> u64 {
        self.rounded
    }

    /// This filler, which may hold sites of this much memory (bytes).
    #[must_use]
    pub fn holding(mut self, most: u64) -> Self {
        self.most = most;
        self
    }

    /// This filler for elements that are mostly as these others on the same lattices, whose eighths are then kept once:
    /// [`EighthMap::empty_like`].
    #[must_use]
    pub fn like(mut self, others: &mut [ExtractedElement<StoredPillars>]) -> Self {
        let prepared = others.iter_mut().map(|other| match &mut other.widths {
            StoredPillars::Eighth(map) => Some(map.empty_like()),
            StoredPillars::Empty(_) | StoredPillars::Whole(_) => None,
        });
        self.prepared = prepared.collect();
        self
    }

    /// Pillars that were put, over all elements.
    pub fn pillars(&self) -> u64 {
        self.pillars
    }

    /// Check that pillars stand where a design has elements, before all of a large layout is read; `elsewhere` counts the shapes
    /// that are none.
    ///
    /// # Errors
    /// [`ExtractionError::NotOfDesign`] after ten million shapes without a pillar.
    #[inline]
    pub fn check_of_design(&self, elsewhere: ReasonCounts) -> Result<(), ExtractionError> {
        if self.pillars > 0 || elsewhere.total() < MOST_BEFORE_A_PILLAR {
            return Ok(());
        }
        Err(ExtractionError::NotOfDesign { reasons: elsewhere })
    }

    /// The elements with their pillars.
    ///
    /// # Errors
    /// [`ExtractionError::Sites`] if they have more sites than are held: what was put after that is lost.
    pub fn finish(self) -> Result<Vec<ExtractedElement<StoredPillars>>, ExtractionError> {
        if !self.refused {
            return Ok(self.elements);
        }
        Err(too_many_sites(self.elements.iter().map(|e| &e.site), self.most))
    }

    /// A cell with these placements begins.
    pub fn begin(&mut self, placements: &[Transform]) {
        self.guesses.clear();
        self.guesses.resize(placements.len(), 0);
        self.orbits = self.orbits_of(placements).unwrap_or_default();
        if !self
            .orbits
            .iter()
            .all(|o| self.elements[o.element as usize].widths.is_folded())
        {
            self.orbits.clear();
        }
        for k in 0..self.orbits.len() {
            self.hold_eighth(self.orbits[k].element);
        }
        self.images = self.images_of(placements);
        self.first = placements.first().copied().unwrap_or(Transform::IDENTITY);
    }

    /// Hold an eighth of an element of which nothing is held, unless that is too much.
    fn hold_eighth(&mut self, element: u32) {
        let widths = &mut self.elements[element as usize].widths;
        let StoredPillars::Empty(lattice) = *widths else { return };
        let prepared = self.prepared.get_mut(element as usize).and_then(Option::take);
        let map = prepared.unwrap_or_else(|| EighthMap::empty(lattice));
        let held = self.held + map.bytes();
        if held <= self.most {
            self.held = held;
            *widths = StoredPillars::Eighth(map);
        }
    }

    /// Placements in sets about the middle of an element; none if any of them is not in such a set.
    fn orbits_of(&self, placements: &[Transform]) -> Option<Vec<Orbit>> {
        if !placements.len().is_multiple_of(4) || placements.len() > 8 * self.elements.len() {
            return None;
        }
        if self.elements.iter().any(|e| !e.site.lattice.is_square()) {
            return None;
        }
        let mut sets: HashMap<(i64, i64), (u8, Vec<usize>)> = HashMap::new();
        for (k, placement) in placements.iter().enumerate() {
            let Transform::Square { orientation, dx, dy } = *placement else {
                return None;
            };
            let (seen, members) = sets.entry((dx, dy)).or_default();
            let bit = 1 << (orientation & 7);
            if *seen & bit != 0 {
                return None;
            }
            *seen |= bit;
            members.push(k);
        }
        let mut orbits = Vec::new();
        for (k, element) in self.elements.iter().enumerate() {
            let [x, y] = element.site.centre_nm.map(|c| c * self.scale.den);
            if x % self.scale.num != 0 || y % self.scale.num != 0 {
                continue;
            }
            if let Some((_, placements)) = sets.remove(&(x / self.scale.num, y / self.scale.num)) {
                orbits.push(Orbit {
                    element: k as u32,
                    placements,
                });
            }
        }
        let whole = |o: &Orbit| o.placements.len() == 8 || o.placements.len() == 4;
        (sets.is_empty() && orbits.iter().all(whole)).then_some(orbits)
    }

    /// Put a pillar of the current cell on its sites in all of its `placements`, if symmetry makes one of them stand for
    /// all; else nothing is put and they are to be put one by one.
    #[inline]
    pub fn put_orbits(&mut self, r: &Rect, placements: &[Transform], takes: impl Fn(i64) -> bool) -> bool {
        if self.orbits.is_empty() || placements.first() != Some(&self.first) || !takes(r.width()) {
            return false;
        }
        // All of them are looked up before one is put. A vector that is kept, because this is the innermost loop of reading.
        let mut sites = std::mem::take(&mut self.orbit_sites);
        sites.clear();
        sites.extend(self.orbits.iter().map_while(|orbit| self.site_of(orbit, r, placements)));
        let is_whole = sites.len() == self.orbits.len();
        if is_whole {
            let is_rounded = self.is_rounded(r);
            for (orbit, &(row, column, width_nm)) in self.orbits.iter().zip(&sites) {
                let copies = orbit.placements.len() as u64;
                if let StoredPillars::Eighth(map) = &mut self.elements[orbit.element as usize].widths {
                    let before = map.bytes();
                    map.set(column, row, width_nm);
                    if map.bytes() != before {
                        self.held = self.held - before + map.bytes();
                        self.refused |= self.held > self.most;
                    }
                    self.pillars += copies;
                    self.rounded += if is_rounded { copies } else { 0 };
                }
            }
        }
        self.orbit_sites = sites;
        is_whole
    }

    /// Site (row, column) and width (nm) of a pillar in the first placement of an orbit, if the others put it on all
    /// copies of that site, all of them free.
    #[inline]
    fn site_of(&self, orbit: &Orbit, r: &Rect, placements: &[Transform]) -> Option<(usize, usize, u16)> {
        let element = orbit.element;
        let StoredPillars::Eighth(map) = &self.elements[element as usize].widths else {
            return None;
        };
        let placed = placements.get(orbit.placements[0])?.apply_rect(r)?;
        let mut guess = element;
        let (found, row, column, width_nm) = self.standing(&placed, &mut guess).ok()?;
        let copies = map.copies(column, row);
        if found != element || copies != orbit.placements.len() || map.number(column, row) != 0 {
            return None;
        }
        // Four sites about the middle are met by four placements only if no two of these put them on one site.
        if copies == 4 {
            let at = |k: &usize| placements.get(*k)?.apply_rect(r).map(|r| (r.x0, r.y0));
            let places: Vec<_> = orbit.placements.iter().map(at).collect();
            if (1..4).any(|k| places[..k].contains(&places[k])) {
                return None;
            }
        }
        Some((row, column, width_nm))
    }

    /// Element, row, column and width (nm) of a pillar on a site.
    #[inline]
    fn standing(&self, r: &Rect, guess: &mut u32) -> Result<(u32, usize, usize, u16), Why> {
        if !self.scale.reaches(r) {
            return Err(Why::OutsideElements);
        }
        let width_nm = match self.scale.whole_nm(r.width()) {
            Some(nm) if r.width() == r.height() => nm,
            _ => return self.standing_rounded(r, guess),
        };
        let (element, row, column) = self.site(r, width_nm, guess)?;
        if width_nm > i64::from(u16::MAX) {
            return Err(Why::TooWide);
        }
        Ok((element, row, column, width_nm as u16))
    }

    /// Variant of [`Filler::standing`] for a shape that is a square of whole nanometres to the rounding of its corners at most.
    #[cold]
    fn standing_rounded(&self, r: &Rect, guess: &mut u32) -> Result<(u32, usize, usize, u16), Why> {
        let is_square = r.width() == r.height();
        let other = if is_square { Why::OddShape } else { Why::UnequalSides };
        let width_nm = self.scale.rounded_width_nm(r).filter(|_| self.tolerant).ok_or(other)?;
        let place = self.site(r, width_nm, guess);
        let unequal = |why: Why| if why == Why::OffLattice { other } else { why };
        let (element, row, column) = place.map_err(|why| if is_square { why } else { unequal(why) })?;
        let width = if is_square {
            r.width() as f64
        } else {
            let about = self.sites.width_about(r, [element as usize, row, column]);
            about.ok_or(other)?
        };
        let width_nm = self.scale.nm(width).round_ties_even();
        let in_range = (1.0..=f64::from(u16::MAX)).contains(&width_nm);
        in_range
            .then_some((element, row, column, width_nm as u16))
            .ok_or(Why::TooWide)
    }

    /// Element, row and column of a pillar that reaches so far (nm), by the box around it.
    #[inline]
    fn site(&self, r: &Rect, width_nm: i64, guess: &mut u32) -> Result<(u32, usize, usize), Why> {
        match self.sites.stand(r, guess) {
            SitePlace::Site(element, ..) | SitePlace::Between(element) if width_nm > self.sites.pitch_nm(element) => {
                Err(Why::TooWide)
            }
            SitePlace::Site(element, row, column) => Ok((element, row, column)),
            SitePlace::Between(_) => Err(Why::OffLattice),
            SitePlace::Outside => Err(Why::OutsideElements),
        }
    }

    /// Variant of [`Filler::put`] for a pillar that its corners may identify: `takes` is called for pillars that their
    /// width identifies.
    ///
    /// # Errors
    /// As [`Filler::put`].
    pub fn put_drawn(
        &mut self,
        pillar: &DrawnPillar,
        placement: usize,
        takes: impl Fn(i64) -> bool,
    ) -> Result<bool, Why> {
        let Some(number) = pillar.number else {
            return self.put(&pillar.around, placement, takes);
        };
        let (element, row, column) = self.site_of_drawn(pillar, placement)?;
        self.fill(element, row, column, number)
    }

    /// Element, row and column of a pillar that is identified by its corners.
    #[inline]
    fn site_of_drawn(&mut self, pillar: &DrawnPillar, placement: usize) -> Result<(u32, usize, usize), Why> {
        let r = &pillar.around;
        if !self.scale.reaches(r) {
            return Err(Why::OutsideElements);
        }
        let widest_nm = self.scale.at_least_nm(r.width().max(r.height()));
        let mut guess = self.guesses[placement];
        let site = self.site(r, widest_nm, &mut guess);
        self.guesses[placement] = guess;
        site
    }

    /// Put a pillar on a free site.
    #[inline]
    fn fill(&mut self, element: u32, row: usize, column: usize, number: u16) -> Result<bool, Why> {
        // Nearly all pillars are of elements that are held whole already.
        let place = match &mut self.elements[element as usize].widths {
            StoredPillars::Whole(map) => Some(&mut map.number[[row, column]]),
            other if other.number(column, row) != 0 => return Err(Why::DuplicateSite),
            _ => self.place(element, row, column),
        };
        let Some(place) = place else { return Ok(true) };
        if *place != 0 {
            return Err(Why::DuplicateSite);
        }
        *place = number;
        self.pillars += 1;
        Ok(true)
    }

    /// Put an upright rectangle of the layout on its site if `takes` its width in database units, and say
    /// whether it was taken.
    ///
    /// # Errors
    /// The reason why it has no site.
    #[inline]
    pub fn put(&mut self, r: &Rect, placement: usize, takes: impl Fn(i64) -> bool) -> Result<bool, Why> {
        let mut guess = self.guesses[placement];
        let standing = self.standing(r, &mut guess);
        self.guesses[placement] = guess;
        let (element, row, column, width_nm) = standing?;
        if !takes(r.width()) {
            return Ok(false);
        }
        let put = self.fill(element, row, column, width_nm);
        self.rounded += u64::from(put.is_ok() && self.is_rounded(r));
        put
    }

    /// True if a shape is no square of whole nanometres.
    #[inline]
    fn is_rounded(&self, r: &Rect) -> bool {
        r.width() != r.height() || self.scale.whole_nm(r.width()).is_none()
    }

    /// The width at one site alone; none if its element cannot be held.
    #[inline]
    fn place(&mut self, element: u32, row: usize, column: usize) -> Option<&mut u16> {
        if !matches!(self.elements[element as usize].widths, StoredPillars::Whole(_)) {
            self.hold_whole(element);
        }
        match &mut self.elements[element as usize].widths {
            StoredPillars::Whole(map) => Some(&mut map.number[[row, column]]),
            _ => None,
        }
    }

    /// Hold all sites of an element, unless these are too many.
    #[cold]
    fn hold_whole(&mut self, element: u32) {
        let widths = &mut self.elements[element as usize].widths;
        let bytes = WHOLE_SITE_BYTES * (widths.lattice().sites() as u64).pow(2);
        let held = self.held - widths.bytes() + bytes;
        self.refused |= held > self.most;
        if !self.refused {
            self.held = held;
            *widths = StoredPillars::Whole(widths.whole());
        }
    }

    /// Keeps the pillar of the larger number, of one that its corners identify and the one that is on its site already;
    /// returns the number of the other.
    pub fn keep_larger_number(&mut self, pillar: &DrawnPillar, placement: usize) -> u16 {
        let number = pillar.number.unwrap_or(0);
        let SitePlace::Site(element, row, column) = self.sites.stand(&pillar.around, &mut self.guesses[placement])
        else {
            return number;
        };
        let there = self.elements[element as usize].widths.number(column, row);
        if number <= there {
            return number;
        }
        if let Some(place) = self.place(element, row, column) {
            *place = number;
        }
        there
    }

    /// True if a shape may be a pillar of an element: in its lattice, or no wider than two pitches of the first.
    pub fn may_be_of_element(&self, r: &Rect) -> bool {
        /// Pitches that a pillar, and what is drawn in the place of one, is no wider than.
        const PITCHES: i64 = 2;
        if !self.scale.reaches(r) || self.elements.is_empty() {
            return false;
        }
        let width_nm = self.scale.at_least_nm(r.width().max(r.height()));
        width_nm <= PITCHES * self.sites.pitch_nm(0) || self.sites.stand(r, &mut 0) != SitePlace::Outside
    }

    /// Keeps the wider of a pillar and the one that is on its site already; returns the other, as a rectangle about the
    /// same site. Both have even widths.
    pub fn keep_wider(&mut self, r: &Rect, placement: usize) -> Rect {
        let SitePlace::Site(element, row, column) = self.sites.stand(r, &mut self.guesses[placement]) else {
            return *r;
        };
        let Some(width_nm) = self.scale.whole_nm(r.width()) else {
            return *r;
        };
        let there = i64::from(self.elements[element as usize].widths.number(column, row));
        if width_nm <= there {
            return *r;
        }
        let Some(place) = self.place(element, row, column) else {
            return *r;
        };
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
