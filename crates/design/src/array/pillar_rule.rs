//! Phase to width, site by site.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use rayon::prelude::*;

use crate::phase::ElementPhase;
use crate::{CellSpec, Design, MappingSpec, SteeredMapping, SteeringSteps};
use metalith_cell::{
    ForwardPolynomial, Handedness, InversePolynomial, MappingTable, PillarLibrary, PolarisationAxis, RotationMapping,
};
use metalith_pillars::{PillarMap, PillarShape, RotatedRectangles, UprightRectangles};

/// Rounds the duty cycle that a mapping asks for to a width that may be written.
#[derive(Clone, Debug, PartialEq)]
pub struct PillarRule {
    polynomial: InversePolynomial,
    table: Option<MappingTable>,
    pitch_nm: f64,
    step_nm: f64,
    range_nm: (f64, f64),
    /// Published phase over width of the paper's cell, and the wavelength of the mapping (um).
    forward: Option<(ForwardPolynomial, f64)>,
    /// Rule of rotated rectangles; with it, no other field counts.
    rotation: Option<RotationRule>,
    /// Rule of upright rectangles; with it, no other field counts.
    pair: Option<PairRule>,
}

/// Two phases to the number of an upright rectangle.
#[derive(Clone, Debug, PartialEq)]
struct PairRule {
    pillars: UprightRectangles,
    choice: Arc<PillarLibrary>,
    /// The light whose phase is asked about where one is asked about.
    axis: PolarisationAxis,
}

/// Turns of the other phase from one sample of a mapping to the next: the golden section, by which samples fill a turn evenly.
const OTHER_PHASE: f64 = 0.618_033_988_749_894_9;

/// Phase to the number of a rotation.
#[derive(Clone, Debug, PartialEq)]
struct RotationRule {
    pillars: RotatedRectangles,
    /// Handedness of the light that arrives.
    arriving: Handedness,
    mapping: RotationMapping,
    /// Change of the rotation of each number by the grid, in steps; the first stands for no pillar.
    turned: Vec<f64>,
    /// The number over each of [`PARTS`] of a turn of phase, zero where it is not the same all over: sums of waves for millions of
    /// sites take longer than to write them.
    over_part: Vec<u16>,
}

/// Parts of a turn of phase whose numbers are kept: of steps of a degree one in ninety has a border.
const PARTS: u16 = 1 << 14;

impl RotationRule {
    fn new(pillars: RotatedRectangles, arriving: Handedness, mapping: RotationMapping) -> Self {
        let in_steps = |number: u16| pillars.turned_by_grid(number) / PI * f64::from(pillars.steps);
        let mut rule = Self {
            pillars,
            arriving,
            mapping,
            turned: std::iter::once(0.0).chain((1..=pillars.steps).map(in_steps)).collect(),
            over_part: Vec::new(),
        };
        let borders: Vec<(f64, u16)> = (0..=PARTS)
            .map(|k| f64::from(k) / f64::from(PARTS))
            .map(|u| (rule.unrounded(u).round(), rule.nearest(u)))
            .collect();
        // Between them the same three rotations are compared, and each is the nearest over one interval.
        let alike = |ends: &[(f64, u16)]| if ends[0] == ends[1] { ends[0].1 } else { 0 };
        rule.over_part = borders.windows(2).map(alike).collect();
        rule
    }

    fn steps(&self) -> f64 {
        f64::from(self.pillars.steps)
    }

    /// The number before rounding for a phase of `u` turns, from half to half beyond the last. Half a turn of rotation is a
    /// turn of phase.
    fn unrounded(&self, u: f64) -> f64 {
        let steps = self.steps();
        let added = match self.mapping.is_half() {
            true => 0.0,
            false => self.mapping.added(TAU * u) / PI * steps,
        };
        let number = match self.arriving {
            Handedness::Left => u * steps + added,
            Handedness::Right => (1.0 - u) * steps - added,
        };
        if number < 0.5 {
            number + steps
        } else if number >= steps + 0.5 {
            number - steps
        } else {
            number
        }
    }

    /// The pillar whose rotation as drawn is nearest to that for a phase of `u` turns, `0 <= u < 1`; of two the first.
    fn number(&self, u: f64) -> u16 {
        match self.over_part.get((u * f64::from(PARTS)) as usize) {
            Some(&number) if number > 0 => number,
            _ => self.nearest(u),
        }
    }

