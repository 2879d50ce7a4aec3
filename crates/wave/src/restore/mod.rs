//! Images restored from their blur, and how near they come.
//!
//! | question | file |
//! | --- | --- |
//! | what is expected of a scene | `scene` |
//! | the filter, at one frequency and of an image | `wiener` |
//! | how near an image is to another | `quality` |

mod quality;
mod scene;
mod wiener;

pub use quality::{psnr_db, ssim, ssim_colour};
pub use scene::Scene;
pub use wiener::{Restoration, Wiener};
