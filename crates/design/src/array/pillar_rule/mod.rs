//! Phase to pillar, site by site: one rule for each quantity that pillars differ by.

mod rotation;
mod size_pair;
mod width;

use std::sync::Arc;

use rayon::prelude::*;

use self::rotation::RotationRule;
use self::size_pair::SizePairRule;
use self::width::WidthRule;
use crate::phase::ElementPhase;
use crate::{CellSpec, Design, MappingSpec, SteeredMapping, SteeringSteps};
use metalith_cell::PolarisationAxis;
use metalith_pillars::{PillarMap, PillarShape, Rectangles};

/// Rounds what a mapping asks for at a phase to the pillar that is written.
#[derive(Clone, Debug, PartialEq)]
pub enum PillarRule {
    /// Squares and circles, by their width.
    Width(WidthRule),
    /// Rectangles of one size, by their rotation.
    Rotation(RotationRule),
    /// Upright rectangles, by both edges.
    SizePair(SizePairRule),
}

impl PillarRule {
    /// The rule of the element of a design with this index, asked about the light that the design is verified in.
    pub fn of_element(design: &Design, index: (i32, i32)) -> Self {
        let common = Self::new(&design.cell, &design.mapping).along(design.axis());
        let own = SteeringSteps::of(&design.array, index).and_then(|steps| design.mapping.steered(steps));
        own.map_or_else(|| common.clone(), |own| common.steered(own))
    }

    /// The rules of all elements of a design, each once: the common one first.
    pub fn all(design: &Design) -> Vec<Self> {
        let common = Self::new(&design.cell, &design.mapping);
        let steered = design.mapping.steered.iter().map(|own| common.steered(own));
        std::iter::once(common.clone()).chain(steered).collect()
    }

    /// This rule with a mapping of steered elements, which pillars have that are mapped to by their width.
    fn steered(&self, own: &SteeredMapping) -> Self {
        match self {
            Self::Width(rule) => Self::Width(rule.steered(own)),
            Self::Rotation(_) | Self::SizePair(_) => self.clone(),
        }
    }

    /// The common rule of a cell and a mapping, which elements without a separate one follow.
    pub fn new(cell: &CellSpec, mapping: &MappingSpec) -> Self {
        match (cell.shape, &mapping.pillar_library) {
            (PillarShape::Rectangle(Rectangles::Rotated(pillars)), _) => {
                let arriving = cell.arriving.unwrap_or_default();
                Self::Rotation(RotationRule::new(pillars, arriving, mapping.rotation.clone()))
            }
            (PillarShape::Rectangle(Rectangles::Upright(pillars)), Some(library)) => {
                Self::SizePair(SizePairRule::new(pillars, Arc::clone(library)))
            }
            // Upright rectangles whose library is still to be made have no other rule.
            _ => Self::Width(WidthRule::new(cell, mapping)),
        }
    }

    /// This rule for the phase of light along an axis; only upright rectangles have a difference.
    #[must_use]
    pub fn along(self, axis: PolarisationAxis) -> Self {
        match self {
            Self::SizePair(rule) => Self::SizePair(rule.along(axis)),
            other => other,
        }
    }

    /// Shape of the pillars, as far as symmetry is concerned: rectangles, or shapes that a mirror leaves unchanged.
    pub(super) fn shape(&self) -> PillarShape {
        match self {
            Self::Width(_) => PillarShape::default(),
            Self::Rotation(rule) => rule.pillars.into(),
            Self::SizePair(rule) => rule.pillars.into(),
        }
    }

    /// Width before rounding (nm) for a phase of `u` turns, `0 <= u < 1`; of rotated rectangles the number of the rotation, from
    /// half to half beyond the last; of upright ones, which no width stands for, the phase itself.
    pub fn unrounded_nm(&self, u: f64) -> f64 {
        match self {
            Self::Width(rule) => rule.unrounded_nm(u),
            Self::Rotation(rule) => rule.unrounded(u),
            Self::SizePair(_) => u,
        }
    }

