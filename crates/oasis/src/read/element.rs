//! Elements, placements and properties: what a record says, and what it takes from the modal variables.

use std::io::{Read, Seek};

use super::OasisReader;
use super::item::{CellReference, Kind, NameEntry, OasisElement, OasisItem, OasisShape, OasisValue, Step};
use super::modal::Named;
use crate::error::{OasisError, OasisFault, OasisLimit};
use crate::record::{info, kind, placed};
use crate::trapezoid::{compact_trapezoid, trapezoid};

type Result<T> = std::result::Result<T, OasisError>;

/// Which of the three pairs of coordinates.
#[derive(Clone, Copy, PartialEq)]
enum Pair {
    Placement,
    Geometry,
    Text,
}

/// Smallest magnification that is read, and the inverse of the largest.
const MAGNIFICATION: f64 = 1e-6;

impl<R: Read + Seek> OasisReader<R> {
    #[cold]
    fn undefined<T>(&self, kind: u8, what: &'static str) -> Result<T> {
        Err(self.input.fault(OasisFault::Undefined { kind, what }))
    }

    #[inline]
    fn modal<T: Copy>(&self, kind: u8, what: &'static str, value: Option<T>) -> Result<T> {
        match value {
            Some(value) => Ok(value),
            None => self.undefined(kind, what),
        }
    }

    /// A reference to an entry of a table, or the name itself.
    pub(super) fn cell_reference(&mut self, by_number: bool) -> Result<()> {
        let mut begun = std::mem::take(&mut self.modal.begun);
        self.named(&mut begun, by_number, true)?;
        self.modal.begun = begun;
        Ok(())
    }

    fn named(&mut self, named: &mut Named, by_number: bool, is_name: bool) -> Result<()> {
        named.known = true;
        if by_number {
            named.number = Some(self.input.unsigned()?);
            Ok(())
        } else {
            named.number = None;
            if is_name {
                self.input.name(&self.limits, &mut named.name)
            } else {
                self.input.string(&self.limits, &mut named.name)
            }
        }
    }

    /// Read an element.
    #[inline]
    pub(super) fn element(&mut self, record: u8) -> Result<Step> {
        let kind = match record {
            kind::RECTANGLE => self.rectangle()?,
            kind::PLACEMENT => self.placement(record)?,
            kind::PLACEMENT_GENERAL => self.placement(record)?,
            kind::POLYGON => self.polygon()?,
            kind::PATH => self.path()?,
            kind::TRAPEZOID | kind::TRAPEZOID_A | kind::TRAPEZOID_B => self.trapezoid(record)?,
            kind::CTRAPEZOID => self.ctrapezoid()?,
            kind::CIRCLE => self.circle()?,
            kind::TEXT => self.text()?,
            _ => self.private(record)?,
        };
        Ok(Step::Element(kind))
    }

    fn layer_number(&mut self) -> Result<u32> {
        Ok(self.input.at_most(u32::MAX.into())? as u32)
    }

    #[inline]
    fn layers(&mut self, record: u8, bits: u8) -> Result<()> {
        if bits & info::LAYER != 0 {
            self.modal.layer = Some(self.layer_number()?);
        } else if self.modal.layer.is_none() {
            return self.undefined(record, "the layer");
        }
        if bits & info::DATATYPE != 0 {
            self.modal.datatype = Some(self.layer_number()?);
        } else if self.modal.datatype.is_none() {
            return self.undefined(record, "the datatype");
        }
        Ok(())
    }

