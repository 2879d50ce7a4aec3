//! The chip as made: what a measured line and bench make of a drawn layout, for every command in one place.
//!
//! ```text
//! pillars as read from a layout  ->  DrawnElement
//! stated cell, model file        ->  AsBuiltChip
//! both                           ->  AsBuiltElement: sites in classes of realised width, aperture, wavefront
//! with a wave                    ->  AsBuiltOptics: transmission of each class, light that arrives, distance, camera
//! with a window                  ->  PSF
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

mod bank;
mod bounds;
mod camera;
mod case;
mod cells;
mod chip;
mod class_table;
mod declared;
mod density;
mod element;
pub mod expression;
mod light;
mod model;
mod neighbour_pillars;
mod not_applied;
mod perturbation;
mod pupil;
mod rational;
mod rectangles;
mod shifted_aperture;
mod stack;
mod stitching;
pub mod zernike;

pub use bank::{BankRange, CellBank};
pub use bounds::PerturbationFault;
pub use camera::{KernelFilter, blur, veiled};
pub use case::SimulationCase;
pub use cells::{NODE_STEP_NM, RealisedCells, SolvedWidths, lagrange};
pub use chip::{AsBuiltChip, AsBuiltOptics, ModelStatement, spread};
pub use class_table::ClassTable;
pub use declared::{CompiledTerm, DeclaredQuantity, DeclaredTerm};
pub use density::{RANGE_UM, fill};
pub use element::{AsBuiltElement, BIAS_STEP_NM, DrawnElement, MadeAperture, mixed, realised_nm};
pub use light::{ArrivingLight, cell_direction};
pub use model::CalibratedModel;
pub use neighbour_pillars::NeighbourPillars;
pub use not_applied::{Applied, NotApplied};
pub use perturbation::{CameraChange, CellChange, GeometryChange, LightChange, PathChange, Perturbation, legendre};
pub use rectangles::{RectangleClass, bank_orders};
pub use stack::{off_cutoff, perturbed, possible_width_nm, to_middle_tops};
pub use stitching::Stitching;
