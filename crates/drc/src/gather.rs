//! One visit of the layout: outlines to the rules that look at them, geometry into the scene.

use std::collections::BTreeMap;

use super::CheckInput;
use super::deck::{ActiveRule, Deck};
use super::found::Found;
use super::polygon::{Outline, twice_area};
use super::scene::{Loose, PlacedText, Scene};
use metalith_core::{Error, Progress, Result};
use metalith_gds::extract::{ElementSite, Filler, Scale, Why, discover};
use metalith_gds::{
    Cell, LayerNumber, Layout, Point, Rect, Selection, Shape, Text, Transform, Visitor, rectangle_of, simplified,
};

/// Widest square that is decided by table [database units].
const TABLE: usize = 4096;
/// Rectangles off every lattice that are held, 16 bytes each: the pillars of a 3 x 3 array, and a fifth more.
const MOST_RECTS: usize = 70_000_000;
/// Vertices of outlines that are not rectangles.
const MOST_VERTICES: usize = 20_000_000;
const TOO_FAR: &str = "shapes farther than 2^31 database units from the origin";
/// Texts that are held.
const MOST_TEXTS: usize = 100_000;
/// Lattice sites of all elements together.
const MOST_SITES: u64 = 1 << 28;

/// Visit the layout and its companions.
pub(super) fn gather<'a>(
    layout: &'a Layout,
    deck: &Deck,
    input: &CheckInput<'a>,
    rules: &mut [ActiveRule],
    found: &mut [Found],
    progress: &dyn Progress,
) -> Result<Scene<'a>> {
    let selection = Selection {
        lenient: true,
        ..Selection::default()
    };
    let (sites, no_elements) = sites(layout, deck, input, &selection, progress)?;
    let unit_nm = layout.unit_nm();
    let (pillars, doses) = deck.pillars.split_first().expect("a deck names a layer of pillars");
    let pillars = *pillars;
    let mut visit = Gather {
        pillars,
        doses,
        unit_nm,
        passes: pass_table(pillars, unit_nm, rules),
        filler: Filler::new(sites, Scale::of(layout)?),
        loose: BTreeMap::new(),
        vertices: 0,
        rects: 0,
        off_lattice: Vec::new(),
        odd_on_lattice: 0,
        pillar_shapes: 0,
        texts: Vec::new(),
        text_count: 0,
        counts: BTreeMap::new(),
        incomplete: None,
        rules,
        found,
    };
    let mut unread = None;
    for file in std::iter::once(&layout).chain(&input.with) {
        match file.visit(&selection, &mut visit, progress).map_err(Error::from) {
            Err(error @ Error::Layout { .. }) => unread = Some(error.to_string()),
            other => other?,
        }
    }
    if visit.pillar_shapes > 0 {
        *visit.counts.entry(pillars).or_default() += visit.pillar_shapes;
    }
    Ok(Scene {
        layout,
        with: input.with.clone(),
        design: input.design,
        unit_nm,
        pillars,
        elements: visit.filler.elements,
        no_elements,
        loose: visit.loose,
        off_lattice: visit.off_lattice,
        odd_on_lattice: visit.odd_on_lattice,
        texts: visit.texts,
        text_count: visit.text_count,
        counts: visit.counts,
        incomplete: unread.clone().or(visit.incomplete),
        unread,
    })
}

/// Elements of the design if there is one, else those that can be found, else why there are none.
fn sites(
    layout: &Layout,
    deck: &Deck,
    input: &CheckInput<'_>,
    selection: &Selection,
    progress: &dyn Progress,
) -> Result<(Vec<ElementSite>, String)> {
    if let Some(design) = input.design {
        let site = |e: &metalith_design::Element| ElementSite {
            name: e.label(),
            centre_nm: [e.centre_nm.0, e.centre_nm.1],
            lattice: design.lattice(),
        };
        return Ok((design.elements().iter().map(site).collect(), String::new()));
    }
    // The pillars may be in a companion, where the apertures are what is checked.
    let mut why = String::new();
    for file in std::iter::once(&layout).chain(&input.with) {
        match discover(file, selection, &deck.pillars, Scale::of(file)?, progress).map_err(Error::from) {
            Ok(sites) => {
                let total: u64 = sites.iter().map(|s| (s.lattice.sites() as u64).pow(2)).sum();
                if total <= MOST_SITES {
                    return Ok((sites, String::new()));
                }
                why = format!("elements with {total} lattice sites; {MOST_SITES} are held");
            }
            Err(Error::Invalid { what, .. } | Error::Layout { what, .. }) => why = what,
            Err(other) => return Err(other),
        }
    }
    Ok((Vec::new(), why))
}

/// For each width and direction whether no rule on the pillar layer finds anything in such a square.
fn pass_table(pillars: LayerNumber, unit_nm: f64, rules: &[ActiveRule]) -> [Vec<bool>; 2] {
    [false, true].map(|clockwise| {
        (0..TABLE)
            .map(|w| {
                rules
                    .iter()
                    .filter(|r| r.in_force && r.rule.outlines().contains(&pillars))
                    .all(|r| r.rule.passes_square(w as f64 * unit_nm, clockwise))
            })
            .collect()
    })
}

