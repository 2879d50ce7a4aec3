//! The first reading: every byte is looked at once, and of each cell the numbers are kept.

use std::collections::HashMap;

use super::cell::{Child, LayerTally, LayoutCell};
use super::cells::FileFormat;
use super::element::{ElementContent, ElementKind};
use super::foreign;
use super::input::{Input, Source};
use super::inventory::{Counter, FormatDetails};
use super::limits::ReadLimits;
use super::names::{Names, Recent};
use super::oasis::{self, Copies, Texts};
use super::path_outline::outline;
use super::read_warnings::{ReadWarnings, Tolerance};
use super::record::{self, kind};
use super::shape::{Point, Rect};
use super::walk::{Sink, SinkError, Walk};
use crate::error::{Error, LayoutError, Limit, Result};
use metalith_core::text::printable_bytes;
use metalith_core::{LayerNumber, Progress};

/// Result of the first reading.
pub(super) struct Scan {
    pub title: String,
    /// Database unit in user units, and in metres.
    pub units: [f64; 2],
    pub cells: Vec<LayoutCell>,
    pub names: Names,
    /// Number of the name of each cell.
    pub numbers: Vec<u32>,
    /// Bytes behind ENDLIB, and whether any of them is not zero.
    pub trailing: (u64, bool),
    pub format: FileFormat,
    /// ReadWarnings from the format.
    pub warnings: ReadWarnings,
    /// Texts that elements refer to by number.
    pub texts: Texts,
    pub details: FormatDetails,
}

/// Read the file once; `counter` counts for an inventory.
pub(super) fn scan(
    source: &Source,
    limits: &ReadLimits,
    counter: Option<Counter>,
    progress: &dyn Progress,
) -> Result<Scan> {
    if source.format()? == FileFormat::Oasis {
        return oasis::scan(source, limits, counter, progress);
    }
    let mut input = source.open()?;
    input.tolerance = Tolerance::of(progress);
    progress.begin("reading cells", source.bytes());
    let mut walk = Walk::new(limits, progress);
    scan_with(&mut input, source.bytes(), counter, &mut walk)
}

/// Variant of [`scan`] with a walk that may be set to use the grammar alone.
pub(super) fn scan_with(input: &mut Input, bytes: u64, counter: Option<Counter>, walk: &mut Walk<'_>) -> Result<Scan> {
    if let &[_, _, first, ..] = input.window()?
        && first != kind::HEADER
    {
        let cause = foreign::format_of(input.window()?).unwrap_or(LayoutError::NoHeader);
        return Err(input.fault(0, cause));
    }
    let header = input.next()?;
    let version = input.body(header).first_chunk().map(|b| u16::from_be_bytes(*b));
    let mut title = String::new();
    let (mut units, mut modified) = (None, None);
    let mut tally = Tally::new(*walk.limits, counter);
    loop {
        let record = input.next()?;
        match record.kind {
            kind::LIBNAME => title = printable_bytes(input.text(record)?),
            kind::UNITS => units = Some(tally.unit(read_units(input, record)?)),
            kind::BGNLIB => modified = date(input.body(record)),
            kind::BGNSTR => {
                if units.is_none() {
                    return Err(input.fault(record.offset, LayoutError::UnitsMissingBeforeCell));
                }
                tally.begin(input, record.offset)?;
                walk.gds_cell(input, &mut tally)?;
                tally.end(input.offset());
            }
            kind::ENDLIB => break,
            kind::ENDSTR | kind::ENDEL | kind::HEADER => return Err(stray(input, record)),
            other if ElementKind::of(other).is_some() => return Err(stray(input, record)),
            _ => {}
        }
    }
    let Some(units) = units else {
        return Err(input.fault(input.offset(), LayoutError::NoUnits));
    };
    if let Some(offset) = tally.absolute.filter(|_| tally.magnified) {
        input.odd(offset, LayoutError::AbsoluteWidth, "such widths were taken as relative")?;
    }
    let trailing = bytes.saturating_sub(input.offset());
    let mut nonzero = false;
    loop {
        let window = input.window()?;
        if window.is_empty() {
            break;
        }
        nonzero |= window.iter().any(|&b| b != 0);
        let count = window.len();
        input.consume(count);
    }
    Ok(Scan {
        title,
        units,
        cells: tally.cells,
        names: tally.names,
        numbers: tally.numbers,
        trailing: (trailing, nonzero),
        format: FileFormat::Gds,
        warnings: std::mem::replace(&mut input.tolerance, Tolerance::Known).into_listed(),
        texts: Texts::default(),
        details: FormatDetails::Gds { version, modified },
    })
}

