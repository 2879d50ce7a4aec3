//! Cells of OASIS files, as the elements that those of GDSII are.

use std::collections::HashMap;
use std::io::{Read, Seek};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use metalith_core::{LayerNumber, Progress};
use metalith_oasis::{
    CellReference, NameTable, OasisElement, OasisError, OasisFault, OasisItem, OasisLimit, OasisLimits, OasisPlace,
    OasisReader, OasisShape, OasisWarning, Repetition, StringKind,
};

use super::cell::LayoutCell;
use super::element::{ElementContent, ElementKind};
use super::input::Source;
use super::inventory::{Counter, FormatDetails};
use super::limits::ReadLimits;
use super::read_warnings::{ReadWarning, ReadWarnings};
use super::scan::{Scan, Tally};
use super::shape::Point;
use super::walk::{Sink, SinkError};
use crate::error::{Error, LayoutError, Limit, Result};

/// Bytes of the file or of a CBLOCK that are read, and the texts that elements refer to by number.
pub(super) trait ReadSeek: Read + Seek + Send {}
impl<T: Read + Seek + Send> ReadSeek for T {}

/// Texts by number.
pub(super) type Texts = Arc<HashMap<u64, Vec<u8>>>;

/// Elements between two looks at whether the user stopped reading.
const ELEMENTS_AT_A_TIME: u32 = 1 << 12;

/// Places of the copies of a repeated element.
pub(super) struct Copies<'a> {
    pub repetition: &'a Repetition,
    /// Number of them; at most `u64::MAX`.
    pub count: u64,
    /// Left, bottom, right, top of their places, from the first.
    pub reach: [i64; 4],
}

impl Copies<'_> {
    /// Call `with` with the place of each copy from the first.
    #[inline]
    pub(crate) fn each<E>(&self, mut with: impl FnMut(Point) -> Result<(), E>) -> Result<(), E> {
        self.repetition.each(|[x, y]| with(Point::new(x, y)))
    }
}

/// A cell by its number in the table of names, as a name: no name of a cell begins with this byte.
const NUMBERED: u8 = 1;
/// Numbers of cells that are read: they fit in a key of eight bytes with the mark.
const MOST_NUMBER: u64 = (1 << 56) - 1;

/// The key that [`super::names::Recent`] knows a numbered cell by.
fn key_of(number: u64) -> u64 {
    number << 8 | u64::from(NUMBERED)
}

/// The name that stands for a numbered cell until the table of names is read.
fn put_numbered(number: u64, name: &mut Vec<u8>) {
    let bytes = key_of(number).to_le_bytes();
    let length = 8 - key_of(number).leading_zeros() as usize / 8;
    name.clear();
    name.extend_from_slice(&bytes[..length]);
}

/// The bytes of a name that stands in a record; one that would read as a number as it is.
fn inline_name(name: &[u8]) -> std::borrow::Cow<'_, [u8]> {
    let bytes = StringKind::Name.unescaped(name);
    if numbered(&bytes).is_some() { name.into() } else { bytes }
}

/// The number that a name stands for.
pub(super) fn numbered(name: &[u8]) -> Option<u64> {
    let (&first, rest) = name.split_first()?;
    let number = rest.iter().rev().fold(0, |number, &b| number << 8 | u64::from(b));
    (first == NUMBERED).then_some(number)
}

/// An OASIS file that is being read.
pub(super) struct OasisCells {
    reader: OasisReader<Box<dyn ReadSeek>>,
    path: PathBuf,
    texts: Texts,
    element: ElementContent,
    /// True if texts that are in no table are an error: not before the tables were read.
    resolve: bool,
}

impl OasisCells {
    pub(crate) fn open(source: &Source, texts: Texts) -> Result<Self> {
        let reader = OasisReader::unverified(source.raw()?, OasisLimits::default());
        let reader = reader.map_err(located(source.path()))?.tolerant(true);
        Ok(Self::of(reader, source, texts, true))
    }

    fn of(reader: OasisReader<Box<dyn ReadSeek>>, source: &Source, texts: Texts, resolve: bool) -> Self {
        Self {
            reader,
            path: source.path().to_owned(),
            texts,
            element: ElementContent::default(),
            resolve,
        }
    }