struct Gather<'r> {
    pillars: LayerNumber,
    /// Further layers whose shapes count as if they were on that one.
    doses: &'r [LayerNumber],
    unit_nm: f64,
    passes: [Vec<bool>; 2],
    filler: Filler,
    loose: BTreeMap<LayerNumber, Loose>,
    rects: usize,
    vertices: usize,
    off_lattice: Vec<Rect>,
    odd_on_lattice: u64,
    pillar_shapes: u64,
    texts: Vec<PlacedText>,
    text_count: u64,
    counts: BTreeMap<LayerNumber, u64>,
    incomplete: Option<String>,
    rules: &'r mut [ActiveRule],
    found: &'r mut [Found],
}

impl Gather<'_> {
    /// The layer that rules know a shape by.
    #[inline]
    fn known_as(&self, layer: LayerNumber) -> LayerNumber {
        if self.doses.contains(&layer) {
            self.pillars
        } else {
            layer
        }
    }

    /// Show an outline to the rules that look at its layer.
    fn show(&mut self, shape: &Shape<'_>, placements: &[Transform]) {
        let outline = Outline::new(shape, placements, self.unit_nm);
        for (rule, found) in self.rules.iter_mut().zip(self.found.iter_mut()) {
            if rule.in_force && rule.rule.outlines().contains(&shape.layer) {
                rule.rule.outline(&outline, found);
            }
        }
    }

    #[inline]
    fn pillar(&mut self, r: &Rect, placement: usize) {
        let standing = self.filler.put(r, placement, |width| width % 2 == 0);
        if standing == Ok(true) {
            return;
        }
        match standing {
            Ok(_) => self.odd_on_lattice += 1,
            Err(Why::OffLattice) => self.off_lattice.push(*r),
            Err(_) => {}
        }
        self.keep_rect(self.pillars, r);
    }

    fn keep_rect(&mut self, layer: LayerNumber, r: &Rect) {
        let small = [r.x0, r.y0, r.x1, r.y1].map(i32::try_from);
        let [Ok(x0), Ok(y0), Ok(x1), Ok(y1)] = small else {
            self.incomplete = Some(TOO_FAR.into());
            return;
        };
        self.rects += 1;
        if self.rects > MOST_RECTS {
            self.incomplete = Some(format!("more than {MOST_RECTS} rectangles off every lattice"));
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
        self.vertices += corners.len();
        if self.vertices > MOST_VERTICES {
            self.incomplete = Some(format!("outlines with more than {MOST_VERTICES} vertices"));
            return;
        }
        self.loose.entry(layer).or_default().polygons.push(corners.into());
    }
}

impl Visitor for Gather<'_> {
    fn cell(&mut self, _cell: &Cell, placements: &[Transform]) -> Result<()> {
        self.filler.begin(placements.len());
        Ok(())
    }

    #[inline]
    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> Result<()> {
        let shape = &Shape {
            layer: self.known_as(shape.layer),
            ..*shape
        };
        let square = placements.iter().all(Transform::is_square);
        if let (Some(rect), true) = (&shape.rect, square)
            && shape.layer == self.pillars
        {
            self.pillar_shapes += placements.len() as u64;
            let table = &self.passes[usize::from(turns_right(shape.points))];
            let known = rect.width() == rect.height() && table.get(rect.width() as usize).is_some_and(|&p| p);
            if !known {
                self.show(shape, placements);
            }
            for (k, placement) in placements.iter().enumerate() {
                let placed = placement.apply_rect(rect).unwrap_or(*rect);
                self.pillar(&placed, k);
            }
            return Ok(());
        }
        self.other(shape, placements, square);
        Ok(())
    }

    fn text(&mut self, text: &Text<'_>, placements: &[Transform]) -> Result<()> {
        for placement in placements {
            self.text_count += 1;
            if self.texts.len() < MOST_TEXTS {
                self.texts.push(PlacedText {
                    layer: self.known_as(text.layer),
                    string: String::from_utf8_lossy(text.string).into_owned(),
                    at: placement.apply(text.at),
                });
            }
        }
        Ok(())
    }
}

impl Gather<'_> {
    /// A shape that is no plain pillar.
    fn other(&mut self, shape: &Shape<'_>, placements: &[Transform], square: bool) {
        *self.counts.entry(shape.layer).or_default() += placements.len() as u64;
        if square {
            self.show(shape, placements);
        }
        for (k, placement) in placements.iter().enumerate() {
            let placed: Vec<Point> = shape.points.iter().map(|&p| placement.apply(p)).collect();
            if !square {
                // Turned and magnified outlines are looked at where they stand: rounding may bend them.
                let here = Shape {
                    points: &placed,
                    rect: rectangle_of(&placed),
                    ..*shape
                };
                self.show(&here, &[Transform::IDENTITY]);
            }
            match rectangle_of(&simplified(&placed)) {
                Some(r) if shape.layer == self.pillars => self.pillar(&r, k),
                _ => self.keep(shape.layer, &placed),
            }
        }
    }
}

/// Whether a rectangle is drawn clockwise.
#[inline]
fn turns_right(points: &[Point]) -> bool {
    let (a, b, c) = (points[0], points[1], points[2]);
    let sign = |from: i64, to: i64| (to - from).signum();
    sign(a.x, b.x) * sign(b.y, c.y) - sign(a.y, b.y) * sign(b.x, c.x) < 0
}
