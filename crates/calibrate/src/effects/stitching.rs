//! Write fields of the pillars do not meet: a part of every lens is displaced.

use super::{Effect, Parameter, Stage};
use crate::set::MeasuredSet;
use metalith_optics::{Perturbation, Stitching};

/// Displacements that a writer may make (nm).
const MOST_NM: f64 = 300.0;
const TYPICAL_NM: f64 = 25.0;

/// Largest distance of a boundary from its stated place, and a typical one, over the diameter of a lens.
const REACH: f64 = 0.1;
const TYPICAL: f64 = 0.02;

/// A boundary at the same place in every lens: the displacement beyond it along x and y, and its place. Tried where it is known about
/// where boundaries run, and where one at some place would explain much of what all others leave.
pub(crate) struct StitchedFields {
    /// Axis that the boundary is across.
    axis: usize,
    /// Stated place from the middle of a lens (um).
    at_um: f64,
    diameter_um: f64,
}

impl StitchedFields {
    /// Names of such effects, by the axis that the boundary is across.
    pub(crate) const NAMES: [&'static str; 2] = ["stitching_x", "stitching_y"];
    /// Index, among their numbers, of the place of the boundary.
    pub(crate) const PLACE: usize = 2;

    /// Boundaries across x and across y for the lenses of a set that says where they run.
    pub(crate) fn of(set: &MeasuredSet) -> impl Iterator<Item = Self> + use<> {
        let diameter_um = set.stack.lens_diameter_um;
        let places = set.field_boundary_um.into_iter();
        places.flat_map(move |place| {
            [0, 1].map(|axis| Self {
                axis,
                at_um: place[axis],
                diameter_um,
            })
        })
    }
}

impl Effect for StitchedFields {
    fn name(&self) -> String {
        Self::NAMES[self.axis].into()
    }

    fn unit(&self) -> &'static str {
        "nm, nm, um"
    }

    fn stage(&self) -> Stage {
        Stage::Geometry
    }

    fn parameters(&self) -> Vec<Parameter> {
        let displaced = Parameter::new(-MOST_NM, MOST_NM, TYPICAL_NM);
        let reach = REACH * self.diameter_um;
        vec![
            displaced,
            displaced,
            Parameter::new(-reach, reach, TYPICAL * self.diameter_um),
        ]
    }

    fn dormant(&self) -> bool {
        // Where nothing is displaced, the place of the boundary changes nothing.
        true
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        if parameters[0] != 0.0 || parameters[1] != 0.0 {
            to.geometry.stitching.push(Stitching {
                axis: self.axis,
                at_um: self.at_um + parameters[2],
                by_nm: [parameters[0], parameters[1]],
            });
        }
    }

    fn reported(&self, numbers: &[f64], half_widths: &[f64], _set: &MeasuredSet) -> Vec<(f64, [f64; 2])> {
        let from = [0.0, 0.0, self.at_um];
        let parts = numbers.iter().zip(half_widths).zip(from);
        parts
            .map(|((v, w), from)| (from + v, [from + v - w, from + v + w]))
            .collect()
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[
            (
                "coma",
                "the overlay marks of the write fields, or a SEM image across a boundary",
            ),
            (
                "astigmatism",
                "the overlay marks of the write fields, or a SEM image across a boundary",
            ),
        ]
    }
}
