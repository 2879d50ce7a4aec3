//! Places of the shapes of one kind on a layout, tile by tile.

use super::sites::Scale;
use super::tiles::{COARSE, MOST_TILES, TileMap};
use crate::{Point, Rect, Transform};

/// A shape as it is looked for, in half steps of [`Scale::steps_per_nm`].
pub(super) struct Centre {
    pub at: Point,
    /// True if its edges are on the grid of whole steps where its centre is on the grid of half ones.
    pub even: bool,
}

impl Centre {
    /// Centre of the box around a shape, if it is near enough and on the grid.
    #[inline]
    pub(crate) fn of(r: &Rect, scale: Scale) -> Option<Self> {
        if !scale.reaches(r) {
            return None;
        }
        let even = r.width() % 2 == 0 && r.height() % 2 == 0;
        let at = Point::new(scale.whole_steps(r.x0 + r.x1)?, scale.whole_steps(r.y0 + r.y1)?);
        Some(Self { at, even })
    }
}

/// Places of an element that were found from rounded corners.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlaceFit {
    /// Middle of the lattice from the whole nanometre that is given as its centre, along x and y (nm).
    pub offset_nm: [f64; 2],
    /// Largest distance of a pillar from its site along an axis (nm); zero where places are exact.
    pub slack_nm: f64,
}

/// Occupied places of a layout.
pub(super) struct Places {
    scale: Scale,
    tiles: TileMap,
    /// Tiles of the current cell in its own coordinates, if it is placed more than once: each shape is visited once.
    own: TileMap,
    /// Placements of the current cell whose shapes are in `own`.
    placements: Vec<Transform>,
    /// Tile that each placement of the current cell met last.
    guesses: Vec<u32>,
    /// There are more tiles than are held.
    scattered: bool,
}

/// Bits of the side of a tile (half steps) that is two to the power of `bits` half nanometres, or less than twice that.
pub(super) fn bits_of_tiles(scale: Scale, bits: u32) -> u32 {
    let finer = (scale.steps_per_nm() as u64).next_power_of_two().trailing_zeros();
    (bits + finer).min(COARSE)
}

impl Places {
    /// Places by tiles whose side is two to the power of `bits` (half nm), or less than twice that; on fine grids
    /// as large as the numbers of places allow.
    pub(crate) fn new(scale: Scale, bits: u32) -> Self {
        let bits = bits_of_tiles(scale, bits);
        Self {
            scale,
            tiles: TileMap::new(bits),
            own: TileMap::new(bits),
            placements: Vec::new(),
            guesses: Vec::new(),
            scattered: false,
        }
    }

    /// The tiles, unless they are more than are held.
    pub(crate) fn finish(mut self) -> Option<TileMap> {
        self.place_own();
        (!self.scattered).then_some(self.tiles)
    }

    /// These places and those of other shapes.
    #[must_use]
    pub(crate) fn united(mut self, mut others: Self) -> Self {
        self.place_own();
        others.place_own();
        if self.tiles.bits() != others.tiles.bits() {
            self.coarsen();
            others.coarsen();
        }
        self.scattered |= others.scattered || !self.tiles.unite(&others.tiles);
        self
    }

    /// A cell with these placements begins.
    pub(crate) fn begin(&mut self, placements: &[Transform]) {
        self.place_own();
        self.placements.clear();
        if self.gathers(placements) {
            self.placements.extend_from_slice(placements);
        }
        self.guesses.clear();
        self.guesses.resize(placements.len().max(1), 0);
    }

    /// A shape of the current cell; `centre` says where it is in a placement, if it is looked for.
    #[inline]
    pub(crate) fn add(&mut self, placements: &[Transform], mut centre: impl FnMut(&Transform) -> Option<Centre>) {
        // A tile too many, and no more is looked for.
        self.limit(self.tiles.len().max(self.own.len()));
        if self.scattered {
            return;
        }
        // What comes with its own placements is turned by other than quarter turns.
        if !self.placements.is_empty() && placements[0].is_square() {
            if let Some(centre) = centre(&Transform::IDENTITY) {
                self.own.add(centre.at, centre.even, &mut self.guesses[0]);
            }
            return;
        }
        for (k, placement) in placements.iter().enumerate() {
            self.limit(self.tiles.len());
            if self.scattered {
                break;
            }
            if let Some(centre) = centre(placement) {
                self.tiles.add(centre.at, centre.even, &mut self.guesses[k]);
            }
        }
    }

    /// Make the tiles coarse if there are to be so many that no more are held; the shapes are scattered if they are coarse already.
    #[inline]
    fn limit(&mut self, tiles: usize) {
        if tiles > MOST_TILES {
            self.scattered |= self.tiles.bits() == COARSE;
            self.coarsen();
        }
    }

    #[cold]
    fn coarsen(&mut self) {
        if self.tiles.bits() < COARSE {
            self.tiles = self.tiles.coarser(COARSE);
            self.own = self.own.coarser(COARSE);
        }
    }

    /// True if the shapes of a cell with these placements are gathered in its own coordinates.
    fn gathers(&self, placements: &[Transform]) -> bool {
        let near = |t: &Transform| matches!(*t, Transform::Square { dx, dy, .. } if self.scale.reaches(&Rect::around(&[Point::new(dx, dy)])));
        placements.len() > 1 && self.scale.den == self.scale.steps_per_nm() && placements.iter().all(near)
    }

    /// Put the tiles of the last cell where it is placed.
    fn place_own(&mut self) {
        /// Tiles that a tile of a cell is placed on, at most.
        const SPREAD: usize = 4;
        if self.own.is_empty() {
            return;
        }
        for k in 0..self.placements.len() {
            if self.tiles.len() + SPREAD * self.own.len() > MOST_TILES {
                self.coarsen();
            }
            let placement = &self.placements[k];
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
}
