#![doc = include_str!("../README.md")]

mod error;
pub mod kernels;
pub mod propagation;
pub mod psf;

pub use error::{Result, WaveError};
pub use propagation::{
    Accuracy, Aperture, ApertureSet, Direct, Fade, Field, FoldedPropagator, Hankel, PhaseFunction, PhaseMap,
    PhaseSites, PillarFunction, Pillars, PlaneWave, Propagator, Scratch, TransmissionMap, Window,
};
pub use psf::{DifferentiablePsf, IdealPsf, Psf, PsfCotangents, PsfMetrics, PsfPullback};
