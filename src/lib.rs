//! From the phase of a metalens array to the layout a cleanroom writes, and back from that file to the
//! image it makes.
//!
//! Data runs one way. The first line makes a file; the second begins at the bytes of that file, so that
//! what is simulated is what is sent to the writer, never what it was meant to be:
//!
//! ```text
//! design text -> Design -> LensPhase -> WidthRule -> PillarArray -> layout bytes
//! layout bytes -> Layout -> Extraction -> Field -> Psf -> Verification -> report
//! ```
//!
//! | stage | room | what it is a function of |
//! | --- | --- | --- |
//! | [`Design`] | `design` | the text of a TOML file, all its mistakes reported at once |
//! | [`LensPhase`], [`ElementPhase`] | `phase` | the radial phase of a design and the wedge of an element |
//! | [`PillarArray`] | `array` | phases, and the mapping from phase to width; copies are proven, not assumed |
//! | [`write_pillars`], [`write_apertures`] | `layout` | the array; bytes that depend on nothing else |
//! | [`Layout`], [`extract()`] | `gds`, `extract` | the bytes of any GDSII file |
//! | [`CellModel`] | `cell` | a pillar's width and a wavelength: published, fitted or rigorous |
//! | [`Propagator`] | `wave` | transmissions on a lattice: folded, direct, by rings |
//! | [`Psf`](image::Psf) | `image` | a field; and scenes through it, with noise, restored |
//! | [`verify()`] | `verify` | a design, its array and the bytes of a layout |
//! | [`report`] | `report` | anything found: one HTML page and one JSON file |
//!
//! Beside the line stand [`optimise`], which finds the radial phase, and the checks, the hand-off and the
//! calibration, which start from layouts too.
//!
//! # Conventions
//!
//! **Units.** Optics in micrometres, angles in radians inside the code and in degrees in files, layouts in
//! whole nanometres. Names carry the unit.
//!
//! **Waves.** Time factor exp(-i w t), a forward wave is exp(+i k z), z runs from the lens to the sensor.
//! A wider pillar is a longer optical path and has a larger phase; the phase of a converging lens falls
//! with the radius. A plane wave from (theta_x, theta_y) multiplies the aperture by
//! exp(+i k (x sin theta_x + y sin theta_y)).
//!
//! **Light path.** Scene, substrate, pillars, air, sensor. Transmission t is a field ratio: the zero order
//! in the plane of the pillar tops over the incident wave in the plane of the pillar base. The share of
//! power in the zero order is |t|^2 over the index of the substrate.
//!
//! **Where an element looks.** Its wedge brings to its axis the light that arrives with
//! sin theta = -sin psi lambda / lambda_w. That is the middle of its field; field angles count from there.
//!
//! **Lattice.** An even number of sites an axis, centres at odd multiples of half a pitch, widths even:
//! every edge is on the 1 nm grid, and a lens has all eight symmetries of the square exactly.
//!
//! **The array phase** (Chakravarthula et al. 2023, Eq. 3) is that of the lens plus
//! 2 pi / lambda_w (x sin psi_x + y sin psi_y), modulo one turn, then mapped to a duty cycle (Eq. 4), the
//! linear one: width over pitch.
//!
//! **Fields.** The element is a lattice of point samples of weight pitch^2. The PSF is |E|^2 / |E_inc|^2,
//! E_inc in the medium of incidence; Strehl is against the same aperture passing all its power in the zero
//! order with the perfect phase.
//!
//! # Example
//!
//! ```no_run
//! use metalith::{Accuracy, Design, PillarArray, Silent, cell_models, verify, write_pillars};
//!
//! # fn main() -> metalith::Result<()> {
//! let design = Design::read("designs/mini_3x3.toml".as_ref())?;
//! let array = PillarArray::build(&design, &Silent)?;
//! let file = "mini.gds".as_ref();
//! write_pillars(&design, &array, design.layout.hierarchy, file, &Silent)?;
//! let cells = cell_models(&design, &[metalith::Fidelity::Rigorous])?;
//! let cells = cells.iter().map(AsRef::as_ref).collect::<Vec<_>>();
//! let found = verify(&design, &array, file, &cells, Accuracy::Accurate, &Silent)?;
//! assert!(found.passed());
//! # Ok(())
//! # }
//! ```

mod array;
pub mod calibrate;
mod cell;
mod design;
pub mod diff;
mod document;
pub mod drc;
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
    LensSpec, LimitSpec, MappingSpec, MarkSpec, MeritSpec, OptimiseSpec, RobustSpec, SolverSpec, StartSpec, VerifySpec,
    ViewSpec,
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
