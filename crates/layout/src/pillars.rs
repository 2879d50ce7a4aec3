//! Millions of pillars into a file, block by block.

use std::collections::BTreeSet;
use std::io::Write;
use std::ops::Range;
use std::path::Path;

use metalith_gds::library::{GdsElement, Orientation};
use rayon::prelude::*;

use super::gds_frame::LibraryFrame;
use super::pillar_form::PillarForm;
use super::{coordinate, point, polygon};
use metalith_core::{AtomicFile, Error, Progress, Result};
use metalith_design::LayoutLayer;
use metalith_design::array::{Class, PillarArray, PlacedElement, Symmetry};
use metalith_gds::write::{PolygonRecord, ReferenceRecord, SquareRecord};
use metalith_pillars::PillarRows;

/// Sites of the rows that are encoded as one block, about: a megabyte.
const SITES: usize = 12_000;

/// Blocks that are encoded side by side before they are written in order.
const BLOCKS: usize = 8;

pub(super) struct PillarWriter<'a> {
    file: AtomicFile,
    path: &'a Path,
    frame: &'a LibraryFrame,
    layer: &'a LayoutLayer,
    form: PillarForm,
    progress: &'a dyn Progress,
    bytes: u64,
    /// References of the top cell, in the order of the elements.
    placed: Vec<GdsElement>,
    /// Buffers into which blocks are encoded, allocated once.
    buffers: [Vec<u8>; BLOCKS],
}

/// One pillar of a lens: its centre from the lens's (database units), its width (nm) or number.
struct PlacedPillar {
    x: i32,
    y: i32,
    width: u16,
}

/// Bytes that are written for a pillar.
enum Template {
    Square(SquareRecord, PillarForm),
    Polygons(ByWidth<PolygonRecord>),
    /// To cells of one outline.
    References(ByWidth<ReferenceRecord>),
}

/// Records of the widths that there are: every pillar is looked up here.
struct ByWidth<T>(Vec<Option<T>>);

impl<T> FromIterator<(u16, T)> for ByWidth<T> {
    fn from_iter<I: IntoIterator<Item = (u16, T)>>(records: I) -> Self {
        let mut by_width = Vec::new();
        for (width, record) in records {
            let place = usize::from(width);
            by_width.resize_with(by_width.len().max(place + 1), || None);
            by_width[place] = Some(record);
        }
        Self(by_width)
    }
}

impl<T> ByWidth<T> {
    #[inline]
    fn of(&self, width: u16) -> &T {
        let record = self.0.get(usize::from(width)).and_then(Option::as_ref);
        record.expect("records were made of all widths of the array")
    }
}

impl Template {
    /// The outline itself for each pillar.
    fn outlines(array: &PillarArray, layer: &LayoutLayer, form: PillarForm) -> Self {
        if form.is_square() {
            return Self::Square(SquareRecord::on(layer.number()), form);
        }
        let record = |width: u16| {
            let corners: Vec<[i32; 2]> = form
                .corners(width)
                .iter()
                .map(|&(x, y)| [coordinate(x), coordinate(y)])
                .collect();
            (width, PolygonRecord::on(layer.number(), &corners))
        };
        Self::Polygons(widths_of(array).into_iter().map(record).collect())
    }

    #[inline]
    fn append(&self, out: &mut Vec<u8>, pillar: &PlacedPillar) {
        let PlacedPillar { x, y, width } = *pillar;
        match self {
            Self::Square(square, form) => square.append(out, x, y, form.edge(width) as u32),
            Self::Polygons(polygons) => polygons.of(width).append(out, x, y),
            Self::References(cells) => cells.of(width).append(out, x, y),
        }
    }
}

/// Widths of the pillars of an array (nm).
fn widths_of(array: &PillarArray) -> BTreeSet<u16> {
    let of_class = |class: &Class| {
        let counts = class.widths.histogram();
        (1..counts.len())
            .filter(|&w| counts[w] > 0)
            .map(|w| w as u16)
            .collect::<Vec<_>>()
    };
    array.classes.iter().flat_map(of_class).collect()
}

