//! The cells of a drawing: one for what is drawn outside of blocks, one for each block, and more for blocks that take over the layer
//! on which they are placed.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::io::Write;

use metalith_core::LayerNumber;

use super::affine::Affine;
use super::drawing::{Block, Drawing, Entity, Kind};
use super::join::{self, Chain};
use super::layers::Layers;
use super::records::{MOST_COPIES, Placed, Records};
use super::shapes::{Drawn, Fields, Insert, drawn};
use super::{Failure, Fault, PER_BYTE, Remarks, SHORT_DRAWING};

/// Name of the cell of what is drawn outside of blocks.
const TOP: &[u8] = b"TOP";

/// Layer of entities in blocks that are on the layer on which the block is placed.
const TAKEN_OVER: &[u8] = b"0";

/// Blocks in blocks that are stretched: followed so deep.
const DEEPEST: usize = 64;

/// Bytes that an entity counts for at least.
const LEAST: u64 = 32;

/// Largest distance of a step of an array from the grid (database units).
const ON_GRID: f64 = 1e-6;

/// A block as one cell, on the layer that its entities on layer 0 take over.
type Variant = (usize, Option<LayerNumber>);

struct Cells<'d, W> {
    drawing: &'d Drawing<'d>,
    layers: &'d Layers,
    unit_nm: f64,
    records: Records<W>,
    /// Bytes of all that was done, and most of them.
    spent: u64,
    most: u64,
    remarks: &'d mut Remarks,
    /// Blocks that take over a layer, they or one that they place.
    takes_over: Vec<bool>,
    names: HashMap<Variant, Vec<u8>>,
    used_names: HashSet<Vec<u8>>,
    waiting: Vec<Variant>,
}

/// Where entities are drawn.
#[derive(Clone, Copy)]
struct Frame {
    to_nm: Affine,
    /// Layer that those on layer 0 take over.
    over: Option<LayerNumber>,
    depth: usize,
}

/// Write all cells.
pub(super) fn write(
    drawing: &Drawing<'_>,
    layers: &Layers,
    unit_nm: f64,
    out: impl Write,
    remarks: &mut Remarks,
) -> Result<(), Failure> {
    let mut cells = Cells {
        drawing,
        layers,
        unit_nm,
        records: Records::new(out),
        spent: 0,
        most: SHORT_DRAWING + PER_BYTE * drawing.bytes.len() as u64,
        remarks,
        takes_over: taking_over(drawing)?,
        names: HashMap::new(),
        used_names: HashSet::new(),
        waiting: Vec::new(),
    };
    cells.records.begin()?;
    let top = cells.unused(TOP);
    let unit = Affine::scale([unit_nm; 2]);
    cells.cell(&top, &drawing.model, Frame::new(unit, None))?;
    while let Some((block, over)) = cells.waiting.pop() {
        let name = cells.names[&(block, over)].clone();
        let Block { base, entities, .. } = &drawing.blocks[block];
        let frame = Frame::new(unit.of(&Affine::shift(base.map(|v| -v))), over);
        cells.cell(&name, entities, frame)?;
    }
    Ok(cells.records.end()?)
}

/// Which blocks have entities on layer 0, they or one that they place on it.
fn taking_over(drawing: &Drawing<'_>) -> Result<Vec<bool>, Fault> {
    let mut takes = vec![false; drawing.blocks.len()];
    // Blocks that each block is placed in, on layer 0.
    let mut placed_in: Vec<Vec<usize>> = vec![Vec::new(); drawing.blocks.len()];
    let mut next = Vec::new();
    for (k, block) in drawing.blocks.iter().enumerate() {
        for entity in &block.entities {
            let pairs = drawing.pairs(entity)?;
            let fields = Fields { pairs: &pairs };
            if fields.text(8).unwrap_or(TAKEN_OVER) != TAKEN_OVER {
                continue;
            }
            if entity.kind == Kind::Insert {
                placed_in[k].extend(fields.text(2).and_then(|name| drawing.block(name)));
            } else if !takes[k] {
                takes[k] = true;
                next.push(k);
            }
        }
    }
    let mut holders = vec![Vec::new(); placed_in.len()];
    for (holder, inner) in placed_in.iter().enumerate() {
        inner.iter().for_each(|inner| holders[*inner].push(holder));
    }
    while let Some(block) = next.pop() {
        for &holder in &holders[block] {
            if !std::mem::replace(&mut takes[holder], true) {
                next.push(holder);
            }
        }
    }
    Ok(takes)
}

impl Frame {
    fn new(to_nm: Affine, over: Option<LayerNumber>) -> Self {
        Self { to_nm, over, depth: 0 }
    }
}

