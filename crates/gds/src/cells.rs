//! A layout in either format, as what its cells are read from.

use super::cell::LayoutCell;
use super::input::{Input, Source};
use super::oasis::OasisCells;
use super::record::kind;
use crate::error::{LayoutError, Result};

/// Format of a layout, identified by its first bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileFormat {
    Gds,
    Oasis,
}

/// Cells to be read one after the other.
pub(super) enum CellInput {
    Gds(Input),
    Oasis(Box<OasisCells>),
}

impl CellInput {
    /// Start reading a layout that was read once.
    pub(crate) fn open(source: &Source, format: FileFormat, texts: &super::oasis::Texts) -> Result<Self> {
        Ok(match format {
            FileFormat::Gds => Self::Gds(source.open()?),
            FileFormat::Oasis => Self::Oasis(Box::new(OasisCells::open(source, texts.clone())?)),
        })
    }

    /// Place in the file of the next byte.
    pub(crate) fn offset(&self) -> u64 {
        match self {
            Self::Gds(input) => input.offset(),
            Self::Oasis(cells) => cells.offset(),
        }
    }

    /// Go to the first element of a cell. In OASIS cells are read in the order of the file: going back inside a CBLOCK
    /// unpacks it again.
    pub(crate) fn seek(&mut self, cell: &LayoutCell) -> Result<()> {
        match self {
            Self::Gds(input) => {
                input.seek(cell.bytes.start)?;
                let (begin, name) = (input.next()?, input.next()?);
                if begin.kind != kind::BGNSTR || name.kind != kind::STRNAME {
                    return Err(input.fault(begin.offset, LayoutError::Rewritten));
                }
                Ok(())
            }
            Self::Oasis(cells) => cells.seek(cell),
        }
    }
}
