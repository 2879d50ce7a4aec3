//! Phase of every site of a design: the radial phase that all elements share, and the wedge that steers each of them.
//! Phases are kept in turns, so that the modulo is exact.

mod element;
mod open_area;
mod radial;
mod table;
mod term;

pub(crate) use element::Rotation;
pub use element::{ElementPhase, LensPhase};
pub use open_area::OpenAreas;
pub use radial::{Interpolation, RadialPhase, TableReading};
pub use term::{MapTable, PhaseTerm, TermForm, ZernikeOrder};
