//! Merits of the field at a few points, which errors of fabrication may be drawn for.

pub(crate) mod fabrication_errors;
pub(crate) mod field;
pub(crate) mod field_merit;
pub(crate) mod field_point;
pub(crate) mod focus;
pub(crate) mod neighbour_terms;
pub(crate) mod objective;
pub(crate) mod ring_context;
pub(crate) mod spectrum;
