//! A rectangle of any edges at the rotations that are solved: numbers that tables can be interpolated from.

use std::f64::consts::FRAC_PI_2;

use num_complex::Complex64;
use rayon::prelude::*;

use metalith_core::{Progress, Result, Silent};
use metalith_pillars::RotatedRectangles;
use metalith_rcwa::{Orders, circular};

use super::series::{Channels, Series, samples, solved_rotations};
use super::{CHOICE, INTERVALS, Solved};
use crate::{CellStack, CircularTables, Handedness, RotatedRectangle};

/// Response of a rectangle to light that arrives left circularly polarised, at rotations evenly over a quarter turn.
/// Its response at any rotation and to either hand is linear in these numbers, so that they may be interpolated between
/// stacks and edges.
#[derive(Clone, Debug, PartialEq)]
pub struct RotationSamples(Vec<Channels>);

impl RotationSamples {
    /// Count of the numbers.
    pub const NUMBERS: usize = 4 * INTERVALS;

    /// Samples of a rectangle with these edges (nm).
    ///
    /// # Errors
    /// As [`CellStack::jones`].
    pub fn solve(
        stack: &CellStack,
        [width_nm, length_nm]: [f64; 2],
        wavelength_um: f64,
        orders: Orders,
    ) -> Result<Self> {
        Self::over(
            INTERVALS,
            stack,
            [width_nm, length_nm],
            wavelength_um,
            orders,
            Handedness::Left,
            &Silent,
        )
    }

    /// Samples with as many orders as [`RotatedCell`](super::RotatedCell) takes at single wavelengths.
    ///
    /// # Errors
    /// As [`CellStack::jones`].
    pub fn converged(stack: &CellStack, edges_nm: [f64; 2], wavelength_um: f64) -> Result<Self> {
        let solved = Solved::converged(CHOICE, |intervals, orders| {
            let orders = Orders::new(orders)?;
            Self::over(
                intervals,
                stack,
                edges_nm,
                wavelength_um,
                orders,
                Handedness::Left,
                &Silent,
            )
            .map(Self::channels)
        })?;
        let samples = Self::NUMBERS / 2;
        let rotation = |k: usize| FRAC_PI_2 * k as f64 / samples as f64;
        Ok(Self((0..samples).map(|k| solved.channels(rotation(k))).collect()))
    }

    /// Samples for light of a hand that arrives, with so many intervals of an eighth of a turn.
    pub(super) fn over(
        intervals: usize,
        stack: &CellStack,
        [width_nm, length_nm]: [f64; 2],
        wavelength_um: f64,
        orders: Orders,
        arriving: Handedness,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let rotations: Vec<f64> = solved_rotations(intervals).collect();
        let what = format!("rectangles, {} orders an axis", orders.along_axis());
        progress.begin(&what, rotations.len() as u64);
        let jones = rotations.into_par_iter().map(|rotation| {
            progress.check_stopped()?;
            let pillar = RotatedRectangle {
                width_nm,
                length_nm,
                rotation,
            };
            let jones = circular(stack.jones(&pillar, wavelength_um, [0.0; 2], orders)?);
            progress.advance(1);
            Ok(jones)
        });
        Ok(Self(samples(&jones.collect::<Result<Vec<_>>>()?, arriving)))
    }

    /// Channels by rotation.
    pub(super) fn channels(self) -> Vec<Channels> {
        self.0
    }

    /// Samples of a site without pillar that transmits this: nothing is converted.
    pub fn of_bare(t: Complex64) -> Self {
        Self(vec![[Complex64::ZERO, t]; Self::NUMBERS / 2])
    }

    /// The numbers.
    pub fn numbers(&self) -> impl Iterator<Item = Complex64> + '_ {
        self.0.iter().flatten().copied()
    }

    /// Samples from [`RotationSamples::numbers`].
    pub fn of_numbers(numbers: &[Complex64]) -> Self {
        Self(numbers.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect())
    }

    /// Tables of pillars with the rotations of these numbers for light of both hands, in their order, where light of a
    /// hand is focused; as the tables of [`RotatedCell`](super::RotatedCell), at rotations as drawn.
    pub fn hands(&self, pillars: RotatedRectangles, numbers: &[u16], focused: Handedness) -> CircularTables {
        let series = Series::of(&self.0);
        let of = |sign: f64, channel: usize| -> Vec<Complex64> {
            let at = |number: &u16| {
                // A mirror turns the pillar back and one handedness into the other.
                let seen = sign * pillars.drawn_rotation(*number);
                let [converted, unconverted] = series.at(seen);
                let geometric = Complex64::cis(Handedness::Left.geometric_phase(seen));
                [converted * geometric, unconverted][channel]
            };
            numbers.iter().map(at).collect()
        };
        let signs = match focused {
            Handedness::Left => [1.0, -1.0],
            Handedness::Right => [-1.0, 1.0],
        };
        CircularTables {
            focused,
            converted: signs.map(|sign| of(sign, 0)),
            unconverted: signs.map(|sign| of(sign, 1)),
            rotation: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::BAND_ORDERS;
    use super::super::RotatedCell;
    use super::*;
    use crate::PolarisedTables;
    use crate::rotated::jones::tests::{PILLARS, titania};

    /// Sums of two dozen numbers of size one; the solver tells left from right to 1e-9.
    const SAME: f64 = 1e-6;

    #[test]
    fn tables_of_samples_are_those_of_the_cell_for_either_hand() {
        let orders = Orders::new(BAND_ORDERS).unwrap();
        let edges = [PILLARS.width_nm, PILLARS.length_nm].map(f64::from);
        let solved = RotationSamples::solve(&titania(), edges, 0.532, orders).unwrap();
        let kept = RotationSamples::of_numbers(&solved.numbers().collect::<Vec<_>>());
        assert_eq!(kept, solved);
        let numbers: Vec<u16> = (0..=PILLARS.steps).collect();
        for focused in [Handedness::Left, Handedness::Right] {
            let cell = RotatedCell::new(titania(), PILLARS, focused);
            let PolarisedTables::Hands(wanted) = cell.both_hands(0.532, true, PILLARS.steps, &Silent).unwrap() else {
                panic!("it knows both hands")
            };
            let found = kept.hands(PILLARS, &numbers, focused);
            for (a, b) in [
                (&found.converted, &wanted.converted),
                (&found.unconverted, &wanted.unconverted),
            ] {
                let pairs = a.iter().zip(b).flat_map(|(a, b)| a.iter().zip(b).skip(1));
                let off = pairs.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
                assert!(off < SAME, "{focused}: {off}");
            }
        }
    }
}
