//! Cells as GDSII.

use std::io::Write;
use std::path::Path;

use metalith_core::text::printable_bytes;
use metalith_core::{Error, LayerNumber, Progress, Result};
use metalith_gds::library::GdsLibrary;
use metalith_gds::write::real8;
use metalith_gds::{CellConsumer, CellItem, Layout, LayoutCell, Point};
use metalith_oasis::Repetition;

use super::cut::cut;
use super::output::Output;
use super::{Changes, does_not_fit};
use crate::gds_frame::{encode, gds_date};

/// Bytes that are written at a time.
const AT_A_TIME: usize = 1 << 18;
/// Points of one XY record.
const MOST_POINTS: usize = 8191;
/// Bytes of a string: the length of a record has 16 bits and is even.
const MOST_STRING: usize = 0xFFFE - 4;
/// Columns and rows of an array.
const MOST_COLUMNS: u64 = i16::MAX as u64;
/// Records ENDSTR and ENDLIB.
const END: usize = 4;
/// Record ENDLIB.
const END_OF_LIBRARY: [u8; 4] = [0, 4, 4, 0];

/// Types of records, each with its type of data.
mod record {
    pub(super) const BGNSTR: u16 = 0x0502;
    pub(super) const STRNAME: u16 = 0x0606;
    pub(super) const ENDSTR: u16 = 0x0700;
    pub(super) const BOUNDARY: u16 = 0x0800;
    pub(super) const PATH: u16 = 0x0900;
    pub(super) const SREF: u16 = 0x0A00;
    pub(super) const AREF: u16 = 0x0B00;
    pub(super) const TEXT: u16 = 0x0C00;
    pub(super) const LAYER: u16 = 0x0D02;
    pub(super) const DATATYPE: u16 = 0x0E02;
    pub(super) const WIDTH: u16 = 0x0F03;
    pub(super) const XY: u16 = 0x1003;
    pub(super) const ENDEL: u16 = 0x1100;
    pub(super) const SNAME: u16 = 0x1206;
    pub(super) const COLROW: u16 = 0x1302;
    pub(super) const TEXTTYPE: u16 = 0x1602;
    pub(super) const STRING: u16 = 0x1906;
    pub(super) const STRANS: u16 = 0x1A01;
    pub(super) const MAG: u16 = 0x1B05;
    pub(super) const ANGLE: u16 = 0x1C05;
    pub(super) const PATHTYPE: u16 = 0x2102;
    pub(super) const BGNEXTN: u16 = 0x3003;
    pub(super) const ENDEXTN: u16 = 0x3103;
}

/// Write all cells. Returns the length of what was written, before compression.
pub(super) fn write(layout: &Layout, path: &Path, changes: &mut Changes, progress: &dyn Progress) -> Result<u64> {
    let mut target = Target {
        layout,
        out: Output::create(path)?,
        path,
        bytes: 0,
        buffer: Vec::new(),
        dates: Vec::new(),
        open: false,
        changes,
    };
    let name = Some(layout.library()).filter(|name| !name.is_empty() && name.is_ascii());
    // The date of everything: a file must not depend on when it was written.
    let date = gds_date(chrono::DateTime::UNIX_EPOCH.naive_utc());
    let units = [layout.user_unit(), layout.unit_nm() * 1e-9];
    let head = encode(&GdsLibrary::new(name.unwrap_or("LIB"), units, date))?;
    // The body of BGNLIB, behind HEADER.
    target.dates = head[10..34].to_vec();
    target.buffer.extend(&head[..head.len() - END]);
    // KLayout reads notes where they are the first cell.
    layout.copy_notes(&mut |bytes| {
        target.buffer.extend(bytes);
        target.flush_above(AT_A_TIME)
    })?;
    layout.cell_items(&mut target, progress)?;
    target.end();
    target.buffer.extend(END_OF_LIBRARY);
    target.flush_above(0)?;
    let bytes = target.bytes;
    target.out.commit(path)?;
    Ok(bytes)
}

