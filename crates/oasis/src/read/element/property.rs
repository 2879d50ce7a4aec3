//! Properties and their values.

use std::io::{Read, Seek};

use super::{Result, named};
use crate::error::{OasisFault, OasisLimit};
use crate::read::OasisReader;
use crate::read::input::Input;
use crate::read::item::{OasisValue, Step};
use crate::record::kind;

impl<R: Read + Seek> OasisReader<R> {
    pub(in crate::read) fn property(&mut self, record: u8) -> Result<Step> {
        if record == kind::PROPERTY_REPEATED {
            if !self.modal.property.known || !self.modal.values_known {
                return self.undefined(record, "name and values");
            }
            return Ok(Step::Property { standard: false });
        }
        let bits = self.input.byte()?;
        if bits & 4 != 0 {
            named(
                &mut self.input,
                &self.limits,
                &mut self.modal.property,
                bits & 2 != 0,
                Input::name,
            )?;
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
}
