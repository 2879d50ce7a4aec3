//! Record of a cell after the first reading: numbers, not shapes.

use super::inventory::CellCounts;
use super::shape::Rect;
use metalith_core::LayerNumber;

/// One cell ("structure") of a layout in number.
#[derive(Clone, Debug)]
pub struct LayoutCell {
    /// Printable: see [`metalith_core::text::printable_bytes`].
    pub name: String,
    /// Bytes in the file, from BGNSTR to behind ENDSTR. In OASIS from its record CELL, or the CBLOCK that has it,
    /// to the next cell or CBLOCK.
    pub bytes: std::ops::Range<u64>,
    /// Shapes drawn in it, by layer, in the order of first use.
    pub layers: Vec<(LayerNumber, LayerTally)>,
    /// Cells that it refers to.
    pub children: Vec<Child>,
    /// Elements with properties.
    pub with_properties: u64,
    /// Number of copies of the cell in the layout, all references followed; at most `u64::MAX`.
    pub placements: u64,
    /// Longest chain of references that ends here; a top cell has zero.
    pub depth: u32,
    /// Place of its record in what the CBLOCK at `bytes.start` unpacks to.
    pub(super) inner: Option<u64>,
    /// Small and without references: placed shape by shape.
    pub(super) inline: bool,
    /// Counts for an inventory, if it was opened for one.
    pub(super) counts: Option<Box<CellCounts>>,
}

impl LayoutCell {
    /// Areas drawn in the cell itself.
    pub fn shapes(&self) -> u64 {
        self.layers
            .iter()
            .fold(0, |sum: u64, (_, t)| sum.saturating_add(t.shapes()))
    }

    /// Texts of the cell itself.
    pub fn texts(&self) -> u64 {
        self.layers
            .iter()
            .fold(0, |sum: u64, (_, t)| sum.saturating_add(t.texts))
    }

    /// References in the cell, an array being one.
    pub fn references(&self) -> u64 {
        self.children.iter().map(|c| c.references).sum()
    }
}

/// The references of one cell to one other.
#[derive(Clone, Debug)]
pub struct Child {
    /// Index into [`super::Layout::cells`]; none if there is no such cell in the file.
    pub cell: Option<usize>,
    pub name: String,
    /// References, an array being one.
    pub references: u64,
    /// Copies, arrays counted out; at most `u64::MAX`.
    pub copies: u64,
    /// Place in the file of the first of them.
    pub offset: u64,
    pub(super) number: u32,
    /// Part of a circle of references: never followed.
    pub(super) cut: bool,
}

/// Tally of one cell on one layer.
#[derive(Clone, Debug)]
pub struct LayerTally {
    pub boundaries: u64,
    pub boxes: u64,
    pub paths: u64,
    pub texts: u64,
    /// Bytes of all their strings.
    pub text_bytes: u64,
    pub nodes: u64,
    pub vertices: u64,
    /// Box around the areas, in the cell's coordinates.
    pub bounds: Rect,
}

impl LayerTally {
    pub(super) const EMPTY: Self = Self {
        boundaries: 0,
        boxes: 0,
        paths: 0,
        texts: 0,
        text_bytes: 0,
        nodes: 0,
        vertices: 0,
        bounds: Rect::EMPTY,
    };

    /// Areas.
    pub fn shapes(&self) -> u64 {
        self.boundaries.saturating_add(self.boxes).saturating_add(self.paths)
    }
}