struct Target<'a> {
    layout: &'a Layout,
    out: Output,
    path: &'a Path,
    bytes: u64,
    buffer: Vec<u8>,
    dates: Vec<u8>,
    /// True if a cell is open.
    open: bool,
    changes: &'a mut Changes,
}

impl Target<'_> {
    /// Write what is in the buffer if it is more than so many bytes.
    fn flush_above(&mut self, bytes: usize) -> Result<()> {
        if self.buffer.len() > bytes {
            self.bytes += self.buffer.len() as u64;
            self.out
                .write_all(&self.buffer)
                .map_err(Error::io("write", self.path))?;
            self.buffer.clear();
        }
        Ok(())
    }

    fn record(&mut self, kind: u16, body: &[u8]) {
        self.buffer.extend((body.len() as u16 + 4).to_be_bytes());
        self.buffer.extend(kind.to_be_bytes());
        self.buffer.extend(body);
    }

    fn string(&mut self, kind: u16, string: &[u8]) -> Result<()> {
        if string.len() > MOST_STRING {
            let start = printable_bytes(&string[..16]);
            return Err(does_not_fit(
                format!("a string of {} bytes, {start}...", string.len()),
                "a string of GDSII has at most 65530 bytes: shorten it",
            ));
        }
        self.record(kind, string);
        if !string.len().is_multiple_of(2) {
            let length = string.len() as u16 + 5;
            let at = self.buffer.len() - string.len() - 4;
            self.buffer[at..at + 2].copy_from_slice(&length.to_be_bytes());
            self.buffer.push(0);
        }
        Ok(())
    }

    fn layers(&mut self, layer: LayerNumber, kind: u16) {
        self.record(record::LAYER, &layer.layer.to_be_bytes());
        self.record(kind, &layer.datatype.to_be_bytes());
    }

    fn points(&mut self, points: impl ExactSizeIterator<Item = Point>, by: [i64; 2]) -> Result<()> {
        if points.len() > MOST_POINTS {
            return Err(does_not_fit(
                format!("a path of {} points", points.len()),
                "an element of GDSII has at most 8191: split the path",
            ));
        }
        self.buffer.extend((8 * points.len() as u16 + 4).to_be_bytes());
        self.buffer.extend(record::XY.to_be_bytes());
        for p in points {
            for value in [p.x + by[0], p.y + by[1]] {
                self.buffer.extend(coordinate(value)?.to_be_bytes());
            }
        }
        Ok(())
    }

    fn strans(&mut self, mirrored: bool, magnification: f64, angle_deg: f64) {
        if mirrored || magnification != 1.0 || angle_deg != 0.0 {
            self.record(record::STRANS, &[if mirrored { 0x80 } else { 0 }, 0]);
            if magnification != 1.0 {
                self.record(record::MAG, &real8(magnification));
            }
            if angle_deg != 0.0 {
                self.record(record::ANGLE, &real8(angle_deg));
            }
        }
    }

    fn end(&mut self) {
        if std::mem::take(&mut self.open) {
            self.record(record::ENDSTR, &[]);
        }
    }

    /// One copy of an item, farther by a step.
    fn copy(&mut self, item: &CellItem<'_>, by: [i64; 2]) -> Result<()> {
        match *item {
            CellItem::Area { layer, points } => {
                self.record(record::BOUNDARY, &[]);
                self.layers(layer, record::DATATYPE);
                let closing = points.first().filter(|p| points.last() != Some(p));
                let all: Vec<Point> = points.iter().chain(closing).copied().collect();
                self.points(all.into_iter(), by)?;
            }
            CellItem::Line {
                layer,
                points,
                width,
                extensions,
            } => {
                self.record(record::PATH, &[]);
                self.layers(layer, record::DATATYPE);
                let plain = extensions == [0, 0];
                self.record(record::PATHTYPE, &[0, if plain { 0 } else { 4 }]);
                self.record(record::WIDTH, &coordinate(width)?.to_be_bytes());
                if !plain {
                    self.record(record::BGNEXTN, &coordinate(extensions[0])?.to_be_bytes());
                    self.record(record::ENDEXTN, &coordinate(extensions[1])?.to_be_bytes());
                }
                self.points(points.iter().copied(), by)?;
            }
            CellItem::Text { layer, string, at } => {
                self.record(record::TEXT, &[]);
                self.layers(layer, record::TEXTTYPE);
                self.points([at].into_iter(), by)?;
                self.string(record::STRING, string)?;
            }
            CellItem::Reference {
                name,
                at,
                mirrored,
                magnification,
                angle_deg,
                ..
            } => {
                self.record(record::SREF, &[]);
                self.string(record::SNAME, name)?;
                self.strans(mirrored, magnification, angle_deg);
                self.points([at].into_iter(), by)?;
            }
        }
        self.record(record::ENDEL, &[]);
        self.flush_above(AT_A_TIME)
    }

    /// An array of references, in as many AREF records as it takes.
    fn array(&mut self, item: &CellItem<'_>, count: [u64; 2], step: [[i64; 2]; 2]) -> Result<()> {
        let CellItem::Reference {
            name,
            at,
            mirrored,
            magnification,
            angle_deg,
            ..
        } = *item
        else {
            return Ok(());
        };
        let pieces = |count: u64| (0..count).step_by(MOST_COLUMNS as usize);
        for (row, column) in pieces(count[1]).flat_map(|row| pieces(count[0]).map(move |column| (row, column))) {
            let first: [i64; 2] =
                std::array::from_fn(|axis| column as i64 * step[0][axis] + row as i64 * step[1][axis]);
            let counts = [count[0] - column, count[1] - row].map(|n| n.min(MOST_COLUMNS) as i64);
            let [along, up] = [0, 1].map(|k: usize| step[k].map(|s| counts[k] * s));
            self.record(record::AREF, &[]);
            self.string(record::SNAME, name)?;
            self.strans(mirrored, magnification, angle_deg);
            let counts = counts.map(|n| (n as i16).to_be_bytes()).concat();
            self.record(record::COLROW, &counts);
            let corners = [[0, 0], along, up].map(|[x, y]| Point::new(at.x + x, at.y + y));
            self.points(corners.into_iter(), first)?;
            self.record(record::ENDEL, &[]);
            self.flush_above(AT_A_TIME)?;
        }
        Ok(())
    }
}

