//! Images that are given as files, or as a folder of them, and how many pixels are asked for.

#[cfg(feature = "baselines")]
use std::path::PathBuf;

use clap::builder::RangedI64ValueParser;
#[cfg(feature = "baselines")]
use metalith::Result;
use metalith::imaging::SCORED_SIDES;
#[cfg(feature = "baselines")]
use metalith::imaging::scene::images_in;

#[cfg(feature = "baselines")]
/// Several files, and the images of folders, in the order in which they are given.
///
/// # Errors
/// As [`images_in`].
pub(crate) fn of_all(given: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut all = Vec::new();
    for path in given {
        if path.is_dir() {
            all.extend(images_in(path)?);
        } else {
            all.push(path.clone());
        }
    }
    Ok(all)
}

/// Reads the side of a scene whose pictures are scored (pixels).
pub(crate) fn scored_sides() -> RangedI64ValueParser<u16> {
    clap::value_parser!(u16).range(*SCORED_SIDES.start() as i64..=*SCORED_SIDES.end() as i64)
}
