//! Layouts as OASIS.

mod encode;
mod pieces;
mod ring_order;

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use metalith_core::{AtomicFile, Error, Progress, Result};
use metalith_design::array::{DomainPart, PillarArray, PlacedElement, Symmetry, SymmetryGroup};
use metalith_design::{Design, Hierarchy, LayoutLayer};
use metalith_oasis::{CompressedBlock, OasisWriter, Placing, RecordBuffer};
use metalith_pillars::{DatabaseUnit, PillarRows};

use super::fixed_shapes::FixedShapes;
use super::pillar_form::PillarForm;
use super::{OasisEncoding, PillarLayout, Written, no_copies, no_symmetry, top_cell};
use encode::{ElementPillars, NOTHING, PillarEncoding, bounds_of, unite};
pub(super) use pieces::PiecesOf;
pub use pieces::{KeptPieces, PieceShard};

/// Nanometres in a micrometre.
const NM_PER_UM: f64 = 1000.0;

/// A sample tells sizes to a few percent: what is not smaller by more is written as lists, which read faster.
const SURE: f64 = 0.97;

/// Readers take some twice as long for outlines as for lists: worth it where they save a third of the bytes. Phases that jump
/// from ring to ring, and are steered, do so.
const MUCH_LESS: f64 = 2.0 / 3.0;

/// Compression of cells with few records.
const LEVEL: u32 = 6;

