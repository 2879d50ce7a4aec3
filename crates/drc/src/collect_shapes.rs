//! One visit of the layout: outlines to the rules that look at them, geometry into the flat.

use std::collections::{BTreeMap, HashSet};
use std::sync::Arc;

use super::body::disc_ring;
use super::deck::Deck;
use super::drawn_outline::DrawnOutline;
use super::elements::{pillar_layers, sites};
use super::findings::Findings;
use super::flat_layout::{FlatLayout, LooseShapes, PlacedText};
use super::input::CheckInput;
use super::polygon::twice_area;
use super::rule::DeckRule;
use super::work::{Allowance, Stop, Work};
use foldhash::fast::RandomState;
use metalith_core::text::printable_bytes;
use metalith_core::{Error, Progress, Result};
use metalith_gds::extract::{Discovered, Filler, ReasonCounts, Scale, Why};
use metalith_gds::{
    BoxMemo, DrawnPillar, LayerNumber, Layout, LayoutCell, Outline, OutlineMemo, PillarFinder, Point, Rect, Selection,
    Shape, Text, Transform, Visitor, circle_of, rectangle_of, simplified,
};
use metalith_pillars::{OutlineForm, PillarShape};

/// Widest square that is decided by table (database units).
const TABLE: usize = 4096;
/// Points of a closed outline of four corners.
const CLOSED: usize = 5;
/// Bytes of a text that reports show.
const LONGEST_TEXT: usize = 512;
const TOO_FAR: &str = "shapes farther than 2^31 database units from the origin";
/// Cells at the top that a message names.
const TOPS_NAMED: usize = 4;

/// Visit the layout and its companions.
pub(super) fn gather<'a>(
    layout: &'a Layout,
    deck: &Deck,
    input: &CheckInput<'a>,
    allowance: &Allowance,
    work: &'a Work<'_>,
    found: &mut [Findings],
    progress: &dyn Progress,
) -> Result<FlatLayout<'a>> {
    let selection = Selection {
        lenient: true,
        ..Selection::default()
    };
    let (Discovered { sites, shape, fits, .. }, no_elements) =
        sites(layout, deck, input, allowance, &selection, progress)?;
    let unit_nm = layout.unit_nm();
    let (pillars, doses) = pillar_layers(deck);
    let rules: Vec<(&DeckRule, &mut Findings)> = deck
        .rules()
        .iter()
        .zip(found)
        .filter(|(rule, _)| rule.always || input.design.is_some())
        .collect();
    let mut visit = Gather {
        pillars,
        shape,
        finder: PillarFinder::new(shape, unit_nm),
        sound: OutlineMemo::default(),
        sound_boxes: Default::default(),
        sound_rings: HashSet::default(),
        relative: Vec::new(),
        pillars_on: deck.pillars_on,
        doses,
        unit_nm,
        passes: pass_table(pillars, unit_nm, &rules),
        filler: Filler::new(sites, Scale::of(layout)?).fitted(&fits),
        loose: BTreeMap::new(),
        vertices: 0,
        rects: 0,
        given: input.design.is_some(),
        off_lattice: Vec::new(),
        elsewhere: ReasonCounts::default(),
        odd_on_lattice: 0,
        pillar_shapes: 0,
        texts: Vec::new(),
        counts: BTreeMap::new(),
        incomplete: None,
        allowance: *allowance,
        work,
        rules,
    };
    let mut unread = None;
    for file in std::iter::once(&layout).chain(&input.with) {
        // Outlines that are told by their number are of one file.
        visit.finder = PillarFinder::new(shape, unit_nm);
        visit.sound = OutlineMemo::default();
        visit.sound_boxes = Default::default();
        match file.visit(&selection, &mut visit, progress).map_err(Error::from) {
            Err(error @ Error::Layout { .. }) => unread = Some(error.to_string()),
            Err(Error::Invalid { what, .. }) => unread = Some(what),
            other => other?,
        }
    }
    if visit.pillar_shapes > 0 {
        *visit.counts.entry(pillars).or_default() += visit.pillar_shapes;
    }
    let (elements, unheld) = match visit.filler.finish() {
        Ok(elements) => (elements, None),
        Err(cause) => (Vec::new(), Some(format!("{cause}; {}", cause.remedy()))),
    };
    Ok(FlatLayout {
        work,
        layout,
        with: input.with.clone(),
        design: input.design,
        array: None,
        unit_nm,
        pillars,
        shape,
        elements,
        slack_nm: fits.iter().map(|fit| fit.slack_nm).fold(0.0, f64::max),
        no_elements,
        loose: visit.loose,
        off_lattice: visit.off_lattice,
        odd_on_lattice: visit.odd_on_lattice,
        texts: visit.texts,
        counts: visit.counts,
        incomplete: unread
            .clone()
            .or_else(|| several_tops(layout, pillars))
            .or(visit.incomplete)
            .or(unheld),
        unread,
    })
}

