//! Light that is simulated at pillars that distinguish polarisations.

use metalith_pillars::PolarisationBasis;
use serde::Serialize;

use super::{Analyser, Polarisation, PolarisationAxis};
use crate::{CellStack, Handedness};

/// The light that pillars give the phase of the design.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FocusedLight {
    /// Light of this hand, which rotated rectangles convert to the other.
    Circular(Handedness),
    /// Light that is polarised along this axis, which upright rectangles keep so.
    Linear(PolarisationAxis),
}

impl FocusedLight {
    /// Polarisation.
    pub fn polarisation(self) -> Polarisation {
        match self {
            Self::Circular(hand) => Polarisation::Circular(hand),
            Self::Linear(axis) => axis.polarisation(),
        }
    }

    /// The basis that it is of: pillars of this basis focus it.
    pub fn basis(self) -> PolarisationBasis {
        match self {
            Self::Circular(_) => PolarisationBasis::Circular,
            Self::Linear(_) => PolarisationBasis::Linear,
        }
    }
}

/// Light that arrives at pillars that distinguish polarisations, and the part of it that reaches the sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PolarisedLight {
    /// Polarisation of the light that arrives; where it is `None`, the light which the pillars focus.
    pub arriving: Option<Polarisation>,
    /// Analyser before the sensor, if any.
    pub analyser: Option<Analyser>,
}

/// Pillars, and the light that they focus.
#[derive(Clone, Debug)]
pub struct FocusingStack {
    pub stack: CellStack,
    /// The light that has the phase of a design behind them, if they distinguish polarisations.
    pub focused: Option<FocusedLight>,
}

impl PolarisedLight {
    /// Light along an axis, all of it before the sensor.
    pub fn along(axis: PolarisationAxis) -> Self {
        Self {
            arriving: Some(axis.polarisation()),
            analyser: None,
        }
    }

    /// The polarisation of the light that arrives at pillars that focus this light.
    pub fn arriving_at(self, focused: FocusedLight) -> Polarisation {
        self.arriving.unwrap_or(focused.polarisation())
    }

    /// Share of the energy of light that arrives which pillars focus through the analyser, if they pass or convert all of it.
    pub fn focused_share(self, focused: FocusedLight) -> f64 {
        let passed = match (self.analyser, focused) {
            (Some(Analyser::Linear(deg)), FocusedLight::Linear(_)) => Polarisation::Linear(deg).share(focused),
            (Some(Analyser::Linear(_)), FocusedLight::Circular(_)) => 0.5,
            (Some(Analyser::Circular) | None, _) => 1.0,
        };
        passed * self.arriving_at(focused).share(focused)
    }

    /// The detector in words: what reaches the sensor beside focused light, and what does not.
    pub fn detector(self, focused: FocusedLight) -> String {
        // Of linear light half a turn on it is the same.
        let own = match self.arriving_at(focused) {
            light @ Polarisation::Linear(_) => light.share(focused) == 1.0,
            light => light == focused.polarisation(),
        };
        match focused {
            FocusedLight::Circular(_) => self.behind_converting(own),
            FocusedLight::Linear(axis) => self.behind_upright(own, axis),
        }
    }

    fn behind_upright(self, own: bool, axis: PolarisationAxis) -> String {
        let other = axis.other();
        match (self.analyser, own) {
            (None, true) => format!("none of it is polarised along {other}"),
            (None, false) => format!("what is polarised along {other} lands by the phase of its own"),
            (Some(analyser), true) => format!("{analyser} is before the sensor"),
            (Some(analyser), false) => {
                format!(
                    "behind {analyser} light of both polarisations interferes as far as it arrives with a fixed phase"
                )
            }
        }
    }

    fn behind_converting(self, own: bool) -> String {
        match (self.analyser, own) {
            (None, true) => "what is not converted lands as it came".into(),
            (None, false) => "what is not converted lands as it came, and the other hand diverges".into(),
            (Some(analyser @ Analyser::Circular), true) => {
                format!("{analyser} keeps what is not converted from the sensor")
            }
            (Some(analyser @ Analyser::Circular), false) => format!(
                "{analyser} passes the hand of focused light alone, with what is not converted of the other hand"
            ),
            (Some(analyser), _) => format!(
                "{analyser} passes half of the focused light, which interferes with what it passes of all other light"
            ),
        }
    }
}