    pub(crate) fn offset(&self) -> u64 {
        self.reader.offset()
    }

    pub(crate) fn fault(&self, offset: u64, cause: LayoutError) -> Error {
        Error::Layout {
            path: self.path.clone(),
            offset,
            cause,
        }
    }

    /// Go to the first element of a cell.
    pub(crate) fn seek(&mut self, cell: &LayoutCell) -> Result<()> {
        let place = OasisPlace {
            offset: cell.bytes.start,
            inner: cell.inner,
        };
        self.reader.seek(place).map_err(located(&self.path))?;
        match self.reader.read_item().map_err(located(&self.path))? {
            OasisItem::Cell(_) => Ok(()),
            _ => Err(self.fault(cell.bytes.start, LayoutError::Rewritten)),
        }
    }

    /// Hand the elements up to the next cell to `sink`, reporting to `progress`.
    pub(crate) fn cell<S: Sink>(
        &mut self,
        limits: &ReadLimits,
        sink: &mut S,
        mut report: impl FnMut(u64) -> Result<()>,
    ) -> Result<()> {
        let mut count = 0u32;
        loop {
            match self.reader.read_item().map_err(located(&self.path))? {
                OasisItem::Element(element) => {
                    let at = element.place.offset;
                    let taken = feed(&element, &mut self.element, &self.texts, self.resolve, limits, sink);
                    settle(taken, &self.path, at)?;
                    count += 1;
                    if count.is_multiple_of(ELEMENTS_AT_A_TIME) {
                        report(self.reader.offset())?;
                    }
                }
                OasisItem::Property { .. } => {}
                OasisItem::Cell(_) | OasisItem::Name(_) | OasisItem::End => return report(self.reader.offset()),
            }
        }
    }
}

/// An error of a sink with its place.
fn settle(taken: Result<(), SinkError>, path: &Path, offset: u64) -> Result<()> {
    taken.map_err(|error| match error {
        SinkError::With(error) => error,
        SinkError::Here(cause) => Error::Layout {
            path: path.to_owned(),
            offset,
            cause,
        },
    })
}

/// An error of the reader with the path of the file.
fn located(path: &Path) -> impl Fn(OasisError) -> Error {
    move |error| match error {
        OasisError::Io(source) => Error::io("read", path)(source),
        OasisError::Fault { offset, inner, fault } => Error::Layout {
            path: path.to_owned(),
            offset,
            cause: LayoutError::Oasis { inner, fault },
        },
        other => Error::io("read", path)(std::io::Error::other(other)),
    }
}

