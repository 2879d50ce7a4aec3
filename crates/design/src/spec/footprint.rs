//! The box that the pillars of an element stand in: what tells which elements are too near to one another.

use super::{ArraySpec, CellSpec, LensSpec, PlacedSpec};
use metalith_core::document::Section;

/// Outermost places of the pillars of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Footprint {
    /// Least and greatest place from the middle, along x and along y (nm).
    pub ends_nm: [[i64; 2]; 2],
    pitch_nm: i64,
}

impl Footprint {
    /// Footprint of a lens whose outline is turned by so many degrees; `None` where there is no lattice, which is
    /// another mistake.
    pub(crate) fn of(lens: &LensSpec, rotation_deg: f64, cell: &CellSpec) -> Option<Self> {
        let lattice = cell.lattice_covering(lens.diameter_nm).ok()?;
        let reach = match &lens.outline {
            Some(outline) => lattice.within(outline.rotated(rotation_deg).ends_nm()),
            None => lattice.reach(),
        };
        Some(Self {
            ends_nm: lattice.ends_nm(&reach),
            pitch_nm: lattice.pitch_nm().at_least_nm(),
        })
    }

    /// Least distance of two such elements side by side along x and along y (nm): their pillars are then a pitch apart.
    pub(crate) fn sides_nm(&self) -> [i64; 2] {
        self.ends_nm.map(|[least, greatest]| greatest - least + self.pitch_nm)
    }

    /// Least distances along x and along y (nm) of another element that is on this side of this one: either is enough.
    fn apart_nm(&self, other: &Self, towards_nm: [i64; 2]) -> [i64; 2] {
        [0, 1].map(|axis| {
            let (own, other) = (self.ends_nm[axis], other.ends_nm[axis]);
            let reach = if towards_nm[axis] >= 0 {
                own[1] - other[0]
            } else {
                other[1] - own[0]
            };
            reach + self.pitch_nm
        })
    }
}

impl ArraySpec {
    /// Pillars of two elements must be a pitch apart along an axis, or they could be of either.
    pub(super) fn apart(&self, lens: &LensSpec, cell: &CellSpec, sections: &[Section<'_, '_>]) {
        let own = |p: &PlacedSpec| Footprint::of(p.lens.as_ref().unwrap_or(lens), p.rotation_deg, cell);
        let Some(boxes) = self.placed.iter().map(own).collect::<Option<Vec<_>>>() else {
            return;
        };
        for (k, s) in sections.iter().enumerate() {
            let (x, y) = self.placed[k].centre_nm;
            let near = |other: usize| {
                let (other_x, other_y) = self.placed[other].centre_nm;
                let towards = [x - other_x, y - other_y];
                let least = boxes[other].apart_nm(&boxes[k], towards);
                (0..2).all(|axis| towards[axis].abs() < least[axis]).then_some(least)
            };
            if let Some((other, least)) = (0..k).find_map(|other| Some((other, near(other)?))) {
                let [along_x, along_y] = least.map(um);
                s.fault_given(
                    &["lens.diameter_um", "cell.pitch_nm", "element.y_um"],
                    "x_um",
                    format!(
                        "this lens overlaps that of element ({}, 0), or the upright boxes about their pillars do",
                        other + 1
                    ),
                    format!(
                        "place them at least {along_x} um apart along x, or {along_y} um along y: the boxes and a pitch between them"
                    ),
                );
            }
        }
    }
}

/// A length as a plain number (um).
pub(super) fn um(nm: i64) -> f64 {
    nm as f64 / 1e3
}
