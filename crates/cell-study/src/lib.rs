//! What the rigorous table of a cell says of it: fits, widths to stay away from, mappings; and their page. What unlike neighbours
//! say of mappings for steered elements.

mod page;
mod steered;
mod study;

pub use page::write_cell_report;
pub use steered::{SteeredLight, SteeredStudy, study_steered};
pub use study::{CellStudy, InverseTrial, MappingStudy, StudyOptions};
