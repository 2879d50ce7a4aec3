//! Point spread functions of known objects, a relief or a complex transmission, in stacks through focus.

mod allowance;
mod bench;
mod chirp;
mod detector;
mod files;
mod frames;
mod light;
mod mask;
mod model;
mod orientation;
mod page;
mod recent;
mod sampling;
mod selection;
mod set;
mod setting;
#[cfg(test)]
mod tests;

use metalith_core::Result;

pub(crate) use allowance::{allow_for_samples, equal_scales};
pub use bench::{ApertureShape, StackBench, ThinLens};
pub use model::StackModel;
pub(crate) use page::figures;
use sampling::Sampling;
pub use set::{StackObject, StackPlane, StackSet, Transmission};

/// What is known of a set before any fit.
pub(crate) struct Prepared {
    pub sampling: Sampling,
    /// Focus offset at which the stated model is registered (um).
    pub focus_um: f64,
    /// Relative error that noise makes alone.
    pub noise: f64,
}

/// Choose how a set is propagated, and settle the orientation of its frames; what was found joins its remarks.
///
/// # Errors
/// If no way of propagation samples the geometry.
pub(crate) fn prepare(set: &mut StackSet) -> Result<Prepared> {
    let sampling = Sampling::new(set)?;
    set.remarks.push(sampling.reason.clone());
    let focus_um = orientation::settle(set, &sampling);
    let noise = orientation::noise(set);
    Ok(Prepared {
        sampling,
        focus_um,
        noise,
    })
}
