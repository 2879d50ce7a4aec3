//! From fields to what a sensor sees: point spread, contrast, and images restored from it.

mod chief;
mod fourier;
mod matched;
mod mtf;
mod orders;
mod patches;
mod psf;
mod quality;
pub mod sensor;
pub mod wiener;

pub use chief::{incident, landing_um, leaving};
pub use matched::Matched;
pub use mtf::{HALF_NYQUIST_LP_MM, NYQUIST_LP_MM, pixel_mtf};
pub use orders::{Steepness, order_shares};
pub use patches::Patches;
pub use psf::{Psf, PsfMeasures};
pub use quality::{psnr_db, ssim};
