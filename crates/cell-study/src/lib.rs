//! Study of a cell by its rigorous table: fits, widths to stay away from, mappings; and their page. Also mappings for
//! steered elements by the coupled model, and the phase of rotated rectangles by their rotation.

mod cell_choice;
mod library;
mod page;
mod rotation;
mod steered;
mod study;

pub use cell_choice::{CellRequest, ChosenCell, LEAST_LIGHT, WIDEST_GAP_WAVES};
pub use library::{LibraryStudy, write_library_report};
pub use page::write_cell_report;
pub use rotation::{RotationPoint, RotationStudy, rotation_keys, write_rotation_report};
pub use steered::{SteeredLight, SteeredStudy, study_steered};
pub use study::{CellStudy, InverseTrial, MappingStudy, StudyOptions};
