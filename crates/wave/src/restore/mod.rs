//! The error of a Wiener filter, and how near an image is to another.
//!
//! | question | file |
//! | --- | --- |
//! | what is expected of a scene | `scene` |
//! | the filter at one frequency | `wiener` |
//! | how near an image is to another | `quality` |

mod quality;
mod scene;
mod wiener;

pub use quality::{psnr_db, ssim, ssim_colour};
pub use scene::Scene;
pub use wiener::Wiener;