/// The first date of a BGNLIB record: year, month, day, hour, minute, second.
fn date(body: &[u8]) -> Option<[u16; 6]> {
    let bytes: &[u8; 12] = body.first_chunk()?;
    Some([0, 2, 4, 6, 8, 10].map(|k| u16::from_be_bytes([bytes[k], bytes[k + 1]])))
}

fn stray(input: &Input, record: record::Record) -> Error {
    input.fault(record.offset, LayoutError::OutsideCells { kind: record.kind })
}

/// Smallest and largest database unit that is read (m).
const UNIT_RANGE_M: std::ops::RangeInclusive<f64> = 1e-13..=1e-3;

fn read_units(input: &mut Input, record: record::Record) -> Result<[f64; 2]> {
    let units = [input.real8(record, 0, 2)?, input.real8(record, 1, 2)?];
    if !UNIT_RANGE_M.contains(&units[1]) || units[0].is_nan() || units[0] <= 0.0 {
        let cause = LayoutError::UnitSize {
            metres: units[1],
            user: units[0],
        };
        return Err(input.fault(record.offset, cause));
    }
    Ok(units)
}

/// Record of the cells met so far, and the counts of the one being read.
pub(super) struct Tally {
    limits: ReadLimits,
    cells: Vec<LayoutCell>,
    names: Names,
    numbers: Vec<u32>,
    recent: Recent,
    layers: HashMap<LayerNumber, usize>,
    last: usize,
    /// References to each name from the current cell: how many, how many copies, the first one's place.
    counts: Vec<(u64, u64, u64)>,
    touched: Vec<u32>,
    tallies: usize,
    path: Vec<Point>,
    /// Place of the first path of absolute width. Together with a reference that magnifies (`magnified`) its meaning is
    /// not defined.
    absolute: Option<u64>,
    magnified: bool,
    /// Counter for an inventory.
    counter: Option<Box<Counter>>,
}

impl Tally {
    pub(crate) fn new(limits: ReadLimits, counter: Option<Counter>) -> Self {
        Self {
            limits,
            cells: Vec::new(),
            names: Names::default(),
            numbers: Vec::new(),
            recent: Recent::new(),
            layers: HashMap::new(),
            last: usize::MAX,
            counts: Vec::new(),
            touched: Vec::new(),
            tallies: 0,
            path: Vec::new(),
            absolute: None,
            magnified: false,
            counter: counter.map(Box::new),
        }
    }

    /// Database unit in user units and in metres.
    pub(crate) fn unit(&mut self, units: [f64; 2]) -> [f64; 2] {
        if let Some(counter) = &mut self.counter {
            counter.unit(units[1]);
        }
        units
    }

    /// A cell begins: read its name.
    fn begin(&mut self, input: &mut Input, offset: u64) -> Result<()> {
        let record = input.next()?;
        if record.kind != kind::STRNAME {
            let kind = record.kind;
            return Err(input.fault(record.offset, LayoutError::NoCellName { kind }));
        }
        let name = input.text(record)?;
        self.begin_cell(name, offset, None)
            .map_err(|cause| input.fault(record.offset, cause))
    }

    /// A cell with this name begins.
    pub(crate) fn begin_cell(&mut self, name: &[u8], offset: u64, inner: Option<u64>) -> Result<(), LayoutError> {
        if name.is_empty() || name.len() > self.limits.name_bytes {
            return Err(LayoutError::CellName { bytes: name.len() });
        }
        if self.cells.len() >= self.limits.cells {
            return Err(too_many(Limit::Cells, self.cells.len() + 1, self.limits.cells));
        }
        self.numbers.push(self.names.number(name));
        self.cells.push(LayoutCell {
            name: printable_bytes(name),
            bytes: offset..offset,
            layers: Vec::new(),
            children: Vec::new(),
            with_properties: 0,
            placements: 0,
            depth: 0,
            inner,
            inline: false,
            counts: None,
        });
        self.layers.clear();
        self.last = usize::MAX;
        Ok(())
    }

