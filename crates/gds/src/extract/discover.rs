//! Discovery of the elements of any layout, and of the lattice on which they stand.

use super::failed;
use super::lattices::{Cluster, FEWEST};
use super::places::{Centre, PlaceFit, Places};
use super::sites::Scale;
use super::sizes::Sizes;
use super::tiles::{COARSE, FINE, MOST_TILES};
use crate::{
    Error, ExtractionError, LayerNumber, Layout, LayoutCell, PillarFinder, Rect, Result, Selection, Shape, Transform,
    Visitor,
};
use metalith_core::Progress;
use metalith_pillars::{ElementSite, PillarShape};

/// Settings of one search of a layout.
#[derive(Clone, Copy)]
struct Look {
    /// Bits of the side of a tile.
    bits: u32,
    /// Wider shapes are pads or marks (nm).
    widest_nm: i64,
}

/// Settings that nearly all lenses need.
const CLOSE: Look = Look {
    bits: FINE,
    widest_nm: 6000,
};
/// Settings for wider pitches, up to the widest of a design. Marks and pads are taken for pillars then too: a second
/// look, where the first finds no closer lattice.
const WIDE: Look = Look {
    bits: COARSE,
    widest_nm: 20_000,
};
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
    /// Shape of most of its pillars.
    pub shape: PillarShape,
    /// How the places of each element were found; none where they are exact.
    pub fits: Vec<PlaceFit>,
}

/// Find the elements of a layout whose pillars are on these layers, each with the ends of its pillars: see
/// [`ElementSite::widen`].
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
    let look = |how: Look| seen(layout, &selection, scale, how, progress);
    let close = look(CLOSE)?;
    let Seen { sites, shape, .. } = if close.may_be_wider() {
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
    Ok(Discovered { sites, shape, fits })
}

/// Findings of one search of a layout.
struct Seen {
    sites: Vec<(ElementSite, PlaceFit)>,
    shape: PillarShape,
    /// Shapes that may be pillars by their outline, however wide.
    shapes: u64,
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
    layout.visit(selection, &mut map, progress)?;
    let [squares, circles] = map.shapes;
    let shapes = squares + circles + map.sizes.rectangles;
    let mostly = map.sizes.rectangles > squares + circles;
    // Squares are upright rectangles too, where others of several sizes stand among them.
    let among = circles == 0 && FEWEST_AMONG * map.sizes.rectangles > squares;
    let rectangles = (mostly || among)
        .then(|| map.sizes.pillars(how.widest_nm))
        .flatten()
        .filter(|found| mostly || found.with_squares);
    let shape = match &rectangles {
        Some(found) => found.shape,
        None if circles > squares => PillarShape::Circle,
        None => PillarShape::Square,
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
            layout.visit(selection, &mut search, progress)?;
            search.pillars
        }
    };
    let Some(tiles) = places.finish() else {
        return Err(fail(ExtractionError::Scattered { most: MOST_TILES }));
    };
    let mut sites = Vec::new();
    for members in tiles.clusters() {
        let cluster = Cluster {
            steps_per_nm: scale.steps_per_nm(),
            unit_halves: 2.0 * scale.steps_per_nm() as f64 * scale.nm(1.0),
            tiles: &tiles,
            members: &members,
        };
        sites.extend(cluster.element().map_err(&fail)?);
    }
    Ok(Seen { sites, shape, shapes })
}

impl Map {
    fn new(scale: Scale, how: Look) -> Self {
        Self {
            scale,
            widest_nm: how.widest_nm,
            pillars: Places::new(scale, how.bits),
            tilted: Places::new(scale, how.bits),
            shapes: [0; 2],
            sizes: Sizes::default(),
        }
    }

    /// The middle of the box around a shape, if it may be a pillar by that.
    #[inline]
    fn square(r: &Rect, scale: Scale, widest_nm: i64) -> Option<Centre> {
        let centre = Centre::of(r, scale)?;
        let width_nm = match scale.whole_nm(r.width()) {
            Some(nm) if r.width() == r.height() => nm,
            _ => scale.rounded_width_nm(r)?,
        };
        (width_nm <= widest_nm).then_some(centre)
    }
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
            Self::square(&placed, scale, widest_nm)
        };
        self.pillars.add(placements, centre);
        Ok(())
    }
}
