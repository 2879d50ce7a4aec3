//! Mapping from phase to the rotation of a rectangular pillar.

use serde::Serialize;

/// The rotation that a phase of converted light asks for: half of it, and a Fourier series that takes back what the lattice
/// adds to twice the rotation, which repeats every quarter turn.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RotationMapping {
    /// Coefficients of sin(2 k phase), k from one (rad), for light that arrives left circularly polarised.
    pub sines: Vec<f64>,
    /// Coefficients of cos(2 k phase), k from one (rad), for the same light.
    pub cosines: Vec<f64>,
}

impl RotationMapping {
    /// True if the rotation is half of the phase.
    pub fn is_half(&self) -> bool {
        self.sines.iter().chain(&self.cosines).all(|c| *c == 0.0)
    }

    /// Rotation that is added to half of a phase (rad). For light of the other handedness, which a mirror exchanges,
    /// the whole rotation for the same phase is reversed.
    pub fn added(&self, phase: f64) -> f64 {
        let sum = |terms: &[f64], wave: fn(f64) -> f64| -> f64 {
            let each = (1u32..).zip(terms);
            each.map(|(k, c)| c * wave(2.0 * f64::from(k) * phase)).sum()
        };
        sum(&self.sines, f64::sin) + sum(&self.cosines, f64::cos)
    }
}
