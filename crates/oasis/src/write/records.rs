//! Elements of a cell as records, without what the record before said already.

use crate::number::{put_real, put_signed, put_step, put_unsigned};
use crate::record::{info, kind, placed};
use crate::repetition::Repetition;

/// Placement of a cell: mirrored at the x axis, then magnified, then turned counter-clockwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placing {
    pub mirrored: bool,
    pub magnification: f64,
    pub angle_deg: f64,
}

impl Placing {
    /// Placement without change: as drawn.
    pub const PLAIN: Self = Self {
        mirrored: false,
        magnification: 1.0,
        angle_deg: 0.0,
    };

    /// Quarter turns, if that is all.
    fn quarters(&self) -> Option<u8> {
        let quarters = self.angle_deg / 90.0;
        (self.magnification == 1.0 && quarters.fract() == 0.0).then(|| quarters.rem_euclid(4.0) as u8)
    }
}

/// Pair of coordinates that an element moves.
#[derive(Clone, Copy)]
enum Pair {
    Placement = 0,
    Geometry = 1,
    Text = 2,
}

#[derive(Clone, Copy, Debug, Default)]
struct ModalState {
    relative: Option<bool>,
    at: [Option<[i64; 2]>; 3],
    layer: Option<u32>,
    datatype: Option<u32>,
    text_layer: Option<u32>,
    text_type: Option<u32>,
    width: Option<i64>,
    height: Option<i64>,
    half_width: Option<i64>,
    extensions: [Option<i64>; 2],
    radius: Option<i64>,
    cell: Option<u64>,
    text: Option<u64>,
}

/// Records of one cell. A buffer relies on nothing before it, so that buffers are filled side by side and written in
/// order. Places are those of the cell in grid steps, at most 2^31 from its origin.
#[derive(Clone, Debug, Default)]
pub struct RecordBuffer {
    bytes: Vec<u8>,
    known: ModalState,
    /// True if places are written as steps from the one before.
    relative: bool,
}

impl RecordBuffer {
    /// A buffer that writes places as they are: best where neighbours in the buffer are no neighbours in the plane.
    pub fn absolute() -> Self {
        Self::default()
    }

    /// A buffer that writes places as steps from the place before.
    pub fn relative() -> Self {
        Self {
            relative: true,
            ..Self::default()
        }
    }

    /// The records so far.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Begin again, keeping the memory.
    pub fn clear(&mut self) {
        self.bytes.clear();
        self.known = ModalState::default();
    }

    /// Steps or places: what this element needs, switching if need be.
    #[inline]
    fn mode(&mut self, pair: Pair) {
        // A step needs a place that it is taken from.
        let wanted = self.relative && self.known.at[pair as usize].is_some();
        if self.known.relative != Some(wanted) {
            self.bytes
                .push(if wanted { kind::XYRELATIVE } else { kind::XYABSOLUTE });
            self.known.relative = Some(wanted);
        }
    }

    /// Coordinates that must be written, of the pair.
    #[inline]
    fn moved(&self, pair: Pair, at: [i64; 2]) -> [bool; 2] {
        match self.known.at[pair as usize] {
            Some(before) => [before[0] != at[0], before[1] != at[1]],
            None => [true; 2],
        }
    }

    #[inline]
    fn put_place(&mut self, pair: Pair, at: [i64; 2], repetition: Option<&Repetition>) {
        let moved = self.moved(pair, at);
        let from = match (self.known.relative, self.known.at[pair as usize]) {
            (Some(true), Some(before)) => before,
            _ => [0; 2],
        };
        for axis in 0..2 {
            if moved[axis] {
                put_signed(&mut self.bytes, at[axis] - from[axis]);
            }
        }
        self.known.at[pair as usize] = Some(at);
        if let Some(repetition) = repetition {
            repetition.put(&mut self.bytes);
        }
    }

    /// Bits of layer, place and repetition of an area.
    #[inline]
    fn area_bits(&self, layer: [u32; 2], at: [i64; 2], repetition: Option<&Repetition>) -> u8 {
        let [x, y] = self.moved(Pair::Geometry, at);
        bit(self.known.layer != Some(layer[0]), info::LAYER)
            | bit(self.known.datatype != Some(layer[1]), info::DATATYPE)
            | bit(x, info::X)
            | bit(y, info::Y)
            | bit(repetition.is_some(), info::REPETITION)
    }

