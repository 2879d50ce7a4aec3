//! ReadWarnings from the format that are read over: a list with places, capped.

use metalith_core::Progress;

use crate::error::{Error, LayoutError, Result};

/// ReadWarnings that are listed; all are counted.
const LISTED: usize = 8;

/// A departure from the format that was read over.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadWarning {
    /// Place of the record in the file.
    pub offset: u64,
    pub cause: LayoutError,
    /// What was taken instead.
    pub taken: &'static str,
}

/// ReadWarnings of one file.
#[derive(Clone, Debug, Default)]
pub struct ReadWarnings {
    /// The first ones.
    pub listed: Vec<ReadWarning>,
    /// Number of all.
    pub count: u64,
}

impl ReadWarnings {
    /// Take in one more.
    pub(super) fn add(&mut self, offset: u64, cause: LayoutError, taken: &'static str) {
        self.count += 1;
        if self.listed.len() < LISTED {
            self.listed.push(ReadWarning { offset, cause, taken });
        }
    }

    /// Hand them as warnings to `progress`.
    pub(super) fn report(&self, path: &std::path::Path, progress: &dyn Progress) {
        let name = path.display();
        for ReadWarning { offset, cause, taken } in &self.listed {
            progress.warn(&format!("warning[layout/odd]: {name}, byte {offset}: {cause}; {taken}"));
        }
        if let more @ 1.. = self.count - self.listed.len() as u64 {
            progress.warn(&format!(
                "warning[layout/odd]: {name}: {more} more records depart from the format"
            ));
        }
    }
}

/// Treatment of warnings from the format.
#[derive(Debug)]
pub(super) enum Tolerance {
    /// They end the reading.
    Strict,
    /// They are read over and listed.
    Listed(ReadWarnings),
    /// They are read over: they were listed before.
    Known,
}

impl Tolerance {
    /// Treatment in the first reading.
    pub(crate) fn of(progress: &dyn Progress) -> Self {
        if progress.strict() {
            Self::Strict
        } else {
            Self::Listed(ReadWarnings::default())
        }
    }

    /// Read over a departure, or make it an error.
    pub(crate) fn meet(
        &mut self,
        offset: u64,
        cause: LayoutError,
        taken: &'static str,
        fault: impl FnOnce(LayoutError) -> Error,
    ) -> Result<()> {
        match self {
            Self::Strict => return Err(fault(cause)),
            Self::Listed(list) => list.add(offset, cause, taken),
            Self::Known => {}
        }
        Ok(())
    }

    /// The warnings that were listed.
    pub(crate) fn into_listed(self) -> ReadWarnings {
        match self {
            Self::Listed(list) => list,
            _ => ReadWarnings::default(),
        }
    }
}
