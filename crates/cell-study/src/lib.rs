//! What the rigorous table of a cell says of it: fits, widths to stay away from, mappings; and their page.

mod page;
mod study;

pub use page::write_cell_report;
pub use study::{CellStudy, InverseTrial, LED_UM, MappingStudy, StudyOptions};