/// Reason why the pillars of a layout are not those of one chip: cells at the top lie on one another by chance.
fn several_tops(layout: &Layout, pillars: LayerNumber) -> Option<String> {
    let tops = layout.tops_on(pillars);
    let names = tops
        .iter()
        .take(TOPS_NAMED)
        .map(|&top| layout.cells()[top].name.as_str());
    (tops.len() > 1).then(|| {
        format!(
            "{} cells at the top have shapes on {pillars}, such as {}: check each of them with --top",
            tops.len(),
            names.collect::<Vec<_>>().join(", ")
        )
    })
}

/// Table by width and direction: true if no rule on the pillar layer finds anything in such a square.
fn pass_table(pillars: LayerNumber, unit_nm: f64, rules: &[(&DeckRule, &mut Findings)]) -> [Vec<bool>; 2] {
    [false, true].map(|clockwise| {
        (0..TABLE)
            .map(|w| {
                rules
                    .iter()
                    .filter(|(r, _)| r.rule.outlines().contains(&pillars))
                    .all(|(r, _)| r.rule.passes_square(w as f64 * unit_nm, clockwise))
            })
            .collect()
    })
}

struct Gather<'r, 'p> {
    pillars: LayerNumber,
    /// Shape of the pillars.
    shape: PillarShape,
    finder: PillarFinder,
    /// Memory of outlines of pillars that are no squares: true if no rule finds anything in them.
    sound: OutlineMemo<bool>,
    /// Such as are upright boxes, drawn counter-clockwise and clockwise: all of these are sound.
    sound_boxes: [BoxMemo<()>; 2],
    /// Sound outlines with more corners, from the middle of the box around them.
    sound_rings: HashSet<Box<[Point]>, RandomState>,
    relative: Vec<Point>,
    /// Layer that counts as that one, and that one as it, if it is not as the deck says.
    pillars_on: Option<LayerNumber>,
    /// Further layers whose shapes count as if they were on that one.
    doses: &'r [LayerNumber],
    unit_nm: f64,
    passes: [Vec<bool>; 2],
    filler: Filler,
    loose: BTreeMap<LayerNumber, LooseShapes>,
    rects: u64,
    /// True if a design gives the elements.
    given: bool,
    vertices: u64,
    off_lattice: Vec<Rect>,
    /// Pillars that have no site, by the reason.
    elsewhere: ReasonCounts,
    odd_on_lattice: u64,
    pillar_shapes: u64,
    texts: Vec<PlacedText>,
    counts: BTreeMap<LayerNumber, u64>,
    incomplete: Option<String>,
    allowance: Allowance,
    work: &'r Work<'p>,
    /// Active rules, each with its findings.
    rules: Vec<(&'r DeckRule, &'r mut Findings)>,
}

