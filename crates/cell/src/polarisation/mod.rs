//! Polarisation of source and detector, before and behind pillars that distinguish polarisations.

mod circular;
mod light;
mod linear;
mod tables;

use std::f64::consts::FRAC_1_SQRT_2;
use std::fmt;
use std::str::FromStr;

use num_complex::Complex64;
use serde::Serialize;

use metalith_core::{Error, Result};

pub use circular::CircularTables;
pub use light::{FocusedLight, FocusingStack, PolarisedLight};
pub use linear::{LinearTables, PolarisationAxis};
pub use tables::{PassedTable, PolarisedTables};

use super::Handedness;

/// Polarisation of light that arrives, with exp(-i w t) and a wave along +z.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Polarisation {
    Circular(Handedness),
    /// Electric field at this angle from x towards y (degrees).
    Linear(f64),
    /// Equal shares of every polarisation, without a fixed phase between any two that are orthogonal.
    Unpolarised,
}

impl Polarisation {
    /// Name and value of each, as design files and options have them; other angles are numbers.
    pub const CHOICES: [(&'static str, Self); 5] = [
        ("left", Self::Circular(Handedness::Left)),
        ("right", Self::Circular(Handedness::Right)),
        ("x", Self::Linear(0.0)),
        ("y", Self::Linear(90.0)),
        ("unpolarised", Self::Unpolarised),
    ];

    /// Largest angle of linear polarisation (degrees), either way.
    pub const MOST_DEG: f64 = 180.0;

    /// Share of the energy that arrives that is in the light that pillars focus.
    pub fn share(self, focused: FocusedLight) -> f64 {
        match (self, focused) {
            (Self::Circular(own), FocusedLight::Circular(hand)) => f64::from(u8::from(own == hand)),
            (Self::Linear(deg), FocusedLight::Linear(axis)) => linear(deg)[axis.index()].powi(2),
            _ => 0.5,
        }
    }

    /// Parts of the light that do not interfere, all together of unit energy: fields along x and y.
    fn parts(self) -> Vec<[Complex64; 2]> {
        let (none, half) = (Complex64::ZERO, Complex64::from(FRAC_1_SQRT_2));
        match self {
            Self::Circular(Handedness::Left) => vec![[half, half * Complex64::I]],
            Self::Circular(Handedness::Right) => vec![[half, half * -Complex64::I]],
            Self::Linear(deg) => vec![linear(deg).map(Complex64::from)],
            Self::Unpolarised => vec![[half, none], [none, half]],
        }
    }

    /// Parts by circular polarisations: amplitudes of left and of right.
    fn circular_parts(self) -> Vec<[Complex64; 2]> {
        let (none, all) = (Complex64::ZERO, Complex64::ONE);
        match self {
            Self::Circular(Handedness::Left) => vec![[all, none]],
            Self::Circular(Handedness::Right) => vec![[none, all]],
            Self::Linear(deg) => {
                let turned = Complex64::cis(deg.to_radians()) * FRAC_1_SQRT_2;
                vec![[turned.conj(), turned]]
            }
            Self::Unpolarised => {
                let half = Complex64::from(FRAC_1_SQRT_2);
                vec![[half, none], [none, half]]
            }
        }
    }
}

/// Cosine and sine of an angle (degrees), exact at whole quarters.
fn linear(deg: f64) -> [f64; 2] {
    match deg.rem_euclid(360.0) {
        0.0 => [1.0, 0.0],
        90.0 => [0.0, 1.0],
        180.0 => [-1.0, 0.0],
        270.0 => [0.0, -1.0],
        other => [other.to_radians().cos(), other.to_radians().sin()],
    }
}

/// Words of the polarisation, as after "light arrives".
impl fmt::Display for Polarisation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Circular(hand) => write!(f, "{hand} circularly polarised"),
            Self::Linear(0.0) => f.write_str("linearly polarised along x"),
            Self::Linear(90.0) => f.write_str("linearly polarised along y"),
            Self::Linear(deg) => write!(f, "linearly polarised at {deg} degrees from x towards y"),
            Self::Unpolarised => f.write_str("unpolarised"),
        }
    }
}

impl FromStr for Polarisation {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        named_or_linear(text, &Self::CHOICES, Self::Linear).ok_or_else(|| {
            refusal(
                "light/unknown-polarisation",
                format!("there is no light of polarisation `{text}`"),
                &Self::CHOICES,
            )
        })
    }
}

/// Part of the light behind the pillars that passes to the sensor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Analyser {
    /// The hand that focused light is converted to, whatever arrives.
    Circular,
    /// Linear polarisation at this angle from x towards y (degrees).
    Linear(f64),
}

impl Analyser {
    /// Name and value of each, as design files and options have them; other angles are numbers.
    pub const CHOICES: [(&'static str, Self); 3] = [
        ("circular", Self::Circular),
        ("x", Self::Linear(0.0)),
        ("y", Self::Linear(90.0)),
    ];
}

/// Words of the analyser, as of a thing before the sensor.
impl fmt::Display for Analyser {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Circular => f.write_str("a circular analyser"),
            Self::Linear(0.0) => f.write_str("a linear analyser along x"),
            Self::Linear(90.0) => f.write_str("a linear analyser along y"),
            Self::Linear(deg) => write!(f, "a linear analyser at {deg} degrees from x towards y"),
        }
    }
}

impl FromStr for Analyser {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        named_or_linear(text, &Self::CHOICES, Self::Linear).ok_or_else(|| {
            refusal(
                "light/unknown-analyser",
                format!("there is no analyser `{text}`"),
                &Self::CHOICES,
            )
        })
    }
}

/// A word, or the angle of linear polarisation.
fn named_or_linear<T: Copy>(text: &str, choices: &[(&str, T)], linear: fn(f64) -> T) -> Option<T> {
    let known = choices.iter().find(|(name, _)| *name == text);
    let angle = || {
        text.parse()
            .ok()
            .filter(|deg: &f64| deg.abs() <= Polarisation::MOST_DEG)
    };
    known.map(|(_, known)| *known).or_else(|| angle().map(linear))
}

fn refusal<T>(id: &'static str, what: String, choices: &[(&str, T)]) -> Error {
    let names: Vec<_> = choices.iter().map(|(name, _)| *name).collect();
    Error::refused(
        id,
        what,
        format!(
            "use {}, or the angle of linear polarisation from x towards y, from -{most} to {most} degrees",
            names.join(", "),
            most = Polarisation::MOST_DEG
        ),
    )
}

#[cfg(test)]
mod tests;
