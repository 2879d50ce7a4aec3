//! Two phases to the number of an upright rectangle.

use std::sync::Arc;

use metalith_cell::{PillarLibrary, PolarisationAxis};
use metalith_pillars::UprightRectangles;

/// Chooses from a library the pillar that is nearest to a phase of light along x and one of light along y.
#[derive(Clone, Debug, PartialEq)]
pub struct SizePairRule {
    pub(super) pillars: UprightRectangles,
    library: Arc<PillarLibrary>,
    /// The light whose phase is meant where one phase is asked for.
    axis: PolarisationAxis,
}

/// Turns of the other phase from one sample of a mapping to the next: the golden section, by which samples fill a turn evenly.
const OTHER_PHASE: f64 = 0.618_033_988_749_894_9;

impl SizePairRule {
    pub(super) fn new(pillars: UprightRectangles, library: Arc<PillarLibrary>) -> Self {
        Self {
            pillars,
            library,
            axis: PolarisationAxis::X,
        }
    }

    pub(super) fn along(self, axis: PolarisationAxis) -> Self {
        Self { axis, ..self }
    }

    /// Number of the pillar for these phases of light along x and along y (turns), each from 0 up to 1.
    pub fn number(&self, turns: [f64; 2]) -> u16 {
        self.library.number(turns)
    }

    /// Phase of a pillar in light along the axis (turns); zero if the library does not have the pillar.
    pub fn turns_of_written(&self, number: u16) -> f64 {
        self.library.turns(number, self.axis).unwrap_or(0.0)
    }

    /// Number of the pillar of sample `k`, whose phase along the axis is `own` (turns), and any along the other one.
    pub fn sample(&self, k: usize, own: f64) -> u16 {
        let mut turns = [(OTHER_PHASE * (k as f64 + 0.5)).fract(); 2];
        turns[self.axis.index()] = own;
        self.number(turns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_cell::LibraryPillar;

    #[test]
    fn the_nearest_pair_is_chosen_and_the_phase_is_that_of_the_axis() {
        let pillars = UprightRectangles::of_lengths([100, 200].into_iter()).unwrap();
        // Each edge sets the phase of light along it.
        let pillar = |number: u16| LibraryPillar {
            number,
            turns: pillars.edges_nm(number).map(|edge| f64::from(edge / 200) * 0.5),
            passed: [1.0; 2],
        };
        let library = PillarLibrary::new((1..=4).map(pillar).collect()).unwrap();
        let rule = SizePairRule::new(pillars, Arc::new(library));
        for (turns, edges) in [
            ([0.05, 0.1], [100, 100]),
            ([0.55, 0.9], [200, 100]),
            ([0.1, 0.45], [100, 200]),
            ([0.5, 0.6], [200, 200]),
        ] {
            assert_eq!(pillars.edges_nm(rule.number(turns)), edges, "{turns:?}");
        }
        let tall = pillars.number([100, 200]).unwrap();
        assert_eq!(rule.turns_of_written(tall), 0.0);
        let along_y = rule.along(PolarisationAxis::Y);
        assert_eq!(along_y.turns_of_written(tall), 0.5);
        // The phase along the axis is that of the sample, whatever the other one is.
        for k in 0..8 {
            assert_eq!(pillars.edges_nm(along_y.sample(k, 0.5))[1], 200, "{k}");
        }
    }
}
