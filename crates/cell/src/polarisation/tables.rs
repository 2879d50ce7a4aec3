//! Tables of pillars that distinguish polarisations, and the light that reaches the sensor behind them.

use num_complex::Complex64;

use super::{Analyser, CircularTables, FocusedLight, LinearTables, PolarisedLight};

/// Tables of pillars for light of both polarisations, by their numbers.
#[derive(Clone, Debug, PartialEq)]
pub enum PolarisedTables {
    /// Rotated rectangles, to both hands.
    Hands(CircularTables),
    /// Upright rectangles, along both axes.
    Axes(LinearTables),
}

/// Transmissions of light that interferes with no other. They are of the field that leaves over that of all light that arrives.
#[derive(Clone, Debug, PartialEq)]
pub struct PassedTable {
    pub table: Vec<Complex64>,
    /// Multiple of the phase of the element that it has: 1 if focused light is in it; else -1 if diverging light is;
    /// else 0.
    pub order: i32,
}

/// Some of the light that leaves in one polarisation: its amplitude, what it is multiplied by, and how often that has the phase of
/// the element.
pub(super) type Part<'a> = (Complex64, &'a [Complex64], i32);

impl PolarisedTables {
    /// Light that reaches the sensor of light of unit energy: energies of these add. Light of both hands that arrives
    /// with a fixed phase between them, as linear polarisation is, interferes where it leaves in one hand: what is
    /// converted of one, with what is not of the other. Behind a linear analyser all of it does.
    pub fn passed(&self, light: PolarisedLight) -> Vec<PassedTable> {
        let leaving = self.leaving(light).into_iter();
        leaving
            .map(|parts| PassedTable {
                order: parts
                    .iter()
                    .map(|part| part.2)
                    .max_by_key(|o| (o.abs(), *o))
                    .unwrap_or(0),
                table: sum(&parts),
            })
            .collect()
    }

    /// Tables as [`PolarisedTables::passed`] for only the light that has the phase of the element `order` times:
    /// focused light for 1, what is not converted for 0, what diverges for -1. Over whole turns of that phase these
    /// three do not interfere.
    pub fn passed_in(&self, order: i32, light: PolarisedLight) -> Vec<Vec<Complex64>> {
        let leaving = self.leaving(light).into_iter();
        let own = leaving.map(|parts| parts.into_iter().filter(|p| p.2 == order).collect::<Vec<_>>());
        own.filter(|parts| !parts.is_empty()).map(|parts| sum(&parts)).collect()
    }

    /// Tables by the direction in which light leaves: behind a linear analyser the light of each order apart, since
    /// they leave in other directions and interfere only where they meet.
    pub fn departing(&self, light: PolarisedLight) -> Vec<PassedTable> {
        let Some(Analyser::Linear(_)) = light.analyser else {
            return self.passed(light);
        };
        if let Self::Axes(_) = self {
            // Each polarisation has its own phase.
            let parts = self.leaving(light).into_iter().flatten();
            let alone = parts.map(|part| PassedTable {
                order: part.2,
                table: sum(&[part]),
            });
            return alone.collect();
        }
        let of_order = |order: i32| {
            self.passed_in(order, light)
                .into_iter()
                .map(move |table| PassedTable { table, order })
        };
        [1, 0, -1].into_iter().flat_map(of_order).collect()
    }

    /// The light that has the phase of the design.
    pub fn focused(&self) -> FocusedLight {
        match self {
            Self::Hands(hands) => FocusedLight::Circular(hands.focused),
            Self::Axes(axes) => FocusedLight::Linear(axes.focused),
        }
    }

    /// Transmissions of the light that is focused.
    pub fn own(&self) -> &[Complex64] {
        match self {
            Self::Hands(hands) => &hands.converted[0],
            Self::Axes(axes) => &axes.along[axes.focused.index()],
        }
    }

    /// All tables, to be changed.
    pub fn all_mut(&mut self) -> Vec<&mut Vec<Complex64>> {
        match self {
            Self::Hands(hands) => hands.converted.iter_mut().chain(&mut hands.unconverted).collect(),
            Self::Axes(axes) => axes.along.iter_mut().collect(),
        }
    }

    /// Parts of the light that reaches the sensor: those of one list interfere, and no others.
    fn leaving(&self, light: PolarisedLight) -> Vec<Vec<Part<'_>>> {
        match self {
            Self::Hands(hands) => hands.leaving(light),
            Self::Axes(axes) => axes.leaving(light),
        }
    }
}

/// Parts that are there, of some.
pub(super) fn there<const N: usize>(parts: [Part<'_>; N]) -> Vec<Part<'_>> {
    parts.into_iter().filter(|part| part.0 != Complex64::ZERO).collect()
}

fn sum(parts: &[Part<'_>]) -> Vec<Complex64> {
    let length = parts.iter().map(|part| part.1.len()).max().unwrap_or(0);
    let at = |k: usize| parts.iter().map(|(a, t, _)| a * t[k]).sum();
    (0..length).map(at).collect()
}