    /// An element of the current cell has properties.
    pub(crate) fn count_properties(&mut self) {
        self.cells.last_mut().expect("a cell was begun").with_properties += 1;
    }

    /// Result for a file whose cells may have numbers, with the names of these.
    pub(crate) fn finish_numbered(
        mut self,
        units: [f64; 2],
        names: &HashMap<u64, Vec<u8>>,
        texts: HashMap<u64, Vec<u8>>,
        details: FormatDetails,
    ) -> Scan {
        let (resolved, renumbered) = self.names.resolve(names);
        for number in &mut self.numbers {
            *number = renumbered[*number as usize];
        }
        // Texts whose table came after them: at most the longest of it.
        let longest = texts.values().map(Vec::len).max().unwrap_or(0) as u64;
        for (cell, &number) in self.cells.iter_mut().zip(&self.numbers) {
            cell.name = printable_bytes(resolved.name(number));
            for child in &mut cell.children {
                child.number = renumbered[child.number as usize];
                child.name = printable_bytes(resolved.name(child.number));
            }
            for (_, tally) in &mut cell.layers {
                if tally.texts > 0 {
                    tally.text_bytes = tally.text_bytes.max(longest.saturating_mul(tally.texts));
                }
            }
            if let Some(counts) = &mut cell.counts {
                for reach in &mut counts.reaches {
                    reach.number = renumbered[reach.number as usize];
                }
                for text in &mut counts.texts {
                    if let Some(string) = oasis::numbered(&text.string).and_then(|number| texts.get(&number)) {
                        text.string.clone_from(string);
                    }
                }
            }
        }
        Scan {
            title: String::new(),
            units,
            cells: self.cells,
            names: resolved,
            numbers: self.numbers,
            trailing: (0, false),
            format: FileFormat::Oasis,
            warnings: ReadWarnings::default(),
            texts: Texts::new(texts),
            details,
        }
    }

    /// The current cell is complete.
    pub(crate) fn end(&mut self, offset: u64) {
        let cell = self.cells.last_mut().expect("a cell was begun");
        cell.bytes.end = offset;
        cell.counts = self
            .counter
            .as_mut()
            .map(|counter| Box::new(counter.end(&self.touched)));
        for number in self.touched.drain(..) {
            let (references, copies, offset) = std::mem::take(&mut self.counts[number as usize]);
            cell.children.push(Child {
                cell: None,
                name: printable_bytes(self.names.name(number)),
                references,
                copies,
                offset,
                number,
                cut: false,
            });
        }
    }

    #[inline]
    fn layer(&mut self, layer: LayerNumber) -> Result<&mut LayerTally, LayoutError> {
        let cell = self.cells.last_mut().expect("a cell was begun");
        if cell.layers.get(self.last).is_none_or(|(l, _)| *l != layer) {
            let next = cell.layers.len();
            self.last = *self.layers.entry(layer).or_insert(next);
            if self.last == next {
                self.tallies += 1;
                if self.tallies > self.limits.tallies {
                    return Err(too_many(Limit::Layers, self.tallies, self.limits.tallies));
                }
                cell.layers.push((layer, LayerTally::EMPTY));
            }
        }
        Ok(&mut cell.layers[self.last].1)
    }

    #[inline]
    fn reference(&mut self, number: u32, copies: u64, offset: u64) -> Result<(), LayoutError> {
        let number = number as usize;
        if number >= self.counts.len() {
            if number >= self.limits.cells || self.names.bytes() > self.limits.all_name_bytes {
                return Err(too_many(Limit::Names, number + 1, self.limits.cells));
            }
            self.counts.resize(self.names.len().max(number + 1), (0, 0, 0));
        }
        let count = &mut self.counts[number];
        if count.0 == 0 {
            count.2 = offset;
            self.touched.push(number as u32);
            self.tallies += 1;
            if self.tallies > self.limits.tallies {
                return Err(too_many(Limit::References, self.tallies, self.limits.tallies));
            }
        }
        count.0 += 1;
        count.1 = count.1.saturating_add(copies);
        Ok(())
    }
}

