//! Numerical kernels that every propagation shares.
//!
//! | file | holds |
//! | --- | --- |
//! | `cis` | exp(2 pi i x), good to 1.5e-7, and products of complex samples |
//! | `fft` | the sizes of all transforms, and transforms of lines |
//! | `fourier` | transforms of images, with the border rule |
//! | `square_fft` | transforms of real squares, in single precision |
//! | `box_sums` | sums over squares about each pixel |
//! | `taper` | the one fade, and sinc |
//! | `products` | sums of products |
//! | `bessel` | J0, J1 and the transform of a disc |

mod bessel;
mod box_sums;
mod cis;
mod fft;
mod fourier;
mod products;
mod square_fft;
mod taper;

pub use bessel::{Bessel, jinc};
pub use box_sums::box_sums;
pub use cis::{CIS_ERROR, cis, cis_all};
pub use fft::fft_size;
pub use fourier::mirrored;
pub use products::sum_of_products;
pub use square_fft::{FftScratch, SquareFft};
pub use taper::{fade, sinc};

pub(crate) use cis::{
    accumulate, cis_where, multiply, multiply_by, multiply_conj, multiply_conj_to, multiply_to, product_sum,
};
pub(crate) use fft::{gather, process, scatter};
pub(crate) use fourier::Fourier;
