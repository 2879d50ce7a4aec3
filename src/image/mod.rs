//! From fields to what a sensor sees: point spread, contrast, and images restored from it.

mod chief;
mod matched;
mod mtf;
mod orders;
mod psf;

pub use chief::{incident, landing_um, leaving};
pub use matched::Matched;
pub use mtf::{HALF_NYQUIST_LP_MM, NYQUIST_LP_MM, pixel_mtf};
pub use orders::{Steepness, order_shares};
pub use psf::{Psf, PsfMeasures};
