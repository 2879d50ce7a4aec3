//! Discovery of the elements of any layout, and of the lattice on which they stand.

use std::f64::consts::FRAC_PI_3;

use super::failed;
use super::lattices::{Cluster, FEWEST, few_are_off};
use super::phases::PartVisitor;
use super::places::{Centre, PlaceFit, Places};
use super::sites::Scale;
use super::sizes::Sizes;
use super::tiles::{COARSE, FINE, MOST_TILES, TileMap};
use super::turned::visit_turned;
use crate::{
    Error, ExtractionError, LayerNumber, Layout, LayoutCell, OutlineMemo, PillarFinder, Point, Rect, Result, Selection,
    Shape, TiltedRectangle, Transform, Visitor, tilted_rectangle_of,
};
use metalith_core::{Named, Progress};
use metalith_pillars::{ElementSite, LatticeKind, PillarShape};

/// Settings of one search of a layout.
#[derive(Clone, Copy)]
struct Look {
    /// Bits of the side of a tile.
    bits: u32,
    /// Wider shapes are pads or marks (nm).
    widest_nm: i64,
    /// True if an angle is looked for at which all stands.
    at_angles: bool,
    /// The angle by which the layout is turned back (rad), and the kind of its lattice.
    turn: Option<(f64, LatticeKind)>,
}

/// Settings that nearly all lenses need.
const CLOSE: Look = Look {
    bits: FINE,
    widest_nm: 6000,
    at_angles: true,
    turn: None,
};
/// Settings for wider pitches, up to the widest of a design. Marks and pads are taken for pillars then too: a second
/// look, where the first finds no closer lattice.
const WIDE: Look = Look {
    bits: COARSE,
    widest_nm: 20_000,
    at_angles: false,
    turn: None,
};
/// Rounding of places that are turned back, in roundings along one axis: that of both axes of the file, along a diagonal, and that of
/// the place where it is turned to.
const TURNED: f64 = 1.0 + std::f64::consts::SQRT_2;
/// Turns that leave a hexagonal lattice as it is, but not the squares on it (rad).
const SIXTHS: [f64; 3] = [0.0, FRAC_PI_3, -FRAC_PI_3];
/// Squares for one upright rectangle, at most, of a layout whose pillars are such.
const FEWEST_AMONG: u64 = 4;
/// Elements found at most.
const MOST_ELEMENTS: usize = 4096;

/// Map of what stands on the layers of pillars of a layout.
struct Map {
    scale: Scale,
    widest_nm: i64,
    /// Squares and circles.
    pillars: Places,
    /// Rectangles at any angle, of whatever size.
    tilted: Places,
    /// Squares and circles that stand at an angle, and their number.
    turned: Places,
    turned_shapes: u64,
    tilted_squares: OutlineMemo<Option<Rect>>,
    at_angles: bool,
    /// Numbers of squares and of circles.
    shapes: [u64; 2],
    /// Other sizes that may be pillars.
    sizes: Sizes,
}

/// Pillars of a known shape on those layers.
struct Search {
    scale: Scale,
    finder: PillarFinder,
    pillars: Places,
}

/// The elements of a layout from anywhere.
#[derive(Clone, Debug)]
pub struct Discovered {
    pub sites: Vec<ElementSite>,
    /// Shape of its pillars: squares and circles together where there are both.
    pub shape: PillarShape,
    /// Shape of most of its pillars.
    pub majority: PillarShape,
    /// How the places of each element were found; none where they are exact.
    pub fits: Vec<PlaceFit>,
    /// Angle by which the layout was turned back before they were found (rad); none for most.
    pub turn: Option<f64>,
}

impl Discovered {
    /// Angle by which the layout was turned back (degrees), to a billionth.
    pub fn turned_deg(&self) -> Option<f64> {
        self.turn.map(|turn| (turn.to_degrees() * 1e9).round() / 1e9)
    }
}