/// Hand one element to a sink.
#[inline]
fn feed<S: Sink>(
    element: &OasisElement<'_>,
    content: &mut ElementContent,
    texts: &HashMap<u64, Vec<u8>>,
    resolve: bool,
    limits: &ReadLimits,
    sink: &mut S,
) -> Result<(), SinkError> {
    let (offset, at) = (element.place.offset, Point::new(element.at[0], element.at[1]));
    let layer = || match (u16::try_from(element.layer), u16::try_from(element.datatype)) {
        (Ok(layer), Ok(datatype)) => Ok(LayerNumber::new(layer, datatype)),
        _ => Err(LayoutError::LayerNumber {
            layer: element.layer,
            datatype: element.datatype,
        }),
    };
    let place = |[x, y]: [i64; 2]| Point::new(at.x + x, at.y + y);
    match element.shape {
        OasisShape::Rectangle { size: [w, h] } => {
            let corners = [[0, 0], [w, 0], [w, h], [0, h], [0, 0]].map(place);
            if element.repetition.is_none() {
                return sink.five_points(offset, layer()?, &corners);
            }
            content.begin(offset, ElementKind::Boundary);
            content.points.extend(corners);
            content.layer = layer()?;
        }
        OasisShape::Placement {
            cell,
            mirrored,
            magnification,
            angle_deg,
        } => {
            let number = match cell {
                CellReference::Number(number) if number > MOST_NUMBER => {
                    return Err(LayoutError::CellNumber { number }.into());
                }
                CellReference::Number(number) => Some(number),
                CellReference::Name(_) => None,
            };
            let plain = !mirrored && magnification == 1.0 && angle_deg == 0.0;
            if let (Some(number), true, None) = (number, plain, element.repetition) {
                return sink.plain_reference(offset, key_of(number), at);
            }
            content.begin(offset, ElementKind::Reference);
            match cell {
                CellReference::Number(number) => put_numbered(number, &mut content.name),
                CellReference::Name(name) if name.len() > limits.name_bytes => {
                    return Err(LayoutError::ReferenceName { bytes: name.len() }.into());
                }
                CellReference::Name(name) => content.name.extend_from_slice(&inline_name(name)),
            }
            content.points.push(at);
            (content.mirror, content.magnification, content.angle_deg) = (mirrored, magnification, angle_deg);
        }
        OasisShape::Polygon { points } => {
            if let (&[a, b, c, d], None) = (points, element.repetition) {
                return sink.five_points(offset, layer()?, &[a, b, c, d, a].map(place));
            }
            content.begin(offset, ElementKind::Boundary);
            let corners = points.iter().chain(points.first());
            content.points.extend(corners.copied().map(place));
            content.layer = layer()?;
        }
        OasisShape::Circle { radius } => {
            content.begin(offset, ElementKind::Boundary);
            circle(at, radius, &mut content.points);
            content.layer = layer()?;
        }
        OasisShape::Path {
            points,
            half_width,
            extensions,
        } => {
            content.begin(offset, ElementKind::Path);
            content.points.extend(points.iter().copied().map(place));
            content.layer = layer()?;
            let narrow = |v: i64| i32::try_from(v).map_err(|_| far(v));
            content.width = narrow(2 * half_width)?;
            content.path_type = 4;
            content.extensions = [narrow(extensions[0])?, narrow(extensions[1])?];
        }
        OasisShape::Text { string } => {
            content.begin(offset, ElementKind::Text);
            content.points.push(at);
            content.layer = layer()?;
            match string {
                CellReference::Name(text) => content.string.extend_from_slice(&StringKind::Text.unescaped(text)),
                CellReference::Number(number) => match texts.get(&number) {
                    Some(text) => content.string.extend_from_slice(text),
                    None if resolve => return Err(LayoutError::TextNumber { number }.into()),
                    // Until the table of texts is read.
                    None if number <= MOST_NUMBER => put_numbered(number, &mut content.string),
                    None => {}
                },
            }
        }
        OasisShape::Private { .. } => return Ok(()),
    }
    match element.repetition {
        None => sink.element(content),
        Some(repetition) => sink.repeated(
            content,
            &Copies {
                repetition,
                count: element.copies,
                reach: element.reach,
            },
        ),
    }
}

/// A length that no path has.
fn far(length: i64) -> LayoutError {
    LayoutError::Oasis {
        inner: None,
        fault: OasisFault::Limit {
            limit: OasisLimit::Farthest,
            found: length.unsigned_abs(),
            most: i32::MAX as u64,
        },
    }
}

/// Fewest and most corners of the polygon of a circle.
const CORNERS: [f64; 2] = [8.0, 256.0];

/// The polygon of a circle, closed: no chord farther from it than half a database unit, if that takes no more than 256
/// corners.
fn circle(centre: Point, radius: i64, out: &mut Vec<Point>) {
    let r = radius as f64;
    // The sagitta of a chord over an angle a is r (1 - cos(a / 2)).
    let half_angle = (1.0 - 0.5 / r.max(1.0)).acos();
    let corners = (std::f64::consts::PI / half_angle).ceil().clamp(CORNERS[0], CORNERS[1]) as usize;
    out.extend((0..=corners).map(|k| {
        let (sin, cos) = (std::f64::consts::TAU * (k % corners) as f64 / corners as f64).sin_cos();
        Point::new(centre.x + (r * cos).round() as i64, centre.y + (r * sin).round() as i64)
    }));
}

