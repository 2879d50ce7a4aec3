//! The radii that a ring is sampled at.

/// Points at which a ring is sampled along r^2. The kernels turn by at most 1.2 rad across a ring of
/// one pitch (400 nm, NA 0.2); Chebyshev interpolation at eight points then errs by 1e-9.
pub(crate) const NODES: usize = 8;

/// One radius that stands for a part of a ring.
#[derive(Clone, Copy, Debug, Default)]
pub struct Node {
    /// Distance from the centre (um).
    pub radius_um: f64,
    /// Number of sites it stands for; not whole, and a few are below zero.
    pub weight: f64,
}
