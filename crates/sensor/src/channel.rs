//! One channel of a sensor.

use serde::Serialize;

use crate::{Illuminant, Spectrum};

/// One channel: which light it counts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Channel {
    pub name: String,
    pub response: Response,
}

/// Electrons a photon, by wavelength.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Response {
    /// Equal over a band and nothing beyond.
    Band {
        /// Ends of the band (nm).
        band_nm: [f64; 2],
        /// Electrons a photon within it.
        efficiency: f64,
    },
    /// A measured curve.
    Curve(Spectrum),
}

impl Response {
    /// Electrons a photon at a wavelength (nm).
    pub fn at(&self, nm: f64) -> f64 {
        match self {
            Self::Band { band_nm, efficiency } if (band_nm[0]..=band_nm[1]).contains(&nm) => *efficiency,
            Self::Band { .. } => 0.0,
            Self::Curve(curve) => curve.at(nm),
        }
    }

    /// Shortest and longest wavelength that is counted (nm).
    pub fn ends_nm(&self) -> [f64; 2] {
        match self {
            Self::Band { band_nm, .. } => *band_nm,
            Self::Curve(curve) => curve.ends_nm(),
        }
    }
}

impl Channel {
    /// Electrons for each nm of wavelength in the light of an illuminant, of any scale: photons times efficiency.
    pub fn weight(&self, illuminant: &Illuminant, nm: f64) -> f64 {
        illuminant.power(nm) * nm * self.response.at(nm)
    }
}
