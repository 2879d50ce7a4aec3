//! Propagation from the transmission of an element to the field, or the intensity, in a window on the sensor.
//!
//! | question | file |
//! | --- | --- |
//! | what an element transmits | `aperture`, `phase` |
//! | what arrives, and where its chief ray lands | `wave` |
//! | where the field is wanted | `window` |
//! | the sum itself | `direct` |
//! | through frequencies, on one window | `fold`, with `band`, `transfer`, `zoom` |
//! | by the rings of a round element | `hankel` |
//! | at several distances at once | `distances` |
//! | where all the light lands, coarsely | `landing`; for many directions of arrival `departure` |
//! | where a phase is too steep for its lattice | `steepness` |

mod aperture;
mod band;
mod direct;
mod distances;
mod fold;
mod hankel;
mod local_angular_spectrum;
mod phase;
mod propagator;
mod sensor_irradiance;
mod steepness;
mod tiles;
mod transfer;
mod wave;
mod window;
mod zoom;

pub use aperture::{Aperture, PillarFunction, Pillars};
pub use band::{Accuracy, Fade};
pub use direct::Direct;
pub use distances::{Distances, DistancesPlan, DistancesScratch};
pub use fold::{FoldedPropagator, Otf};
pub use hankel::Hankel;
pub use local_angular_spectrum::LocalAngularSpectrum;
pub use phase::{PhaseFunction, PhaseMap, PhaseSites};
pub use propagator::{Field, Propagator, Scratch};
pub use sensor_irradiance::{LandingGrid, SensorIrradiance};
pub use steepness::Steepness;
pub use wave::{PlaneWave, incident, landing_um, leaving};
pub use window::Window;