    #[inline]
    fn put_layer(&mut self, layer: [u32; 2], bits: u8) {
        if bits & info::LAYER != 0 {
            put_unsigned(&mut self.bytes, layer[0].into());
        }
        if bits & info::DATATYPE != 0 {
            put_unsigned(&mut self.bytes, layer[1].into());
        }
        (self.known.layer, self.known.datatype) = (Some(layer[0]), Some(layer[1]));
    }

    /// A rectangle with its lower left corner at a place.
    #[inline]
    pub fn rectangle(&mut self, layer: [u32; 2], at: [i64; 2], size: [i64; 2], repetition: Option<&Repetition>) {
        let repetition = some(repetition);
        self.mode(Pair::Geometry);
        let square = size[0] == size[1];
        let width = self.known.width != Some(size[0]);
        let height = !square && self.known.height != Some(size[1]);
        let bits = self.area_bits(layer, at, repetition)
            | bit(square, info::FIRST)
            | bit(width, info::WIDTH)
            | bit(height, info::HEIGHT);
        self.bytes.extend([kind::RECTANGLE, bits]);
        self.put_layer(layer, bits);
        if width {
            put_unsigned(&mut self.bytes, size[0].unsigned_abs());
        }
        if height {
            put_unsigned(&mut self.bytes, size[1].unsigned_abs());
        }
        (self.known.width, self.known.height) = (Some(size[0]), Some(size[1]));
        self.put_place(Pair::Geometry, at, repetition);
    }

    /// A polygon of at least three corners, the first not repeated.
    pub fn polygon(&mut self, layer: [u32; 2], corners: &[[i64; 2]], repetition: Option<&Repetition>) {
        let repetition = some(repetition);
        let at = corners[0];
        self.mode(Pair::Geometry);
        let bits = self.area_bits(layer, at, repetition) | info::HEIGHT;
        self.bytes.extend([kind::POLYGON, bits]);
        self.put_layer(layer, bits);
        self.put_corners(corners);
        self.put_place(Pair::Geometry, at, repetition);
    }

    /// The list of a polygon: one number an edge if edges are level and upright in turn.
    fn put_corners(&mut self, corners: &[[i64; 2]]) {
        let n = corners.len();
        let edge = |k: usize| {
            let (a, b) = (corners[k], corners[(k + 1) % n]);
            [b[0] - a[0], b[1] - a[1]]
        };
        for first in 0..2 {
            // Edge k keeps the coordinate that it must keep; lists have an even number of points.
            let keeps = |k: usize| edge(k)[(k + first + 1) % 2] == 0;
            if n >= 4 && n.is_multiple_of(2) && (0..n).all(keeps) {
                self.bytes.push(first as u8);
                put_unsigned(&mut self.bytes, n as u64 - 2);
                for k in 0..n - 2 {
                    put_signed(&mut self.bytes, edge(k)[(k + first) % 2]);
                }
                return;
            }
        }
        self.bytes.push(4);
        put_unsigned(&mut self.bytes, n as u64 - 1);
        for k in 0..n - 1 {
            let [x, y] = edge(k);
            put_step(&mut self.bytes, x, y);
        }
    }