impl Gather<'_, '_> {
    /// The layer that rules see for a shape.
    #[inline]
    fn known_as(&self, layer: LayerNumber) -> LayerNumber {
        if let Some(on) = self.pillars_on {
            return match layer {
                _ if layer == on => self.pillars,
                _ if layer == self.pillars => on,
                other => other,
            };
        }
        if self.doses.contains(&layer) {
            self.pillars
        } else {
            layer
        }
    }

    /// Show an outline to the rules that look at its layer.
    ///
    /// # Errors
    /// If that is too much work.
    fn show(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> Result<()> {
        let points: Vec<Point> = shape.outline.points().collect();
        let outline = DrawnOutline::new(shape, &points, placements, self.unit_nm);
        for (rule, found) in &mut self.rules {
            if rule.rule.outlines().contains(&shape.layer) {
                self.work.spend(points.len() as u64).map_err(ended)?;
                rule.rule.outline(&outline, found);
            }
        }
        Ok(())
    }

    /// Variant of [`Gather::show`] that returns true if no rule found anything.
    ///
    /// # Errors
    /// If that is too much work.
    fn passes(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> Result<bool> {
        let total = |rules: &[(&DeckRule, &mut Findings)]| rules.iter().map(|(_, found)| found.total).sum::<u64>();
        let before = total(&self.rules);
        self.show(shape, placements)?;
        Ok(total(&self.rules) == before)
    }

    /// Variant of [`Gather::show`] for a rectangle that is equal wherever it stands: a sound one is checked once.
    ///
    /// # Errors
    /// If that is too much work.
    #[inline]
    fn show_rectangle(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> Result<()> {
        if let Some(rect) = &shape.rect {
            let direction = usize::from(turns_right(shape.outline));
            if self.sound_boxes[direction].get(rect).is_none() && self.passes(shape, placements)? {
                self.sound_boxes[direction].remember(rect, ());
            }
            return Ok(());
        }
        self.remembered(shape, placements, |own| own.passes(shape, placements))
    }

    /// Answer of `ask` for an outline, remembered for all outlines that are known to be equal: true if no rule finds
    /// anything in it. One in which something is found is shown each time.
    ///
    /// # Errors
    /// If that is too much work.
    #[inline]
    fn remembered(
        &mut self,
        shape: &Shape<'_>,
        placements: &[Transform],
        ask: impl FnOnce(&mut Self) -> Result<bool>,
    ) -> Result<()> {
        let mut memo = std::mem::take(&mut self.sound);
        let mut shown = None;
        let is_sound = memo.placed(shape.outline, &Transform::IDENTITY, || {
            let passes = ask(self);
            let is_sound = matches!(passes, Ok(true));
            shown = Some(passes);
            is_sound
        });
        self.sound = memo;
        match shown {
            Some(passes) => passes.map(|_| ()),
            None if is_sound => Ok(()),
            None => self.show(shape, placements),
        }
    }

    /// Variant of [`Gather::show`] for an outline of any number of corners. Outlines of a cell that stands in a million
    /// places are identified by their number.
    ///
    /// # Errors
    /// If that is too much work.
    #[inline]
    fn show_ring(&mut self, shape: &Shape<'_>, around: &Rect, placements: &[Transform]) -> Result<()> {
        if shape.outline.has_number() {
            self.remembered(shape, placements, |own| own.ring_passes(shape, around, placements))
        } else {
            self.ring_passes(shape, around, placements).map(|_| ())
        }
    }

    /// Show such an outline to the rules, unless one of the same corners was sound; whether it is.
    ///
    /// # Errors
    /// If that is too much work.
    fn ring_passes(&mut self, shape: &Shape<'_>, around: &Rect, placements: &[Transform]) -> Result<bool> {
        let (x, y) = (around.x0 + around.width() / 2, around.y0 + around.height() / 2);
        self.relative.clear();
        self.relative
            .extend(shape.outline.points().map(|p| Point::new(p.x - x, p.y - y)));
        if self.sound_rings.contains(self.relative.as_slice()) {
            return Ok(true);
        }
        let is_sound = self.passes(shape, placements)?;
        if is_sound && self.sound_rings.len() < TABLE {
            self.sound_rings.insert(self.relative.as_slice().into());
        }
        Ok(is_sound)
    }

    /// A pillar that is known by its corners: where it has no site it is kept as it is drawn.
    fn drawn_pillar(&mut self, pillar: &DrawnPillar, placement: usize, placed: impl FnOnce() -> Vec<Point>) {
        if pillar.number.is_none() {
            return self.pillar(&pillar.around, placement);
        }
        match self.filler.put_drawn(pillar, placement, |_| true) {
            Ok(_) => return,
            Err(why) => self.stands_elsewhere(why, pillar.around),
        }
        self.keep(self.pillars, &placed());
    }

    #[inline]
    fn pillar(&mut self, r: &Rect, placement: usize) {
        let standing = self.filler.put(r, placement, |width| width % 2 == 0);
        if standing == Ok(true) {
            return;
        }
        match standing {
            Ok(_) => self.odd_on_lattice += 1,
            Err(why) => self.stands_elsewhere(why, *r),
        }
        if self.shape.is_square() {
            self.keep_rect(self.pillars, r);
        } else {
            self.keep(self.pillars, &disc_ring(r));
        }
    }

    fn stands_elsewhere(&mut self, why: Why, around: Rect) {
        self.elsewhere.add(why);
        if why == Why::OffLattice {
            self.off_lattice.push(around);
        }
    }

    /// Check that pillars stand where the design has elements, before all of a large layout is read.
    ///
    /// # Errors
    /// As [`Filler::check_of_design`].
    #[inline]
    fn check_of_design(&self) -> Result<()> {
        if !self.given {
            return Ok(());
        }
        let checked = self.filler.check_of_design(self.elsewhere);
        checked.map_err(|cause| Error::refused(cause.id(), cause.to_string(), cause.remedy()))
    }

    fn keep_rect(&mut self, layer: LayerNumber, r: &Rect) {
        let small = [r.x0, r.y0, r.x1, r.y1].map(i32::try_from);
        let [Ok(x0), Ok(y0), Ok(x1), Ok(y1)] = small else {
            self.incomplete = Some(TOO_FAR.into());
            return;
        };
        self.rects += 1;
        if self.rects > self.allowance.rects {
            self.incomplete = Some(format!(
                "more than {} rectangles off every lattice",
                self.allowance.rects
            ));
            return;
        }
        self.loose.entry(layer).or_default().rects.push([x0, y0, x1, y1]);
    }

    fn keep(&mut self, layer: LayerNumber, placed: &[Point]) {
        let corners = simplified(placed);
        if twice_area(&corners) == 0 {
            return;
        }
        if let Some(r) = rectangle_of(&corners) {
            self.keep_rect(layer, &r);
            return;
        }
        let range = i64::from(i32::MIN)..=i64::from(i32::MAX);
        if corners.iter().any(|p| !range.contains(&p.x) || !range.contains(&p.y)) {
            self.incomplete = Some(TOO_FAR.into());
            return;
        }
        self.vertices += corners.len() as u64;
        if self.vertices > self.allowance.vertices {
            self.incomplete = Some(format!(
                "outlines with more than {} vertices together",
                self.allowance.vertices
            ));
            return;
        }
        self.loose.entry(layer).or_default().polygons.push(corners.into());
    }
}

impl Visitor for Gather<'_, '_> {
    fn cell(&mut self, _cell: &LayoutCell, placements: &[Transform]) -> Result<()> {
        self.filler.begin(placements);
        Ok(())
    }

    #[inline]
    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> Result<()> {
        let shape = &Shape {
            layer: self.known_as(shape.layer),
            ..*shape
        };
        let square = placements.iter().all(Transform::is_square);
        if let (Some(rect), true) = (shape.pillar(self.shape), square)
            && shape.layer == self.pillars
        {
            self.pillar_shapes += placements.len() as u64;
            if self.shape.is_square() {
                let table = &self.passes[usize::from(turns_right(shape.outline))];
                let known = rect.width() == rect.height() && table.get(rect.width() as usize).is_some_and(|&p| p);
                if !known {
                    self.show(shape, placements)?;
                }
            } else {
                self.show_ring(shape, rect, placements)?;
            }
            if self.filler.put_orbits(rect, placements, |width| width % 2 == 0) {
                return Ok(());
            }
            for (k, placement) in placements.iter().enumerate() {
                match placement.apply_rect(rect) {
                    Some(placed) => self.pillar(&placed, k),
                    None => self.pillar(rect, k),
                }
            }
            return self.check_of_design();
        }
        self.other(shape, placements, square)
    }

    fn text(&mut self, text: &Text<'_>, placements: &[Transform]) -> Result<()> {
        // The reader bounds them by the size of the file.
        let (layer, string) = (
            self.known_as(text.layer),
            Arc::from(printable_bytes(&text.string[..text.string.len().min(LONGEST_TEXT)])),
        );
        let placed = placements.iter().map(|placement| PlacedText {
            layer,
            string: Arc::clone(&string),
            at: placement.apply(text.at),
        });
        self.texts.extend(placed);
        Ok(())
    }
}

impl Gather<'_, '_> {
    /// A shape that is no plain pillar.
    ///
    /// # Errors
    /// If that is too much work.
    fn other(&mut self, shape: &Shape<'_>, placements: &[Transform], square: bool) -> Result<()> {
        let is_drawn_pillar = shape.layer == self.pillars && self.shape.outline() == OutlineForm::Polygon;
        if is_drawn_pillar {
            self.pillar_shapes += placements.len() as u64;
        } else {
            *self.counts.entry(shape.layer).or_default() += placements.len() as u64;
        }
        let mut put = 0;
        if square {
            match is_drawn_pillar {
                false => self.show(shape, placements)?,
                true if shape.outline.len() == CLOSED => self.show_rectangle(shape, placements)?,
                true => self.show_ring(shape, &shape.outline.around(), placements)?,
            }
            if self.incomplete.is_some() {
                return Ok(());
            }
            if is_drawn_pillar {
                put = self.filler.put_copies(&mut self.finder, shape, placements);
                let steps = (put as u64).saturating_mul(shape.outline.len() as u64);
                self.work.spend(steps).map_err(ended)?;
            }
        }
        for (k, placement) in placements.iter().enumerate().skip(put) {
            self.work.spend(shape.outline.len() as u64).map_err(ended)?;
            let placed = || shape.outline.placed(placement);
            if !square {
                // Turned and magnified outlines are looked at where they stand: rounding may bend them.
                let placed = placed();
                let here = Shape {
                    outline: Outline::new(&placed),
                    rect: rectangle_of(&placed),
                    circle: circle_of(&placed, self.unit_nm),
                    ..*shape
                };
                self.show(&here, &[Transform::IDENTITY])?;
            }
            if shape.layer == self.pillars
                && let Some(pillar) = self.finder.placed(shape, placement)
            {
                self.drawn_pillar(&pillar, k, placed);
            } else {
                self.keep(shape.layer, &placed());
            }
        }
        self.check_of_design()
    }
}

/// The error that ends a visit.
fn ended(stop: Stop) -> Error {
    match stop {
        Stop::TooMuch(why) => Error::refused(
            "check/too-complex",
            why,
            "write the layout with simpler outlines or fewer copies",
        ),
        Stop::Interrupted => Error::Interrupted,
    }
}

/// True if a rectangle is drawn clockwise.
#[inline]
fn turns_right(outline: Outline<'_>) -> bool {
    let mut points = outline.points();
    let (Some(a), Some(b), Some(c)) = (points.next(), points.next(), points.next()) else {
        return false;
    };
    let sign = |from: i64, to: i64| (to - from).signum();
    sign(a.x, b.x) * sign(b.y, c.y) - sign(a.y, b.y) * sign(b.x, c.x) < 0
}