impl CellConsumer for Target<'_> {
    fn cell(&mut self, index: usize, _cell: &LayoutCell) -> Result<()> {
        self.end();
        let dates = std::mem::take(&mut self.dates);
        self.record(record::BGNSTR, &dates);
        self.dates = dates;
        self.open = true;
        let layout = self.layout;
        self.string(record::STRNAME, layout.name_bytes(index))
    }

    fn item(&mut self, item: &CellItem<'_>, repetition: Option<&Repetition>) -> Result<()> {
        if let CellItem::Area { layer, points } = *item
            && points.len() + usize::from(points.first() != points.last()) > MOST_POINTS
        {
            let corners: Vec<[i64; 2]> = points.iter().map(|p| [p.x, p.y]).collect();
            let parts = cut(&corners, MOST_POINTS - 1).ok_or_else(|| {
                does_not_fit(
                    format!("an outline of {} points that cuts do not shorten", points.len()),
                    "an element of GDSII has at most 8191: split the polygon",
                )
            })?;
            self.changes.cut(points.len(), parts.len());
            for part in parts {
                let points: Vec<Point> = part.iter().map(|&[x, y]| Point::new(x, y)).collect();
                self.item(&CellItem::Area { layer, points: &points }, repetition)?;
            }
            return Ok(());
        }
        match repetition {
            None => self.copy(item, [0, 0]),
            Some(&Repetition::Grid { count, step }) if matches!(item, CellItem::Reference { .. }) => {
                self.array(item, count, step)
            }
            // So many copies fit: see `Layout::copies_fit`.
            Some(repetition) => repetition.each(|by| self.copy(item, by)),
        }
    }
}

fn coordinate(value: i64) -> Result<i32> {
    i32::try_from(value).map_err(|_| {
        does_not_fit(
            format!("a coordinate of {value}"),
            "coordinates of GDSII have 32 bits: write the layout about the origin, or on a coarser grid",
        )
    })
}
