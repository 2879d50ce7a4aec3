//! The rings of a lens: their sites and neighbours, widths, and the field that each makes.

pub(crate) mod kernel;
pub(crate) mod mapping;
pub(crate) mod neighbour_links;
pub(crate) mod pair_response;
pub(crate) mod phase_file;
pub(crate) mod phase_step_limit;
pub(crate) mod ring_radii;
pub(crate) mod sites;
pub(crate) mod split_complex;
