//! One element, decoded by the grammar alone. What [`super::pillar_records`] recognises is tested against this.

use super::input::Input;
use super::limits::ReadLimits;
use super::record::{Record, data, kind};
use super::shape::{Point, Rect, rectangle_of};
use super::transform::Transform;
use crate::error::{Error, LayoutError, Limit, Result};
use metalith_core::LayerNumber;

/// Kind of element that the records between a head and ENDEL make.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ElementKind {
    Boundary,
    Box,
    Path,
    Text,
    Node,
    Reference,
    Array,
}

impl ElementKind {
    /// The element that a record begins, if it begins one.
    pub(crate) fn of(record_kind: u8) -> Option<Self> {
        Some(match record_kind {
            kind::BOUNDARY => Self::Boundary,
            kind::BOX => Self::Box,
            kind::PATH => Self::Path,
            kind::TEXT => Self::Text,
            kind::NODE => Self::Node,
            kind::SREF => Self::Reference,
            kind::AREF => Self::Array,
            _ => return None,
        })
    }

    /// Its name in messages.
    fn name(self) -> &'static str {
        match self {
            Self::Boundary => "BOUNDARY",
            Self::Box => "BOX",
            Self::Path => "PATH",
            Self::Text => "TEXT",
            Self::Node => "NODE",
            Self::Reference => "SREF",
            Self::Array => "AREF",
        }
    }

    /// Fewest and most points that it may have.
    fn points(self) -> std::ops::RangeInclusive<usize> {
        match self {
            Self::Boundary | Self::Box => 3..=usize::MAX,
            Self::Path | Self::Node => 1..=usize::MAX,
            Self::Text | Self::Reference => 1..=1,
            Self::Array => 3..=3,
        }
    }
}

/// The content of one element. Kept and filled again, so that reading allocates nothing.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ElementContent {
    pub offset: u64,
    pub kind: ElementKind,
    pub layer: LayerNumber,
    pub points: Vec<Point>,
    /// Name of the cell referred to.
    pub name: Vec<u8>,
    pub string: Vec<u8>,
    pub mirror: bool,
    pub magnification: f64,
    pub angle_deg: f64,
    pub columns: u16,
    pub rows: u16,
    /// Width of a path; negative if magnification leaves it unchanged.
    pub width: i32,
    pub path_type: i16,
    pub extensions: [i32; 2],
    pub properties: u32,
    /// Place of the STRANS record with absolute magnification or angle.
    absolute: Option<u64>,
}

impl Default for ElementContent {
    fn default() -> Self {
        Self {
            offset: 0,
            kind: ElementKind::Boundary,
            layer: LayerNumber::default(),
            points: Vec::new(),
            name: Vec::new(),
            string: Vec::new(),
            mirror: false,
            magnification: 1.0,
            angle_deg: 0.0,
            columns: 0,
            rows: 0,
            width: 0,
            path_type: 0,
            extensions: [0; 2],
            properties: 0,
            absolute: None,
        }
    }
}

impl ElementContent {
    /// Forget the last element.
    pub(crate) fn begin(&mut self, offset: u64, kind: ElementKind) {
        let (mut points, mut name, mut string) = (
            std::mem::take(&mut self.points),
            std::mem::take(&mut self.name),
            std::mem::take(&mut self.string),
        );
        points.clear();
        name.clear();
        string.clear();
        *self = Self {
            offset,
            kind,
            points,
            name,
            string,
            ..Self::default()
        };
    }