    /// Nearest number, from the sums themselves.
    fn nearest(&self, u: f64) -> u16 {
        let wanted = self.unrounded(u);
        let nearest = wanted.round();
        let mut best = (f64::INFINITY, 1);
        // What the grid adds is less than a step.
        for beside in [-1.0, 0.0, 1.0] {
            let number = match (nearest + beside) as i64 {
                n if n < 1 => n + i64::from(self.pillars.steps),
                n if n > i64::from(self.pillars.steps) => n - i64::from(self.pillars.steps),
                n => n,
            } as u16;
            let off = nearest + beside + self.turned[usize::from(number)] - wanted;
            if off.abs() < best.0 {
                best = (off.abs(), number);
            }
        }
        best.1
    }

    /// Turns of phase of so many steps of rotation.
    fn turns(&self, steps: f64) -> f64 {
        let turns = steps / self.steps();
        match self.arriving {
            Handedness::Left => turns,
            Handedness::Right => -turns,
        }
    }
}

/// The largest phase below a turn that tables of mappings tell from one.
const LAST_TURN: f64 = 0.9999;

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

    /// This rule with a mapping of steered elements.
    fn steered(&self, own: &SteeredMapping) -> Self {
        Self {
            polynomial: own.polynomial.clone(),
            table: None,
            ..self.clone()
        }
    }

    /// The common rule of a cell and a mapping, which elements follow that have none of their own.
    pub fn new(cell: &CellSpec, mapping: &MappingSpec) -> Self {
        Self {
            polynomial: mapping.polynomial.clone(),
            table: mapping.table.clone(),
            pitch_nm: f64::from(cell.pitch_nm),
            step_nm: f64::from(cell.width_step_nm),
            range_nm: (f64::from(cell.width_range_nm.0), f64::from(cell.width_range_nm.1)),
            forward: cell
                .is_of_the_paper()
                .then(|| (ForwardPolynomial::published(), mapping.wavelength_um)),
            rotation: cell
                .shape
                .rotated()
                .map(|pillars| RotationRule::new(pillars, cell.arriving.unwrap_or_default(), mapping.rotation.clone())),
            pair: cell
                .shape
                .upright()
                .zip(mapping.pillar_library.as_ref())
                .map(|(pillars, library)| PairRule {
                    pillars,
                    choice: Arc::clone(library),
                    axis: PolarisationAxis::X,
                }),
        }
    }

    /// Same rule for the phase of light along an axis; only upright rectangles have a difference.
    #[must_use]
    pub fn along(mut self, axis: PolarisationAxis) -> Self {
        if let Some(pair) = &mut self.pair {
            pair.axis = axis;
        }
        self
    }

    /// Shape of the pillars, as far as symmetry is concerned: rectangles, or shapes that a mirror leaves unchanged.
    pub(super) fn shape(&self) -> PillarShape {
        match (&self.rotation, &self.pair) {
            (Some(rule), _) => PillarShape::Rectangle(rule.pillars.into()),
            (None, Some(rule)) => PillarShape::Rectangle(rule.pillars.into()),
            (None, None) => PillarShape::Square,
        }
    }

    /// Width before rounding (nm) for a phase of `u` turns, `0 <= u < 1`; of rotated rectangles the number of the rotation, from
    /// half to half beyond the last; of upright ones, which no width stands for, the phase itself.
    pub fn unrounded_nm(&self, u: f64) -> f64 {
        if self.pair.is_some() {
            return u;
        }
        if let Some(rule) = &self.rotation {
            return rule.unrounded(u);
        }
        match &self.table {
            Some(table) => f64::from(table.width_nm(u)),
            None => self.pitch_nm * self.polynomial.duty(u),
        }
    }

    /// Phase (turns) that stands for a width (nm) where what counts is the difference of two: by the published polynomial for
    /// the cell of the paper, else by the mean slope of the mapping.
    pub fn turns_of_width(&self, nm: f64) -> f64 {
        if self.pair.is_some() {
            return nm;
        }
        if let Some(rule) = &self.rotation {
            return rule.turns(nm);
        }
        if let Some(forward) = &self.forward {
            return forward.0.turns(nm / self.pitch_nm, forward.1);
        }
        let span_nm = self.unrounded_nm(LAST_TURN) - self.unrounded_nm(0.0);
        nm / span_nm.abs().max(self.step_nm)
    }

    /// Phase (waves) of a width that is written, or of the number of a rectangle as it is drawn; one that is not in the
    /// library has none.
    pub fn turns_of_written(&self, width_nm: u16) -> f64 {
        if let Some(pair) = &self.pair {
            return pair.choice.turns(width_nm, pair.axis).unwrap_or(0.0);
        }
        match &self.rotation {
            Some(rule) => {
                let turned = rule.turned.get(usize::from(width_nm)).copied().unwrap_or(0.0);
                rule.turns(f64::from(width_nm) + turned)
            }
            None => self.turns_of_width(f64::from(width_nm)),
        }
    }

    /// Width to write (nm) for a phase of `u` turns, `0 <= u < 1`; of rectangles the number. Light along both axes has the same
    /// phase.
    pub fn width_nm(&self, u: f64) -> u16 {
        if let Some(pair) = &self.pair {
            return pair.choice.number([u; 2]);
        }
        if let Some(rule) = &self.rotation {
            return rule.number(u);
        }
        let width = (self.unrounded_nm(u) / self.step_nm).round() * self.step_nm;
        width.clamp(self.range_nm.0, self.range_nm.1) as u16
    }

    /// Width or number of a sample of the mapping, of so many whose phases are evenly spaced over a turn: see
    /// [`PillarRule::phase_of_sample`]. Where light along the other axis has a phase of its own, it is any.
    pub fn sample(&self, k: usize, samples: usize) -> u16 {
        let own = Self::phase_of_sample(k, samples);
        let Some(pair) = &self.pair else {
            return self.width_nm(own);
        };
        let mut turns = [(OTHER_PHASE * (k as f64 + 0.5)).fract(); 2];
        turns[pair.axis.index()] = own;
        pair.choice.number(turns)
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
        match (&self.pair, along_y) {
            (Some(pair), Some(y)) => y.wrapped(ix, iy).map_or(0, |v| pair.choice.number([u, v])),
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

    /// Test of both hands, series that go forwards and back, and steps from a degree to a tenth of it: what is kept is
    /// what the sums give.
    #[test]
    fn numbers_that_are_kept_are_those_of_the_sums() {
        for (arriving, steps) in [
            (Handedness::Left, 180),
            (Handedness::Right, 180),
            (Handedness::Right, 1800),
        ] {
            let pillars = RotatedRectangles {
                width_nm: 100,
                length_nm: 250,
                steps,
            };
            let mapping = RotationMapping {
                sines: vec![-0.1, 0.02],
                cosines: vec![0.05],
            };
            let rule = RotationRule::new(pillars, arriving, mapping);
            let kept = rule.over_part.iter().filter(|n| **n > 0).count();
            assert!(kept > usize::from(PARTS) - 4 * usize::from(steps), "{kept}");
            for k in 0..400_003 {
                let u = f64::from(k) / 400_003.0;
                assert_eq!(rule.number(u), rule.nearest(u), "{arriving:?} {steps} {u}");
            }
        }
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

    /// Each phase gets the pillar whose rotation as drawn is nearest to what the mapping asks for, for both hands.
    #[test]
    fn rotations_are_those_drawn_nearest() {
        let pillars = RotatedRectangles {
            width_nm: 100,
            length_nm: 250,
            steps: 180,
        };
        let mapping = RotationMapping {
            sines: vec![0.004],
            cosines: vec![-0.003, 0.001],
        };
        for arriving in [Handedness::Left, Handedness::Right] {
            let rule = RotationRule::new(pillars, arriving, mapping.clone());
            let half = RotationRule::new(pillars, arriving, RotationMapping::default());
            for k in 0..2000 {
                let u = f64::from(k) / 2000.0;
                let sign = if arriving == Handedness::Left { 1.0 } else { -1.0 };
                let wanted = sign * (PI * u + mapping.added(TAU * u));
                let off = |number: u16| {
                    let apart = pillars.drawn_rotation(number) - wanted;
                    (apart - PI * (apart / PI).round()).abs()
                };
                let best = (1..=180).map(off).fold(f64::INFINITY, f64::min);
                // Rounding of sums of numbers below 200.
                assert!(off(rule.number(u)) < best + 1e-12, "{arriving:?} {u}");
                assert!(
                    (half.unrounded(u) - 0.5).rem_euclid(180.0) - (180.0 * sign * u - 0.5).rem_euclid(180.0) < 1e-9
                );
                assert!((0.5..180.5).contains(&rule.unrounded(u)));
            }
        }
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
