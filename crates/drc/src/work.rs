//! Limits of the memory and work of a check: in proportion to its files, so that a few bytes cannot cost hours.

use std::cell::Cell;

use metalith_core::Progress;
use metalith_gds::Layout;

/// Steps of work for any layout. A step is about 10 ns, so these are two seconds.
const STEPS: u64 = 200_000_000;
/// Steps for each byte of the files: two seconds a megabyte.
const STEPS_A_BYTE: u64 = 200;
/// Rectangles off every lattice: 16 bytes each. A rectangle that is drawn takes 64 bytes of the file.
const RECTS: u64 = 8_000_000;
const RECTS_A_BYTE: u64 = 1;
/// Vertices of other outlines: 16 bytes each. A vertex that is drawn takes 8 bytes of the file.
const VERTICES: u64 = 4_000_000;
const VERTICES_A_BYTE: u64 = 1;
/// Sites of lattices that were found, 2 bytes each, of eighths a sixteenth of that. The layout of a lens of 100 mm, folded to an
/// eighth, has 38 sites a byte.
const SITES: u64 = 16_000_000;
const SITES_A_BYTE: u64 = 40;
/// Steps between two checks for an interrupt.
const STEPS_A_LOOK: u64 = 1 << 20;

/// Limits on memory and work of a check or a comparison, by the size of the files.
#[derive(Clone, Copy, Debug)]
pub(super) struct Allowance {
    pub rects: u64,
    pub vertices: u64,
    pub sites: u64,
    steps: u64,
}

impl Allowance {
    pub(crate) fn of<'l>(layouts: impl IntoIterator<Item = &'l Layout>) -> Self {
        let bytes = layouts.into_iter().map(Layout::bytes).fold(0, u64::saturating_add);
        let grown = |base: u64, a_byte: u64| bytes.saturating_mul(a_byte).saturating_add(base);
        Self {
            rects: grown(RECTS, RECTS_A_BYTE),
            vertices: grown(VERTICES, VERTICES_A_BYTE),
            sites: grown(SITES, SITES_A_BYTE),
            steps: grown(STEPS, STEPS_A_BYTE),
        }
    }
}

/// Reason why work ended early.
#[derive(Debug, PartialEq)]
pub(super) enum Stop {
    /// Work over a limit; the text says which one.
    TooMuch(String),
    Interrupted,
}

/// Counts work against the limits that follow from the size of the files.
pub(super) struct Work<'p> {
    left: Cell<u64>,
    unseen: Cell<u64>,
    allowed: u64,
    progress: &'p dyn Progress,
}

impl<'p> Work<'p> {
    pub(crate) fn new(allowance: &Allowance, progress: &'p dyn Progress) -> Self {
        Self {
            left: Cell::new(allowance.steps),
            unseen: Cell::new(0),
            allowed: allowance.steps,
            progress,
        }
    }

    /// Count steps that are about to be done.
    ///
    /// # Errors
    /// If they are more than the files allow, or the user asked to stop.
    #[inline]
    pub(crate) fn spend(&self, steps: u64) -> Result<(), Stop> {
        let Some(left) = self.left.get().checked_sub(steps) else {
            return Err(Stop::TooMuch(format!(
                "more than {} steps of work, which is out of proportion to the size of the files",
                self.allowed
            )));
        };
        self.left.set(left);
        let unseen = self.unseen.get() + steps;
        if unseen < STEPS_A_LOOK {
            self.unseen.set(unseen);
            return Ok(());
        }
        self.unseen.set(0);
        self.look()
    }

    /// Fails if the user asked to stop: for work whose size the design sets and not the layout.
    ///
    /// # Errors
    /// If so.
    pub(crate) fn look(&self) -> Result<(), Stop> {
        if self.progress.stopped() {
            return Err(Stop::Interrupted);
        }
        Ok(())
    }
}
