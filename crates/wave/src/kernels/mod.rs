//! Numerical kernels that every propagation shares.
//!
//! | file | holds |
//! | --- | --- |
//! | `cis` | exp(2 pi i x), good to 1.5e-7, and products of complex samples |
//! | `fft` | the sizes of all transforms, and transforms of lines |
//! | `fourier` | transforms of images, with the border rule |
//! | `taper` | the one fade, and sinc |
//! | `products` | sums of products |
//! | `bessel` | J0, J1 and the transform of a disc |

mod bessel;
mod cis;
mod fft;
mod fourier;
mod products;
mod taper;

pub use bessel::{Bessel, jinc};
pub use cis::{CIS_ERROR, cis, cis_all};
pub use fft::fft_size;
pub use fourier::mirrored;
pub use products::sum_of_products;
pub use taper::{fade, sinc};

pub(crate) use cis::{accumulate, cis_where, multiply, multiply_by, multiply_conj, multiply_to, product_sum};
pub(crate) use fft::{gather, process, scatter};
pub(crate) use fourier::Fourier;
