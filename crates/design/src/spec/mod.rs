//! The sections of a design file, one module each.

mod array;
mod cell;
mod footprint;
mod layout;
mod lens;
mod mapping;
mod mapping_cell;
mod optimise;
mod outline;
mod phase_term;
mod steered_mapping;
mod verify;

pub use array::{ArraySpec, Element, PlacedSpec};
pub use cell::{CellSpec, TALLEST_NM, UnderSpec};
pub(crate) use footprint::Footprint;
pub use layout::{ApertureSpec, ChipSpec, Hierarchy, Layers, LayoutLayer, LayoutSpec, MarkSpec};
pub use lens::FOCAL_LENGTH;
pub(crate) use lens::WAVELENGTH;
pub use lens::{LensSpec, PhaseAlongY};
pub(crate) use mapping::LibraryFile;
pub use mapping::{MappingComparison, MappingSpec};
pub use mapping_cell::MappingIdentity;
pub use optimise::{
    CameraSearchSpec, CameraSizes, MeritSpec, OptimiseSpec, RobustSpec, SolverSpec, StartSpec, ViewSpec,
};
pub(crate) use outline::OutlineRows;
pub use outline::{DIAMETER, LensOutline};
pub use steered_mapping::{SteeredMapping, SteeringSteps};
pub use verify::{CellIncidence, FieldAngle, LimitSpec, USUAL_PIXEL_UM, VerifySpec};
