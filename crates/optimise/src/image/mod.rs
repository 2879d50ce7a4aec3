//! The expected error of restored images, from the field over a wide window.

pub(crate) mod buffer_pool;
pub(crate) mod deconvolution;
pub(crate) mod image_error;
pub(crate) mod image_slopes;
pub(crate) mod imaging;
pub(crate) mod pupil;
pub(crate) mod scene;
pub(crate) mod views;
pub(crate) mod wiener;
pub(crate) mod window;