/// Find the elements of a layout whose pillars are on these layers, each with the ends of its pillars: see
/// [`ElementSite::widen`]. Where all of it stands at an angle, elements are those of the layout turned back by it.
///
/// # Errors
/// If there is no element on these layers or there are too many, or if the layout cannot be read.
pub fn discover(
    layout: &Layout,
    from: &Selection,
    layers: &[LayerNumber],
    scale: Scale,
    progress: &dyn Progress,
) -> Result<Discovered> {
    let selection = Selection {
        layers: Some(layers.to_vec()),
        ..from.clone()
    };
    let fail = failed(layout.path());
    let progress = Named(progress, "finding elements");
    let look = |how: Look| seen(layout, &selection, scale, how, &progress);
    let close = look(CLOSE)?;
    let turned = match close.turn {
        None => None,
        // What a turned look cannot tell is no fault of the layout.
        Some((angle, kind)) => SIXTHS[..if kind.is_square() { 1 } else { 3 }].iter().find_map(|more| {
            let turn = Some((angle + more, kind));
            look(Look {
                turn,
                at_angles: false,
                ..CLOSE
            })
            .ok()
            .filter(Seen::holds_a_lens)
        }),
    };
    let Seen {
        sites,
        shape,
        majority,
        turn,
        ..
    } = if let Some(turned) = turned {
        turned
    } else if let Some(cause) = close.cause {
        return Err(fail(cause));
    } else if close.may_be_wider() {
        match look(WIDE) {
            Ok(wide) if wide.holds_a_lens() => wide,
            // What a second look cannot tell is no fault of the layout.
            Ok(_) | Err(Error::Extraction { .. }) => close,
            Err(other) => return Err(other),
        }
    } else {
        close
    };
    let layers = || layers.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    if sites.is_empty() {
        return Err(fail(ExtractionError::NoElements {
            layers: layers(),
            contents: None,
        }));
    }
    if sites.len() > MOST_ELEMENTS {
        return Err(fail(ExtractionError::Groups {
            groups: sites.len(),
            layers: layers(),
            most: MOST_ELEMENTS,
        }));
    }
    let mut sites = sites;
    sites.sort_by_key(|(s, _)| (s.centre_nm[1], s.centre_nm[0]));
    let (mut sites, fits): (Vec<ElementSite>, Vec<PlaceFit>) = sites.into_iter().unzip();
    for (k, site) in sites.iter_mut().enumerate() {
        site.name = format!("element {}", k + 1);
    }
    Ok(Discovered {
        sites,
        shape,
        majority,
        fits,
        turn: turn.map(|(angle, _)| angle),
    })
}

/// Findings of one search of a layout.
struct Seen {
    sites: Vec<(ElementSite, PlaceFit)>,
    shape: PillarShape,
    /// The same, but squares or circles where there are both.
    majority: PillarShape,
    /// Shapes that may be pillars by their outline, however wide.
    shapes: u64,
    /// Angle by which a layout is turned back in this search, or by which it should be in another one (rad), and the kind of its
    /// lattice.
    turn: Option<(f64, LatticeKind)>,
    /// Reason why there is no element, where another angle may show one.
    cause: Option<ExtractionError>,
}

impl Seen {
    /// True if a search for wider pitches may find more: nothing was found, or no lattice that is closer than such
    /// pitches are.
    fn may_be_wider(&self) -> bool {
        let is_wide = |(site, _): &(ElementSite, PlaceFit)| site.lattice.pitch_nm().at_least_nm() > CLOSE.widest_nm;
        self.shapes >= FEWEST && self.sites.iter().all(is_wide)
    }

    /// True if there are elements, none of a pitch that no design has.
    fn holds_a_lens(&self) -> bool {
        let is_known = |(site, _): &(ElementSite, PlaceFit)| site.lattice.pitch_nm().at_least_nm() <= WIDE.widest_nm;
        !self.sites.is_empty() && self.sites.iter().all(is_known)
    }
}

