//! Where the elements of a layout from anywhere are, and on which lattice they stand.

use std::collections::BTreeMap;

use super::sites::Scale;
use super::sizes::Sizes;
use super::tiles::{MOST_TILES, TileMap};
use crate::{
    Error, ExtractionError, LayerNumber, Layout, LayoutCell, Point, Rect, Result, Selection, Shape, Transform, Visitor,
    pillar_of,
};
use metalith_core::{ElementSite, Lattice, LatticeKind, PillarShape, Progress};

/// Wider shapes are pads or marks (nm).
const WIDEST_NM: i64 = 6000;
/// Fewer squares together are no element.
const FEWEST: u64 = 16;
/// Elements found at most.
const MOST_ELEMENTS: usize = 4096;
/// One in so many tiles at least shows a row between those of its samples, where two arrays make a hexagonal lattice: all do but
/// those that pillars reach by their rims.
const ROWS_BETWEEN: usize = 4;
/// All centres but one in so many at most are sites of a hexagonal lattice.
const SHARE_OF_SITES: u64 = 4;
/// Lattice sites for each square found: a lens fills 0.79 of its lattice.
const SITES_PER_PILLAR: u64 = 64;

/// Occupied places of a layout.
struct Map {
    scale: Scale,
    tiles: TileMap,
    /// Of the current cell in its own coordinates, if it is placed more than once: each square is looked at once.
    own: TileMap,
    /// Placements of the current cell whose squares are in `own`.
    placements: Vec<Transform>,
    /// Tile that each placement of the current cell met last.
    guesses: Vec<u32>,
    /// There are more tiles than are held.
    scattered: bool,
    /// Squares and circles.
    shapes: [u64; 2],
    /// What else may be pillars.
    sizes: Sizes,
    /// What is looked for: squares and circles, or these.
    wanted: PillarShape,
}

/// The elements of a layout from anywhere.
#[derive(Clone, Debug)]
pub struct Discovered {
    pub sites: Vec<ElementSite>,
    /// What most of its pillars are.
    pub shape: PillarShape,
}

/// Find the elements of a layout whose pillars are on these layers.
pub fn discover(
    layout: &Layout,
    from: &Selection,
    layers: &[LayerNumber],
    scale: Scale,
    progress: &dyn Progress,
) -> Result<Discovered> {
    let mut map = Map::new(scale, PillarShape::Square);
    let selection = Selection {
        layers: Some(layers.to_vec()),
        ..from.clone()
    };
    let fail = |cause| Error::Extraction {
        path: layout.path().to_owned(),
        cause,
    };
    layout.visit(&selection, &mut map, progress)?;
    if map.sizes.rectangles > map.shapes.iter().sum()
        && let Some(pillars) = map.sizes.pillars(WIDEST_NM)
    {
        map = Map::new(scale, PillarShape::Rectangle(pillars));
        layout.visit(&selection, &mut map, progress)?;
    }
    map.place_own();
    if map.scattered {
        return Err(fail(ExtractionError::Scattered { most: MOST_TILES }));
    }
    let layers = || layers.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    let mut sites = Vec::new();
    for cluster in map.tiles.clusters() {
        if let Some(site) = map.element(&cluster).map_err(fail)? {
            sites.push(site);
        }
    }
    if sites.is_empty() {
        return Err(fail(ExtractionError::NoElements { layers: layers() }));
    }
    if sites.len() > MOST_ELEMENTS {
        return Err(fail(ExtractionError::Groups {
            groups: sites.len(),
            layers: layers(),
            most: MOST_ELEMENTS,
        }));
    }
    sites.sort_by_key(|s| (s.centre_nm[1], s.centre_nm[0]));
    for (k, site) in sites.iter_mut().enumerate() {
        site.name = format!("element {}", k + 1);
    }
    let [squares, circles] = map.shapes;
    Ok(Discovered {
        sites,
        shape: if circles > squares {
            PillarShape::Circle
        } else {
            map.wanted
        },
    })
}

/// A square as it is looked for, in half nanometres.
struct Square {
    centre: Point,
    /// Whether its edges are on the grid of whole nanometres if its centre is on that of half ones.
    even: bool,
}

impl Map {
    fn new(scale: Scale, wanted: PillarShape) -> Self {
        Self {
            scale,
            tiles: TileMap::new(),
            own: TileMap::new(),
            placements: Vec::new(),
            guesses: Vec::new(),
            scattered: false,
            shapes: [0; 2],
            sizes: Sizes::default(),
            wanted,
        }
    }

