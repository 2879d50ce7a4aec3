//! Phases to begin from.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::merit::focus::Lens;

/// Start of a solver.
#[derive(Clone, Debug, PartialEq)]
pub enum Start {
    /// One focus for one wavelength: phi = -k (sqrt(r^2 + f^2) - f).
    Hyperbolic {
        /// Wavelength in focus (um).
        wavelength_um: f64,
    },
    /// A focal length that changes with r^2 such that each zone of equal area has another wavelength of
    /// the band in focus (logarithmic asphere: dphi/dr = -k r / sqrt(r^2 + F(r)^2)).
    LogAsphere {
        /// First and last wavelength in focus, at the centre and at the edge (um).
        band_um: (f64, f64),
    },
    /// Phases of an earlier result (waves).
    Previous(Vec<f64>),
    /// Every phase at random.
    Random,
}

impl Start {
    /// The name used in designs and reports.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Hyperbolic { .. } => "hyperbolic",
            Self::LogAsphere { .. } => "log_asphere",
            Self::Previous(_) => "previous",
            Self::Random => "random",
        }
    }

    /// Phase of each ring (waves), before any limit on the step. A previous result of another number of
    /// rings is cut, or goes on with its last phase.
    pub fn waves(&self, lens: &Lens, seed: u64) -> Vec<f64> {
        let (count, f) = (lens.rings.len(), lens.distance_um);
        match self {
            Self::Hyperbolic { wavelength_um } => (0..count)
                .map(|ring| {
                    let r = lens.rings.middle_um(ring);
                    -(r.hypot(f) - f) / wavelength_um
                })
                .collect(),
            Self::LogAsphere { band_um } => log_asphere(lens, *band_um),
            Self::Previous(waves) => {
                let last = waves.last().copied().unwrap_or(0.0);
                (0..count)
                    .map(|ring| waves.get(ring).copied().unwrap_or(last))
                    .collect()
            }
            Self::Random => {
                let mut random = ChaCha8Rng::seed_from_u64(seed);
                (0..count).map(|_| random.random()).collect()
            }
        }
    }
}

/// Logarithmic asphere. At wavelength w the lens of phase slope -s (in waves a length) has rays sin = w s; the zone at
/// r^2 = q R^2 is to focus w(q) at f, so s = r / (w(q) sqrt(r^2 + f^2)). Summed ring by ring.
fn log_asphere(lens: &Lens, band_um: (f64, f64)) -> Vec<f64> {
    let (edge, f) = (lens.rings.middle_um(lens.rings.len() - 1), lens.distance_um);
    let mut phase = 0.0;
    (0..lens.rings.len())
        .map(|ring| {
            let r = lens.rings.middle_um(ring);
            let q = (r / edge).powi(2);
            let wavelength = band_um.0 + (band_um.1 - band_um.0) * q;
            phase -= lens.rings.lattice().pitch_um() * r / (wavelength * r.hypot(f));
            phase
        })
        .collect()
}
