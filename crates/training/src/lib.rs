//! The training of the networks of `metalith-prior`.
//!
//! ```text
//! photographs -> pieces with noise -> gradients -> weights           (`train`)
//! pictures of frames, their scenes -> gradients -> weights           (`train_post_processor`)
//! the same, through fits to frames -> gradients -> weights           (`train_through_fits`)
//! ```
//!
//! | question | file |
//! | --- | --- |
//! | pieces of photographs, and noise on them | `examples` |
//! | pictures of frames, and the scenes that they are of | `stacks` |
//! | the same with fits to the frames between passes of the network | `fitted_stacks` |
//! | the steps down the gradient, and their state on the disk | `learning`, `adam`, `checkpoint` |
//! | what each of the two networks learns | `denoiser`, `post_processor`, `stacks` |

mod adam;
mod checkpoint;
mod denoiser;
mod examples;
mod fitted_stacks;
mod learning;
mod post_processor;
mod stacks;

pub use denoiser::{JUDGED, train};
pub use examples::Photographs;
pub use fitted_stacks::{FittedStacks, train_through_fits};
pub use learning::{TrainingReport, TrainingSpec};
pub use post_processor::train_post_processor;
pub use stacks::{Stack, Stacks};
