//! The hand-off: one folder, and one archive of it, from which a cleanroom can start.
//!
//! Layouts of both steps, dose matrix, test structures, tables to fill in, a draft of the writer's job,
//! write times, what was checked, and a manifest with the digest of every file. What belongs to the
//! design comes from the design, what belongs to the lab from a [`Process`] file, nothing from here.
//! Counts, areas and bounding boxes are read from the bytes of the files that are handed over.

mod build;
mod census;
mod contents;
mod documents;
mod dose;
mod drawing;
mod exposure;
mod fields;
mod front;
mod guard;
mod job;
mod kind_words;
mod layouts;
mod listing;
mod manifest;
mod matrix;
mod options;
mod pad;
mod pictures;
mod process;
mod rules;
mod sites;
mod sources;
mod structures;
mod tables;
mod zip;

pub use build::handoff;
pub use census::{CellCount, LayerCount, LayoutStatistics};
pub use contents::{Handoff, HandoffCheck};
pub use dose::{Beam, DoseRow, Exposure, WriteTime};
pub use manifest::{HandoffVerification, Manifest, ManifestEntry, verify as verify_handoff};
pub use options::HandoffOptions;
pub use pad::DrawnSize;
pub use process::Process;
pub use sites::{Cross, MetrologySite};