    /// Add the rectangles that are looked for where they stand.
    fn rectangle(&mut self, shape: &Shape<'_>, placements: &[Transform]) {
        for (k, placement) in placements.iter().enumerate() {
            let placed: Vec<Point> = shape.points.iter().map(|&p| placement.apply(p)).collect();
            let Some(pillar) = pillar_of(&placed, self.wanted, self.scale.nm(1.0)) else {
                continue;
            };
            let r = pillar.around;
            if let (true, Some(x), Some(y)) = (
                self.scale.reaches(&r),
                self.scale.whole_nm(r.x0 + r.x1),
                self.scale.whole_nm(r.y0 + r.y1),
            ) {
                let even = r.width() % 2 == 0 && r.height() % 2 == 0;
                self.tiles.add(Point::new(x, y), even, &mut self.guesses[k]);
            }
        }
    }

    /// The box around a shape as a square that may be a pillar.
    #[inline]
    fn square(&self, r: &Rect) -> Option<Square> {
        if !self.scale.reaches(r) || r.width() != r.height() {
            return None;
        }
        let width = self.scale.whole_nm(r.width())?;
        let centre = Point::new(self.scale.whole_nm(r.x0 + r.x1)?, self.scale.whole_nm(r.y0 + r.y1)?);
        (width <= WIDEST_NM).then_some(Square {
            centre,
            even: width % 2 == 0,
        })
    }

    /// Whether the squares of a cell with these placements are gathered in its own coordinates.
    fn gathers(&self, placements: &[Transform]) -> bool {
        placements.len() > 1
            && self.scale.den == 1
            && placements
                .iter()
                .all(|t| matches!(t, Transform::Square { dx, dy, .. } if self.scale.reaches(&Rect::around(&[Point::new(*dx, *dy)]))))
    }

    /// Put the tiles of the last cell where it is placed.
    fn place_own(&mut self) {
        if self.own.is_empty() {
            return;
        }
        for placement in &self.placements {
            let Transform::Square { orientation, dx, dy } = *placement else {
                continue;
            };
            let twice = 2 * self.scale.num;
            let placement = Transform::Square {
                orientation,
                dx: twice * dx,
                dy: twice * dy,
            };
            self.scattered |= !self.tiles.place(&self.own, &placement);
            if self.scattered {
                break;
            }
        }
        self.own.clear();
    }

    /// The lattice of one cluster; none if it is too small to be an element.
    fn element(&self, cluster: &[usize]) -> Result<Option<ElementSite>, ExtractionError> {
        let squares: u64 = cluster.iter().map(|&k| self.tiles.squares(k)).sum();
        if squares < FEWEST {
            return Ok(None);
        }
        let mut steps = [BTreeMap::<i64, u64>::new(), BTreeMap::new()];
        for &k in cluster {
            for (axis, steps) in AXES.into_iter().zip(&mut steps) {
                let mut places: Vec<i64> = self.tiles.samples(k).map(axis).collect();
                places.sort_unstable();
                places.dedup();
                for pair in places.windows(2) {
                    *steps.entry(pair[1] - pair[0]).or_default() += 1;
                }
            }
        }
        if let Some(element) = self.hexagonal(cluster, squares, &steps)? {
            return Ok(Some(element));
        }
        let [mut steps, along_y] = steps;
        along_y
            .into_iter()
            .for_each(|(step, count)| *steps.entry(step).or_default() += count);
        let Some(step) = most_common(steps) else {
            return Ok(None);
        };
        let bounds = self.bounds(cluster);
        let (x, columns) = self.places(cluster, 0, step, [bounds.x0, bounds.x1]);
        let (y, rows) = self.places(cluster, 1, step, [bounds.y0, bounds.y1]);
        let sites = columns.max(rows);
        dense_enough(squares, sites, &bounds, [columns, rows], step as f64 / 2.0)?;
        let centre = |first: i64, count: i64| first - (sites - count) / 2 * step + (sites - 1) * step / 2;
        let (twice_x, twice_y) = (centre(x, columns), centre(y, rows));
        let bad = ExtractionError::Lattice {
            pitch_nm: step as f64 / 2.0,
            centre_nm: [twice_x as f64 / 2.0, twice_y as f64 / 2.0],
        };
        if step % 4 != 0 || twice_x % 2 != 0 || twice_y % 2 != 0 {
            return Err(bad);
        }
        let Ok(lattice) = Lattice::new((step / 2) as u32, sites as usize) else {
            return Err(bad);
        };
        Ok(Some(ElementSite {
            name: String::new(),
            centre_nm: [twice_x / 2, twice_y / 2],
            lattice,
        }))
    }
}

