#![doc = include_str!("../README.md")]

pub mod camera;
mod error;
pub mod kernels;
pub mod propagation;
pub mod psf;

pub use error::{Result, WaveError};
pub use propagation::{
    Accuracy, Aperture, Direct, Fade, Field, FoldedPropagator, Hankel, PhaseFunction, PhaseMap, PhaseSites,
    PillarFunction, Pillars, PlaneWave, Propagator, Scratch, Window,
};
pub use psf::{IdealPsf, Psf, PsfMetrics};
