//! The rings of a lens: their sites and neighbours, widths, and the field that each makes.

pub(crate) mod kernel;
pub(crate) mod limit;
pub(crate) mod links;
pub(crate) mod mapping;
pub(crate) mod node;
pub(crate) mod pair_response;
pub(crate) mod planes;
pub(crate) mod sites;
pub(crate) mod table;
