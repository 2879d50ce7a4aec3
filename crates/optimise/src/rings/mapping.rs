//! Mapping from the phase of a ring to the width of its pillars, and the widths there are to choose from.

use metalith_design::array::PillarRule;

/// Points at which a mapping is sampled over one turn; between them it is a straight line.
const SAMPLES: usize = 4096;

/// Phase to pillar width, as the array stage of a design maps it.
#[derive(Clone, Debug)]
pub struct Mapping {
    /// Width at `i / SAMPLES` waves, the last entry at the end of the turn (nm).
    width_nm: Vec<f64>,
    choices: Vec<WidthChoice>,
}

/// A width that a ring can have, and the phase to ask for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WidthChoice {
    /// Phase (waves), in [0, 1): the middle of the phases that are mapped to this width, so that
    /// rounding a phase to a text file and back cannot change the width.
    pub waves: f64,
    /// Width of the pillars (nm).
    pub width_nm: u16,
}

impl Mapping {
    /// The mapping of a design.
    pub fn new(rule: &PillarRule) -> Self {
        let waves = |i: usize| (i as f64 / SAMPLES as f64).min(1.0 - f64::EPSILON);
        let width_nm = (0..=SAMPLES).map(|i| rule.unrounded_nm(waves(i))).collect();
        let made = (0..SAMPLES).map(|i| rule.width_nm(waves(i))).collect::<Vec<_>>();
        Self {
            width_nm,
            choices: choices_of(&made),
        }
    }

    /// Width before rounding (nm), and its derivative (nm per turn). Any phase; it is taken modulo one turn.
    pub fn width_nm(&self, waves: f64) -> (f64, f64) {
        let at = waves.rem_euclid(1.0) * SAMPLES as f64;
        let i = (at as usize).min(SAMPLES - 1);
        let slope = self.width_nm[i + 1] - self.width_nm[i];
        (self.width_nm[i] + (at - i as f64) * slope, slope * SAMPLES as f64)
    }

    /// The widths a ring can have, by rising phase.
    pub fn choices(&self) -> &[WidthChoice] {
        &self.choices
    }

    /// Phases of given choices (waves).
    pub fn turns_of(&self, choices: &[usize]) -> Vec<f64> {
        choices.iter().map(|&c| self.choices[c].waves).collect()
    }

    /// Widths of given choices (nm).
    pub fn widths_of(&self, choices: &[usize]) -> Vec<u16> {
        choices.iter().map(|&c| self.choices[c].width_nm).collect()
    }

    /// Largest width (nm).
    pub fn max_width_nm(&self) -> u16 {
        self.choices.iter().map(|c| c.width_nm).max().unwrap_or(0)
    }

    /// The choice whose phase is nearest on the circle.
    pub fn nearest(&self, waves: f64) -> usize {
        (0..self.choices.len())
            .min_by(|&a, &b| {
                let distance = |i: usize| step(self.choices[i].waves, waves).abs();
                distance(a).total_cmp(&distance(b))
            })
            .unwrap_or(0)
    }
}

/// Phase step from one ring to the next, wrapped to [-1/2, 1/2) turn.
pub fn step(from_waves: f64, to_waves: f64) -> f64 {
    (to_waves - from_waves + 0.5).rem_euclid(1.0) - 0.5
}

/// The longest run of samples of each width; its middle is the phase of that width.
fn choices_of(widths: &[u16]) -> Vec<WidthChoice> {
    let mut runs = std::collections::BTreeMap::<u16, (usize, usize)>::new();
    let mut start = 0;
    for end in 1..=SAMPLES {
        if end == SAMPLES || widths[end] != widths[start] {
            let run = runs.entry(widths[start]).or_default();
            if end - start > run.1 - run.0 {
                *run = (start, end);
            }
            start = end;
        }
    }
    let mut choices = runs
        .into_iter()
        .map(|(width_nm, (start, end))| WidthChoice {
            waves: 0.5 * (start + end - 1) as f64 / SAMPLES as f64,
            width_nm,
        })
        .collect::<Vec<_>>();
    choices.sort_by(|a, b| a.waves.total_cmp(&b.waves));
    choices
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    use metalith_cell::InversePolynomial;
    use metalith_design::{CellSpec, MappingComparison, MappingSpec};
    use metalith_pillars::PillarShape;

    /// The rule of the shipped designs but for the coefficients.
    pub(crate) fn rule(coefficients: &[f64]) -> PillarRule {
        let cell = CellSpec {
            lattice: Default::default(),
            pitch_nm: 350.into(),
            database_unit: Default::default(),
            pillar_height_nm: 700.0,
            width_range_nm: (100, 300),
            width_step_nm: 2,
            pillar_material: "sin_luke_2015".into(),
            substrate_material: "fused_silica_malitson_1965".into(),
            ambient_index: 1.0,
            shape: PillarShape::Square,
            arriving: None,
            ambient_material: None,
            under: Vec::new(),
            band_um: None,
        };
        let polynomial = InversePolynomial {
            coefficients: coefficients.to_vec(),
            ..InversePolynomial::published()
        };
        let mapping = MappingSpec {
            wavelength_um: 0.452,
            polynomial,
            table_file: None,
            phase_convention: None,
            table: None,
            from_cells: false,
            solved: None,
            pillar_library_file: None,
            pillar_library: None,
            pillar_library_refused: None,
            rotation: Default::default(),
            steered: Vec::new(),
            comparison: MappingComparison::default(),
            identity: Default::default(),
        };
        PillarRule::new(&cell, &mapping)
    }

    /// The published mapping, all powers.
    pub(crate) fn published() -> Mapping {
        Mapping::new(&rule(&[0.2923, 0.6809, -0.1484]))
    }

    #[test]
    fn every_choice_makes_its_width() {
        let (mapping, rule) = (published(), rule(&[0.2923, 0.6809, -0.1484]));
        assert_eq!(mapping.choices().first().unwrap().width_nm, 102);
        assert_eq!(mapping.max_width_nm(), 288);
        assert_eq!(mapping.choices().len(), 94);
        for (i, choice) in mapping.choices().iter().enumerate() {
            assert_eq!(rule.width_nm(choice.waves), choice.width_nm);
            assert_eq!(mapping.nearest(choice.waves), i);
        }
    }

    #[test]
    fn steps_are_wrapped() {
        const ROUNDING: f64 = 1e-15;
        assert!((step(0.9, 0.1) - 0.2).abs() < ROUNDING);
        assert!((step(0.1, 0.9) + 0.2).abs() < ROUNDING);
        assert_eq!(step(0.25, 0.75), -0.5);
    }

    #[test]
    fn the_slope_is_that_of_the_width() {
        /// Rounding of widths of hundreds of nm, 1e-13, over steps of 1e-6 waves, and a margin.
        const DIFFERENCE: f64 = 1e-5;
        let mapping = published();
        for waves in [0.01, 0.3, 0.77, 0.99] {
            let (h, slope) = (1e-6, mapping.width_nm(waves).1);
            let difference = (mapping.width_nm(waves + h).0 - mapping.width_nm(waves - h).0) / (2.0 * h);
            assert!(
                (slope - difference).abs() < DIFFERENCE * slope.abs(),
                "{waves}: {slope} {difference}"
            );
        }
    }
}
