//! Millions of pillars into a file, block by block.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

use gds21::{GdsElement, GdsStrans, GdsStructRef};
use rayon::prelude::*;

use super::frame::LibraryFrame;
use super::{coordinate, point, polygon};
use metalith_core::{Error, Progress, Result, WholeFile, WidthMap};
use metalith_design::LayoutLayer;
use metalith_design::array::{PillarArray, PlacedElement, Symmetry};
use metalith_gds::write::{ReferenceRecord, SquareRecord};

/// Rows of a lattice that are encoded as one block: a megabyte of a full-size lens.
const ROWS: usize = 4;

/// Blocks that are encoded side by side before they are written in order.
const BLOCKS: usize = 8;

pub(super) struct PillarWriter<'a> {
    file: WholeFile,
    path: &'a Path,
    frame: &'a LibraryFrame,
    layer: &'a LayoutLayer,
    progress: &'a dyn Progress,
    bytes: u64,
    /// References of the top cell, in the order of the elements.
    placed: Vec<GdsElement>,
    /// What blocks are encoded into: memory that is asked for once.
    buffers: [Vec<u8>; BLOCKS],
}

/// One pillar of a lens: its site, its centre from the lens's (nm), its width (nm).
struct PlacedPillar {
    ix: usize,
    iy: usize,
    x: i32,
    y: i32,
    width: u16,
}

impl<'a> PillarWriter<'a> {
    pub fn create(
        path: &'a Path,
        frame: &'a LibraryFrame,
        layer: &'a LayoutLayer,
        progress: &'a dyn Progress,
    ) -> Result<Self> {
        let mut writer = Self {
            file: WholeFile::create(path)?,
            path,
            frame,
            layer,
            progress,
            bytes: 0,
            placed: Vec::new(),
            buffers: Default::default(),
        };
        writer.put(frame.head())?;
        Ok(writer)
    }

    /// Write each class once, folded by its symmetries, and refer to it for each element.
    /// Says which classes have no symmetry to fold by.
    pub fn folded(&mut self, array: &PillarArray) -> Result<Vec<String>> {
        let square = SquareRecord::on(self.layer.number());
        let n = array.lattice.sites();
        let mut remarks = Vec::new();
        for (k, class) in array.classes.iter().enumerate() {
            let lens = lens_name(k);
            let mut references = Vec::new();
            for (j, part) in class.group.domain(&class.widths).iter().enumerate() {
                let name = format!("{lens}_{}", (b'A' + j as u8) as char);
                let (begin, end) = self.frame.cell(&name, Vec::new())?;
                self.put(&begin)?;
                self.rows(&class.widths, |out, s| {
                    if class.group.holds(part, n, s.ix, s.iy) {
                        square.append(out, s.x, s.y, s.width);
                    }
                })?;
                self.put(&end)?;
                references.extend(part.copies.iter().map(|s| reference(&name, *s, (0, 0))));
            }
            remarks.extend(super::no_symmetry(array, k));
            let (begin, end) = self.frame.cell(&lens, references)?;
            self.put(&begin)?;
            self.put(&end)?;
        }
        let place = |p: &PlacedElement| reference(&lens_name(p.class), p.symmetry, p.element.centre_nm);
        self.placed = array.placed.iter().map(place).collect();
        Ok(remarks)
    }

    /// Write a cell for each width and one reference a pillar, each element a cell of its own.
    pub fn referenced(&mut self, array: &PillarArray) -> Result<()> {
        let mut cells = BTreeMap::new();
        for class in &array.classes {
            for (width, _) in class
                .widths
                .histogram()
                .iter()
                .enumerate()
                .skip(1)
                .filter(|(_, count)| **count > 0)
            {
                cells.insert(width as u16, ReferenceRecord::to(&width_name(width)));
            }
        }
        for &width in cells.keys() {
            let h = i64::from(width) / 2;
            let square = polygon(self.layer, &[(-h, -h), (h, -h), (h, h), (-h, h)]);
            let (begin, end) = self.frame.cell(&width_name(width.into()), vec![square])?;
            self.put(&begin)?;
            self.put(&end)?;
        }
        for (k, placed) in array.placed.iter().enumerate() {
            let name = format!("E{k}");
            let widths = array.widths(placed);
            let (begin, end) = self.frame.cell(&name, Vec::new())?;
            self.put(&begin)?;
            self.rows(&widths, |out, s| cells[&s.width].append(out, s.x, s.y))?;
            self.put(&end)?;
            self.placed
                .push(reference(&name, Symmetry::IDENTITY, placed.element.centre_nm));
        }
        Ok(())
    }

