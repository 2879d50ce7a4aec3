//! Accuracy of simulated fields.

use metalith::Accuracy;

/// Accuracy of the fields of a command.
#[derive(Clone, Copy, clap::Args)]
pub(crate) struct AccuracyArgs {
    /// Simulate with errors of 1e-3 instead of 1e-5 of the amplitude of an ideal lens, with shorter transforms. What a command does
    /// beside fields takes as long.
    #[arg(long)]
    pub fast: bool,
}

impl AccuracyArgs {
    pub(crate) fn accuracy(self) -> Accuracy {
        if self.fast { Accuracy::Fast } else { Accuracy::Accurate }
    }
}
