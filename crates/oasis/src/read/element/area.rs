//! Shapes: rectangles, polygons, paths, trapezoids and circles.

use std::io::{Read, Seek};

use super::Result;
use crate::error::OasisFault;
use crate::read::OasisReader;
use crate::read::item::Kind;
use crate::record::{info, kind};
use crate::trapezoid::{compact_trapezoid, trapezoid};

impl<R: Read + Seek> OasisReader<R> {
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
    pub(super) fn rectangle(&mut self) -> Result<Kind> {
        let bits = self.input.byte()?;
        self.layers(kind::RECTANGLE, bits)?;
        let square = bits & info::FIRST != 0;
        if square {
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

    pub(super) fn polygon(&mut self) -> Result<Kind> {
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

    pub(super) fn path(&mut self) -> Result<Kind> {
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

    pub(super) fn trapezoid(&mut self, record: u8) -> Result<Kind> {
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

    pub(super) fn ctrapezoid(&mut self) -> Result<Kind> {
        let bits = self.input.byte()?;
        self.layers(kind::CTRAPEZOID, bits)?;
        if bits & info::FIRST != 0 {
            self.modal.trapezoid = Some(self.input.unsigned()?);
        }
        let form = self.modal(kind::CTRAPEZOID, "the type", self.modal.trapezoid)?;
        self.box_size(bits)?;
        // Forms of one side set the modal state of the other.
        let (width, height) = (self.modal.width, self.modal.height);
        match form {
            16..=19 | 25 => self.modal.height = width,
            22 | 23 => self.modal.height = width.map(|width| 2 * width),
            20 | 21 => self.modal.width = height.map(|height| 2 * height),
            _ => {}
        }
        let (what_width, what_height) = match form {
            20 | 21 => ("the height", "the height"),
            16..=19 | 22 | 23 | 25 => ("the width", "the width"),
            _ => ("the width", "the height"),
        };
        let width = self.modal(kind::CTRAPEZOID, what_width, self.modal.width)?;
        let height = self.modal(kind::CTRAPEZOID, what_height, self.modal.height)?;
        self.stand_area(kind::CTRAPEZOID, bits)?;
        let Some(corners) = compact_trapezoid(form, width, height) else {
            let kind = form;
            return Err(self.input.fault(OasisFault::Trapezoid { kind, width, height }));
        };
        self.within(&corners)?;
        self.modal.corners = corners;
        Ok(Kind::Trapezoid)
    }

    pub(super) fn circle(&mut self) -> Result<Kind> {
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
}