/// Look at what stands on the layers of a selection.
fn seen(layout: &Layout, selection: &Selection, scale: Scale, how: Look, progress: &dyn Progress) -> Result<Seen> {
    let fail = failed(layout.path());
    let mut map = Map::new(scale, how);
    let is_rounded = visit_turned(layout, selection, how.turn.map(|(angle, _)| angle), &mut map, progress)?;
    let [squares, circles] = map.shapes;
    let shapes = squares + circles + map.sizes.rectangles;
    let mostly_turned = how.at_angles && map.turned_shapes > squares + circles;
    if mostly_turned && map.turned_shapes >= FEWEST {
        let Some(tiles) = map.turned.finish() else {
            return Err(fail(ExtractionError::Scattered { most: MOST_TILES }));
        };
        let clusters = tiles.clusters();
        let largest = clusters.iter().max_by_key(|members| members.len());
        return Ok(Seen {
            sites: Vec::new(),
            shape: PillarShape::default(),
            majority: PillarShape::default(),
            shapes,
            turn: largest.and_then(|members| cluster_of(&tiles, members, scale, false).turn()),
            cause: None,
        });
    }
    let mostly = map.sizes.rectangles > squares + circles;
    // Squares are upright rectangles too, where others of several sizes stand among them.
    let among = circles == 0 && FEWEST_AMONG * map.sizes.rectangles > squares;
    let rectangles = (mostly || among)
        .then(|| map.sizes.pillars(how.widest_nm, is_rounded))
        .flatten()
        .filter(|found| mostly || found.with_squares);
    let square_or_circle = if circles > squares {
        PillarShape::Circle
    } else {
        PillarShape::Square
    };
    let shape = match &rectangles {
        Some(found) => found.shape,
        None if is_mixed([squares, circles]) => PillarShape::Mixed,
        None => square_or_circle,
    };
    let places = match rectangles {
        None => map.pillars,
        // All of them are at their places already.
        Some(found) if map.sizes.all_are(&found, squares) => {
            if found.with_squares {
                map.tilted.united(map.pillars)
            } else {
                map.tilted
            }
        }
        Some(_) => {
            let mut search = Search {
                scale,
                finder: PillarFinder::new(shape, scale.nm(1.0)),
                pillars: Places::new(scale, how.bits),
            };
            visit_turned(
                layout,
                selection,
                how.turn.map(|(angle, _)| angle),
                &mut search,
                progress,
            )?;
            search.pillars
        }
    };
    let Some(tiles) = places.finish() else {
        return Err(fail(ExtractionError::Scattered { most: MOST_TILES }));
    };
    let (mut sites, mut turn, mut failed) = (Vec::new(), how.turn, None);
    for members in tiles.clusters() {
        let cluster = cluster_of(&tiles, &members, scale, is_rounded);
        let found = cluster.element();
        let is_whole = found.as_ref().is_ok_and(|f| f.as_ref().is_none_or(|f| f.is_whole));
        let parts = if is_whole { Vec::new() } else { cluster.parts() };
        if !parts.is_empty() {
            let mut visitor = PartVisitor::new(parts, shape, scale, tiles.bits(), how.widest_nm);
            visit_turned(
                layout,
                selection,
                how.turn.map(|(angle, _)| angle),
                &mut visitor,
                progress,
            )?;
            let element = |tiles: &TileMap, members: &[usize]| cluster_of(tiles, members, scale, is_rounded).element();
            // Parts that leave out more than a few pillars are none.
            let pillars: u64 = members.iter().map(|&k| tiles.pillars(k)).sum();
            if few_are_off(visitor.pillars() as usize, pillars as usize) {
                let found = visitor.finish(element).map_err(&fail)?;
                sites.extend(found.into_iter().map(|found| (found.site, found.fit)));
                continue;
            }
        }
        if how.at_angles && turn.is_none() && found.as_ref().map_or(true, |f| f.as_ref().is_some_and(|f| f.is_poor)) {
            turn = cluster.turn();
        }
        match found {
            Ok(found) => sites.extend(found.map(|found| (found.site, found.fit))),
            Err(cause) if turn.is_some() && how.turn.is_none() => failed = Some(cause),
            Err(cause) => return Err(fail(cause)),
        }
    }
    Ok(Seen {
        sites,
        shape,
        majority: if shape == PillarShape::Mixed {
            square_or_circle
        } else {
            shape
        },
        shapes,
        turn,
        cause: failed,
    })
}

/// True if both squares and circles are pillars: as few as these may be marks.
fn is_mixed(shapes: [u64; 2]) -> bool {
    /// One in so many at least.
    const SHARE: u64 = 100;
    let [few, all] = [shapes[0].min(shapes[1]), shapes[0] + shapes[1]];
    few >= FEWEST && SHARE * few >= all
}

/// Tiles of one group in a search; `is_turned` if places were turned back and rounded.
fn cluster_of<'a>(tiles: &'a TileMap, members: &'a [usize], scale: Scale, is_turned: bool) -> Cluster<'a> {
    let unit_halves = 2.0 * scale.steps_per_nm() as f64 * scale.nm(1.0);
    Cluster {
        steps_per_nm: scale.steps_per_nm(),
        unit_halves,
        rounding_halves: if is_turned { TURNED } else { 1.0 } * unit_halves,
        tiles,
        members,
    }
}

impl Map {
    fn new(scale: Scale, how: Look) -> Self {
        Self {
            scale,
            widest_nm: how.widest_nm,
            pillars: Places::new(scale, how.bits),
            tilted: Places::new(scale, how.bits),
            turned: Places::new(scale, how.bits),
            turned_shapes: 0,
            tilted_squares: OutlineMemo::default(),
            at_angles: how.at_angles,
            shapes: [0; 2],
            sizes: Sizes::default(),
        }
    }

