//! Tolerances for comparing whole database units with numbers of the deck.

/// Lengths closer than this are equal (nm): database units are converted to nanometres in double precision, and
/// places up to 1 m (1e9 nm) have 2e-7 nm of rounding.
pub(super) const EQUAL_NM: f64 = 1e-6;
/// Differences of whole nanometres that are computed without a change of unit, up to 1e6 nm: rounding is 2e-10 nm.
pub(super) const ROUNDING_NM: f64 = 1e-9;
/// Rounding of one quotient, relative: two units in the last place are 4e-16.
pub(super) const ROUNDING: f64 = 1e-12;
/// Rounding of an arc tangent (degrees): 3e-14 at 180 degrees.
pub(super) const ROUNDING_DEG: f64 = 1e-9;
