//! Phase to the number of a rotation: geometric phase, twice the rotation.

use std::f64::consts::{PI, TAU};

use metalith_cell::{Handedness, RotationMapping};
use metalith_pillars::RotatedRectangles;

/// Rounds the rotation that a phase asks for to the number of one that may be written.
#[derive(Clone, Debug, PartialEq)]
pub struct RotationRule {
    pub(super) pillars: RotatedRectangles,
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
    pub(super) fn new(pillars: RotatedRectangles, arriving: Handedness, mapping: RotationMapping) -> Self {
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
    pub fn unrounded(&self, u: f64) -> f64 {
        let steps = self.steps();
        let added = if self.mapping.is_half() {
            0.0
        } else {
            self.mapping.added(TAU * u) / PI * steps
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
    pub fn number(&self, u: f64) -> u16 {
        match self.over_part.get((u * f64::from(PARTS)) as usize) {
            Some(&number) if number > 0 => number,
            _ => self.nearest(u),
        }
    }

    /// The pillar that [`RotationRule::number`] names, from the sums themselves.
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
    pub fn turns(&self, steps: f64) -> f64 {
        let turns = steps / self.steps();
        match self.arriving {
            Handedness::Left => turns,
            Handedness::Right => -turns,
        }
    }

    /// Phase of the pillar with a number as it is drawn, the grid counted (turns).
    pub fn turns_of_written(&self, number: u16) -> f64 {
        let turned = self.turned.get(usize::from(number)).copied().unwrap_or(0.0);
        self.turns(f64::from(number) + turned)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both hands, series that go forwards and back, and steps from a degree to a tenth of it: what is kept is what the sums give.
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
}
