//! The cell in which KLayout and gdsfactory keep notes: read over, and copied from GDSII to GDSII.

use super::cells::FileFormat;
use super::layout::Layout;
use super::record::{data, kind};
use super::scan::Scan;
use crate::error::Result;

/// Name of the cell of notes. It refers to every cell with notes, at (0, 0), and has one shape without area: none of
/// it is layout.
const NOTES: &[u8] = b"$$$CONTEXT_INFO$$$";

/// Bytes of a reference before its name that are held; one of more is copied whatever it refers to.
const HELD: usize = 1 << 16;

/// Take the cells of notes out of what was read. Returns their places in the file.
pub(super) fn take(scan: &mut Scan) -> Vec<std::ops::Range<u64>> {
    let Some(notes) = scan.names.find(NOTES) else {
        return Vec::new();
    };
    let mut places = Vec::new();
    let mut numbers = scan.numbers.iter();
    scan.cells.retain(|cell| {
        let is_notes = numbers.next() == Some(&notes);
        if is_notes {
            places.push(cell.bytes.clone());
        }
        !is_notes
    });
    scan.numbers.retain(|&number| number != notes);
    places
}

impl Layout {
    /// True if the file has notes of KLayout or gdsfactory, which are no layout.
    pub fn has_notes(&self) -> bool {
        !self.notes.is_empty()
    }

    /// Hand the records of the cells of notes to `put`, as they are in a GDSII file, without those on cells that the
    /// layout does not have. OASIS has no such cells.
    ///
    /// # Errors
    /// If the file cannot be read again, and what `put` returns.
    pub fn copy_notes(&self, put: &mut dyn FnMut(&[u8]) -> metalith_core::Result<()>) -> Result<()> {
        if self.format() != FileFormat::Gds || self.notes.is_empty() {
            return Ok(());
        }
        let mut input = self.source().open()?;
        for place in &self.notes {
            input.seek(place.start)?;
            // Records of a reference whose cell is not known yet, and whether those of one are passed over.
            let (mut held, mut in_head, mut skipping) = (Vec::new(), false, false);
            while input.offset() < place.end {
                let record = input.next_of_any()?;
                let body = input.body(record);
                let head = [((body.len() + 4) as u16).to_be_bytes(), [record.kind, record.data]].concat();
                if matches!(record.kind, kind::SREF | kind::AREF) {
                    in_head = true;
                }
                if in_head {
                    held.extend(head);
                    held.extend(body);
                    let named = record.kind == kind::SNAME && record.data == data::ASCII;
                    if named {
                        let name = input.text(record)?;
                        let number = self.names().find(name);
                        skipping = number.is_none_or(|n| self.tree().definitions[n as usize].is_none());
                    }
                    if named || record.kind == kind::ENDEL || held.len() > HELD {
                        in_head = false;
                        if !skipping {
                            put(&held)?;
                        }
                        held.clear();
                    }
                } else if !skipping {
                    put(&head)?;
                    put(body)?;
                }
                skipping &= record.kind != kind::ENDEL;
            }
        }
        Ok(())
    }
}