fn too_many(limit: Limit, found: usize, most: usize) -> LayoutError {
    LayoutError::Limit {
        limit,
        found: found as u64,
        most: most as u64,
    }
}

impl Sink for Tally {
    #[inline]
    fn five_points(&mut self, _offset: u64, layer: LayerNumber, points: &[Point; 5]) -> Result<(), SinkError> {
        let tally = self.layer(layer)?;
        tally.boundaries += 1;
        tally.vertices += 5;
        points[..4].iter().for_each(|&p| tally.bounds.include(p));
        if points[4] != points[0] {
            tally.bounds.include(points[4]);
        }
        if let Some(counter) = &mut self.counter {
            counter.five_points(self.last, points);
        }
        Ok(())
    }

    #[inline]
    fn plain_reference(&mut self, offset: u64, key: u64, at: Point) -> Result<(), SinkError> {
        let names = &mut self.names;
        let number = self.recent.number(key, |name| names.number(name));
        self.reference(number, 1, offset)?;
        if let Some(counter) = &mut self.counter {
            counter.plain(number, at);
        }
        Ok(())
    }

    fn element(&mut self, element: &ElementContent) -> Result<(), SinkError> {
        Ok(self.add(element, 1, [0; 4])?)
    }

    fn repeated(&mut self, element: &ElementContent, copies: &Copies<'_>) -> Result<(), SinkError> {
        Ok(self.add(element, copies.count, copies.reach)?)
    }
}