    /// Phase (turns) that stands for what [`PillarRule::unrounded_nm`] answers, where what counts is the difference of two.
    pub fn turns_of_width(&self, nm: f64) -> f64 {
        match self {
            Self::Width(rule) => rule.turns(nm),
            Self::Rotation(rule) => rule.turns(nm),
            Self::SizePair(_) => nm,
        }
    }

    /// Phase (turns) of a width that is written, or of the number of a rectangle as it is drawn; zero of a pillar that is not in
    /// the library.
    pub fn turns_of_written(&self, width_nm: u16) -> f64 {
        match self {
            Self::Width(rule) => rule.turns(f64::from(width_nm)),
            Self::Rotation(rule) => rule.turns_of_written(width_nm),
            Self::SizePair(rule) => rule.turns_of_written(width_nm),
        }
    }

    /// Width to write (nm) for a phase of `u` turns, `0 <= u < 1`; of rectangles the number. Light along both axes has the same
    /// phase.
    pub fn width_nm(&self, u: f64) -> u16 {
        match self {
            Self::Width(rule) => rule.width_nm(u),
            Self::Rotation(rule) => rule.number(u),
            Self::SizePair(rule) => rule.number([u; 2]),
        }
    }

    /// Width or number of a sample of the mapping, of so many whose phases are evenly spaced over a turn: see
    /// [`PillarRule::phase_of_sample`]. Where light along the other axis has its own phase, it is any.
    pub fn sample(&self, k: usize, samples: usize) -> u16 {
        let own = Self::phase_of_sample(k, samples);
        match self {
            Self::SizePair(rule) => rule.sample(k, own),
            Self::Width(_) | Self::Rotation(_) => self.width_nm(own),
        }
    }

    /// Phase of a sample of a mapping (turns).
    pub fn phase_of_sample(k: usize, samples: usize) -> f64 {
        (k as f64 + 0.5) / samples as f64
    }

    /// Width or number at a site, of an element with this phase, and with this one of light along y if it is another; 0 outside of
    /// the lens.
    pub(super) fn pillar(
        &self,
        phase: &ElementPhase<'_>,
        along_y: Option<&ElementPhase<'_>>,
        ix: usize,
        iy: usize,
    ) -> u16 {
        let Some(u) = phase.wrapped(ix, iy) else { return 0 };
        match (self, along_y) {
            (Self::SizePair(rule), Some(y)) => y.wrapped(ix, iy).map_or(0, |v| rule.number([u, v])),
            _ => self.width_nm(u),
        }
    }

