//! Bytes of a file, read from a place on.

use super::Parsed;

/// Bytes behind a place.
#[derive(Clone, Copy)]
pub(super) struct Bytes<'a>(pub(super) &'a [u8]);

impl<'a> Bytes<'a> {
    pub(super) fn take(&mut self, count: usize) -> Parsed<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or("the file ends within an object")?;
        self.0 = rest;
        Ok(taken)
    }

    /// Unsigned number of so many bytes, eight at the most.
    pub(super) fn number(&mut self, count: usize) -> Parsed<u64> {
        let bytes = self.take(count)?;
        Ok(bytes.iter().rev().fold(0, |sum, byte| sum << 8 | u64::from(*byte)))
    }

    pub(super) fn is(&mut self, mark: &[u8]) -> Parsed<()> {
        if self.take(mark.len())? == mark {
            Ok(())
        } else {
            Err(format!("no {} where one should be", String::from_utf8_lossy(mark)))
        }
    }

    /// Text up to a zero byte, which is taken too.
    pub(super) fn text(&mut self) -> Parsed<String> {
        let end = self.0.iter().position(|b| *b == 0).ok_or("a name without an end")?;
        let text = String::from_utf8_lossy(self.take(end)?).into_owned();
        self.take(1)?;
        Ok(text)
    }
}
