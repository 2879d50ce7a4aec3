//! The elements of one cell, one after the other.

use super::cells::CellInput;
use super::element::{ElementContent, ElementKind};
use super::input::Input;
use super::limits::ReadLimits;
use super::oasis::Copies;
use super::pillar_records;
use super::record::{Record, kind};
use super::shape::Point;
use crate::error::{Error, LayoutError, Result};
use metalith_core::{LayerNumber, Progress};

/// Consumer of the elements of a cell.
pub(super) trait Sink {
    /// A BOUNDARY of five points; most of them are upright squares.
    fn five_points(&mut self, offset: u64, layer: LayerNumber, points: &[Point; 5]) -> Result<(), SinkError>;

    /// A plain reference, the name by its key.
    fn plain_reference(&mut self, offset: u64, key: u64, at: Point) -> Result<(), SinkError>;

    /// Any other element.
    fn element(&mut self, element: &ElementContent) -> Result<(), SinkError>;

    /// Any element with all its copies.
    fn repeated(&mut self, element: &ElementContent, copies: &Copies<'_>) -> Result<(), SinkError>;
}

/// Reason why a sink ends the reading: a cause at the element that it was given, or an error as it is.
pub(super) enum SinkError {
    Here(LayoutError),
    With(Error),
}

impl From<LayoutError> for SinkError {
    fn from(cause: LayoutError) -> Self {
        Self::Here(cause)
    }
}

impl From<Error> for SinkError {
    fn from(error: Error) -> Self {
        Self::With(error)
    }
}

impl From<metalith_core::Error> for SinkError {
    fn from(error: metalith_core::Error) -> Self {
        Self::With(error.into())
    }
}

/// Pass over an element of another program's own, such as the paths of a moving stage that Raith writes: a record of a
/// type above those of the format, without a body, and all up to ENDEL.
#[cold]
fn skip_private(input: &mut Input, head: Record) -> Result<()> {
    let kind = head.kind;
    if head.data != 0 || !input.body(head).is_empty() || kind > kind::LAST_PRIVATE {
        return Err(input.unknown(head));
    }
    input.odd(head.offset, LayoutError::PrivateElement { kind }, "it was left out")?;
    loop {
        let record = input.next_of_any()?;
        match record.kind {
            kind::ENDEL => return Ok(()),
            kind::ENDSTR | kind::ENDLIB | kind::BGNSTR | kind::BGNLIB | kind::HEADER => {
                let (kind, begin) = (record.kind, head.offset);
                return Err(input.fault(record.offset, LayoutError::ElementNotEnded { kind, begin }));
            }
            other if other > kind::LAST_PRIVATE => return Err(input.unknown(record)),
            _ => {}
        }
    }
}

/// Reads the elements of a cell: in GDSII from behind STRNAME to behind ENDSTR.
pub(super) struct Walk<'a> {
    pub limits: &'a ReadLimits,
    pub progress: &'a dyn Progress,
    element: ElementContent,
    /// True if [`super::pillar_records`] may be used: tests read with and without.
    fast: bool,
    reported: u64,
}

impl<'a> Walk<'a> {
    pub(crate) fn new(limits: &'a ReadLimits, progress: &'a dyn Progress) -> Self {
        Self {
            limits,
            progress,
            element: ElementContent::default(),
            fast: true,
            reported: 0,
        }
    }

    /// Use the grammar for every element.
    #[cfg(test)]
    pub(crate) fn slowly(mut self) -> Self {
        self.fast = false;
        self
    }

    /// Tell how far reading is.
    ///
    /// # Errors
    /// If the user asked to stop.
    pub(crate) fn report(&mut self, offset: u64) -> Result<()> {
        self.progress.advance(offset.saturating_sub(self.reported));
        self.reported = offset;
        self.progress.check_stopped()?;
        Ok(())
    }

    /// Start counting bytes of progress at a place.
    pub(crate) fn start_at(&mut self, offset: u64) {
        self.reported = offset;
    }

    /// Hand the elements up to the end of the cell to `sink`.
    pub(crate) fn cell<S: Sink>(&mut self, input: &mut CellInput, sink: &mut S) -> Result<()> {
        match input {
            CellInput::Gds(input) => self.gds_cell(input, sink),
            CellInput::Oasis(cells) => cells.cell(self.limits, sink, |offset| self.report(offset)),
        }
    }

    /// Hand the elements up to ENDSTR to `sink`.
    pub(crate) fn gds_cell<S: Sink>(&mut self, input: &mut Input, sink: &mut S) -> Result<()> {
        loop {
            if self.fast {
                self.fast_run(input, sink)?;
            }
            let record = input.next_of_any()?;
            if let Some(kind) = ElementKind::of(record.kind) {
                self.element.read(input, record, kind, self.limits)?;
                sink.element(&self.element).map_err(|error| match error {
                    SinkError::Here(cause) => input.fault(self.element.offset, cause),
                    SinkError::With(error) => error,
                })?;
            } else if record.kind == kind::ENDSTR {
                return self.report(input.offset());
            } else if matches!(record.kind, kind::BGNSTR | kind::ENDLIB | kind::BGNLIB | kind::HEADER) {
                let kind = record.kind;
                return Err(input.fault(record.offset, LayoutError::CellNotEnded { kind }));
            } else if record.kind > kind::LAST {
                skip_private(input, record)?;
            }
        }
    }

    /// Reads as many of the two common elements as follow one another.
    fn fast_run<S: Sink>(&mut self, input: &mut Input, sink: &mut S) -> Result<()> {
        loop {
            let base = input.offset();
            self.report(base)?;
            let window = input.window()?;
            let mut at = 0;
            while let Some(bytes) = window.get(at..).and_then(<[u8]>::first_chunk) {
                let offset = base + at as u64;
                let (taken, length) = if let Some((layer, points)) = pillar_records::boundary(bytes) {
                    (sink.five_points(offset, layer, &points), pillar_records::BOUNDARY_BYTES)
                } else if let Some(reference) = bytes.first_chunk().and_then(pillar_records::reference) {
                    let taken = sink.plain_reference(offset, reference.key, reference.at);
                    (taken, reference.bytes)
                } else {
                    break;
                };
                match taken {
                    Ok(()) => at += length,
                    Err(SinkError::Here(cause)) => return Err(input.fault(offset, cause)),
                    Err(SinkError::With(error)) => return Err(error),
                }
            }
            let more = window.len() - at < pillar_records::BOUNDARY_BYTES && at > 0;
            input.consume(at);
            if !more {
                return Ok(());
            }
        }
    }
}