    /// Write the top cell with what is fixed and the elements, as references or, if `flat` is given,
    /// all their pillars; then the end of the library. Returns the length of the file.
    pub fn finish(mut self, top: &str, mut fixed: Vec<GdsElement>, flat: Option<&PillarArray>) -> Result<u64> {
        fixed.append(&mut self.placed);
        let (begin, end) = self.frame.cell(top, fixed)?;
        self.put(&begin)?;
        if let Some(array) = flat {
            let square = SquareRecord::on(self.layer.number());
            for placed in &array.placed {
                let widths = array.widths(placed);
                let (cx, cy) = placed.element.centre_nm;
                let (cx, cy) = (coordinate(cx), coordinate(cy));
                self.rows(&widths, |out, s| square.append(out, cx + s.x, cy + s.y, s.width))?;
            }
        }
        self.put(&end)?;
        self.put(self.frame.tail())?;
        let bytes = self.bytes;
        self.file.commit()?;
        Ok(bytes)
    }

    /// Encode the pillars of a lens row by row: blocks side by side on all threads, written in order.
    fn rows(&mut self, widths: &WidthMap, encode: impl Fn(&mut Vec<u8>, PlacedPillar) + Sync) -> Result<()> {
        let n = widths.lattice.sites();
        let places = (0..n)
            .map(|i| coordinate(widths.lattice.coordinate_nm(i)))
            .collect::<Vec<_>>();
        let all = widths.width_nm.as_slice().expect("rows are contiguous");
        let blocks = all.chunks(n * ROWS).collect::<Vec<_>>();
        for (batch, side_by_side) in blocks.chunks(BLOCKS).enumerate() {
            if self.progress.stopped() {
                return Err(Error::Interrupted);
            }
            let first = batch * BLOCKS * ROWS;
            let mut buffers = std::mem::take(&mut self.buffers);
            let pillars = side_by_side
                .par_iter()
                .zip(&mut buffers)
                .enumerate()
                .map(|(k, (block, out))| {
                    out.clear();
                    let mut pillars = 0;
                    for (row, line) in block.chunks(n).enumerate() {
                        let iy = first + k * ROWS + row;
                        for (ix, &width) in line.iter().enumerate().filter(|(_, w)| **w != 0) {
                            let (x, y) = (places[ix], places[iy]);
                            encode(out, PlacedPillar { ix, iy, x, y, width });
                            pillars += 1;
                        }
                    }
                    pillars
                })
                .sum();
            for bytes in &buffers[..side_by_side.len()] {
                self.put(bytes)?;
            }
            self.buffers = buffers;
            self.progress.advance(pillars);
        }
        Ok(())
    }

    fn put(&mut self, bytes: &[u8]) -> Result<()> {
        self.bytes += bytes.len() as u64;
        self.file.write_all(bytes).map_err(Error::io("write", self.path))
    }
}

fn lens_name(class: usize) -> String {
    format!("LENS{class}")
}

pub(super) fn width_name(width: usize) -> String {
    format!("W{width}")
}

/// A reference with one of the symmetries of the square; a plain one has no STRANS record.
fn reference(cell: &str, symmetry: Symmetry, at_nm: (i64, i64)) -> GdsElement {
    let strans = (symmetry != Symmetry::IDENTITY).then(|| GdsStrans {
        reflected: symmetry.mirrored,
        angle: (symmetry.quarter_turns > 0).then(|| 90.0 * f64::from(symmetry.quarter_turns)),
        ..Default::default()
    });
    GdsStructRef {
        name: cell.to_owned(),
        xy: point(at_nm.0, at_nm.1),
        strans,
        ..Default::default()
    }
    .into()
}