    /// A pen of twice `half_width` drawn along a line of at least two points, longer than it by `extensions`.
    pub fn path(
        &mut self,
        layer: [u32; 2],
        half_width: i64,
        extensions: [i64; 2],
        line: &[[i64; 2]],
        repetition: Option<&Repetition>,
    ) {
        let repetition = some(repetition);
        let at = line[0];
        self.mode(Pair::Geometry);
        let wide = self.known.half_width != Some(half_width);
        let extended = self.known.extensions != extensions.map(Some);
        let bits =
            self.area_bits(layer, at, repetition) | bit(extended, info::FIRST) | bit(wide, info::WIDTH) | info::HEIGHT;
        self.bytes.extend([kind::PATH, bits]);
        self.put_layer(layer, bits);
        if wide {
            put_unsigned(&mut self.bytes, half_width.unsigned_abs());
        }
        if extended {
            let way = |e: i64| match e {
                0 => 1,
                e if e == half_width => 2,
                _ => 3,
            };
            put_unsigned(&mut self.bytes, way(extensions[0]) << 2 | way(extensions[1]));
            for e in extensions.into_iter().filter(|&e| way(e) == 3) {
                put_signed(&mut self.bytes, e);
            }
        }
        (self.known.half_width, self.known.extensions) = (Some(half_width), extensions.map(Some));
        self.bytes.push(4);
        put_unsigned(&mut self.bytes, line.len() as u64 - 1);
        for pair in line.windows(2) {
            put_step(&mut self.bytes, pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
        }
        self.put_place(Pair::Geometry, at, repetition);
    }

    /// A circle about a place. Other tools choose the polygon themselves.
    pub fn circle(&mut self, layer: [u32; 2], at: [i64; 2], radius: i64, repetition: Option<&Repetition>) {
        let repetition = some(repetition);
        self.mode(Pair::Geometry);
        let wide = self.known.radius != Some(radius);
        let bits = self.area_bits(layer, at, repetition) | bit(wide, info::HEIGHT);
        self.bytes.extend([kind::CIRCLE, bits]);
        self.put_layer(layer, bits);
        if wide {
            put_unsigned(&mut self.bytes, radius.unsigned_abs());
        }
        self.known.radius = Some(radius);
        self.put_place(Pair::Geometry, at, repetition);
    }

    /// A text, by its number from [`crate::OasisWriter::text_number`].
    pub fn text(&mut self, layer: [u32; 2], text: u64, at: [i64; 2], repetition: Option<&Repetition>) {
        let repetition = some(repetition);
        self.mode(Pair::Text);
        let [x, y] = self.moved(Pair::Text, at);
        let named = self.known.text != Some(text);
        let bits = bit(named, (placed::CELL | placed::NUMBER) >> 1)
            | bit(self.known.text_layer != Some(layer[0]), info::LAYER)
            | bit(self.known.text_type != Some(layer[1]), info::DATATYPE)
            | bit(x, info::X)
            | bit(y, info::Y)
            | bit(repetition.is_some(), info::REPETITION);
        self.bytes.extend([kind::TEXT, bits]);
        if named {
            put_unsigned(&mut self.bytes, text);
        }
        if bits & info::LAYER != 0 {
            put_unsigned(&mut self.bytes, layer[0].into());
        }
        if bits & info::DATATYPE != 0 {
            put_unsigned(&mut self.bytes, layer[1].into());
        }
        (self.known.text, self.known.text_layer, self.known.text_type) = (Some(text), Some(layer[0]), Some(layer[1]));
        self.put_place(Pair::Text, at, repetition);
    }

    /// A cell, by its number from [`crate::OasisWriter::cell_number`].
    #[inline]
    pub fn placement(&mut self, cell: u64, at: [i64; 2], placing: &Placing, repetition: Option<&Repetition>) {
        let repetition = some(repetition);
        self.mode(Pair::Placement);
        let [x, y] = self.moved(Pair::Placement, at);
        let named = self.known.cell != Some(cell);
        let mut bits = bit(named, placed::CELL | placed::NUMBER)
            | bit(x, placed::X)
            | bit(y, placed::Y)
            | bit(repetition.is_some(), placed::REPETITION)
            | bit(placing.mirrored, placed::FLIP);
        let quarters = placing.quarters();
        match quarters {
            Some(quarters) => bits |= quarters << 1,
            None => bits |= placed::MAGNIFICATION | placed::ANGLE,
        }
        let record = if quarters.is_some() {
            kind::PLACEMENT
        } else {
            kind::PLACEMENT_GENERAL
        };
        self.bytes.extend([record, bits]);
        if named {
            put_unsigned(&mut self.bytes, cell);
        }
        self.known.cell = Some(cell);
        if quarters.is_none() {
            put_real(&mut self.bytes, placing.magnification);
            put_real(&mut self.bytes, placing.angle_deg);
        }
        self.put_place(Pair::Placement, at, repetition);
    }
}

/// A repetition of one copy is none.
#[inline]
fn some(repetition: Option<&Repetition>) -> Option<&Repetition> {
    repetition.filter(|r| r.copies() > 1)
}

#[inline]
fn bit(condition: bool, bits: u8) -> u8 {
    if condition { bits } else { 0 }
}
