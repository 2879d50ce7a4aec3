//! Propagation from the transmission of an element to the field, or the intensity, in a window on the sensor.
//!
//! | question | file |
//! | --- | --- |
//! | what an element transmits | `aperture`, `phase` |
//! | what arrives, and where its chief ray lands | `plane_wave` |
//! | where the field is wanted | `window` |
//! | the Rayleigh-Sommerfeld sum itself | `direct_sum` |
//! | through frequencies, on one window | `folded_propagator`, with `band`, `transfer`, `chirp_transform` |
//! | in windows of many directions of arrival, from one spectrum | `shared_spectrum` |
//! | by the rings of a round element | `hankel` |
//! | at several distances at once | `distances` |
//! | where all the light lands, coarsely | `sensor_irradiance`; for many directions of arrival `local_angular_spectrum` |

mod aperture;
mod band;
mod chirp_transform;
mod direct_sum;
mod distances;
mod folded_propagator;
mod hankel;
mod local_angular_spectrum;
mod phase;
mod plane_wave;
mod propagator;
mod sensor_irradiance;
mod shared_spectrum;
mod tiles;
mod transfer;
mod window;

pub use aperture::{Aperture, ApertureSet, PillarFunction, Pillars, Together, TransmissionMap};
pub use band::{Accuracy, Fade};
pub use direct_sum::Direct;
pub use distances::{Distances, DistancesPlan, DistancesScratch};
pub use folded_propagator::{FoldedPropagator, Otf};
pub use hankel::Hankel;
pub use local_angular_spectrum::LocalAngularSpectrum;
pub use metalith_pillars::Steepness;
pub use phase::{PhaseFunction, PhaseMap, PhaseSites};
pub use plane_wave::{PlaneWave, incident, landing_um, leaving};
pub(crate) use propagator::check_shape;
pub use propagator::{Field, Propagator, Scratch};
pub use sensor_irradiance::{LandingGrid, SensorIrradiance};
pub use shared_spectrum::{ApertureSpectrum, Direction, SharedSpectrumPlan};
pub use window::Window;

/// Columns that are transformed together: one cache line of samples.
const LANES: usize = 8;
