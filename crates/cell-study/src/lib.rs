//! What the rigorous table of a cell says of it: fits, widths to stay away from, mappings; and their page. What unlike neighbours
//! say of mappings for steered elements. Of rotated rectangles the phase by their rotation.

mod library;
mod page;
mod rotation;
mod steered;
mod study;

pub use library::{LibraryStudy, write_library_report};
pub use page::write_cell_report;
pub use rotation::{RotationPoint, RotationStudy, rotation_keys, write_rotation_report};
pub use steered::{SteeredLight, SteeredStudy, study_steered};
pub use study::{CellStudy, InverseTrial, MappingStudy, StudyOptions};
