//! Number of pixels that scenes may have.

use std::ops::RangeInclusive;

/// Shortest and longest side of a picture that is read (pixels): not all are scored.
pub(crate) const SIDES: RangeInclusive<usize> = 16..=*SCORED_SIDES.end();

/// Least and longest side of a scene whose pictures are scored (pixels): a third of the least holds the window of the similarity,
/// 11 pixels wide.
pub const SCORED_SIDES: RangeInclusive<usize> = 33..=4096;

/// Words for the number of pixels of scenes, for messages.
pub(crate) fn sides_words() -> String {
    format!(
        "{} to {} pixels a side; where pictures are not scored (`dataset`, `train`, `denoise`) {} are enough",
        SCORED_SIDES.start(),
        SCORED_SIDES.end(),
        SIDES.start()
    )
}