impl Map {
    /// Around all centres of a cluster (half nm).
    fn bounds(&self, cluster: &[usize]) -> Rect {
        let mut bounds = Rect::EMPTY;
        cluster.iter().for_each(|&k| bounds.unite(&self.tiles.bounds(k)));
        bounds
    }

    /// The first place of a lattice with this step along an axis, between two ends, and the number of its places (half nm).
    fn places(&self, cluster: &[usize], axis: usize, step: i64, [from, to]: [i64; 2]) -> (i64, i64) {
        let mut phases: BTreeMap<i64, u64> = BTreeMap::new();
        for s in cluster.iter().flat_map(|&k| self.tiles.samples(k)) {
            *phases.entry(AXES[axis](s).rem_euclid(step)).or_default() += 1;
        }
        let phase = most_common(phases).unwrap_or(0);
        // Outermost places on the lattice: what is off it does not widen it.
        let first = from + (phase - from).rem_euclid(step);
        let last = to - (to - phase).rem_euclid(step);
        (first, (last - first).max(0) / step + 1)
    }

    /// Whether enough of the last centres of the tiles of a cluster are in rows between those of its samples, and shifted as those of
    /// a hexagonal lattice with this half pitch and distance of rows (half nm).
    fn has_rows_between(&self, cluster: &[usize], half_pitch: i64, row: i64) -> bool {
        let between = |&&k: &&usize| {
            let (Some(first), Some(last)) = (self.tiles.samples(k).next(), self.tiles.last(k)) else {
                return false;
            };
            let [x, y] = [last.x - first.x, last.y - first.y];
            let whole = x % half_pitch == 0 && y % row == 0;
            whole && x / half_pitch % 2 != 0 && y / row % 2 != 0
        };
        cluster.iter().filter(between).count() * ROWS_BETWEEN >= cluster.len()
    }

    /// The hexagonal lattice of a cluster, if most centres are a pitch or half of one apart along x, and along y as far as its
    /// rows, or twice as far with rows between them. Samples of a tile may be of one row alone, or of every other one where two
    /// arrays make the lattice.
    fn hexagonal(
        &self,
        cluster: &[usize],
        squares: u64,
        steps: &[BTreeMap<i64, u64>; 2],
    ) -> Result<Option<ElementSite>, ExtractionError> {
        let [Some(step_x), Some(step_y)] = [0, 1].map(|axis: usize| most_common(steps[axis].clone())) else {
            return Ok(None);
        };
        // Half a pitch in half nanometres is a pitch in nanometres.
        let pitches = [step_x / 2, step_x].map(|pitch| u32::try_from(pitch).unwrap_or(0));
        let row = |pitch_nm: u32| 2 * i64::from(LatticeKind::Hexagonal.row_nm(pitch_nm));
        let fits = |pitch: &u32| {
            let row = row(*pitch);
            let sound = pitch.is_multiple_of(2) && *pitch > 0;
            sound && (step_y == row || (step_y == 2 * row && self.has_rows_between(cluster, (*pitch).into(), row)))
        };
        let Some(pitch_nm) = pitches.into_iter().find(fits) else {
            return Ok(None);
        };
        let (step_x, step_y) = (i64::from(pitch_nm), row(pitch_nm));
        let bounds = self.bounds(cluster);
        let (x, columns) = self.places(cluster, 0, step_x, [bounds.x0, bounds.x1]);
        let (y, rows) = self.places(cluster, 1, step_y, [bounds.y0, bounds.y1]);
        let staggered = |s: Point| ((s.x - x).div_euclid(step_x) + (s.y - y).div_euclid(step_y)).rem_euclid(2);
        let mut parities: BTreeMap<i64, u64> = BTreeMap::new();
        for s in cluster.iter().flat_map(|&k| self.tiles.samples(k)) {
            *parities.entry(staggered(s)).or_default() += 1;
        }
        // Where as many centres are on the other places of the grid it is no lattice of such rows.
        let most = most_common_count(&parities);
        if SHARE_OF_SITES * most < (SHARE_OF_SITES - 1) * parities.values().sum::<u64>() {
            return Ok(None);
        }
        // A site in the middle, or beside it.
        let row = rows / 2;
        let column = columns / 2;
        let column = column + (column + row + most_common(parities).unwrap_or(0)).rem_euclid(2);
        let reach = column.max(columns - 1 - column);
        let high = row.max(rows - 1 - row);
        let sites = 2 * reach.max((high * step_y + step_x - 1) / step_x) + 1;
        let centre = [x + column * step_x, y + row * step_y];
        dense_enough(squares, sites, &bounds, [columns, rows], pitch_nm.into())?;
        let lattice = Lattice::of_kind(LatticeKind::Hexagonal, pitch_nm, sites as usize);
        match lattice {
            Ok(lattice) if centre.iter().all(|c| c % 2 == 0) => Ok(Some(ElementSite {
                name: String::new(),
                centre_nm: centre.map(|c| c / 2),
                lattice,
            })),
            _ => Err(ExtractionError::Lattice {
                pitch_nm: f64::from(pitch_nm),
                centre_nm: centre.map(|c| c as f64 / 2.0),
            }),
        }
    }
}

