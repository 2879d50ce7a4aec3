//! Surroundings of one ring: all that follows from the widths of its neighbours, before its candidates are tried.

use crate::rings::neighbour_links::DISTANCES;
use crate::rings::split_complex::Planes;

/// All that a ring's width is multiplied with.
pub struct RingContext {
    /// Own factors: `[product][row]`.
    pub(crate) around: Planes,
    /// Factors as a neighbour of others: `[product of one distance][row]`.
    pub(crate) reverse: Planes,
    /// Links to itself.
    pub(crate) same: [Option<usize>; DISTANCES],
}