    /// Place and repetition, which every element ends with.
    #[inline]
    fn stand(&mut self, record: u8, pair: Pair, x: bool, y: bool, repeated: bool) -> Result<()> {
        let mut at = match pair {
            Pair::Placement => self.modal.placement,
            Pair::Geometry => self.modal.geometry,
            Pair::Text => self.modal.text,
        };
        for (axis, said) in [x, y].into_iter().enumerate() {
            if said {
                let value = self.input.signed(&self.limits)?;
                at[axis] = if self.modal.relative { at[axis] + value } else { value };
                if at[axis].abs() > self.limits.farthest {
                    return Err(self.input.too_far(at[axis].unsigned_abs(), &self.limits));
                }
            }
        }
        match pair {
            Pair::Placement => self.modal.placement = at,
            Pair::Geometry => self.modal.geometry = at,
            Pair::Text => self.modal.text = at,
        }
        self.modal.repeated = repeated;
        if repeated {
            if let Some(repetition) = self.input.repetition(&self.limits)? {
                self.modal.copies = repetition.copies();
                self.modal.reach = repetition.bounds();
                self.modal.repetition = Some(repetition);
            } else if self.modal.repetition.is_none() {
                return self.undefined(record, "the repetition");
            }
            let [left, low, right, high] = self.modal.reach;
            let far = [at[0] + left, at[0] + right, at[1] + low, at[1] + high];
            let far = far.map(i64::unsigned_abs).into_iter().max().unwrap_or(0);
            if far > self.limits.farthest.unsigned_abs() {
                return Err(self.input.too_far(far, &self.limits));
            }
        }
        Ok(())
    }

    #[inline]
    fn stand_area(&mut self, record: u8, bits: u8) -> Result<()> {
        let repeated = bits & info::REPETITION != 0;
        self.stand(
            record,
            Pair::Geometry,
            bits & info::X != 0,
            bits & info::Y != 0,
            repeated,
        )
    }

    fn spare(&self, kind: u8, info: u8, bits: u8) -> Result<()> {
        if info & bits != 0 {
            return Err(self.input.fault(OasisFault::Info { kind, info }));
        }
        Ok(())
    }

    /// Farther corners than the place must be in reach too.
    fn within(&self, points: &[[i64; 2]]) -> Result<()> {
        let at = self.modal.geometry;
        let far = |p: &[i64; 2]| (p[0] + at[0]).abs().max((p[1] + at[1]).abs());
        match points.iter().map(far).max() {
            Some(far) if far > self.limits.farthest => Err(self.input.too_far(far.unsigned_abs(), &self.limits)),
            _ => Ok(()),
        }
    }

    fn box_size(&mut self, bits: u8) -> Result<()> {
        if bits & info::WIDTH != 0 {
            self.modal.width = Some(self.input.distance(&self.limits)?);
        }
        if bits & info::HEIGHT != 0 {
            self.modal.height = Some(self.input.distance(&self.limits)?);
        }
        Ok(())
    }

    #[inline]
    fn rectangle(&mut self) -> Result<Kind> {
        let bits = self.input.byte()?;
        self.layers(kind::RECTANGLE, bits)?;
        let square = bits & info::FIRST != 0;
        if square && bits & info::HEIGHT != 0 {
            self.spare(kind::RECTANGLE, bits, info::HEIGHT)?;
        }
        self.box_size(bits)?;
        let width = self.modal(kind::RECTANGLE, "the width", self.modal.width)?;
        if square {
            self.modal.height = Some(width);
        }
        let height = self.modal(kind::RECTANGLE, "the height", self.modal.height)?;
        self.stand_area(kind::RECTANGLE, bits)?;
        self.within(&[[width, height]])?;
        Ok(Kind::Rectangle)
    }

    fn polygon(&mut self) -> Result<Kind> {
        let bits = self.input.byte()?;
        self.spare(kind::POLYGON, bits, info::FIRST | info::WIDTH)?;
        self.layers(kind::POLYGON, bits)?;
        if bits & info::HEIGHT != 0 {
            let points = &mut self.modal.polygon;
            self.input.points(kind::POLYGON, true, &self.limits, points)?;
        } else if self.modal.polygon.is_empty() {
            return self.undefined(kind::POLYGON, "the point list");
        }
        self.stand_area(kind::POLYGON, bits)?;
        self.within(&self.modal.polygon)?;
        Ok(Kind::Polygon)
    }