    /// Read the records after the head up to ENDEL, in any order.
    pub(crate) fn read(
        &mut self,
        input: &mut Input,
        head: Record,
        kind: ElementKind,
        limits: &ReadLimits,
    ) -> Result<()> {
        self.begin(head.offset, kind);
        let (mut has_layer, mut has_datatype) = (false, false);
        loop {
            let record = input.next()?;
            match record.kind {
                kind::ENDEL => break,
                kind::XY if record.data == data::INT4 && input.body(record).is_empty() => {}
                other if !self.points.is_empty() && (other == kind::ENDSTR || ElementKind::of(other).is_some()) => {
                    let (kind, begin) = (other, self.offset);
                    let cause = LayoutError::ElementNotEnded { kind, begin };
                    input.odd(record.offset, cause, "the element was taken as ended")?;
                    input.again(record);
                    break;
                }
                kind::XY => self.extend_points(input, record, limits)?,
                kind::LAYER => {
                    self.layer.layer = input.int2(record)? as u16;
                    has_layer = true;
                }
                kind::DATATYPE | kind::TEXTTYPE | kind::BOXTYPE | kind::NODETYPE => {
                    self.layer.datatype = input.int2(record)? as u16;
                    has_datatype = true;
                }
                kind::SNAME => {
                    let name = input.text(record)?;
                    if name.is_empty() || name.len() > limits.name_bytes {
                        let cause = LayoutError::ReferenceName { bytes: name.len() };
                        return Err(input.fault(record.offset, cause));
                    }
                    self.name.clear();
                    self.name.extend_from_slice(name);
                }
                kind::STRING => {
                    self.string.clear();
                    self.string.extend_from_slice(input.text(record)?);
                }
                kind::STRANS => {
                    let body = input.checked(record, data::BITS, 2)?;
                    let bits = u16::from_be_bytes([body[0], body[1]]);
                    self.mirror = bits & 0x8000 != 0;
                    self.absolute = (bits & 6 != 0).then_some(record.offset);
                }
                kind::MAG => self.magnification = input.real8(record, 0, 1)?,
                kind::ANGLE => self.angle_deg = input.real8(record, 0, 1)?,
                kind::COLROW => {
                    let body = input.checked(record, data::INT2, 4)?;
                    self.columns = u16::from_be_bytes([body[0], body[1]]);
                    self.rows = u16::from_be_bytes([body[2], body[3]]);
                }
                kind::WIDTH => self.width = input.int4(record)?,
                kind::PATHTYPE => self.path_type = input.int2(record)?,
                kind::BGNEXTN => self.extensions[0] = input.int4(record)?,
                kind::ENDEXTN => self.extensions[1] = input.int4(record)?,
                kind::PROPATTR => self.properties += 1,
                kind::ENDSTR | kind::ENDLIB | kind::BGNSTR | kind::BGNLIB | kind::HEADER => {
                    return Err(self.unended(input, record));
                }
                other if ElementKind::of(other).is_some() => return Err(self.unended(input, record)),
                _ => {}
            }
        }
        self.check(input, has_layer, has_datatype)
    }

    fn extend_points(&mut self, input: &mut Input, record: Record, limits: &ReadLimits) -> Result<()> {
        let body = input.checked(record, data::INT4, 8)?;
        let found = self.points.len() + body.len() / 8;
        if found > limits.vertices {
            let cause = LayoutError::Limit {
                limit: Limit::Vertices,
                found: found as u64,
                most: limits.vertices as u64,
            };
            return Err(input.fault(record.offset, cause));
        }
        self.points.extend(body.chunks_exact(8).map(|xy| {
            Point::new(
                i64::from(i32::from_be_bytes([xy[0], xy[1], xy[2], xy[3]])),
                i64::from(i32::from_be_bytes([xy[4], xy[5], xy[6], xy[7]])),
            )
        }));
        Ok(())
    }

    fn unended(&self, input: &Input, record: Record) -> Error {
        let cause = LayoutError::ElementNotEnded {
            kind: record.kind,
            begin: self.offset,
        };
        input.fault(record.offset, cause)
    }

    /// Checks that everything that this element needs was there.
    fn check(&mut self, input: &mut Input, has_layer: bool, has_datatype: bool) -> Result<()> {
        self.mend(input)?;
        let (element, points) = (self.kind.name(), self.kind.points());
        let fail = |cause: LayoutError| Err(input.fault(self.offset, cause));
        if !points.contains(&self.points.len()) {
            let points = self.points.len();
            return fail(LayoutError::Points { element, points });
        }
        if matches!(self.kind, ElementKind::Reference | ElementKind::Array) {
            if self.name.is_empty() {
                return fail(LayoutError::Lacks {
                    element,
                    lacks: "SNAME",
                });
            }
            if self.transform().is_none() {
                return fail(LayoutError::Magnification {
                    element,
                    magnification: self.magnification,
                    angle_deg: self.angle_deg,
                });
            }
        } else if !has_layer || !has_datatype {
            let lacks = if has_layer { "its datatype" } else { "LAYER" };
            return fail(LayoutError::Lacks { element, lacks });
        }
        Ok(())
    }

