//! Tables of names: before or after their use, with numbers or counted.

use std::io::{Read, Seek};

use super::input::Input;
use super::item::{NameTable, Step};
use crate::error::{OasisError, OasisFault};
use crate::limits::OasisLimits;
use crate::record::kind;

/// One table.
#[derive(Clone, Copy, Debug, Default)]
struct State {
    /// Offset of its first record.
    first: Option<u64>,
    /// True if its entries have numbers.
    numbered: Option<bool>,
    next: u64,
    /// Offset at which all of its records stand, as the table of offsets says.
    strict_offset: Option<u64>,
}

/// The six tables, and the entry read last.
#[derive(Debug, Default)]
pub(super) struct Tables {
    states: [State; 6],
    name: Vec<u8>,
}

const ALL: [NameTable; 6] = [
    NameTable::Cells,
    NameTable::Texts,
    NameTable::Properties,
    NameTable::PropertyTexts,
    NameTable::Layers,
    NameTable::Private,
];

impl Tables {
    /// The name of the entry read last.
    pub(crate) fn last(&self) -> &[u8] {
        &self.name
    }

    /// The offsets of the tables, from START or END.
    pub(crate) fn read_offsets<R: Read + Seek>(&mut self, input: &mut Input<R>) -> Result<(), OasisError> {
        for state in &mut self.states {
            let strict = input.at_most(1)? == 1;
            let offset = input.unsigned_padded()?;
            state.strict_offset = (strict && offset != 0).then_some(offset);
        }
        Ok(())
    }

    /// True if the table of offsets says that all names of some table stand in one place.
    pub(crate) fn strict(&self) -> bool {
        self.states.iter().any(|state| state.strict_offset.is_some())
    }

    /// Checks that the tables stand where their offsets say.
    pub(crate) fn check_offsets<R: Read + Seek>(&self, input: &Input<R>) -> Result<(), OasisError> {
        for (table, state) in ALL.into_iter().zip(&self.states) {
            if let (Some(found), Some(said)) = (state.first, state.strict_offset)
                && found != said
            {
                let table = table.words();
                return Err(input.fault(OasisFault::TableOffset { table, found, said }));
            }
        }
        Ok(())
    }

    /// Read an entry.
    pub(crate) fn read<R: Read + Seek>(
        &mut self,
        input: &mut Input<R>,
        record: u8,
        limits: &OasisLimits,
    ) -> Result<Step, OasisError> {
        let (table, numbered) = match record {
            kind::CELLNAME | kind::CELLNAME_NUMBERED => (NameTable::Cells, record == kind::CELLNAME_NUMBERED),
            kind::TEXTSTRING | kind::TEXTSTRING_NUMBERED => (NameTable::Texts, record == kind::TEXTSTRING_NUMBERED),
            kind::PROPNAME | kind::PROPNAME_NUMBERED => (NameTable::Properties, record == kind::PROPNAME_NUMBERED),
            kind::PROPSTRING | kind::PROPSTRING_NUMBERED => {
                (NameTable::PropertyTexts, record == kind::PROPSTRING_NUMBERED)
            }
            kind::LAYERNAME | kind::LAYERNAME_OF_TEXT => (NameTable::Layers, false),
            _ => {
                input.unsigned()?;
                (NameTable::Private, record == kind::XNAME_NUMBERED)
            }
        };
        if matches!(table, NameTable::Cells | NameTable::Properties) {
            input.name(limits, &mut self.name)?;
        } else {
            input.string(limits, &mut self.name)?;
        }
        let state = &mut self.states[table as usize];
        state.first.get_or_insert(input.record().offset);
        if *state.numbered.get_or_insert(numbered) != numbered {
            let table = table.words();
            return Err(input.fault(OasisFault::MixedNumbers { table }));
        }
        let number = if numbered { input.unsigned()? } else { state.next };
        state.next += 1;
        if table == NameTable::Layers {
            interval(input)?;
            interval(input)?;
        }
        Ok(Step::Name(table, number))
    }
}

/// A range of layers or datatypes, which nothing here depends on.
fn interval<R: Read + Seek>(input: &mut Input<R>) -> Result<(), OasisError> {
    let bounds = match input.unsigned()? {
        0 => 0,
        1..=3 => 1,
        4 => 2,
        other => return Err(input.fault(OasisFault::IntervalKind(other))),
    };
    for _ in 0..bounds {
        input.unsigned()?;
    }
    Ok(())
}