    fn path(&mut self) -> Result<Kind> {
        let bits = self.input.byte()?;
        self.layers(kind::PATH, bits)?;
        if bits & info::WIDTH != 0 {
            self.modal.half_width = Some(self.input.distance(&self.limits)?);
        }
        let half_width = self.modal(kind::PATH, "the half width", self.modal.half_width)?;
        if bits & info::FIRST != 0 {
            let scheme = self.input.unsigned()?;
            if scheme > 15 {
                return Err(self.input.fault(OasisFault::Extension(scheme)));
            }
            for (end, way) in [scheme >> 2, scheme & 3].into_iter().enumerate() {
                match way {
                    0 => {}
                    1 => self.modal.extensions[end] = Some(0),
                    2 => self.modal.extensions[end] = Some(half_width),
                    _ => self.modal.extensions[end] = Some(self.input.signed(&self.limits)?),
                }
            }
        }
        if self.modal.extensions.contains(&None) {
            return self.undefined(kind::PATH, "the extensions");
        }
        if bits & info::HEIGHT != 0 {
            let points = &mut self.modal.path;
            self.input.points(kind::PATH, false, &self.limits, points)?;
        } else if self.modal.path.is_empty() {
            return self.undefined(kind::PATH, "the point list");
        }
        self.stand_area(kind::PATH, bits)?;
        self.within(&self.modal.path)?;
        Ok(Kind::Path)
    }

    fn trapezoid(&mut self, record: u8) -> Result<Kind> {
        let bits = self.input.byte()?;
        self.layers(record, bits)?;
        self.box_size(bits)?;
        let width = self.modal(record, "the width", self.modal.width)?;
        let height = self.modal(record, "the height", self.modal.height)?;
        let (mut a, mut b) = (0, 0);
        if record != kind::TRAPEZOID_B {
            a = self.input.signed(&self.limits)?;
        }
        if record != kind::TRAPEZOID_A {
            b = self.input.signed(&self.limits)?;
        }
        self.stand_area(record, bits)?;
        let corners = trapezoid(bits & info::FIRST != 0, width, height, a, b);
        self.modal.corners.clear();
        self.modal.corners.extend(corners);
        self.within(&corners)?;
        Ok(Kind::Trapezoid)
    }

    fn ctrapezoid(&mut self) -> Result<Kind> {
        let bits = self.input.byte()?;
        self.layers(kind::CTRAPEZOID, bits)?;
        if bits & info::FIRST != 0 {
            self.modal.trapezoid = Some(self.input.unsigned()?);
        }
        let form = self.modal(kind::CTRAPEZOID, "the type", self.modal.trapezoid)?;
        self.box_size(bits)?;
        let [needs_width, needs_height] = match form {
            16..=19 | 22 | 23 | 25 => [true, false],
            20 | 21 => [false, true],
            _ => [true, true],
        };
        let size = |needed: bool, what, value: Option<i64>| {
            if needed {
                self.modal(kind::CTRAPEZOID, what, value)
            } else {
                Ok(0)
            }
        };
        let width = size(needs_width, "the width", self.modal.width)?;
        let height = size(needs_height, "the height", self.modal.height)?;
        self.stand_area(kind::CTRAPEZOID, bits)?;
        let Some(corners) = compact_trapezoid(form, width, height) else {
            let kind = form;
            return Err(self.input.fault(OasisFault::Trapezoid { kind, width, height }));
        };
        self.within(&corners)?;
        self.modal.corners = corners;
        Ok(Kind::Trapezoid)
    }

    fn circle(&mut self) -> Result<Kind> {
        let bits = self.input.byte()?;
        self.spare(kind::CIRCLE, bits, info::FIRST | info::WIDTH)?;
        self.layers(kind::CIRCLE, bits)?;
        if bits & info::HEIGHT != 0 {
            self.modal.radius = Some(self.input.distance(&self.limits)?);
        }
        let r = self.modal(kind::CIRCLE, "the radius", self.modal.radius)?;
        self.stand_area(kind::CIRCLE, bits)?;
        self.within(&[[r, r], [-r, -r]])?;
        Ok(Kind::Circle)
    }

