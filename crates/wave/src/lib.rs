//! From the transmission of an element to the field in a window on the sensor.
//!
//! An element is a lattice of point samples, each of weight pitch^2, and its field is their
//! Rayleigh-Sommerfeld sum, with time factor exp(-i w t):
//!
//! U(P) = sum_j t_j exp(i k r_j . sin) p^2 Z / (2 pi R^2) (1/R - i k) exp(i k R),  R = |P - r_j|.
//!
//! Three ways to it, which tests hold to one another:
//! [`Direct`] is that sum, and what the others are judged by; [`Fold`] goes through frequencies and is what
//! everything runs on; [`Hankel`] takes the rings of a round element. Beside each forward stands its adjoint.

mod aperture;
mod cis;
mod direct;
mod fade;
mod fold;
mod hankel;
pub mod image;
mod landing;
mod plane;
mod zoom;

pub use aperture::{Aperture, PhaseArray, PhaseFunction, PillarFunction, Pillars};
pub use cis::cis;
pub use direct::Direct;
pub use fade::{Accuracy, Fade};
pub use fold::Fold;
pub use hankel::Hankel;
pub use landing::{Landing, LandingGrid};
pub use plane::{Field, PlaneWave, Propagator, Scratch, Window};
pub use zoom::fft_size;
