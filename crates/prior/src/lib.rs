//! Prior of pictures that a small network learnt from photographs.
//!
//! ```text
//! noisy picture, map of its noise    -> expected picture             (`NetworkDenoiser::denoise`)
//! the same, and a seed               -> one of the pictures it may be of  (`NetworkDenoiser::sample`)
//! pictures restored from one frame   -> one picture                  (`PostProcessor::finish`)
//! the same, and a fit to the frame   -> one picture                  (`PostProcessor::finish_fitted`)
//! two pictures, weights of others    -> how different they look      (`PerceptualDistance`)
//! ```
//!
//! The denoiser has 0.8 million weights, the last stage of a camera 0.2. Its convolutions and their gradients are made here, in registers: what they are
//! needed for is small enough, they are three times as fast as those of the general packages that were measured (see
//! docs/method/prior.md), and the order of their sums is known.

mod convolution;
mod denoiser;
mod diffusion_sampling;
mod features;
mod network;
mod network_input;
mod noise;
#[cfg(feature = "onnx")]
mod onnx;
mod perceptual;
mod post_processor;
mod weights;

pub use denoiser::NetworkDenoiser;
pub use diffusion_sampling::SAMPLING_STEPS;
pub use network::COLOURS;
pub use noise::with_noise;
pub use perceptual::PerceptualDistance;
pub use post_processor::{MOST_REFITS, PictureFit, PostProcessor, Provenance};

/// The parts of the networks that a training needs: layers, gradients, files of weights.
pub mod parts {
    pub use crate::denoiser::{input, over_squares};
    pub use crate::features::Features;
    pub use crate::network::{Layer, Network, Plan, Size, Trace};
    pub use crate::network_input::{SIDE, cut, folded, mirrored, piled, refitted, seen, with_answer};
    pub use crate::post_processor::{STAGE, read_stage};
    pub use crate::weights::write_weights;
}