/// A place on the grid of nanometres.
fn grid(place: [f64; 2], line: u64) -> Result<[i32; 2], Fault> {
    let most = f64::from(i32::MAX);
    let what = "a coordinate beyond 2.1 m, the end of GDSII in nanometres";
    if place.iter().all(|v| v.abs() <= most) {
        Ok(place.map(|v| v.round() as i32))
    } else {
        Err(Fault { line, what })
    }
}

impl<W: Write> Cells<'_, W> {
    fn spend(&mut self, bytes: u64, line: u64) -> Result<(), Fault> {
        self.spent += bytes;
        if self.spent > self.most {
            let what = "the drawing grows out of proportion: blocks in blocks multiply";
            return Err(Fault { line, what });
        }
        Ok(())
    }

    /// A name that no cell has: this one, or with a number behind it.
    fn unused(&mut self, name: &[u8]) -> Vec<u8> {
        let mut own = name.to_vec();
        let mut k = 0;
        while !self.used_names.insert(own.clone()) {
            k += 1;
            own = [name, b"$", k.to_string().as_bytes()].concat();
        }
        own
    }

    fn cell(&mut self, name: &[u8], entities: &[Entity], frame: Frame) -> Result<(), Failure> {
        self.records.begin_cell(name)?;
        let mut open = BTreeMap::new();
        self.draw(entities, frame, &mut open)?;
        for (layer, chains) in open {
            let (outlines, left) = join::closed(chains);
            for mut outline in outlines {
                self.polygon(layer, &mut outline, 0)?;
            }
            left.iter()
                .for_each(|chain| self.remarks.leave_out("open lines without width", chain.line));
        }
        Ok(self.records.end_cell()?)
    }

    fn draw(
        &mut self,
        entities: &[Entity],
        frame: Frame,
        open: &mut BTreeMap<LayerNumber, Vec<Chain>>,
    ) -> Result<(), Failure> {
        let unit = frame.to_nm.factor();
        for entity in entities {
            let line = entity.line();
            let before = self.records.bytes;
            let pairs = self.drawing.pairs(entity)?;
            let fields = Fields { pairs: &pairs };
            let name = fields.text(8).unwrap_or(TAKEN_OVER);
            let layer = match frame.over {
                Some(over) if name == TAKEN_OVER => over,
                _ => self.layers.number(name),
            };
            // Lines and ellipses have coordinates of the drawing.
            let own_plane = !matches!(entity.kind, Kind::Line | Kind::Ellipse | Kind::Face);
            let to_nm = if own_plane {
                frame.to_nm.of(&fields.plane()?)
            } else {
                frame.to_nm
            };
            let onto = |points: &[[f64; 2]]| -> Result<Vec<[i32; 2]>, Fault> {
                points.iter().map(|p| grid(to_nm.at(*p), line)).collect()
            };
            match drawn(entity, &fields, unit)? {
                Drawn::Polygon(points) => self.polygon(layer, &mut onto(&points)?, line)?,
                Drawn::Polygons(all) => {
                    for points in all {
                        self.polygon(layer, &mut onto(&points)?, line)?;
                    }
                }
                Drawn::Open(points) if !points.is_empty() => {
                    let mut points = onto(&points)?;
                    points.dedup();
                    self.spend(8 * points.len() as u64, line)?;
                    if points.len() > 1 {
                        open.entry(layer).or_default().push(Chain { points, line });
                    }
                }
                Drawn::Path { points, width } if points.len() > 1 => {
                    let width = grid([width * unit, 0.0], line)?[0];
                    self.records.path(layer, width, &onto(&points)?)?;
                }
                Drawn::Label { at, text } => self.records.label(layer, grid(to_nm.at(at), line)?, &cut(text))?,
                Drawn::Insert(insert) => {
                    let frame = Frame { to_nm, ..frame };
                    self.insert(&insert, layer, frame, line, open)?;
                }
                Drawn::Unread(what) => self.remarks.leave_out(what, line),
                Drawn::Open(_) | Drawn::Path { .. } => {}
            }
            self.spend((self.records.bytes - before).max(LEAST), line)?;
        }
        Ok(())
    }

    fn polygon(&mut self, layer: LayerNumber, corners: &mut Vec<[i32; 2]>, line: u64) -> Result<(), Failure> {
        corners.dedup();
        while corners.len() > 1 && corners.first() == corners.last() {
            corners.pop();
        }
        if corners.len() < 3 {
            self.remarks.leave_out("outlines smaller than the grid of 1 nm", line);
            return Ok(());
        }
        Ok(self.records.polygon(layer, corners)?)
    }

    fn insert(
        &mut self,
        insert: &Insert<'_>,
        layer: LayerNumber,
        frame: Frame,
        line: u64,
        open: &mut BTreeMap<LayerNumber, Vec<Chain>>,
    ) -> Result<(), Failure> {
        let Some(block) = self.drawing.block(insert.name) else {
            self.remarks
                .leave_out("references to blocks that are not in the drawing", line);
            return Ok(());
        };
        let turned = frame
            .to_nm
            .of(&Affine::shift(insert.at))
            .of(&Affine::turn(insert.turn_deg));
        let steps = [[insert.spacing[0], 0.0], [0.0, insert.spacing[1]]].map(|s| turned.along(s));
        let placed = turned.of(&Affine::scale(insert.scale));
        let over = self.takes_over[block].then_some(layer);
        // In cells units are nanometres already.
        let in_nm = placed.of(&Affine::scale([1.0 / self.unit_nm; 2]));
        let Some((mirrored, magnification, angle_deg)) = in_nm.similarity() else {
            return self.stretched(
                insert,
                (block, over),
                Frame { to_nm: placed, ..frame },
                steps,
                line,
                open,
            );
        };
        let mut reference = Placed {
            cell: &self.name_of((block, over)),
            mirrored,
            magnification,
            angle_deg,
            copies: insert.copies,
            places: &[],
        };
        let first = placed.at([0.0, 0.0]);
        let [columns, rows] = insert.copies;
        let on_grid = steps.iter().flatten().all(|v| (v - v.round()).abs() <= ON_GRID);
        if columns * rows > 1 && on_grid && columns <= MOST_COPIES && rows <= MOST_COPIES {
            let far = |k: usize| {
                let count = f64::from(insert.copies[k]);
                grid(
                    [0, 1].map(|axis| first[axis].round() + count * steps[k][axis].round()),
                    line,
                )
            };
            let places = [grid(first, line)?, far(0)?, far(1)?];
            reference.places = &places;
            return Ok(self.records.reference(&reference)?);
        }
        // An array off the grid: each copy at its own place.
        for copy in 0..u64::from(columns) * u64::from(rows) {
            let by = step(steps, copy, insert.copies);
            let place = [grid([first[0] + by[0], first[1] + by[1]], line)?];
            self.spend(LEAST, line)?;
            let reference = Placed {
                places: &place,
                ..reference
            };
            self.records.reference(&reference)?;
        }
        Ok(())
    }

    /// Draw the entities of a block that is stretched along one axis, which no reference can, where it is placed.
    fn stretched(
        &mut self,
        insert: &Insert<'_>,
        (block, over): Variant,
        frame: Frame,
        steps: [[f64; 2]; 2],
        line: u64,
        open: &mut BTreeMap<LayerNumber, Vec<Chain>>,
    ) -> Result<(), Failure> {
        if frame.depth == DEEPEST {
            let what = "stretched blocks in blocks, too deep or round in a circle";
            return Err(Fault { line, what }.into());
        }
        let drawing = self.drawing;
        let Block { base, entities, .. } = &drawing.blocks[block];
        let placed = frame.to_nm.of(&Affine::shift(base.map(|v| -v)));
        for copy in 0..u64::from(insert.copies[0]) * u64::from(insert.copies[1]) {
            self.spend(LEAST, line)?;
            let frame = Frame {
                to_nm: Affine::shift(step(steps, copy, insert.copies)).of(&placed),
                over,
                depth: frame.depth + 1,
            };
            self.draw(entities, frame, open)?;
        }
        Ok(())
    }

    /// Name of the cell of a block, which is written once.
    fn name_of(&mut self, variant: Variant) -> Vec<u8> {
        if let Some(name) = self.names.get(&variant) {
            return name.clone();
        }
        let drawing = self.drawing;
        let name = match &drawing.blocks[variant.0].name[..] {
            [] => b"BLOCK",
            name => name,
        };
        let name = self.unused(name);
        self.names.insert(variant, name.clone());
        self.waiting.push(variant);
        name
    }
}

/// Shift of a copy of an array.
fn step(steps: [[f64; 2]; 2], copy: u64, copies: [u32; 2]) -> [f64; 2] {
    let (column, row) = (copy % u64::from(copies[0]), copy / u64::from(copies[0]));
    [0, 1].map(|k| column as f64 * steps[0][k] + row as f64 * steps[1][k])
}

/// A text without what a record has no room for.
fn cut(mut text: Vec<u8>) -> Vec<u8> {
    /// Bytes of a text that all readers of GDSII take.
    const LONGEST: usize = 512;
    text.truncate(LONGEST);
    text
}
