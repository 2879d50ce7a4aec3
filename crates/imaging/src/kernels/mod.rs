//! Images of a point: for each element, channel of the camera and spectrum of the scene, over the field.
//!
//! | question | file |
//! | --- | --- |
//! | what a bank holds, and where copies by symmetry are found | `bank` |
//! | how it is simulated | `build` |
//! | what is found so far, and stored | `nodes` |
//! | how single wavelengths become a channel | `spectrum` |
//! | sums of moved spectra in the widest registers | `part_sum` |

mod bank;
mod build;
mod nodes;
mod part_sum;
mod spectrum;

pub use bank::{BankSpec, KernelBank};
pub(crate) use bank::{DistinctKernels, MOST_BYTES, SMALL_UM, TurnedKernel};
pub(crate) use nodes::NodeKernels;
