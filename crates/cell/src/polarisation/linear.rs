//! Upright rectangles: what they do to light along both axes.

use std::fmt;

use num_complex::Complex64;
use serde::Serialize;

use super::tables::{Part, there};
use super::{Analyser, FocusedLight, Polarisation, PolarisedLight, linear};

/// An axis of linear polarisation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PolarisationAxis {
    #[default]
    X,
    Y,
}

impl PolarisationAxis {
    /// Axes, both of them.
    pub const ALL: [Self; 2] = [Self::X, Self::Y];

    /// 0 for x, 1 for y.
    pub fn index(self) -> usize {
        match self {
            Self::X => 0,
            Self::Y => 1,
        }
    }

    /// The other one.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::X => Self::Y,
            Self::Y => Self::X,
        }
    }

    /// Light along it.
    pub fn polarisation(self) -> Polarisation {
        Polarisation::Linear(90.0 * self.index() as f64)
    }

    /// The axis that light is nearer to; x where it is as near to both.
    pub fn nearest(light: Polarisation) -> Self {
        let along = |axis: Self| light.share(FocusedLight::Linear(axis));
        if along(Self::Y) > along(Self::X) + ROUNDING {
            Self::Y
        } else {
            Self::X
        }
    }
}

/// Tolerance of a share.
const ROUNDING: f64 = 1e-9;

impl fmt::Display for PolarisationAxis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::X => "x",
            Self::Y => "y",
        })
    }
}

/// Tables of pillars whose sides are along the axes, for light along x and along y, which keeps its polarisation:
/// transmissions as [`CellResponse`] has them, by the number of the pillar.
///
/// [`CellResponse`]: crate::CellResponse
#[derive(Clone, Debug, PartialEq)]
pub struct LinearTables {
    /// The light whose phase is that of the design.
    pub focused: PolarisationAxis,
    /// Transmissions of light along x, and along y.
    pub along: [Vec<Complex64>; 2],
}

impl LinearTables {
    /// Parts of the light that reaches the sensor: those of one list interfere, and no others. Light along either axis has the
    /// phase of the element by its own pillars once.
    pub(super) fn leaving(&self, light: PolarisedLight) -> Vec<Vec<Part<'_>>> {
        let mut leaving = Vec::new();
        for [x, y] in light.arriving_at(FocusedLight::Linear(self.focused)).parts() {
            let [of_x, of_y]: [Part<'_>; 2] = [(x, &self.along[0], 1), (y, &self.along[1], 1)];
            match light.analyser {
                // A circular analyser is refused where it is asked for: no hand is focused.
                None | Some(Analyser::Circular) => leaving.extend([there([of_x]), there([of_y])]),
                Some(Analyser::Linear(deg)) => {
                    let [cos, sin] = linear(deg);
                    leaving.push(there([(x * cos, of_x.1, 1), (y * sin, of_y.1, 1)]));
                }
            }
        }
        leaving.retain(|parts| !parts.is_empty());
        leaving
    }
}