/// Read the file once.
pub(super) fn scan(
    source: &Source,
    limits: &ReadLimits,
    counter: Option<Counter>,
    progress: &dyn Progress,
) -> Result<Scan> {
    let path = source.path();
    progress.begin("reading cells", source.bytes());
    let reader = OasisReader::new(source.raw()?, OasisLimits::default()).map_err(located(path))?;
    let reader = reader.tolerant(!progress.strict());
    let grid_per_um = reader.grid_per_um();
    let units = [1.0 / grid_per_um, 1e-6 / grid_per_um];
    let mut tally = Tally::new(*limits, counter);
    tally.unit(units);
    let mut cells = OasisCells::of(reader, source, Texts::default(), false);
    let mut tables = Tables::new(limits);
    let (mut in_cell, mut with_properties, mut reported, mut name) = (false, true, 0, Vec::new());
    let mut count = 0u32;
    loop {
        let before = cells.reader.offset();
        let item = cells.reader.read_item().map_err(located(path))?;
        if in_cell && !matches!(item, OasisItem::Element(_) | OasisItem::Property { .. }) {
            tally.end(before);
            in_cell = false;
        }
        let mut begun = false;
        match item {
            OasisItem::Element(element) => {
                let at = element.place.offset;
                let texts = &tables.texts;
                let taken = feed(&element, &mut cells.element, texts, false, limits, &mut tally);
                settle(taken, path, at)?;
                with_properties = false;
            }
            OasisItem::Property { .. } => {
                if in_cell && !std::mem::replace(&mut with_properties, true) {
                    tally.count_properties();
                }
            }
            OasisItem::Cell(reference) => {
                match reference {
                    CellReference::Number(number) if number > MOST_NUMBER => {
                        let at = cells.reader.place().offset;
                        return Err(cells.fault(at, LayoutError::CellNumber { number }));
                    }
                    CellReference::Number(number) => put_numbered(number, &mut name),
                    CellReference::Name(bytes) => {
                        name.clear();
                        name.extend_from_slice(&inline_name(bytes));
                    }
                }
                begun = true;
            }
            OasisItem::Name(entry) => {
                let taken = tables.add(entry.table, entry.number, entry.name);
                let at = cells.reader.place().offset;
                settle(taken.map_err(SinkError::Here), path, at)?;
            }
            OasisItem::End => break,
        }
        if begun {
            let place = cells.reader.place();
            let taken = tally.begin_cell(&name, place.offset, place.inner);
            settle(taken.map_err(SinkError::Here), path, place.offset)?;
            (in_cell, with_properties) = (true, true);
        }
        count += 1;
        if count.is_multiple_of(ELEMENTS_AT_A_TIME) {
            progress.advance(cells.reader.offset().saturating_sub(reported));
            reported = cells.reader.offset();
            progress.check_stopped()?;
        }
    }
    let details = FormatDetails::Oasis(cells.reader.details());
    let mut scan = tally.finish_numbered(units, &tables.cells, tables.texts, details);
    let (listed, count) = cells.reader.warnings();
    let warning = |warning: &OasisWarning| {
        let (inner, fault) = (None, warning.fault.clone());
        ReadWarning {
            offset: warning.offset,
            cause: LayoutError::Oasis { inner, fault },
            taken: warning.taken,
        }
    };
    scan.warnings = ReadWarnings {
        listed: listed.iter().map(warning).collect(),
        count,
    };
    Ok(scan)
}

/// Names and texts by number.
struct Tables {
    cells: HashMap<u64, Vec<u8>>,
    texts: HashMap<u64, Vec<u8>>,
    bytes: usize,
    limits: ReadLimits,
}

impl Tables {
    fn new(limits: &ReadLimits) -> Self {
        Self {
            cells: HashMap::new(),
            texts: HashMap::new(),
            bytes: 0,
            limits: *limits,
        }
    }

    fn add(&mut self, table: NameTable, number: u64, name: &[u8]) -> Result<(), LayoutError> {
        let (entries, kind) = match table {
            NameTable::Cells => (&mut self.cells, StringKind::Name),
            NameTable::Texts => (&mut self.texts, StringKind::Text),
            _ => return Ok(()),
        };
        if table == NameTable::Cells && name.len() > self.limits.name_bytes {
            return Err(LayoutError::CellName { bytes: name.len() });
        }
        self.bytes += name.len();
        if entries.len() >= self.limits.cells || self.bytes > self.limits.all_name_bytes {
            return Err(LayoutError::Limit {
                limit: Limit::Names,
                found: entries.len() as u64 + 1,
                most: self.limits.cells as u64,
            });
        }
        entries
            .entry(number)
            .or_insert_with(|| kind.unescaped(name).into_owned());
        Ok(())
    }
}
