//! The hand-off: one folder, and one archive of it, from which a cleanroom can start. It is made from a design, or from a layout
//! of any program.
//!
//! Layouts of both steps, dose matrix, test structures, tables to fill in, a draft of the writer's job,
//! write times, what was checked, and a manifest with the digest of every file. What belongs to the
//! design comes from the design, what belongs to the lab from a [`Process`] file, nothing from here.
//! Counts, areas and bounding boxes are read from the bytes of the files that are handed over.

mod build;
mod contents;
mod cures;
mod documents;
mod dose;
mod dose_classes;
mod dose_matrix;
mod drawing;
mod exposure;
mod from_design;
mod from_layout;
mod front_page;
mod inputs;
mod job;
mod kind_words;
mod lab;
mod layout_statistics;
mod layouts;
mod listing;
mod manifest;
mod metrology_sites;
mod options;
mod pad;
mod pictures;
mod preconditions;
mod process;
mod raith;
mod rules;
mod structures;
mod tables;
mod write_fields;
mod zip;

pub use build::handoff;
pub use contents::{Handoff, HandoffCheck};
pub use cures::BrokenRule;
pub use dose::{Beam, DoseRow, Exposure, WriteTime};
pub use dose_classes::{DoseClass, DoseClasses};
pub use from_layout::handoff_name;
pub use layout_statistics::{CellCount, LayerCount, LayoutStatistics};
pub use manifest::{HandoffVerification, Manifest, ManifestEntry, verify as verify_handoff};
pub use metrology_sites::{Cross, MetrologySite};
pub use options::{DesignSource, HandoffOptions, HandoffSource, LayoutSource};
pub use pad::DrawnSize;
pub use process::Process;