/// Write an array of pillars and what is fixed beside it. In the plain encoding each further layer has a file of its
/// own beside it, with its numbers in the name.
///
/// Folded layouts have a cell for each part that symmetry leaves unique, all others a cell for each element, which is
/// placed without turn or mirror. The same array gives the same bytes on any number of threads; memory does not grow
/// with the number of pillars.
///
/// # Errors
/// If the file cannot be written, or the user stopped it; the old file is then as it was.
pub(super) fn write_pillars(
    layout: &PillarLayout<'_>,
    array: &PillarArray,
    hierarchy: Hierarchy,
    (encoding, pieces): (OasisEncoding, PiecesOf<'_>),
    path: &Path,
    progress: &dyn Progress,
) -> Result<Written> {
    let (fixed, pillars) = (&layout.fixed, layout.layer);
    let mut file = OasisFile::create(&layout.top, layout.form.unit(), path)?;
    let (placed, remarks) = write_elements(layout, array, hierarchy, (encoding, pieces), &mut file, progress)?;
    if encoding == OasisEncoding::Plain {
        file.top(fixed, &placed, |layer| layer.number() == pillars.number())?;
        let mut written = file.finish(remarks)?;
        written.beside = layers_apart(&layout.top, layout.form.unit(), fixed, pillars, path)?;
        return Ok(written);
    }
    file.top(fixed, &placed, |_| true)?;
    file.finish(remarks)
}

/// Make a shard of the pieces of an array of pillars.
///
/// # Errors
/// As [`write_pillars`].
pub(super) fn make_pieces(
    layout: &PillarLayout<'_>,
    array: &PillarArray,
    hierarchy: Hierarchy,
    encoding: OasisEncoding,
    (kept, shard): (&KeptPieces, PieceShard),
    progress: &dyn Progress,
) -> Result<()> {
    // The file around them is begun, for the numbers of cells, and never put into its place.
    let path = kept.file_of(shard);
    let mut file = OasisFile::create(&layout.top, layout.form.unit(), &path)?;
    let pieces = (encoding, PiecesOf::Shard(kept, shard));
    write_elements(layout, array, hierarchy, pieces, &mut file, progress)?;
    Ok(())
}

/// Write the cells of all elements. Returns where they are placed, and remarks for people.
fn write_elements(
    layout: &PillarLayout<'_>,
    array: &PillarArray,
    hierarchy: Hierarchy,
    (encoding, pieces): (OasisEncoding, PiecesOf<'_>),
    file: &mut OasisFile<'_>,
    progress: &dyn Progress,
) -> Result<(Vec<PlacedCell>, Vec<String>)> {
    let mut remarks = Vec::new();
    let mut elements = Elements {
        file,
        layer: layout.layer,
        form: layout.form,
        encoding,
        pieces,
        written: 0,
        width_cells: vec![None; usize::from(u16::MAX) + 1],
        progress,
    };
    let placed = if hierarchy == Hierarchy::Folded {
        remarks.extend(no_copies(array));
        remarks.extend((0..array.classes.len()).filter_map(|k| no_symmetry(array, k)));
        elements.folded(array)?
    } else {
        elements.apart(array)?
    };
    elements.width_cells()?;
    Ok((placed, remarks))
}

/// Write the aperture layout of a design as OASIS: one flat cell, in the plain encoding for each layer a file.
///
/// # Errors
/// If the file cannot be written; the old file is then as it was.
pub(super) fn write_apertures(design: &Design, encoding: OasisEncoding, path: &Path) -> Result<Written> {
    let fixed = FixedShapes::of_apertures(design);
    let openings = &design.layout.layers.apertures;
    let top = top_cell(design);
    let unit = design.cell.database_unit;
    let mut file = OasisFile::create(&top, unit, path)?;
    let plain = encoding == OasisEncoding::Plain;
    file.top(&fixed, &[], |layer| !plain || layer.number() == openings.number())?;
    let mut written = file.finish(Vec::new())?;
    if plain {
        written.beside = layers_apart(&top, unit, &fixed, openings, path)?;
    }
    Ok(written)
}

/// A file for each layer of polygons but one; texts for people are left out.
fn layers_apart(
    top: &str,
    unit: DatabaseUnit,
    fixed: &FixedShapes<'_>,
    but: &LayoutLayer,
    path: &Path,
) -> Result<Vec<PathBuf>> {
    let mut numbers: Vec<_> = fixed.polygons.iter().map(|(layer, _)| layer.number()).collect();
    numbers.sort_unstable();
    numbers.dedup();
    numbers.retain(|&number| number != but.number());
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut paths = Vec::new();
    for number in numbers {
        let name = format!("{stem}_{}_{}.oas", number.layer, number.datatype);
        let path = path.with_file_name(name);
        let mut file = OasisFile::create(top, unit, &path)?;
        file.top(fixed, &[], |layer| layer.number() == number)?;
        paths.push(file.finish(Vec::new())?.path);
    }
    Ok(paths)
}

/// A cell that is placed in another, and the box around it where it stands.
struct PlacedCell {
    cell: u64,
    symmetry: Symmetry,
    /// Place (database units).
    at: (i64, i64),
    bounds: [i64; 4],
}

impl PlacedCell {
    fn new(cell: u64, symmetry: Symmetry, at: (i64, i64), own: [i64; 4]) -> Self {
        let mut bounds = NOTHING;
        if own[0] <= own[2] {
            for (x, y) in [(own[0], own[1]), (own[2], own[3])] {
                let (x, y) = symmetry.point(x, y);
                let (x, y) = (x + at.0, y + at.1);
                bounds = unite(bounds, [x, y, x, y]);
            }
        }
        Self {
            cell,
            symmetry,
            at,
            bounds,
        }
    }

    fn put(&self, records: &mut RecordBuffer) {
        let placing = Placing {
            mirrored: self.symmetry.mirrored,
            angle_deg: 90.0 * f64::from(self.symmetry.quarter_turns),
            ..Placing::PLAIN
        };
        records.placement(self.cell, [self.at.0, self.at.1], &placing, None);
    }
}

/// The file that is written.
struct OasisFile<'a> {
    writer: OasisWriter<BufWriter<AtomicFile>>,
    path: &'a Path,
    top: String,
}

impl<'a> OasisFile<'a> {
    fn create(top: &str, unit: DatabaseUnit, path: &'a Path) -> Result<Self> {
        let out = BufWriter::new(AtomicFile::create(path)?);
        let writer =
            OasisWriter::new(out, NM_PER_UM * unit.per_nm() as f64, &[top], true).map_err(Error::io("write", path))?;
        Ok(Self {
            writer,
            path,
            top: top.to_owned(),
        })
    }

    fn begin(&mut self, name: &str) -> Result<u64> {
        let number = self.writer.cell_number(name);
        self.writer.begin_cell(number).map_err(Error::io("write", self.path))?;
        Ok(number)
    }

    fn block(&mut self, block: &CompressedBlock) -> Result<()> {
        self.writer.block(block).map_err(Error::io("write", self.path))
    }

    /// A cell with few records.
    fn cell(&mut self, name: &str, records: &RecordBuffer, bounds: [i64; 4]) -> Result<u64> {
        let number = self.begin(name)?;
        self.block(&CompressedBlock::of(records.bytes(), LEVEL))?;
        self.writer.end_cell(bounds_of(bounds));
        Ok(number)
    }

    /// The top cell: placed cells, and what of the fixed shapes is on layers that are wanted.
    fn top(
        &mut self,
        fixed: &FixedShapes<'_>,
        placed: &[PlacedCell],
        wants: impl Fn(&LayoutLayer) -> bool,
    ) -> Result<()> {
        let mut records = RecordBuffer::absolute();
        let mut bounds = NOTHING;
        for (layer, corners) in fixed.polygons.iter().filter(|(layer, _)| wants(layer)) {
            let corners: Vec<[i64; 2]> = corners.iter().map(|&(x, y)| [x, y]).collect();
            for &[x, y] in &corners {
                bounds = unite(bounds, [x, y, x, y]);
            }
            records.polygon(numbers(layer), &corners, None);
        }
        for (layer, text, (x, y)) in fixed.texts.iter().filter(|(layer, _, _)| wants(layer)) {
            let text = self.writer.text_number(text);
            records.text(numbers(layer), text, [*x, *y], None);
            bounds = unite(bounds, [*x, *y, *x, *y]);
        }
        for cell in placed {
            cell.put(&mut records);
            bounds = unite(bounds, cell.bounds);
        }
        let name = self.top.clone();
        self.cell(&name, &records, bounds)?;
        Ok(())
    }

    fn finish(self, remarks: Vec<String>) -> Result<Written> {
        let io = |error| Error::io("write", self.path)(error);
        let (mut out, bytes) = self.writer.finish().map_err(io)?;
        out.flush().map_err(io)?;
        let file = out.into_inner().map_err(|e| io(e.into_error()))?;
        file.commit()?;
        Ok(Written {
            path: self.path.to_owned(),
            bytes,
            top_cell: self.top,
            remarks,
            beside: Vec::new(),
        })
    }
}

fn numbers(layer: &LayoutLayer) -> [u32; 2] {
    let number = layer.number();
    [number.layer.into(), number.datatype.into()]
}

/// Writes the cells of the elements.
struct Elements<'f, 'p> {
    file: &'f mut OasisFile<'p>,
    layer: &'f LayoutLayer,
    form: PillarForm,
    encoding: OasisEncoding,
    pieces: PiecesOf<'f>,
    /// Elements whose pillars were written.
    written: usize,
    /// Cells of one width that were referred to.
    width_cells: Vec<Option<u64>>,
    progress: &'f dyn Progress,
}

impl Elements<'_, '_> {
    /// Level of compression.
    fn level(&self) -> u32 {
        if self.encoding == OasisEncoding::Smallest {
            9
        } else {
            LEVEL
        }
    }

    /// Centre of an element (database units).
    fn centre(&self, placed: &PlacedElement) -> (i64, i64) {
        let (x, y) = placed.element.centre_nm;
        (self.form.unit().units(x), self.form.unit().units(y))
    }

    /// Each class once, in the parts that symmetry leaves unique.
    fn folded(&mut self, array: &PillarArray) -> Result<Vec<PlacedCell>> {
        let mut classes = Vec::new();
        for (k, class) in array.classes.iter().enumerate() {
            classes.push(self.lens(&format!("LENS{k}"), &class.widths, &class.group)?);
        }
        Ok(array
            .placed
            .iter()
            .map(|p| {
                let (cell, bounds) = classes[p.class];
                PlacedCell::new(cell, p.symmetry, self.centre(p), bounds)
            })
            .collect())
    }

    /// Each element individually, neither turned nor mirrored.
    fn apart(&mut self, array: &PillarArray) -> Result<Vec<PlacedCell>> {
        let mut placed = Vec::new();
        for (k, element) in array.placed.iter().enumerate() {
            let widths = array.rows(element);
            let alone = SymmetryGroup::trivial();
            let parts = alone.domain(widths.as_ref());
            let mut pillars = self.element(widths.as_ref(), &alone, &parts);
            let (cell, bounds) = self.pillars(&[format!("E{k}")], &mut pillars)?[0];
            placed.push(PlacedCell::new(cell, Symmetry::IDENTITY, self.centre(element), bounds));
        }
        Ok(placed)
    }

    fn element<'e>(
        &self,
        widths: &'e dyn PillarRows,
        group: &'e SymmetryGroup,
        parts: &'e [DomainPart],
    ) -> ElementPillars<'e> {
        ElementPillars::new(widths, group, parts, self.layer.number(), self.form, self.level())
    }

    /// A lens of parts.
    fn lens(&mut self, name: &str, widths: &dyn PillarRows, group: &SymmetryGroup) -> Result<(u64, [i64; 4])> {
        let parts = group.domain(widths);
        let mut pillars = self.element(widths, group, &parts);
        let names: Vec<String> = (b'A'..)
            .take(parts.len())
            .map(|j| format!("{name}_{}", char::from(j)))
            .collect();
        let cells = self.pillars(&names, &mut pillars)?;
        let (mut records, mut bounds) = (RecordBuffer::absolute(), NOTHING);
        for (part, (cell, own)) in parts.iter().zip(cells) {
            for &copy in &part.copies {
                let placed = PlacedCell::new(cell, copy, (0, 0), own);
                placed.put(&mut records);
                bounds = unite(bounds, placed.bounds);
            }
        }
        Ok((self.file.cell(name, &records, bounds)?, bounds))
    }

    /// Write the cells of an element. Returns number and box of each.
    fn pillars(&mut self, names: &[String], pillars: &mut ElementPillars<'_>) -> Result<Vec<(u64, [i64; 4])>> {
        let encoding = match self.encoding {
            // Where many symmetries hold, phase and rings agree with strips: lists are always near the best there.
            OasisEncoding::Compact if pillars.has_many_symmetries() => pillars.lists(),
            OasisEncoding::Compact => Self::lists_or(PillarEncoding::Outlines, MUCH_LESS, pillars),
            OasisEncoding::Plain => PillarEncoding::Outlines,
            OasisEncoding::Smallest => Self::lists_or(PillarEncoding::References, SURE, pillars),
        };
        pillars.width_cells = self.numbers_of_widths(pillars.widths, encoding);
        let largest = pillars.largest();
        let mut numbers = vec![0; names.len()];
        let file = &mut *self.file;
        if pillars.is_empty() {
            let empty = |name: &String| Ok((file.cell(name, &RecordBuffer::absolute(), NOTHING)?, NOTHING));
            return names.iter().map(empty).collect();
        }
        numbers[largest] = file.begin(&names[largest])?;
        let pieces = (self.pieces, self.written);
        self.written += 1;
        let cells = pillars.encode(encoding, pieces, self.progress, |block| file.block(block))?;
        file.writer.end_cell(bounds_of(cells[largest].bounds));
        for (k, cell) in cells.iter().enumerate().filter(|(k, _)| *k != largest) {
            numbers[k] = file.begin(&names[k])?;
            cell.blocks.iter().try_for_each(|block| file.block(block))?;
            file.writer.end_cell(bounds_of(cell.bounds));
        }
        Ok(numbers.into_iter().zip(cells.iter().map(|c| c.bounds)).collect())
    }

    /// Lists, but another encoding where it takes less than a shard of their bytes, as a part of the pillars tells.
    fn lists_or(other: PillarEncoding, shard: f64, pillars: &mut ElementPillars<'_>) -> PillarEncoding {
        // Any numbers will do to see how small it gets.
        pillars.width_cells = (0..=u64::from(u16::MAX)).collect();
        let candidates = [pillars.lists(), other];
        match candidates.map(|encoding| pillars.bytes_of_sample(encoding)) {
            [Some(lists), Some(others)] if others < shard * lists => other,
            _ => pillars.lists(),
        }
    }

    /// Numbers of the cells of all widths, by width, if the encoding refers to them.
    fn numbers_of_widths(&mut self, widths: &dyn PillarRows, encoding: PillarEncoding) -> Vec<u64> {
        let refers = match encoding {
            PillarEncoding::References => true,
            PillarEncoding::Lists(_) => !self.form.is_square(),
            PillarEncoding::Outlines => false,
        };
        if !refers {
            return Vec::new();
        }
        let counts = widths.histogram();
        let mut numbers = vec![0; counts.len()];
        for (width, _) in counts.iter().enumerate().skip(1).filter(|(_, count)| **count > 0) {
            numbers[width] = *self.width_cells[width]
                .get_or_insert_with(|| self.file.writer.cell_number(self.form.cell_name(width as u16)));
        }
        numbers
    }

    /// Write the cells of one width that were referred to.
    fn width_cells(self) -> Result<()> {
        for (width, number) in self.width_cells.iter().enumerate() {
            if number.is_some() {
                let side = self.form.edge(width as u16);
                let mut records = RecordBuffer::absolute();
                if self.form.is_square() {
                    records.rectangle(numbers(self.layer), [-side / 2; 2], [side; 2], None);
                } else {
                    let corners = self.form.corners(width as u16);
                    let corners: Vec<[i64; 2]> = corners.iter().map(|&(x, y)| [x, y]).collect();
                    records.polygon(numbers(self.layer), &corners, None);
                }
                let name = self.form.cell_name(width as u16);
                let (x, y) = self.form.reach(width as u16);
                self.file.cell(&name, &records, [-x, -y, x, y])?;
            }
        }
        Ok(())
    }
}