    /// The pillars of an element with this phase, and with this one of light along y if it is another.
    pub fn widths(&self, phase: &ElementPhase<'_>, along_y: Option<&ElementPhase<'_>>) -> PillarMap {
        let mut map = PillarMap::empty(phase.lattice());
        let n = map.lattice.sites();
        let is_mirrored = phase.is_mirrored() && along_y.is_none_or(ElementPhase::is_mirrored);
        let computed = if is_mirrored { n.div_ceil(2) } else { n };
        let sites = map.number.as_slice_mut().expect("a new array is contiguous");
        let (rows, mirrored) = sites.split_at_mut(computed * n);
        rows.par_chunks_mut(n).enumerate().for_each(|(iy, row)| {
            for (ix, width) in row.iter_mut().enumerate() {
                *width = self.pillar(phase, along_y, ix, iy);
            }
        });
        for (row, from) in mirrored.chunks_mut(n).rev().zip(rows.chunks(n)) {
            row.copy_from_slice(from);
        }
        map
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::PillarArray;
    use metalith_core::Silent;

    fn mini(steered: &str) -> metalith_core::Result<Design> {
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../designs/mini_3x3.toml"));
        let text = std::fs::read_to_string(path).unwrap();
        Design::parse(path, &text.replacen("[layout]", &format!("{steered}\n[layout]"), 1))
    }

    #[test]
    fn steered_elements_follow_their_own_mapping_and_stay_copies_of_one_another() {
        let (common, own) = (
            mini("").unwrap(),
            mini("[[mapping.steered]]\nsteps = [1, 0]\ncoefficients = [0.3, 0.5]\n").unwrap(),
        );
        let [before, after] = [&common, &own].map(|design| PillarArray::build(design, &Silent).unwrap());
        assert_eq!(before.classes.len(), after.classes.len());
        assert_ne!(common.digest(), own.digest());
        let mut changed = 0;
        for (a, b) in before.placed.iter().zip(&after.placed) {
            let along_an_axis = (a.element.index.0 == 0) != (a.element.index.1 == 0);
            assert_eq!(
                before.widths(a) != after.widths(b),
                along_an_axis,
                "{:?}",
                a.element.index
            );
            changed += usize::from(along_an_axis);
            if along_an_axis {
                // A phase of u turns is a duty cycle of 0.3 + 0.5 u on a pitch of 350 nm.
                let drawn = after.widths(b).number.iter().copied().max().unwrap();
                assert_eq!(drawn, 280);
            }
        }
        assert_eq!(changed, 4);
        assert_eq!(PillarRule::all(&own).len(), 2);
        // A design without them is what it was.
        assert!(!serde_json::to_string(&common.mapping).unwrap().contains("steered"));
    }

    #[test]
    fn steps_that_no_element_has_and_steps_given_twice_are_faults() {
        let designs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../designs");
        let words = |error: &metalith_core::Error| metalith_testing::without_folder(error, &designs);
        let mut absent = Vec::new();
        for steps in ["[0, 0]", "[2, 0]", "[0, 1]", "[1, 0.5]"] {
            let text = format!("[[mapping.steered]]\nsteps = {steps}\ncoefficients = [0.3, 0.5]\n");
            let error = mini(&text).unwrap_err();
            assert_eq!(
                error.ids(),
                ["mapping.steered#0.steps/inconsistent"],
                "{steps}: {error}"
            );
            absent.push(words(&error));
        }
        insta::assert_snapshot!(absent.join("\n"), @"
            mini_3x3.toml:39:9: no steered elements are 0 and 0 steps from the middle of the array
              help: give steps of elements that there are, the larger first, such as [1, 0]; along an axis with an even number of elements they are 0.5, 1.5, ...
            mini_3x3.toml:39:9: no steered elements are 2 and 0 steps from the middle of the array
              help: give steps of elements that there are, the larger first, such as [1, 0]; along an axis with an even number of elements they are 0.5, 1.5, ...
            mini_3x3.toml:39:9: no steered elements are 0 and 1 steps from the middle of the array
              help: give steps of elements that there are, the larger first, such as [1, 0]; along an axis with an even number of elements they are 0.5, 1.5, ...
            mini_3x3.toml:39:9: no steered elements are 1 and 0.5 steps from the middle of the array
              help: give steps of elements that there are, the larger first, such as [1, 0]; along an axis with an even number of elements they are 0.5, 1.5, ...
            ");
        let one = "[[mapping.steered]]\nsteps = [1, 1]\ncoefficients = [0.3, 0.5]\n";
        let twice = mini(&format!("{one}{one}")).unwrap_err();
        insta::assert_snapshot!(words(&twice), @"
            mini_3x3.toml:42:9: these elements have a mapping already
              help: give one `[[mapping.steered]]` for each pair of steps
            ");
        assert_eq!(twice.ids(), ["mapping.steered#1.steps/inconsistent"]);
        let wide = mini(&one.replace("0.5", "0.9")).unwrap_err();
        insta::assert_snapshot!(words(&wide), @"
            mini_3x3.toml:40:16: this mapping asks for widths from 105.0 to 420.0 nm
              help: the cell allows 100 to 300 nm: change the coefficients or [cell] width_min_nm, width_max_nm
            ");
        assert_eq!(wide.ids(), ["mapping.steered#0.coefficients/inconsistent"]);
    }
}
