//! Cells that are solved for directions of arrival, and what light between these directions meets.

use std::borrow::Cow;
use std::f64::consts::TAU;

use metalith_cell::Illumination;
use metalith_core::Result;
use metalith_design::CellIncidence;
use metalith_optics::ClassFields;
use metalith_pillars::LatticeKind;

/// Sines of the angles of arrival, in air, that cells are solved for; steeper light meets the last.
const SINES: [f64; 6] = [0.15, 0.3, 0.45, 0.6, 0.75, 0.9];

/// Answers of a cell along the normal, and along directions in both planes of mirror symmetry of the lattice.
pub(crate) struct DirectionalCells<T = ClassFields> {
    pub(crate) normal: T,
    /// For each of [`SINES`] along a row of the lattice, and midway to the next row of equal neighbours; empty where cells are
    /// solved along the normal alone.
    oblique: Vec<[T; 2]>,
    /// Directions of a turn in which the lattice is the same.
    turns: f64,
}

impl<T> DirectionalCells<T> {
    /// Number of directions that cells are solved for.
    pub(crate) fn count(incidence: CellIncidence) -> usize {
        match incidence {
            CellIncidence::Normal => 1,
            CellIncidence::Oblique => 1 + 2 * SINES.len(),
        }
    }

    /// Answers to a light along the normal, and to the same light from all directions.
    ///
    /// # Errors
    /// Errors of `solve`.
    pub(crate) fn solve(
        incidence: CellIncidence,
        lattice: LatticeKind,
        normal: &Illumination<'_>,
        solve: impl Fn(&Illumination<'_>) -> Result<T>,
    ) -> Result<Self> {
        let turns = match lattice {
            LatticeKind::Square => 4.0,
            LatticeKind::Hexagonal => 6.0,
        };
        let along = |sine: f64, azimuth: f64| {
            let light = Illumination {
                sines: [sine * azimuth.cos(), sine * azimuth.sin()],
                ..*normal
            };
            solve(&light.oblique())
        };
        let both = |sine: f64| Ok([along(sine, 0.0)?, along(sine, 0.5 * TAU / turns)?]);
        Ok(Self {
            normal: solve(normal)?,
            oblique: match incidence {
                CellIncidence::Normal => Vec::new(),
                CellIncidence::Oblique => SINES.into_iter().map(both).collect::<Result<_>>()?,
            },
            turns,
        })
    }
}

impl DirectionalCells {
    /// Fields in light that arrives from anywhere, where cells are solved along the normal alone.
    pub(crate) fn of_all_directions(&self) -> Option<&ClassFields> {
        self.oblique.is_empty().then_some(&self.normal)
    }

    /// Fields in light that arrives under these sines, in air: between two angles of arrival straight, between both planes by the
    /// first harmonic that the symmetry of the lattice allows.
    pub(crate) fn from(&self, sines: [f64; 2]) -> std::borrow::Cow<'_, ClassFields> {
        let Some(last) = self.oblique.len().checked_sub(1) else {
            return Cow::Borrowed(&self.normal);
        };
        let step = SINES[0];
        let place = (sines[0].hypot(sines[1]) / step).min((last + 1) as f64);
        let upper = (place.ceil() as usize).clamp(1, last + 1);
        let part = place - (upper - 1) as f64;
        let of_row = 0.5 + 0.5 * (self.turns * sines[1].atan2(sines[0])).cos();
        let mut parts = Vec::with_capacity(4);
        let mut add = |node: usize, weight: f64| {
            if let Some([row, between]) = node.checked_sub(1).map(|k| &self.oblique[k]) {
                parts.push((weight * of_row, row));
                parts.push((weight * (1.0 - of_row), between));
            } else {
                parts.push((weight, &self.normal));
            }
        };
        add(upper, part);
        add(upper - 1, 1.0 - part);
        Cow::Owned(ClassFields::between(&parts))
    }
}
