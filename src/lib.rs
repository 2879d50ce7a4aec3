//! metalith

mod array;
mod cell;
mod design;
#[allow(dead_code, unused_imports)] // read by the design, the rules and the measurements to come
mod document;
mod error;
mod extract;
mod file;
mod gds;
mod handoff;
pub mod image;
mod lattice;
mod layout;
pub mod optimise;
mod phase;
mod progress;
pub mod report;
mod verify;
mod wave;

pub use array::{Class, DomainPart, Group, PillarArray, Placed, Symmetry, WidthRule};
pub use cell::{
    BadCell, Basis, CellModel, CellStack, CellStudy, CellTable, Fidelity, FittedCell, ForwardFit, ForwardPolynomial,
    InverseFit, InversePolynomial, InverseTrial, LED_UM, MappingError, MappingStudy, MappingTable, Material, Origin,
    PhaseCurve, PointwiseCell, PublishedCell, RampOrders, RigorousCell, StudyOptions, TableSpec, bad_cells,
    cache_folder, cell_models, curves_over, fit_forward, fit_inverse, forward_errors, rcwa, round_trip,
    write_cell_report,
};
pub use design::{
    ApertureSpec, ArraySpec, CellSpec, ChipSpec, Design, Element, FieldAngle, Hierarchy, Layer, Layers, LayoutSpec,
    LensSpec, LimitSpec, MappingSpec, MarkSpec, VerifySpec,
};
pub use document::{Fault, Faults};
pub use error::{Error, Result};
pub use extract::{
    ElementSite, Elements, ExtractedElement, Extraction, ExtractionPlan, LayerSummary, Oddities, Oddity, Survey,
    TextSummary, Why, extract,
};
pub use file::WholeFile;
pub use gds::{
    Cell, Child, Faulty, LayerNumber, LayerTally, Layout, Point, ReadLimits, Rect, Selection, Shape, ShapeKind, Text,
    Transform, Visitor,
};
pub use handoff::{
    Beam, CellCount, Census, Cross, DoseRow, Entry, Exposure, Handoff, HandoffOptions, LayerCount, Manifest, Process,
    Site, Verification as HandoffVerification, WriteTime, handoff, verify_handoff,
};
pub use image::{Matched, Psf, PsfMeasures, Steepness};
pub use lattice::{Lattice, WidthMap};
pub use layout::{Written, write_apertures, write_layer_properties, write_pillars};
pub use phase::{ElementPhase, Interpolation, LensPhase, RadialPhase, Wedge};
pub use progress::{Progress, Silent};
pub use verify::{
    Check, DistinctElement, ElementCheck, LayoutFacts, Lighting, LonePsf, Orders, PhaseError, PhaseErrors, Sense, Spot,
    SpotPair, Verification, WidthCheck, lone_psfs, verify, write_lone_report, write_report,
};
pub use wave::{
    Accuracy, Aperture, Direct, Fade, Field, Fold, Hankel, PhaseArray, PhaseFunction, Pillars, PlaneWave, Propagator,
    Scratch, Window,
};
