//! Reading: records one after the other, each with its place.

mod element;
mod end;
mod input;
mod item;
mod modal;
mod number;
mod table;

use std::io::{Read, Seek};

pub use item::{
    CellReference, NameEntry, NameTable, OasisDetails, OasisElement, OasisItem, OasisPlace, OasisShape, OasisValue,
    OasisWarning,
};

use crate::MAGIC;
use crate::error::{OasisError, OasisFault};
use crate::limits::OasisLimits;
use crate::record::{kind, validation};
use input::Input;
use item::Step;
use modal::Modal;
use table::Tables;

/// Steps of the grid in a micrometre that are read.
const GRID_PER_UM: std::ops::RangeInclusive<f64> = 1e-3..=1e7;

/// Reads records from the first byte to END, or from any cell that was met before.
///
/// Memory is that of two buffers and of the largest single record. Nothing is expanded: a repetition is handed out as
/// it is. Names are not resolved, since their tables may come last: cells, texts and properties may be numbers.
pub struct OasisReader<R> {
    input: Input<R>,
    limits: OasisLimits,
    grid_per_um: f64,
    /// True if END, not START, holds the offsets of the tables.
    offsets_in_end: bool,
    tables: Tables,
    modal: Modal,
    in_cell: bool,
    ended: bool,
    /// CBLOCK records that were entered, and the validation scheme of END.
    blocks: u64,
    validation: u64,
    /// The CELL record read last, if nothing was read since.
    at_cell: Option<OasisPlace>,
    /// It is to be handed out again.
    again: bool,
}

impl<R: Read + Seek> OasisReader<R> {
    /// Begin to read: START, and the checksum of the whole file if it has one.
    ///
    /// # Errors
    /// If it is not OASIS 1.0 or its bytes are not those that were written.
    pub fn new(raw: R, limits: OasisLimits) -> Result<Self, OasisError> {
        let mut reader = Self::unverified(raw, limits)?;
        end::verify_checksum(&mut reader.input, reader.offsets_in_end)?;
        Ok(reader)
    }

    /// Variant of [`OasisReader::new`] without the checksum, for a file that was verified before.
    ///
    /// # Errors
    /// If it is not OASIS 1.0.
    pub fn unverified(raw: R, limits: OasisLimits) -> Result<Self, OasisError> {
        let mut input = Input::new(raw, &limits)?;
        if input.file_bytes() < MAGIC.len() as u64 || input.array()? != *MAGIC {
            return Err(input.fault(OasisFault::NoMagic));
        }
        if input.begin_record()? != Some(u64::from(kind::START)) {
            return Err(input.fault(OasisFault::NoStart));
        }
        let mut version = Vec::new();
        input.string(&limits, &mut version)?;
        if version != b"1.0" {
            let version = version.iter().take(16).flat_map(|b| b.escape_ascii()).map(char::from);
            return Err(input.fault(OasisFault::Version(version.collect())));
        }
        let grid_per_um = input.real()?;
        if !GRID_PER_UM.contains(&grid_per_um) {
            return Err(input.fault(OasisFault::Unit(grid_per_um)));
        }
        let offsets_in_end = input.at_most(1)? == 1;
        let mut tables = Tables::default();
        if !offsets_in_end {
            tables.read_offsets(&mut input)?;
        }
        Ok(Self {
            input,
            limits,
            grid_per_um,
            offsets_in_end,
            tables,
            modal: Modal::default(),
            in_cell: false,
            ended: false,
            blocks: 0,
            validation: validation::NONE,
            at_cell: None,
            again: false,
        })
    }

    /// Steps of the grid in a micrometre: 1000 for a database unit of 1 nm.
    pub fn grid_per_um(&self) -> f64 {
        self.grid_per_um
    }

    /// Place of the next byte of the file, or of the CBLOCK that is being read.
    pub fn offset(&self) -> u64 {
        self.input.offset()
    }

    /// Place where the record read last begins.
    pub fn place(&self) -> OasisPlace {
        self.input.record()
    }

    /// Read over departures from the format that have one reading, and list them, instead of an error.
    #[must_use]
    pub fn tolerant(mut self, tolerant: bool) -> Self {
        self.input.tolerant = tolerant;
        self
    }

    /// The first departures from the format that were read over, and the number of all.
    pub fn warnings(&self) -> (&[OasisWarning], u64) {
        self.input.warnings()
    }

