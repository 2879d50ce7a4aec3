//! What pictures look like, learnt from photographs by a small network.
//!
//! ```text
//! photographs -> pieces with noise -> gradients -> weights           (`train`)
//! noisy picture, map of its noise    -> expected picture             (`NetworkDenoiser::denoise`)
//! the same, and a seed               -> one of the pictures it may be of  (`NetworkDenoiser::sample`)
//! pictures of frames, their scenes   -> weights                      (`train_finisher`)
//! pictures restored from one frame   -> one picture                  (`PostProcessor::finish`)
//! two pictures, weights of others    -> how different they look      (`PerceptualDistance`)
//! ```
//!
//! The denoiser has 0.8 million weights, the last stage of a camera 0.2. Its convolutions and their gradients are made here, in registers: what they are
//! needed for is small enough, they are three times as fast as those of the general packages that were measured (see
//! docs/method/prior.md), and the order of their sums is known.

mod adam;
mod checkpoint;
mod convolution;
mod denoiser;
mod examples;
mod features;
mod learning;
mod network;
#[cfg(feature = "onnx")]
mod onnx;
mod perceptual;
mod post_processor;
mod sample;
mod squares;
mod stacks;
mod training;
mod weights;

pub use denoiser::NetworkDenoiser;
pub use examples::{Photographs, with_noise};
pub use learning::{TrainingReport, TrainingSpec};
pub use network::COLOURS;
pub use perceptual::PerceptualDistance;
pub use post_processor::{PostProcessor, Provenance, train_finisher};
pub use sample::SAMPLING_STEPS;
pub use stacks::{Stack, Stacks};
pub use training::{JUDGED, train};