    /// Put right what departs from the format and has one reading, as other programs read it.
    fn mend(&mut self, input: &mut Input) -> Result<()> {
        let (element, points) = (self.kind.name(), self.points.len());
        let most = *self.kind.points().end();
        if points > most {
            let taken = if most == 1 {
                "the first was taken"
            } else {
                "the first three were taken"
            };
            input.odd(self.offset, LayoutError::Points { element, points }, taken)?;
            self.points.truncate(most);
        }
        let refers = matches!(self.kind, ElementKind::Reference | ElementKind::Array);
        let fewest = if self.kind == ElementKind::Box {
            2
        } else {
            *self.kind.points().start()
        };
        if !refers && points < fewest {
            input.odd(self.offset, LayoutError::Points { element, points }, "it was left out")?;
            self.points.resize(1, Point::default());
            self.kind = ElementKind::Node;
        }
        if self.kind == ElementKind::Box && points >= 2 && rectangle_of(&self.points).is_none() {
            let r = Rect::around(&self.points);
            if points >= 4 {
                input.odd(
                    self.offset,
                    LayoutError::BoxForm { points },
                    "its bounding box was taken",
                )?;
            } else {
                input.odd(
                    self.offset,
                    LayoutError::Points { element, points },
                    "their bounding box was taken",
                )?;
            }
            self.points.clear();
            let corners = [(r.x0, r.y0), (r.x1, r.y0), (r.x1, r.y1), (r.x0, r.y1), (r.x0, r.y0)];
            self.points.extend(corners.map(|(x, y)| Point::new(x, y)));
        }
        if self.kind == ElementKind::Array {
            let (columns, rows) = (self.columns as i16, self.rows as i16);
            let cause = LayoutError::ArraySize { columns, rows };
            if columns == 0 || rows == 0 {
                input.odd(self.offset, cause, "1 was taken for 0")?;
            } else if columns < 0 || rows < 0 {
                input.odd(self.offset, cause, "the numbers were taken without sign")?;
            }
            (self.columns, self.rows) = (self.columns.max(1), self.rows.max(1));
        }
        if let Some(offset) = self.absolute.take()
            && (self.magnification != 1.0 || self.angle_deg != 0.0)
        {
            input.odd(offset, LayoutError::Absolute { element }, "they were taken as relative")?;
        }
        Ok(())
    }

    /// Transform of the first copy of the cell referred to.
    pub(crate) fn transform(&self) -> Option<Transform> {
        let at = self.points.first().copied().unwrap_or_default();
        Transform::of_reference(self.mirror, self.magnification, self.angle_deg, at)
    }

    /// Copies of the cell referred to.
    pub(crate) fn copies(&self) -> u64 {
        match self.kind {
            ElementKind::Array => u64::from(self.columns) * u64::from(self.rows),
            _ => 1,
        }
    }

    /// Place of copy `k` of an array: columns first. Distances that do not divide are rounded a copy, so that the last
    /// one is where the file says.
    pub(crate) fn origin(&self, k: u64) -> Point {
        if self.kind != ElementKind::Array {
            return self.points[0];
        }
        let (column, row) = (
            (k % u64::from(self.columns)) as i64,
            (k / u64::from(self.columns)) as i64,
        );
        let [at, along, up] = [self.points[0], self.points[1], self.points[2]];
        let part =
            |from: i64, to: i64, k: i64, n: u16| (2 * k * (to - from) + i64::from(n)).div_euclid(2 * i64::from(n));
        Point::new(
            at.x + part(at.x, along.x, column, self.columns) + part(at.x, up.x, row, self.rows),
            at.y + part(at.y, along.y, column, self.columns) + part(at.y, up.y, row, self.rows),
        )
    }

    /// Transform of copy `k` of the cell referred to.
    pub(crate) fn copy(&self, k: u64) -> Transform {
        let origin = self.origin(k);
        match self.transform().unwrap_or(Transform::IDENTITY) {
            Transform::Square { orientation, .. } => Transform::Square {
                orientation,
                dx: origin.x,
                dy: origin.y,
            },
            Transform::General { matrix, .. } => Transform::General {
                matrix,
                dx: origin.x as f64,
                dy: origin.y as f64,
            },
        }
    }
}