    /// Count a square or a circle that stands at an angle; whether it does.
    #[inline]
    fn stands_at_angle(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> bool {
        let is_placed_upright = placements.iter().all(Transform::keeps_upright);
        if is_placed_upright && (shape.rect.is_some() || shape.circle.is_some() || shape.outline.len() != 5) {
            return false;
        }
        self.counts_at_angle(shape, placements, is_placed_upright)
    }

    fn counts_at_angle(&mut self, shape: &Shape<'_>, placements: &[Transform], is_placed_upright: bool) -> bool {
        let scale = self.scale;
        let around = if is_placed_upright {
            let points = shape.outline.points;
            let ask = || {
                let tilted = tilted_rectangle_of(points, scale.nm(1.0)).filter(TiltedRectangle::is_square)?;
                Some(tilted.around.moved(Point::new(-points[0].x, -points[0].y)))
            };
            let from_first = self.tilted_squares.of(shape.outline, 0, ask);
            from_first.and_then(|around| shape.outline.at.apply_rect(&around.moved(points[0])))
        } else {
            shape.rect.filter(|r| r.width() == r.height()).or(shape.circle)
        };
        let Some(around) = around else { return false };
        self.turned_shapes += placements.len() as u64;
        let twice = Point::new(around.x0 + around.x1, around.y0 + around.y1);
        let centre = |placement: &Transform| {
            let [x, y] = placement.twice(twice);
            let place = Rect {
                x0: x,
                x1: 0,
                y0: y,
                y1: 0,
            };
            let half = |v: i64| scale.whole_steps(v);
            scale.reaches(&place).then_some(())?;
            Some(Centre {
                at: Point::new(half(x)?, half(y)?),
                even: true,
            })
        };
        self.turned.add(placements, centre);
        true
    }
}

/// The middle of the box around a shape, if it may be a pillar by that.
#[inline]
pub(super) fn square_about(r: &Rect, scale: Scale, widest_nm: i64) -> Option<Centre> {
    let centre = Centre::of(r, scale)?;
    let width_nm = match scale.whole_nm(r.width()) {
        Some(nm) if r.width() == r.height() => nm,
        _ => scale.rounded_width_nm(r)?,
    };
    (width_nm <= widest_nm).then_some(centre)
}

impl Visitor for Search {
    fn cell(&mut self, _cell: &LayoutCell, placements: &[Transform]) -> metalith_core::Result<()> {
        self.pillars.begin(placements);
        Ok(())
    }

    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> metalith_core::Result<()> {
        let centre = |placement: &Transform| {
            let pillar = self.finder.placed(shape, placement)?;
            Centre::of(&pillar.around, self.scale)
        };
        self.pillars.add(placements, centre);
        Ok(())
    }
}

impl Visitor for Map {
    fn cell(&mut self, _cell: &LayoutCell, placements: &[Transform]) -> metalith_core::Result<()> {
        self.pillars.begin(placements);
        self.tilted.begin(placements);
        self.turned.begin(placements);
        Ok(())
    }

    #[inline]
    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> metalith_core::Result<()> {
        let scale = self.scale;
        let copies = placements.len() as u64;
        let around = if placements.iter().all(Transform::is_square) {
            self.sizes.count(shape, copies, &Transform::IDENTITY, scale)
        } else {
            let each = |placement: &Transform| self.sizes.count(shape, 1, placement, scale);
            placements.iter().map(each).fold(None, Option::or)
        };
        if let Some(around) = around {
            let centre = |placement: &Transform| {
                if placement.is_square() {
                    Centre::of(&placement.apply_rect(&around)?, scale)
                } else {
                    Centre::of(&Rect::around(&shape.outline.placed(placement)), scale)
                }
            };
            self.tilted.add(placements, centre);
            return Ok(());
        }
        if self.at_angles && self.stands_at_angle(shape, placements) {
            return Ok(());
        }
        let Some(rect) = shape.rect.as_ref().or(shape.circle.as_ref()) else {
            return Ok(());
        };
        self.shapes[usize::from(shape.rect.is_none())] += copies;
        if shape.rect.is_some()
            && rect.width() == rect.height()
            && let Some(width_nm) = scale.whole_nm(rect.width())
        {
            self.sizes.count_squares(width_nm, copies);
        }
        let widest_nm = self.widest_nm;
        let centre = |placement: &Transform| {
            let placed = placement.apply_rect(rect)?;
            square_about(&placed, scale, widest_nm)
        };
        self.pillars.add(placements, centre);
        Ok(())
    }
}
