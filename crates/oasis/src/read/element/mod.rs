//! Elements, placements and properties: what a record says, and what it takes from the modal variables.

mod area;
mod property;
mod reference;
mod view;

use std::io::{Read, Seek};

use super::OasisReader;
use super::input::Input;
use super::item::Step;
use super::modal::Named;
use crate::error::{OasisError, OasisFault};
use crate::limits::OasisLimits;
use crate::record::{info, kind};

type Result<T> = std::result::Result<T, OasisError>;

/// Pair of coordinates, one of three.
#[derive(Clone, Copy, PartialEq)]
enum Pair {
    Placement,
    Geometry,
    Text,
}

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
    pub(in crate::read) fn cell_reference(&mut self, by_number: bool) -> Result<()> {
        named(
            &mut self.input,
            &self.limits,
            &mut self.modal.begun,
            by_number,
            Input::name,
        )
    }

    /// Read an element.
    #[inline]
    pub(in crate::read) fn element(&mut self, record: u8) -> Result<Step> {
        let kind = match record {
            kind::RECTANGLE => self.rectangle()?,
            kind::PLACEMENT | kind::PLACEMENT_GENERAL => self.placement(record)?,
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
}

/// Read a number of a table, or a name by the rules of its kind ([`Input::name`] or [`Input::string`]).
fn named<R: Read + Seek>(
    input: &mut Input<R>,
    limits: &OasisLimits,
    named: &mut Named,
    by_number: bool,
    read: impl FnOnce(&mut Input<R>, &OasisLimits, &mut Vec<u8>) -> Result<()>,
) -> Result<()> {
    named.number = if by_number {
        Some(input.unsigned()?)
    } else {
        read(input, limits, &mut named.name)?;
        None
    };
    named.known = true;
    Ok(())
}
