//! Cells as OASIS.

use std::io::{BufWriter, Write};
use std::path::Path;

use metalith_core::{AtomicFile, Error, LayerNumber, Progress, Result};
use metalith_gds::{CellConsumer, CellItem, Layout, LayoutCell, Point, rectangle_of};
use metalith_oasis::{CellBounds, CompressedBlock, OasisWriter, Placing, RecordBuffer, Repetition};

use super::does_not_fit;

/// Bytes of records that are compressed together.
const BLOCK_BYTES: usize = 4 << 20;
/// Level of their compression.
const LEVEL: u32 = 6;

/// Write all cells. Returns the length of the file.
pub(super) fn write(layout: &Layout, tops: &[&str], path: &Path, progress: &dyn Progress) -> Result<u64> {
    let io = |error| Error::io("write", path)(error);
    let out = BufWriter::new(AtomicFile::create(path)?);
    let mut writer = OasisWriter::new(out, 1000.0 / layout.unit_nm(), tops, false).map_err(io)?;
    // Numbers of cells are their indices.
    for (index, cell) in layout.cells().iter().enumerate() {
        if writer.cell_number(&cell.name) != index as u64 {
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
    };
    layout.cell_items(&mut target, progress)?;
    target.end()?;
    let (out, bytes) = target.writer.finish().map_err(io)?;
    let mut out = out;
    out.flush().map_err(io)?;
    out.into_inner().map_err(|e| io(e.into_error()))?.commit()?;
    Ok(bytes)
}

struct Target<'a> {
    writer: OasisWriter<BufWriter<AtomicFile>>,
    path: &'a Path,
    records: RecordBuffer,
    open: bool,
    corners: Vec<[i64; 2]>,
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
                let text = self.writer.text_number(&metalith_core::text::printable_bytes(string));
                self.records.text(numbers(layer), text, pair(at), repetition);
            }
            CellItem::Reference {
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
                self.records.placement(cell as u64, pair(at), &placing, repetition);
            }
        }
        if self.records.bytes().len() >= BLOCK_BYTES {
            self.flush()?;
        }
        Ok(())
    }
}
