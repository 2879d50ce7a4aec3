//! Records that place or name: placements of cells, texts, and elements of private use.

use std::io::{Read, Seek};

use super::{Pair, Result, named};
use crate::error::OasisFault;
use crate::read::OasisReader;
use crate::read::input::Input;
use crate::read::item::Kind;
use crate::record::{info, kind, placed};

/// Smallest magnification that is read, and the inverse of the largest.
const MAGNIFICATION: f64 = 1e-6;

impl<R: Read + Seek> OasisReader<R> {
    pub(super) fn text(&mut self) -> Result<Kind> {
        let bits = self.input.byte()?;
        self.spare(kind::TEXT, bits, 0x80)?;
        // The bits of the string stand one place below those of placements.
        if bits & (placed::CELL >> 1) != 0 {
            let by_number = bits & (placed::NUMBER >> 1) != 0;
            named(
                &mut self.input,
                &self.limits,
                &mut self.modal.string,
                by_number,
                Input::string,
            )?;
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
    pub(super) fn placement(&mut self, record: u8) -> Result<Kind> {
        let bits = self.input.byte()?;
        if bits & placed::CELL != 0 {
            let by_number = bits & placed::NUMBER != 0;
            named(
                &mut self.input,
                &self.limits,
                &mut self.modal.cell,
                by_number,
                Input::name,
            )?;
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
    pub(super) fn private(&mut self, record: u8) -> Result<Kind> {
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
}