/// Coordinates of a place along x and along y.
const AXES: [fn(Point) -> i64; 2] = [|s| s.x, |s| s.y];

/// Nothing, if so many squares fill a lattice of so many places an axis well enough to be one.
fn dense_enough(
    squares: u64,
    sites: i64,
    bounds: &Rect,
    [columns, rows]: [i64; 2],
    pitch_nm: f64,
) -> Result<(), ExtractionError> {
    if (sites as u64).saturating_pow(2) <= squares.saturating_mul(SITES_PER_PILLAR) + (1 << 16) {
        return Ok(());
    }
    Err(ExtractionError::Sparse {
        squares,
        at_nm: [bounds.x0 / 2, bounds.y0 / 2],
        columns,
        rows,
        pitch_nm,
    })
}

/// How often the key counted most often was.
fn most_common_count(counts: &BTreeMap<i64, u64>) -> u64 {
    counts.values().copied().max().unwrap_or(0)
}

/// The key counted most often, the smallest of equals.
fn most_common(counts: BTreeMap<i64, u64>) -> Option<i64> {
    counts
        .into_iter()
        .max_by_key(|&(key, count)| (count, std::cmp::Reverse(key)))
        .map(|(key, _)| key)
}

impl Visitor for Map {
    fn cell(&mut self, _cell: &LayoutCell, placements: &[Transform]) -> metalith_core::Result<()> {
        self.place_own();
        self.placements.clear();
        if self.gathers(placements) {
            self.placements.extend_from_slice(placements);
        }
        self.guesses.clear();
        self.guesses.resize(placements.len().max(1), 0);
        Ok(())
    }

    #[inline]
    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> metalith_core::Result<()> {
        if self.wanted.rectangles().is_some() {
            self.scattered |= self.tiles.len() > MOST_TILES;
            if !self.scattered {
                self.rectangle(shape, placements);
            }
            return Ok(());
        }
        let rectangle = Sizes::rectangle(shape, self.scale);
        if let Some(rectangle) = &rectangle {
            self.sizes.add(rectangle, placements.len() as u64, self.scale);
        }
        let Some(rect) = shape.rect.as_ref().or(shape.circle.as_ref()) else {
            return Ok(());
        };
        if rectangle.is_none() {
            self.shapes[usize::from(shape.rect.is_none())] += placements.len() as u64;
        }
        // A tile too many, and no more is looked for.
        self.scattered |= self.tiles.len().max(self.own.len()) > MOST_TILES;
        if self.scattered {
            return Ok(());
        }
        // What comes with placements of its own is turned by other than quarter turns.
        if !self.placements.is_empty() && placements[0].is_square() {
            if let Some(square) = self.square(rect) {
                self.own.add(square.centre, square.even, &mut self.guesses[0]);
            }
            return Ok(());
        }
        for (k, placement) in placements.iter().enumerate() {
            if self.tiles.len() > MOST_TILES {
                break;
            }
            if let Some(square) = placement.apply_rect(rect).and_then(|r| self.square(&r)) {
                self.tiles.add(square.centre, square.even, &mut self.guesses[k]);
            }
        }
        Ok(())
    }
}
