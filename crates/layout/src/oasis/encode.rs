//! The pillars of one cell as compressed blocks, made side by side.

use std::ops::Range;

use metalith_core::{LayerNumber, Progress, Result};
use metalith_design::array::{DomainPart, SymmetryGroup};
use metalith_oasis::{CellBounds, CompressedBlock, Placing, RecordBuffer, Repetition};
use metalith_pillars::{PillarRows, RowExtent};
use rayon::prelude::*;

use super::super::pillar_form::PillarForm;
use super::pieces::PiecesOf;
use super::ring_order;

/// Bytes of records that are compressed together: smaller blocks cost size, larger ones memory.
const BLOCK_BYTES: usize = 4 << 20;
/// Columns of a strip: a step of up to 31 columns is one byte in a list.
const STRIP: usize = 32;
/// Pieces that are encoded side by side before they are written in order.
const SIDE_BY_SIDE: usize = 8;

/// Pieces for each one that is encoded to see how small it gets; of the part that many symmetries leave, which is in few
/// pieces, half as many.
const SAMPLE: usize = 6;

/// Encoding of the pillars of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PillarEncoding {
    /// Lists of places in strips.
    Lists(StripsOf),
    /// The outline of each.
    Outlines,
    /// A reference for each, to cells of one width.
    References,
}

/// Direction of strips: columns or rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum StripsOf {
    /// Columns, gone through row by row.
    Columns,
    /// Rows, gone through column by column.
    Rows,
}

impl StripsOf {
    /// Direction that takes fewer bytes: columns, but where symmetries exchange the axes, and the part that they leave
    /// unique is wide at the bottom; rows then save 22 % of an octant and 1 % of a half.
    fn of(group: &SymmetryGroup) -> Self {
        if group.members().iter().any(|s| !s.quarter_turns.is_multiple_of(2)) {
            Self::Rows
        } else {
            Self::Columns
        }
    }
}

impl PillarEncoding {
    /// Bytes of the records of a pillar, about.
    fn bytes_of_pillar(self) -> u64 {
        match self {
            Self::Lists(_) => 2,
            Self::Outlines | Self::References => 6,
        }
    }

    /// Pieces that are encoded by themselves: strips, or sectors.
    fn pieces(self, n: usize) -> usize {
        match self {
            Self::Lists(_) => n.div_ceil(STRIP),
            _ => ring_order::SECTORS,
        }
    }
}

/// Pillars of an element, those that its symmetries leave unique, in a cell for each part of them.
pub(super) struct ElementPillars<'a> {
    pub widths: &'a dyn PillarRows,
    group: &'a SymmetryGroup,
    parts: &'a [DomainPart],
    /// Columns of each part in each row.
    runs: Vec<Vec<[Range<usize>; 2]>>,
    layer: LayerNumber,
    form: PillarForm,
    /// Number of the cell of each width, for references.
    pub width_cells: Vec<u64>,
    /// Level of compression, 1 to 9.
    level: u32,
}

/// Blocks of a cell and the box around its pillars.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Encoded {
    pub blocks: Vec<CompressedBlock>,
    pub bounds: [i64; 4],
    pub pillars: u64,
}

impl Encoded {
    pub(crate) const EMPTY: Self = Self {
        blocks: Vec::new(),
        bounds: NOTHING,
        pillars: 0,
    };

    fn append(&mut self, mut other: Self) {
        self.blocks.append(&mut other.blocks);
        self.bounds = unite(self.bounds, other.bounds);
        self.pillars += other.pillars;
    }
}

/// A box around nothing.
pub(super) const NOTHING: [i64; 4] = [i64::MAX, i64::MAX, i64::MIN, i64::MIN];

/// A box around two.
pub(super) fn unite(a: [i64; 4], b: [i64; 4]) -> [i64; 4] {
    [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])]
}

/// A box as the file has it.
pub(super) fn bounds_of(corners: [i64; 4]) -> CellBounds {
    if corners[0] > corners[2] {
        CellBounds::Empty
    } else {
        CellBounds::Box(corners)
    }
}

