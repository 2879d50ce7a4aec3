//! An element in light, whatever it is simulated as: pillars as drawn, or the chip as a measured process and bench make it.
//!
//! # The question: a light
//!
//! An [`Illumination`](metalith_cell::Illumination) is a wavelength, the direction that light arrives from, the polarisation of source
//! and analyser, whether cells are solved along the normal or for that direction, and whether the wavelength is reported itself or one
//! of many of a band.
//!
//! # The answer of a pillar: a cell model
//!
//! A [`CellModel`](metalith_cell::CellModel) answers with a [`CellResponse`](metalith_cell::CellResponse): one transmission for each
//! width or number (`Scalar`), tables by polarisation (`Jones`), or by the pillar and its neighbours (`Neighbours`). A new model is one
//! implementation of `CellModel::response`; nothing here or above is changed for it.
//!
//! # The answer of an element: fields that do not interfere
//!
//! ```text
//! cell model, or AsBuiltChip      ->  SimulationCase
//! with a lattice                  ->  CaseOptics: holds what cells have answered
//! with the pillars of an element  ->  ElementOptics: as drawn, or as fabricated
//! with an Illumination            ->  IncoherentFields: apertures, weight, arriving wave, added distance, camera
//! with a window on the sensor     ->  PSF
//! ```
//!
//! As drawn, rows are read when light passes them, so that elements of any size work, also those whose pillars are computed or held
//! folded. As fabricated, and among neighbours, elements are held as a map. Pictures ask for many directions of one element: they take
//! [`CaseOptics::classes`], for which pillars as drawn are those of a chip without a perturbation, and [`SharedFields`] where cells are
//! the same for all directions.
//!
//! # The chip as fabricated
//!
//! ```text
//! pillars as read from a layout  ->  DrawnElement
//! stated cell, model file        ->  AsBuiltChip
//! both                           ->  AsBuiltElement: sites in classes of realised width, aperture, wavefront
//! ```
//!
//! A [`Perturbation`] is applied as follows; what is zero changes nothing.
//!
//! | part | applied to |
//! | --- | --- |
//! | `geometry` | width of each site (bias, bias by the density around it, declared terms), open sites (aperture offset), places of pillars beyond a boundary (stitching), transmission of each class (missing pillars, light that sees no pillar, free amplitude), path, phase and amplitude of each site (wavefront, declared terms) |
//! | `cell` | the stack that every realised width is solved with; pillars that are higher at the rim of a lens, from the stacks in its middle and at its rim |
//! | `path` | the wave that arrives (tilt, curvature) and the distance of the sensor (gap, tilt of the sensor, declared terms) |
//! | `camera` | the PSF: declared kernels, Gaussian blur, veil over its window |
//! | `light` | spectra and source of a bench; a PSF of one wavelength and one point names them with [`Perturbation::not_applied`] |
//!
//! [`AsBuiltElement::aperture`] gives a [`metalith_wave::Aperture`], so that every propagator runs from it.

mod as_built_chip;
mod as_built_element;
mod as_built_optics;
mod as_built_rectangles;
mod bounds;
mod camera;
mod cell_bank;
mod class_fields;
mod class_table;
mod declared;
mod density;
mod drawn_optics;
mod element_optics;
mod etched_stack;
mod fields;
mod lens_psf;
mod light;
mod model;
mod neighbour_pillars;
mod not_applied;
mod perturbation;
mod pupil;
mod rational_interpolation;
mod realised_cells;
mod shared_fields;
mod shifted_aperture;
mod simulation_case;
mod stitching;
mod transmission_curve;
pub mod zernike;

pub use metalith_core::expression;

pub use as_built_chip::{AsBuiltChip, ModelStatement};
pub use as_built_element::{AsBuiltAperture, AsBuiltElement, BIAS_STEP_NM, DrawnElement, mixed, realised_nm};
pub use as_built_rectangles::{RectangleClass, bank_orders};
pub use bounds::{PerturbationFault, RANGES_UM};
pub use camera::{KernelFilter, blur, veiled};
pub use cell_bank::{BankRange, CellBank};
pub use class_fields::ClassFields;
pub use class_table::ClassTable;
pub use declared::{CompiledTerm, DeclaredQuantity, DeclaredTerm};
pub use density::{RANGE_UM, fill};
pub use element_optics::{ElementOptics, FocusedSites, Placement};
pub use etched_stack::{off_cutoff, perturbed, possible_width_nm, to_middle_tops};
pub use fields::{Field, IncoherentFields, spread};
pub use lens_psf::{LensGradient, LensPsf, LensPullback, PillarVariable};
pub use light::{ArrivingLight, cell_direction};
pub use model::{CalibratedModel, DoseResponse};
pub use neighbour_pillars::{NeighbourPillars, NeighbourSites};
pub use not_applied::{Applied, NotApplied};
pub use perturbation::{CameraChange, CellChange, GeometryChange, LightChange, PathChange, Perturbation, legendre};
pub use realised_cells::{NODE_STEP_NM, RealisedCells, SolvedWidths, lagrange};
pub use shared_fields::SharedFields;
pub use simulation_case::{CaseOptics, SimulationCase};
pub use stitching::Stitching;
pub use transmission_curve::TransmissionCurve;
