//! Cells as OASIS.

use std::path::Path;

use metalith_core::{Error, LayerNumber, Progress, Result};
use metalith_gds::{CellConsumer, CellItem, Layout, LayoutCell, Point, Rect, rectangle_of};
use metalith_oasis::{CellBounds, CompressedBlock, OasisWriter, Placing, RecordBuffer, Repetition, StringKind};

use super::output::Output;
use super::{Changes, does_not_fit};

/// Bytes of records that are compressed together.
const BLOCK_BYTES: usize = 4 << 20;
/// Level of their compression.
const LEVEL: u32 = 6;

/// Write all cells. Returns the length of the file.
pub(super) fn write(layout: &Layout, path: &Path, changes: &mut Changes, progress: &dyn Progress) -> Result<u64> {
    let io = |error| Error::io("write", path)(error);
    let name = |index: usize| StringKind::Name.escaped(layout.name_bytes(index));
    let tops: Vec<_> = layout.tops().iter().map(|&top| name(top)).collect();
    let out = Output::create(path)?;
    let mut writer = OasisWriter::new(out, 1000.0 / layout.unit_nm(), &tops, false).map_err(io)?;
    // Numbers of cells are their indices.
    for (index, cell) in layout.cells().iter().enumerate() {
        let name = name(index);
        if *name != *layout.name_bytes(index) {
            changes.escape(layout.name_bytes(index));
        }
        if writer.cell_number(name) != index as u64 {
            return Err(does_not_fit(
                format!("two cells with the name {}", cell.name),
                "rename one of them: references cannot tell which is meant",
            ));
        }
    }
    let mut target = Target {
        writer,
        path,
        records: RecordBuffer::relative(),
        open: false,
        corners: Vec::new(),
        changes,
    };
    layout.cell_items(&mut target, progress)?;
    target.end()?;
    let (out, bytes) = target.writer.finish().map_err(io)?;
    out.commit(path)?;
    Ok(bytes)
}

struct Target<'a> {
    writer: OasisWriter<Output>,
    path: &'a Path,
    records: RecordBuffer,
    open: bool,
    corners: Vec<[i64; 2]>,
    changes: &'a mut Changes,
}

impl Target<'_> {
    fn flush(&mut self) -> Result<()> {
        if !self.records.bytes().is_empty() {
            let block = CompressedBlock::of(self.records.bytes(), LEVEL);
            self.writer.block(&block).map_err(Error::io("write", self.path))?;
            self.records.clear();
        }
        Ok(())
    }

    /// End the cell that is open, if one is.
    fn end(&mut self) -> Result<()> {
        if std::mem::take(&mut self.open) {
            self.flush()?;
            self.writer.end_cell(CellBounds::Unknown);
        }
        Ok(())
    }
}

fn numbers(layer: LayerNumber) -> [u32; 2] {
    [layer.layer.into(), layer.datatype.into()]
}

/// Coordinates and sizes of 32 bits with a sign are what readers of OASIS take.
fn fits(item: &CellItem<'_>) -> Result<()> {
    let most = i64::from(i32::MAX);
    let points = match *item {
        CellItem::Area { points, .. } | CellItem::Line { points, .. } => points,
        CellItem::Text { at, .. } | CellItem::Reference { at, .. } => &[at],
    };
    let r = Rect::around(points);
    let far = [r.x0, r.y0, r.x1, r.y1].map(i64::abs).into_iter().max().unwrap_or(0);
    let wide = r.width().max(r.height());
    if points.is_empty() || far.max(wide) <= most {
        return Ok(());
    }
    Err(does_not_fit(
        format!("an element from ({}, {}) to ({}, {})", r.x0, r.y0, r.x1, r.y1),
        "readers of OASIS take coordinates and sizes up to 2147483647: split it, or write the layout on a coarser grid",
    ))
}

fn pair(p: Point) -> [i64; 2] {
    [p.x, p.y]
}

impl CellConsumer for Target<'_> {
    fn cell(&mut self, index: usize, _cell: &LayoutCell) -> Result<()> {
        self.end()?;
        self.writer
            .begin_cell(index as u64)
            .map_err(Error::io("write", self.path))?;
        self.open = true;
        Ok(())
    }

    fn item(&mut self, item: &CellItem<'_>, repetition: Option<&Repetition>) -> Result<()> {
        fits(item)?;
        match *item {
            CellItem::Area { layer, points } => {
                if let Some(r) = rectangle_of(points) {
                    let size = [r.width(), r.height()];
                    self.records.rectangle(numbers(layer), [r.x0, r.y0], size, repetition);
                } else {
                    self.corners.clear();
                    self.corners.extend(points.iter().map(|&p| pair(p)));
                    self.corners.dedup();
                    if self.corners.len() > 1 && self.corners.first() == self.corners.last() {
                        self.corners.pop();
                    }
                    // What covers no area cannot be said in OASIS.
                    if self.corners.len() >= 3 {
                        self.records.polygon(numbers(layer), &self.corners, repetition);
                    }
                }
            }
            CellItem::Line {
                layer,
                points,
                width,
                extensions,
            } => {
                self.corners.clear();
                self.corners.extend(points.iter().map(|&p| pair(p)));
                self.corners.dedup();
                self.records
                    .path(numbers(layer), width / 2, extensions, &self.corners, repetition);
            }
            CellItem::Text { layer, string, at } => {
                let escaped = StringKind::Text.escaped(string);
                if *escaped != *string {
                    self.changes.escape(string);
                }
                let text = self.writer.text_number(escaped);
                self.records.text(numbers(layer), text, pair(at), repetition);
            }
            CellItem::Reference {
                name,
                cell,
                at,
                mirrored,
                magnification,
                angle_deg,
            } => {
                let placing = Placing {
                    mirrored,
                    magnification,
                    angle_deg,
                };
                // A cell of another file has a name in the table, and no content.
                let cell = match cell {
                    Some(cell) => cell as u64,
                    None => self.writer.cell_number(StringKind::Name.escaped(name)),
                };
                self.records.placement(cell, pair(at), &placing, repetition);
            }
        }
        if self.records.bytes().len() >= BLOCK_BYTES {
            self.flush()?;
        }
        Ok(())
    }
}