impl<'a> ElementPillars<'a> {
    pub(crate) fn new(
        widths: &'a dyn PillarRows,
        group: &'a SymmetryGroup,
        parts: &'a [DomainPart],
        layer: LayerNumber,
        form: PillarForm,
        level: u32,
    ) -> Self {
        let n = widths.lattice().sites();
        let runs = |part| (0..n).map(|iy| group.runs(part, n, iy)).collect();
        Self {
            widths,
            group,
            parts,
            runs: parts.iter().map(runs).collect(),
            layer,
            form,
            width_cells: Vec::new(),
            level,
        }
    }

    /// Lists in the strips that suit its symmetries.
    pub(crate) fn lists(&self) -> PillarEncoding {
        PillarEncoding::Lists(StripsOf::of(self.group))
    }

    /// True if the element is more than a mirror image of itself.
    pub(crate) fn has_many_symmetries(&self) -> bool {
        self.group.members().len() > 2
    }

    /// True if there is no pillar.
    pub(crate) fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// The cell with most pillars: its blocks are not held.
    pub(crate) fn largest(&self) -> usize {
        (0..self.parts.len())
            .max_by_key(|&k| self.parts[k].pillars)
            .unwrap_or(0)
    }

    /// Encode all pillars, but those that were kept as pieces of this element; blocks of the largest cell are handed to `put` in
    /// order, those of the others returned.
    pub(crate) fn encode(
        &self,
        encoding: PillarEncoding,
        (pieces_of, element): (PiecesOf<'_>, usize),
        progress: &dyn Progress,
        mut put: impl FnMut(&CompressedBlock) -> Result<()>,
    ) -> Result<Vec<Encoded>> {
        let pieces = encoding.pieces(self.widths.lattice().sites());
        let bytes = self
            .parts
            .iter()
            .map(|part| part.pillars)
            .sum::<u64>()
            .saturating_mul(encoding.bytes_of_pillar());
        let groups = (bytes.div_ceil(BLOCK_BYTES as u64) as usize).clamp(1, pieces);
        let ranges: Vec<Range<usize>> = (0..groups)
            .map(|k| k * pieces / groups..(k + 1) * pieces / groups)
            .collect();
        let (largest, rings) = (self.largest(), self.rings(encoding));
        let mut cells: Vec<Encoded> = self.parts.iter().map(|_| Encoded::EMPTY).collect();
        for (number, batch) in ranges.chunks(SIDE_BY_SIDE).enumerate() {
            progress.check_stopped()?;
            let encode = || {
                let encoded: Vec<Vec<Encoded>> = batch
                    .par_iter()
                    .map(|range| self.pieces(encoding, rings, range.clone()))
                    .collect();
                let mut parts: Vec<Encoded> = self.parts.iter().map(|_| Encoded::EMPTY).collect();
                for (part, more) in encoded.into_iter().flat_map(|piece| piece.into_iter().enumerate()) {
                    parts[part].append(more);
                }
                parts
            };
            for (k, part) in pieces_of
                .piece([element, number], encode, progress)?
                .into_iter()
                .enumerate()
            {
                progress.advance(part.pillars);
                cells[k].append(part);
            }
            cells[largest].blocks.iter().try_for_each(&mut put)?;
            cells[largest].blocks.clear();
        }
        Ok(cells)
    }

    /// Rings that hold all pillars; none for strips.
    fn rings(&self, encoding: PillarEncoding) -> i64 {
        if matches!(encoding, PillarEncoding::Lists(_)) {
            return 0;
        }
        let n = self.widths.lattice().sites();
        let mut room = Vec::new();
        let extents = (0..n).map(|iy| {
            let runs = self.runs.iter().flat_map(|rows| rows[iy].clone());
            runs.fold(None, |extent: Option<(usize, usize)>, run| {
                let Some(RowExtent { first, last, .. }) = self.widths.extent(iy, run, &mut room) else {
                    return extent;
                };
                Some(extent.map_or((first, last), |(l, r)| (l.min(first), r.max(last))))
            })
        });
        ring_order::rings_of(n, extents)
    }

    /// Bytes of a pillar, from some pieces; none if no pillar is in them.
    pub(crate) fn bytes_of_sample(&self, encoding: PillarEncoding) -> Option<f64> {
        let every = if self.has_many_symmetries() { SAMPLE / 2 } else { SAMPLE };
        let pieces: Vec<usize> = (every / 3..encoding.pieces(self.widths.lattice().sites()))
            .step_by(every)
            .collect();
        let rings = self.rings(encoding);
        let encoded: Vec<Encoded> = pieces
            .par_iter()
            .flat_map_iter(|&k| self.pieces(encoding, rings, k..k + 1))
            .collect();
        let pillars: u64 = encoded.iter().map(|e| e.pillars).sum();
        let length: usize = encoded
            .iter()
            .flat_map(|e| &e.blocks)
            .map(CompressedBlock::length)
            .sum();
        (pillars > 0).then(|| length as f64 / pillars as f64)
    }

    /// Encode some pieces of all cells.
    fn pieces(&self, encoding: PillarEncoding, rings: i64, range: Range<usize>) -> Vec<Encoded> {
        let mut out: Vec<Packer> = self.parts.iter().map(|_| Packer::new(self.level)).collect();
        for piece in range {
            match encoding {
                PillarEncoding::Lists(StripsOf::Columns) => self.columns(piece, &mut out),
                PillarEncoding::Lists(StripsOf::Rows) => self.rows(piece, &mut out),
                _ => self.sector(encoding, piece, rings, &mut out),
            }
        }
        out.into_iter().map(Packer::finish).collect()
    }

    /// Pillars of a strip of columns, a list for each width, rows from below.
    fn columns(&self, strip: usize, out: &mut [Packer]) {
        let n = self.widths.lattice().sites();
        let columns = strip * STRIP..((strip + 1) * STRIP).min(n);
        let mut room = Vec::new();
        for (packer, rows) in out.iter_mut().zip(&self.runs) {
            for (iy, run) in rows
                .iter()
                .enumerate()
                .flat_map(|(iy, runs)| runs.iter().map(move |r| (iy, r)))
            {
                let run = run.start.max(columns.start)..run.end.min(columns.end);
                if run.is_empty() {
                    continue;
                }
                let row = self.widths.row(iy, run.clone(), &mut room);
                for (ix, &width) in run.zip(row).filter(|(_, w)| **w != 0) {
                    packer.list(ix, iy, width);
                }
            }
            self.put_lists(packer);
        }
    }

    /// Pillars of a strip of rows, a list for each width, columns from the left.
    fn rows(&self, strip: usize, out: &mut [Packer]) {
        let n = self.widths.lattice().sites();
        let rows = strip * STRIP..((strip + 1) * STRIP).min(n);
        let (mut room, mut turned) = (Vec::new(), vec![0; n * STRIP]);
        for (packer, runs) in out.iter_mut().zip(&self.runs) {
            turned.fill(0);
            for (k, runs) in runs[rows.clone()].iter().enumerate() {
                for run in runs.iter().filter(|run| !run.is_empty()) {
                    let row = self.widths.row(rows.start + k, run.clone(), &mut room);
                    for (ix, &width) in run.clone().zip(row) {
                        turned[ix * STRIP + k] = width;
                    }
                }
            }
            for (place, &width) in turned.iter().enumerate().filter(|(_, w)| **w != 0) {
                packer.list(place / STRIP, rows.start + place % STRIP, width);
            }
            self.put_lists(packer);
        }
    }

    /// Write the lists of a strip and empty them.
    fn put_lists(&self, out: &mut Packer) {
        let lattice = self.widths.lattice();
        let at = |ix: i32, iy: i32| [lattice.place_units(0, ix as usize), lattice.place_units(1, iy as usize)];
        let grid = lattice.grid_step();
        for width in 1..out.lists.len() {
            let mut places = std::mem::take(&mut out.lists[width]);
            let Some(&first) = places.first() else {
                continue;
            };
            let side = self.form.edge(width as u16);
            let corners = places.iter().fold([first; 2], |[low, high], p| {
                [
                    [low[0].min(p[0]), low[1].min(p[1])],
                    [high[0].max(p[0]), high[1].max(p[1])],
                ]
            });
            for [x, y] in corners {
                out.include(at(x, y), self.form.reach(width as u16));
            }
            let count = places.len() as u64;
            places.remove(0);
            let from = at(first[0], first[1]);
            places.iter_mut().for_each(|p| {
                *p = if grid.is_some() {
                    [p[0] - first[0], p[1] - first[1]]
                } else {
                    // No number of units but 1 divides all distances in general.
                    let place = at(p[0], p[1]);
                    [0, 1].map(|axis| (place[axis] - from[axis]) as i32)
                };
            });
            let grid = grid.unwrap_or(1);
            let list = Repetition::List { grid, places };
            let (centre, copies) = (at(first[0], first[1]), (count > 1).then_some(&list));
            if self.form.is_square() {
                let corner = centre.map(|c| c - side / 2);
                out.records.rectangle(self.layer(), corner, [side; 2], copies);
            } else {
                let cell = self.width_cells[width];
                out.records.placement(cell, centre, &Placing::PLAIN, copies);
            }
            out.written(count);
            if let Repetition::List { mut places, .. } = list {
                places.clear();
                out.lists[width] = places;
            }
        }
    }

    /// Pillars of a sector, one record each, ring by ring.
    fn sector(&self, encoding: PillarEncoding, sector: usize, rings: i64, out: &mut [Packer]) {
        let lattice = self.widths.lattice();
        // Outlines that are no squares, by width: made once a sector.
        let mut corners: Vec<Vec<[i64; 2]>> = Vec::new();
        ring_order::walk(lattice.sites(), sector, rings, |ix, iy| {
            if let Some(part) = self.group.part_of(self.parts, lattice.sites(), ix, iy)
                && let width = self.widths.number(ix, iy)
                && width != 0
            {
                let out = &mut out[part];
                let centre = [lattice.place_units(0, ix), lattice.place_units(1, iy)];
                let side = self.form.edge(width);
                if encoding == PillarEncoding::References {
                    let cell = self.width_cells[usize::from(width)];
                    out.records.placement(cell, centre, &Placing::PLAIN, None);
                } else if self.form.is_square() {
                    out.records
                        .rectangle(self.layer(), centre.map(|c| c - side / 2), [side; 2], None);
                } else {
                    if corners.len() <= usize::from(width) {
                        corners.resize(usize::from(width) + 1, Vec::new());
                    }
                    let own = &mut corners[usize::from(width)];
                    if own.is_empty() {
                        own.extend(self.form.corners(width).iter().map(|&(x, y)| [x, y]));
                    }
                    let placed: Vec<[i64; 2]> = own.iter().map(|[x, y]| [centre[0] + x, centre[1] + y]).collect();
                    out.records.polygon(self.layer(), &placed, None);
                }
                out.include(centre, self.form.reach(width));
                out.written(1);
            }
        });
    }

    fn layer(&self) -> [u32; 2] {
        [self.layer.layer.into(), self.layer.datatype.into()]
    }
}

/// Records that become blocks as they fill up.
struct Packer {
    records: RecordBuffer,
    level: u32,
    encoded: Encoded,
    /// Places of each width in a strip: memory that is asked for once.
    lists: Vec<Vec<[i32; 2]>>,
}

impl Packer {
    fn new(level: u32) -> Self {
        Self {
            records: RecordBuffer::relative(),
            level,
            encoded: Encoded::EMPTY,
            lists: Vec::new(),
        }
    }

    #[inline]
    fn include(&mut self, centre: [i64; 2], reach: (i64, i64)) {
        let ([x, y], (rx, ry)) = (centre, reach);
        self.encoded.bounds = unite(self.encoded.bounds, [x - rx, y - ry, x + rx, y + ry]);
    }

    /// A pillar of a strip.
    #[inline]
    fn list(&mut self, ix: usize, iy: usize, width: u16) {
        let width = usize::from(width);
        if width >= self.lists.len() {
            self.lists.resize(width + 1, Vec::new());
        }
        self.lists[width].push([ix as i32, iy as i32]);
    }

    /// Counts so many pillars more in the records.
    #[inline]
    fn written(&mut self, pillars: u64) {
        self.encoded.pillars += pillars;
        if self.records.bytes().len() >= BLOCK_BYTES {
            self.flush();
        }
    }

    fn finish(mut self) -> Encoded {
        self.flush();
        self.encoded
    }

    fn flush(&mut self) {
        if !self.records.bytes().is_empty() {
            self.encoded
                .blocks
                .push(CompressedBlock::of(self.records.bytes(), self.level));
            self.records.clear();
        }
    }
}