impl Tally {
    /// Count an element with so many copies; `reach` is left, bottom, right, top of their places from the first.
    fn add(&mut self, element: &ElementContent, copies: u64, reach: [i64; 4]) -> Result<(), LayoutError> {
        self.cells.last_mut().expect("a cell was begun").with_properties += u64::from(element.properties > 0);
        let refers = matches!(element.kind, ElementKind::Reference | ElementKind::Array);
        if element.kind == ElementKind::Path && element.width < 0 {
            self.absolute.get_or_insert(element.offset);
        }
        self.magnified |= refers && element.magnification != 1.0;
        if refers {
            let number = self.names.number(&element.name);
            self.reference(number, element.copies().saturating_mul(copies), element.offset)?;
            if let Some(counter) = &mut self.counter {
                counter.reference(number, element, reach);
            }
            return Ok(());
        }
        if element.kind == ElementKind::Path {
            let width = i64::from(element.width);
            outline(
                &element.points,
                width,
                element.path_type,
                element.extensions,
                &mut self.path,
            );
        }
        let path = Rect::around(&self.path);
        self.layer(element.layer)?;
        if let Some(counter) = &mut self.counter {
            counter.element(self.last, element, copies);
        }
        let tally = self.layer(element.layer)?;
        let count = match element.kind {
            ElementKind::Boundary => &mut tally.boundaries,
            ElementKind::Box => &mut tally.boxes,
            ElementKind::Path => &mut tally.paths,
            ElementKind::Text => &mut tally.texts,
            _ => &mut tally.nodes,
        };
        *count = count.saturating_add(copies);
        let bounds = match element.kind {
            ElementKind::Text => {
                let bytes = copies.saturating_mul(element.string.len() as u64);
                tally.text_bytes = tally.text_bytes.saturating_add(bytes);
                return Ok(());
            }
            ElementKind::Path => path,
            ElementKind::Boundary | ElementKind::Box => Rect::around(&element.points),
            _ => return Ok(()),
        };
        let vertices = copies.saturating_mul(element.points.len() as u64);
        tally.vertices = tally.vertices.saturating_add(vertices);
        if !bounds.is_empty() {
            tally.bounds.unite(&Rect {
                x0: bounds.x0 + reach[0],
                y0: bounds.y0 + reach[1],
                x1: bounds.x1 + reach[2],
                y1: bounds.y1 + reach[3],
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::layout::Layout;
    use super::super::visit::{Selection, Visitor};
    use super::*;
    use crate::{Shape, Transform};
    use metalith_core::Silent;

    struct All(Vec<(LayerNumber, Vec<Point>, Option<Rect>)>);

    impl Visitor for All {
        fn shape(&mut self, shape: &Shape<'_>, _placements: &[Transform]) -> metalith_core::Result<()> {
            self.0.push((shape.layer, shape.outline.points().collect(), shape.rect));
            Ok(())
        }
    }

    /// Bytes of a library with squares, nearly squares and references, names of one to twelve letters.
    fn sample() -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut record = |kind: u8, data: u8, body: &[u8]| {
            bytes.extend((body.len() as u16 + 4).to_be_bytes());
            bytes.extend([kind, data]);
            bytes.extend(body);
        };
        record(kind::HEADER, 2, &[2, 0x58]);
        let units = [0x3E41_8937_4BC6_A7F0u64, 0x3944_B82F_A09B_5A54].map(u64::to_be_bytes);
        record(kind::UNITS, 5, units.concat().as_slice());
        for cell in ["A", "BC", "DEF", "GHIJKLMN", "GHIJKLMNOPQR", "TOP"] {
            let padded = |name: &str| {
                let mut name = name.as_bytes().to_vec();
                name.resize(name.len().next_multiple_of(2), 0);
                name
            };
            record(kind::BGNSTR, 2, &[0; 24]);
            record(kind::STRNAME, 6, &padded(cell));
            for k in 0..200i32 {
                let w = 2 + k % 5;
                let mut square = [(0, 0), (w, 0), (w, w), (0, w), (0, 0)].map(|(x, y)| (x + 7 * k, y - 3 * k));
                if k % 17 == 0 {
                    square[k as usize % 5].0 += 1;
                }
                record(kind::BOUNDARY, 0, &[]);
                record(kind::LAYER, 2, &(k as i16 % 3).to_be_bytes());
                record(kind::DATATYPE, 2, &0i16.to_be_bytes());
                let xy: Vec<u8> = square
                    .iter()
                    .flat_map(|p| [p.0, p.1])
                    .flat_map(i32::to_be_bytes)
                    .collect();
                record(kind::XY, 3, &xy);
                record(kind::ENDEL, 0, &[]);
                for name in ["A", "BC", "DEF", "GHIJKLMN", "GHIJKLMNOPQR"]
                    .iter()
                    .filter(|_| cell == "TOP")
                {
                    record(kind::SREF, 0, &[]);
                    record(kind::SNAME, 6, &padded(name));
                    record(kind::XY, 3, &[k.to_be_bytes(), (-k).to_be_bytes()].concat());
                    record(kind::ENDEL, 0, &[]);
                }
            }
            record(kind::ENDSTR, 0, &[]);
        }
        record(kind::ENDLIB, 0, &[]);
        bytes
    }

    /// Elements recognised by their bytes are what the grammar says, in both readings.
    #[test]
    fn recognised_elements_are_those_of_the_grammar() {
        let bytes = sample();
        let limits = ReadLimits::default();
        let source = Source::Memory {
            name: "sample.gds".into(),
            bytes: bytes.clone().into(),
        };
        let numbers = |walk: Walk<'_>| {
            let mut walk = walk;
            let mut input = source.open().unwrap();
            scan_with(&mut input, bytes.len() as u64, Some(Counter::new()), &mut walk).unwrap()
        };
        let (fast, slow) = (
            numbers(Walk::new(&limits, &Silent)),
            numbers(Walk::new(&limits, &Silent).slowly()),
        );
        assert_eq!(format!("{:?}", fast.cells), format!("{:?}", slow.cells));
        let layout = Layout::from_scan(source.clone(), limits, fast);
        let shapes = |slowly: bool| {
            let mut all = All(Vec::new());
            let visit = if slowly { Layout::visit_slowly } else { Layout::visit };
            visit(&layout, &Selection::default(), &mut all, &Silent).unwrap();
            all.0
        };
        let read = shapes(false);
        assert_eq!(read.len(), 6 * 200);
        assert!(read == shapes(true));
    }
}