    fn text(&mut self) -> Result<Kind> {
        let bits = self.input.byte()?;
        self.spare(kind::TEXT, bits, 0x80)?;
        // The bits of the string stand one place below those of placements.
        if bits & (placed::CELL >> 1) != 0 {
            let mut string = std::mem::take(&mut self.modal.string);
            self.named(&mut string, bits & (placed::NUMBER >> 1) != 0, false)?;
            self.modal.string = string;
        } else if !self.modal.string.known {
            return self.undefined(kind::TEXT, "the text");
        }
        if bits & info::LAYER != 0 {
            self.modal.text_layer = Some(self.layer_number()?);
        }
        if bits & info::DATATYPE != 0 {
            self.modal.text_type = Some(self.layer_number()?);
        }
        self.modal(kind::TEXT, "the layer", self.modal.text_layer)?;
        self.modal(kind::TEXT, "the text type", self.modal.text_type)?;
        let repeated = bits & info::REPETITION != 0;
        self.stand(
            kind::TEXT,
            Pair::Text,
            bits & info::X != 0,
            bits & info::Y != 0,
            repeated,
        )?;
        Ok(Kind::Text)
    }

    #[inline]
    fn placement(&mut self, record: u8) -> Result<Kind> {
        let bits = self.input.byte()?;
        if bits & placed::CELL != 0 {
            if bits & placed::NUMBER != 0 {
                self.modal.cell.number = Some(self.input.unsigned()?);
                self.modal.cell.known = true;
            } else {
                let mut cell = std::mem::take(&mut self.modal.cell);
                self.named(&mut cell, false, true)?;
                self.modal.cell = cell;
            }
        } else if !self.modal.cell.known {
            return self.undefined(record, "the cell");
        }
        let (mut magnification, mut angle_deg) = (1.0, 0.0);
        if record == kind::PLACEMENT {
            angle_deg = f64::from(bits >> 1 & 3) * 90.0;
        } else {
            if bits & placed::MAGNIFICATION != 0 {
                magnification = self.input.real()?;
            }
            if bits & placed::ANGLE != 0 {
                angle_deg = self.input.real()?;
            }
            if !(MAGNIFICATION..=1.0 / MAGNIFICATION).contains(&magnification) {
                return Err(self.input.fault(OasisFault::Magnification {
                    magnification,
                    angle_deg,
                }));
            }
        }
        self.modal.mirrored = bits & placed::FLIP != 0;
        (self.modal.magnification, self.modal.angle_deg) = (magnification, angle_deg);
        let repeated = bits & placed::REPETITION != 0;
        self.stand(
            record,
            Pair::Placement,
            bits & placed::X != 0,
            bits & placed::Y != 0,
            repeated,
        )?;
        Ok(Kind::Placement)
    }

    /// XELEMENT and XGEOMETRY.
    fn private(&mut self, record: u8) -> Result<Kind> {
        let mut skipped = Vec::new();
        if record == kind::XELEMENT {
            let attribute = self.input.unsigned()?;
            self.input.string(&self.limits, &mut skipped)?;
            self.modal.repeated = false;
            return Ok(Kind::Private(attribute));
        }
        let bits = self.input.byte()?;
        self.spare(record, bits, info::FIRST | info::WIDTH | info::HEIGHT)?;
        let attribute = self.input.unsigned()?;
        self.layers(record, bits)?;
        self.input.string(&self.limits, &mut skipped)?;
        self.stand_area(record, bits)?;
        Ok(Kind::Private(attribute))
    }

    pub(super) fn property(&mut self, record: u8) -> Result<Step> {
        if record == kind::PROPERTY_REPEATED {
            if !self.modal.property.known || !self.modal.values_known {
                return self.undefined(record, "name and values");
            }
            return Ok(Step::Property { standard: false });
        }
        let bits = self.input.byte()?;
        if bits & 4 != 0 {
            let mut name = std::mem::take(&mut self.modal.property);
            self.named(&mut name, bits & 2 != 0, true)?;
            self.modal.property = name;
        } else if !self.modal.property.known {
            return self.undefined(record, "the name");
        }
        let count = bits >> 4;
        if bits & 8 != 0 {
            if count != 0 {
                return Err(self.input.fault(OasisFault::Info {
                    kind: record,
                    info: bits,
                }));
            }
            if !self.modal.values_known {
                return self.undefined(record, "the values");
            }
        } else {
            let found = if count == 15 {
                self.input.unsigned()?
            } else {
                count.into()
            };
            let most = self.limits.values;
            if found > most {
                let limit = OasisLimit::Values;
                return Err(self.input.fault(OasisFault::Limit { limit, found, most }));
            }
            self.modal.values.clear();
            for _ in 0..found {
                let value = self.value()?;
                self.modal.values.push(value);
            }
            self.modal.values_known = true;
        }
        let standard = bits & 1 != 0;
        Ok(Step::Property { standard })
    }