impl<'a> PillarWriter<'a> {
    pub(crate) fn create(
        path: &'a Path,
        frame: &'a LibraryFrame,
        layer: &'a LayoutLayer,
        form: PillarForm,
        progress: &'a dyn Progress,
    ) -> Result<Self> {
        let mut writer = Self {
            file: AtomicFile::create(path)?,
            path,
            frame,
            layer,
            form,
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
    pub(crate) fn folded(&mut self, array: &PillarArray) -> Result<Vec<String>> {
        // Squares are as short as references to them; other outlines are written once each.
        let template = if self.form.is_square() {
            Template::Square(SquareRecord::on(self.layer.number()), self.form)
        } else {
            Template::References(self.width_cells(array)?)
        };
        let n = array.lattice.sites();
        let mut remarks = Vec::new();
        for (k, class) in array.classes.iter().enumerate() {
            let lens = lens_name(k);
            let mut references = Vec::new();
            for (j, part) in class.group.domain(&class.widths).iter().enumerate() {
                let name = format!("{lens}_{}", (b'A' + j as u8) as char);
                let (begin, end) = self.frame.cell(&name, Vec::new())?;
                self.put(&begin)?;
                let runs = |iy| class.group.runs(part, n, iy);
                self.rows(&class.widths, runs, |out, s| template.append(out, &s))?;
                self.put(&end)?;
                references.extend(part.copies.iter().map(|s| reference(&name, *s, (0, 0))));
            }
            remarks.extend(super::no_symmetry(array, k));
            let (begin, end) = self.frame.cell(&lens, references)?;
            self.put(&begin)?;
            self.put(&end)?;
        }
        let place = |p: &PlacedElement| reference(&lens_name(p.class), p.symmetry, self.centre(p));
        self.placed = array.placed.iter().map(place).collect();
        Ok(remarks)
    }

    /// Write a cell for each width that there is.
    fn width_cells(&mut self, array: &PillarArray) -> Result<ByWidth<ReferenceRecord>> {
        let mut cells = Vec::new();
        for width in widths_of(array) {
            let name = self.form.cell_name(width);
            let outline = polygon(self.layer, &self.form.corners(width));
            let (begin, end) = self.frame.cell(&name, vec![outline])?;
            self.put(&begin)?;
            self.put(&end)?;
            cells.push((width, ReferenceRecord::to(&name)));
        }
        Ok(cells.into_iter().collect())
    }

    /// Write a cell for each width and one reference a pillar, each element its own cell.
    pub(crate) fn referenced(&mut self, array: &PillarArray) -> Result<()> {
        let template = Template::References(self.width_cells(array)?);
        for (k, placed) in array.placed.iter().enumerate() {
            let name = format!("E{k}");
            let widths = array.rows(placed);
            let (begin, end) = self.frame.cell(&name, Vec::new())?;
            self.put(&begin)?;
            self.rows(
                widths.as_ref(),
                |_| [all_of(array), 0..0],
                |out, s| template.append(out, &s),
            )?;
            self.put(&end)?;
            let at = self.centre(placed);
            self.placed.push(reference(&name, Symmetry::IDENTITY, at));
        }
        Ok(())
    }

    /// Write the top cell with what is fixed and the elements, as references or, if `flat` is given,
    /// all their pillars; then the end of the library. Returns the length of the file.
    pub(crate) fn finish(mut self, top: &str, mut fixed: Vec<GdsElement>, flat: Option<&PillarArray>) -> Result<u64> {
        fixed.append(&mut self.placed);
        let (begin, end) = self.frame.cell(top, fixed)?;
        self.put(&begin)?;
        if let Some(array) = flat {
            let template = Template::outlines(array, self.layer, self.form);
            for placed in &array.placed {
                let widths = array.rows(placed);
                let (cx, cy) = self.centre(placed);
                let (cx, cy) = (coordinate(cx), coordinate(cy));
                self.rows(
                    widths.as_ref(),
                    |_| [all_of(array), 0..0],
                    |out, s| {
                        let (x, y) = (cx + s.x, cy + s.y);
                        template.append(out, &PlacedPillar { x, y, ..s });
                    },
                )?;
            }
        }
        self.put(&end)?;
        self.put(self.frame.tail())?;
        let bytes = self.bytes;
        self.file.commit()?;
        Ok(bytes)
    }

    /// Encode the pillars of a lens row by row, those in the runs of columns that `runs` gives for a row: blocks side by
    /// side on all threads, written in order.
    fn rows(
        &mut self,
        widths: &impl PillarRows,
        runs: impl Fn(usize) -> [Range<usize>; 2] + Sync,
        encode: impl Fn(&mut Vec<u8>, PlacedPillar) + Sync,
    ) -> Result<()> {
        let lattice = widths.lattice();
        let n = lattice.sites();
        let places =
            [0, 1].map(|axis| -> Vec<i32> { (0..n).map(|i| coordinate(lattice.place_units(axis, i))).collect() });
        for side_by_side in blocks(n, &runs).chunks(BLOCKS) {
            self.progress.check_stopped()?;
            let mut buffers = std::mem::take(&mut self.buffers);
            let pillars = side_by_side
                .par_iter()
                .zip(&mut buffers)
                .map(|(rows, out)| {
                    out.clear();
                    let (mut pillars, mut room) = (0, Vec::new());
                    for (iy, run) in rows.clone().flat_map(|iy| runs(iy).map(|run| (iy, run))) {
                        let row = widths.row(iy, run.clone(), &mut room);
                        for (ix, &width) in run.zip(row).filter(|(_, w)| **w != 0) {
                            let (x, y) = (places[0][ix], places[1][iy]);
                            encode(out, PlacedPillar { x, y, width });
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

    /// Centre of an element (database units).
    fn centre(&self, placed: &PlacedElement) -> (i64, i64) {
        let (x, y) = placed.element.centre_nm;
        (self.form.unit().units(x), self.form.unit().units(y))
    }

    fn put(&mut self, bytes: &[u8]) -> Result<()> {
        self.bytes += bytes.len() as u64;
        self.file.write_all(bytes).map_err(Error::io("write", self.path))
    }
}

/// All columns of an element.
fn all_of(array: &PillarArray) -> Range<usize> {
    0..array.lattice.sites()
}

/// Rows in blocks of about [`SITES`] sites.
fn blocks(n: usize, runs: impl Fn(usize) -> [Range<usize>; 2]) -> Vec<Range<usize>> {
    let mut blocks = Vec::new();
    let (mut first, mut sites) = (0, 0);
    for iy in 0..n {
        sites += runs(iy).iter().map(ExactSizeIterator::len).sum::<usize>();
        if sites >= SITES || iy + 1 == n {
            blocks.push(first..iy + 1);
            (first, sites) = (iy + 1, 0);
        }
    }
    blocks
}

fn lens_name(class: usize) -> String {
    format!("LENS{class}")
}

/// A reference with one of the symmetries of the square; a plain one has no STRANS record.
fn reference(cell: &str, symmetry: Symmetry, at: (i64, i64)) -> GdsElement {
    GdsElement::Reference {
        cell: cell.to_owned(),
        orientation: orientation(symmetry),
        at: point(at.0, at.1),
    }
}

/// Mirror and rotation of a copy with a symmetry of the square; none of a plain one.
pub fn orientation(symmetry: Symmetry) -> Option<Orientation> {
    (symmetry != Symmetry::IDENTITY).then(|| Orientation {
        mirrored: symmetry.mirrored,
        angle_deg: (symmetry.quarter_turns > 0).then(|| 90.0 * f64::from(symmetry.quarter_turns)),
    })
}
