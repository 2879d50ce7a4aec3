//! The first reading: every byte is looked at once, and of each cell the numbers are kept.

use std::collections::HashMap;

use super::cell::{Child, LayerTally, LayoutCell};
use super::element::{ElementContent, ElementKind};
use super::input::{Input, Source};
use super::limits::ReadLimits;
use super::names::{Names, Recent};
use super::outline::outline;
use super::record::{self, kind};
use super::shape::{Point, Rect};
use super::walk::{Sink, SinkError, Walk};
use crate::error::{Error, LayoutError, Limit, Result};
use metalith_core::text::printable_bytes;
use metalith_core::{LayerNumber, Progress};

/// What the first reading found.
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
}

/// Read the file once.
pub(super) fn scan(source: &Source, limits: &ReadLimits, progress: &dyn Progress) -> Result<Scan> {
    let mut input = source.open()?;
    progress.begin("reading cells", source.bytes());
    let mut walk = Walk::new(limits, progress);
    scan_with(&mut input, source.bytes(), &mut walk)
}

/// As [`scan`], with a walk that may be told to use the grammar alone.
pub(super) fn scan_with(input: &mut Input, bytes: u64, walk: &mut Walk<'_>) -> Result<Scan> {
    if let &[_, _, first, ..] = input.window()?
        && first != kind::HEADER
    {
        return Err(input.fault(0, LayoutError::NoHeader));
    }
    input.next()?;
    let mut title = String::new();
    let mut units = None;
    let mut tally = Tally::new(*walk.limits);
    loop {
        let record = input.next()?;
        match record.kind {
            kind::LIBNAME => title = printable_bytes(input.text(record)?),
            kind::UNITS => units = Some(read_units(input, record)?),
            kind::BGNSTR => {
                if units.is_none() {
                    return Err(input.fault(record.offset, LayoutError::UnitsMissingBeforeCell));
                }
                tally.begin(input, record.offset)?;
                walk.cell(input, &mut tally)?;
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
    })
}

fn stray(input: &Input, record: record::Record) -> Error {
    input.fault(record.offset, LayoutError::OutsideCells { kind: record.kind })
}

/// Smallest and largest database unit that is read (m).
const UNIT_RANGE_M: std::ops::RangeInclusive<f64> = 1e-13..=1e-3;

fn read_units(input: &Input, record: record::Record) -> Result<[f64; 2]> {
    let units = [input.real8(record, 0)?, input.real8(record, 1)?];
    if !UNIT_RANGE_M.contains(&units[1]) || units[0].is_nan() || units[0] <= 0.0 {
        let cause = LayoutError::UnitSize {
            metres: units[1],
            user: units[0],
        };
        return Err(input.fault(record.offset, cause));
    }
    Ok(units)
}

/// What is kept of the cells met so far, and the counts of the one being read.
struct Tally {
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
}

impl Tally {
    fn new(limits: ReadLimits) -> Self {
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
        }
    }

    /// A cell begins: read its name.
    fn begin(&mut self, input: &mut Input, offset: u64) -> Result<()> {
        let record = input.next()?;
        if record.kind != kind::STRNAME {
            let kind = record.kind;
            return Err(input.fault(record.offset, LayoutError::NoCellName { kind }));
        }
        let name = input.text(record)?;
        if name.is_empty() || name.len() > self.limits.name_bytes {
            return Err(input.fault(record.offset, LayoutError::CellName { bytes: name.len() }));
        }
        if self.cells.len() >= self.limits.cells {
            let cause = too_many(Limit::Cells, self.cells.len() + 1, self.limits.cells);
            return Err(input.fault(record.offset, cause));
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
            inline: false,
        });
        self.layers.clear();
        self.last = usize::MAX;
        Ok(())
    }

    /// The current cell is complete.
    fn end(&mut self, offset: u64) {
        let cell = self.cells.last_mut().expect("a cell was begun");
        cell.bytes.end = offset;
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
        Ok(())
    }

    #[inline]
    fn plain_reference(&mut self, offset: u64, key: u64, _at: Point) -> Result<(), SinkError> {
        let names = &mut self.names;
        let number = self.recent.number(key, |name| names.number(name));
        Ok(self.reference(number, 1, offset)?)
    }

    fn element(&mut self, input: &Input, element: &ElementContent) -> Result<()> {
        let located = |cause| input.fault(element.offset, cause);
        self.cells.last_mut().expect("a cell was begun").with_properties += u64::from(element.properties > 0);
        if matches!(element.kind, ElementKind::Reference | ElementKind::Array) {
            let number = self.names.number(&element.name);
            return self
                .reference(number, element.copies(), element.offset)
                .map_err(located);
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
        let tally = self.layer(element.layer).map_err(located)?;
        let count = match element.kind {
            ElementKind::Boundary => &mut tally.boundaries,
            ElementKind::Box => &mut tally.boxes,
            ElementKind::Path => &mut tally.paths,
            ElementKind::Text => &mut tally.texts,
            _ => &mut tally.nodes,
        };
        *count += 1;
        match element.kind {
            ElementKind::Text => tally.text_bytes += element.string.len() as u64,
            ElementKind::Path => tally.bounds.unite(&path),
            ElementKind::Boundary | ElementKind::Box => element.points.iter().for_each(|&p| tally.bounds.include(p)),
            _ => {}
        }
        if matches!(element.kind, ElementKind::Text | ElementKind::Node) {
            return Ok(());
        }
        tally.vertices += element.points.len() as u64;
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
            self.0.push((shape.layer, shape.points.to_vec(), shape.rect));
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

    /// What is recognised by its bytes is what the grammar says it is, in both readings.
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
            scan_with(&mut input, bytes.len() as u64, &mut walk).unwrap()
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