    fn value(&mut self) -> Result<OasisValue> {
        let kind = self.input.unsigned()?;
        Ok(match kind {
            0..=7 => OasisValue::Real(self.input.real_of(kind)?),
            8 => OasisValue::Unsigned(self.input.unsigned()?),
            9 => {
                let value = self.input.unsigned()?;
                let magnitude = (value >> 1) as i64;
                OasisValue::Signed(if value & 1 == 0 { magnitude } else { -magnitude })
            }
            10..=12 => {
                let mut text = Vec::new();
                self.input.string(&self.limits, &mut text)?;
                OasisValue::Text(text)
            }
            13..=15 => OasisValue::TextNumber(self.input.unsigned()?),
            other => return Err(self.input.fault(OasisFault::ValueKind(other))),
        })
    }

    /// What was read, borrowed.
    #[inline]
    pub(super) fn view(&self, step: Step) -> OasisItem<'_> {
        let modal = &self.modal;
        match step {
            Step::Cell => OasisItem::Cell(reference(&modal.begun)),
            Step::Element(kind) => OasisItem::Element(self.view_element(kind)),
            Step::Name(table, number) => OasisItem::Name(NameEntry {
                table,
                number,
                name: self.tables.last(),
            }),
            Step::Property { standard } => OasisItem::Property {
                name: reference(&modal.property),
                standard,
                values: &modal.values,
            },
            Step::End => OasisItem::End,
        }
    }

    #[inline]
    fn view_element(&self, kind: Kind) -> OasisElement<'_> {
        let modal = &self.modal;
        let mut at = modal.geometry;
        let (mut layer, mut datatype) = (modal.layer, modal.datatype);
        let shape = match kind {
            Kind::Rectangle => OasisShape::Rectangle {
                size: [modal.width.unwrap_or(0), modal.height.unwrap_or(0)],
            },
            Kind::Polygon => OasisShape::Polygon { points: &modal.polygon },
            Kind::Trapezoid => OasisShape::Polygon { points: &modal.corners },
            Kind::Path => OasisShape::Path {
                points: &modal.path,
                half_width: modal.half_width.unwrap_or(0),
                extensions: modal.extensions.map(|e| e.unwrap_or(0)),
            },
            Kind::Circle => OasisShape::Circle {
                radius: modal.radius.unwrap_or(0),
            },
            Kind::Text => {
                (at, layer, datatype) = (modal.text, modal.text_layer, modal.text_type);
                OasisShape::Text {
                    string: reference(&modal.string),
                }
            }
            Kind::Placement => {
                (at, layer, datatype) = (modal.placement, None, None);
                OasisShape::Placement {
                    cell: reference(&modal.cell),
                    mirrored: modal.mirrored,
                    magnification: modal.magnification,
                    angle_deg: modal.angle_deg,
                }
            }
            Kind::Private(attribute) => OasisShape::Private { attribute },
        };
        let repetition = modal.repetition.as_ref().filter(|_| modal.repeated);
        OasisElement {
            place: self.input.record(),
            shape,
            layer: layer.unwrap_or(0),
            datatype: datatype.unwrap_or(0),
            at,
            copies: repetition.map_or(1, |_| modal.copies),
            reach: repetition.map_or([0; 4], |_| modal.reach),
            repetition,
        }
    }
}

fn reference(named: &Named) -> CellReference<'_> {
    match named.number {
        Some(number) => CellReference::Number(number),
        None => CellReference::Name(&named.name),
    }
}