    /// Details of the format, after END was read.
    pub fn details(&self) -> OasisDetails {
        OasisDetails {
            compressed_blocks: self.blocks,
            table_offsets_in_end: self.offsets_in_end,
            strict_tables: self.tables.strict(),
            checksum: match self.validation {
                validation::CRC32 => Some("CRC32"),
                validation::CHECKSUM32 => Some("CHECKSUM32"),
                _ => None,
            },
        }
    }

    /// An error at the record read last.
    pub fn fault(&self, fault: OasisFault) -> OasisError {
        self.input.fault(fault)
    }

    /// Go to a CELL record that was met before. Going forward inside a CBLOCK goes on unpacking, anything else begins
    /// with its first byte: read cells in the order of the file.
    ///
    /// # Errors
    /// If the file changed.
    pub fn seek(&mut self, place: OasisPlace) -> Result<(), OasisError> {
        if self.at_cell == Some(place) {
            // Whoever reads one cell to its end has read the head of the next.
            self.again = true;
            return Ok(());
        }
        (self.in_cell, self.ended, self.at_cell) = (false, false, None);
        let Some(inner) = place.inner else {
            return self.input.seek(place.offset);
        };
        if self.input.skip_in_block(place.offset, inner)? {
            return Ok(());
        }
        self.input.seek(place.offset)?;
        if self.input.begin_record()? != Some(u64::from(kind::CBLOCK)) {
            return Err(self.input.fault(OasisFault::Compression(0)));
        }
        self.enter_block()?;
        if !self.input.skip_in_block(place.offset, inner)? {
            return Err(self.input.fault(OasisFault::EndsInRecord));
        }
        Ok(())
    }

    fn enter_block(&mut self) -> Result<(), OasisError> {
        let compression = self.input.unsigned()?;
        if compression != 0 {
            return Err(self.input.fault(OasisFault::Compression(compression)));
        }
        self.blocks += 1;
        let (unpacked, packed) = (self.input.unsigned_padded()?, self.input.unsigned_padded()?);
        self.input.enter_block(unpacked, packed)
    }

    /// The next record that holds something; [`OasisItem::End`] at the end, and ever after.
    ///
    /// # Errors
    /// If the file breaks the format or ends early.
    pub fn read_item(&mut self) -> Result<OasisItem<'_>, OasisError> {
        let step = loop {
            if self.ended {
                return Ok(OasisItem::End);
            }
            if std::mem::take(&mut self.again) {
                break Step::Cell;
            }
            if let Some(step) = self.record()? {
                break step;
            }
        };
        self.at_cell = matches!(step, Step::Cell).then(|| self.input.record());
        Ok(self.view(step))
    }

    /// Read one record; none if it holds nothing by itself.
    #[inline]
    fn record(&mut self) -> Result<Option<Step>, OasisError> {
        let Some(number) = self.input.begin_record()? else {
            return Err(self.input.fault(OasisFault::EndsEarly));
        };
        let Some(record) = u8::try_from(number).ok().filter(|&k| k <= kind::CBLOCK) else {
            return Err(self.input.fault(OasisFault::RecordKind(number)));
        };
        match record {
            kind::PLACEMENT..=kind::CIRCLE | kind::XELEMENT | kind::XGEOMETRY => {
                if !self.in_cell {
                    return Err(self.input.fault(OasisFault::OutsideCells { kind: record }));
                }
                self.element(record).map(Some)
            }
            kind::PAD => Ok(None),
            kind::XYABSOLUTE | kind::XYRELATIVE => {
                self.modal.relative = record == kind::XYRELATIVE;
                Ok(None)
            }
            kind::PROPERTY | kind::PROPERTY_REPEATED => self.property(record).map(Some),
            kind::CELL | kind::CELL_NAMED => {
                self.modal.forget();
                self.in_cell = true;
                self.cell_reference(record == kind::CELL)?;
                Ok(Some(Step::Cell))
            }
            kind::CELLNAME..=kind::LAYERNAME_OF_TEXT | kind::XNAME | kind::XNAME_NUMBERED => {
                self.in_cell = false;
                self.tables.read(&mut self.input, record, &self.limits).map(Some)
            }
            kind::CBLOCK if !self.input.in_block() => {
                self.enter_block()?;
                Ok(None)
            }
            kind::END if !self.input.in_block() => {
                self.validation = end::read(&mut self.input, self.offsets_in_end, &mut self.tables)?;
                self.ended = true;
                Ok(Some(Step::End))
            }
            kind::START if !self.input.in_block() => Err(self.input.fault(OasisFault::SecondStart)),
            _ => Err(self.input.fault(OasisFault::InBlock { kind: record })),
        }
    }
}
