//! The mapping of phase to width of a design, forth and back.

use metalith_core::{Error, Result};

/// Phases at which the mapping is sampled over one turn: ten for each of a hundred widths.
const SAMPLES: usize = 1024;

/// Width of the pillar for every phase, and the phase that a drawn width stands for.
#[derive(Clone, Debug, PartialEq)]
pub struct Mapping {
    /// Drawn width (nm) at the phases (i + 1/2) / SAMPLES turns.
    widths_nm: Vec<u16>,
    /// Phase (turns, 0 to 1) by width (nm).
    phases: Vec<Option<f64>>,
}

impl Mapping {
    /// `width_nm` is the drawn width (nm) for a phase (turns, 0 <= u < 1).
    ///
    /// A width stands for the middle of the phases that are drawn with it. Where these are several ranges, it stands
    /// for none of them: its phase cannot be told from the layout.
    pub fn new(width_nm: impl Fn(f64) -> u16) -> Self {
        let widths_nm: Vec<u16> = (0..SAMPLES).map(|i| width_nm(phase_of(i))).collect();
        let widest = widths_nm.iter().copied().max().unwrap_or(0);
        let mut runs: Vec<Vec<(usize, usize)>> = vec![Vec::new(); usize::from(widest) + 1];
        for (i, &width) in widths_nm.iter().enumerate() {
            match runs[usize::from(width)].last_mut() {
                Some((_, last)) if *last + 1 == i => *last = i,
                _ => runs[usize::from(width)].push((i, i)),
            }
        }
        let middle = |runs: &Vec<(usize, usize)>| match runs[..] {
            [(first, last)] => Some(0.5 * (phase_of(first) + phase_of(last))),
            _ => None,
        };
        Self {
            phases: runs.iter().map(middle).collect(),
            widths_nm,
        }
    }

    /// Mapping of pillars whose phase is not known: each stands for the share of the pillars that are narrower.
    /// `counts` are numbers of pillars with the width (nm) as index, of one element each; the first entry counts sites
    /// without one.
    ///
    /// # Errors
    /// If there are no pillars.
    pub fn of_widths(counts: impl IntoIterator<Item = Vec<u64>>) -> Result<Self> {
        let mut sums: Vec<u64> = Vec::new();
        for counts in counts {
            sums.resize(sums.len().max(counts.len()), 0);
            sums.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
        }
        let mut up_to = 0;
        for (width, sum) in sums.iter_mut().enumerate() {
            up_to += if width == 0 { 0 } else { *sum };
            *sum = up_to;
        }
        if up_to == 0 {
            return Err(Error::refused(
                "neighbours/no-pillars",
                "the layout has no pillars",
                "name the layer of the pillars",
            ));
        }
        Ok(Self::new(|u| {
            let narrower = (u * up_to as f64) as u64;
            sums.partition_point(|sum| *sum <= narrower) as u16
        }))
    }

    /// Drawn width (nm) for a phase (turns, 0 <= u < 1).
    pub fn width_nm(&self, phase: f64) -> f64 {
        let i = ((phase * SAMPLES as f64) as usize).min(SAMPLES - 1);
        f64::from(self.widths_nm[i])
    }

    /// A phase (turns, 0 to 1) that is drawn with the width nearest to this (nm).
    pub fn nearest_phase(&self, width_nm: f64) -> f64 {
        let off = |i: &usize| (f64::from(self.widths_nm[*i]) - width_nm).abs();
        let nearest = (0..SAMPLES).min_by(|a, b| off(a).total_cmp(&off(b)));
        phase_of(nearest.expect("there are samples"))
    }

    /// Phase that a drawn width (nm) stands for (turns, 0 to 1); none if the mapping does not draw it.
    pub fn phase(&self, width_nm: u16) -> Option<f64> {
        self.phases.get(usize::from(width_nm)).copied().flatten()
    }

    /// Narrowest and widest pillar (nm).
    pub fn range_nm(&self) -> (f64, f64) {
        let (low, high) = (self.widths_nm.iter().min(), self.widths_nm.iter().max());
        (low.map_or(0.0, |w| f64::from(*w)), high.map_or(0.0, |w| f64::from(*w)))
    }

    /// The sampled widths (nm): two mappings with equal ones are the same here.
    pub fn samples_nm(&self) -> &[u16] {
        &self.widths_nm
    }
}

/// Phase of a sample (turns).
fn phase_of(sample: usize) -> f64 {
    (sample as f64 + 0.5) / SAMPLES as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widths_stand_for_the_middle_of_their_phases() {
        let mapping = Mapping::new(|u| 100 + 2 * (u * 100.0) as u16);
        // Phases are known to half a sample.
        const STEP: f64 = 0.5 / SAMPLES as f64 + 1e-12;
        for i in 0..100_u16 {
            let phase = mapping.phase(100 + 2 * i).unwrap();
            assert!((phase - (f64::from(i) + 0.5) / 100.0).abs() <= STEP, "{i}: {phase}");
            assert_eq!(mapping.width_nm(phase), f64::from(100 + 2 * i));
        }
        assert_eq!(
            (mapping.phase(101), mapping.phase(0), mapping.phase(4000)),
            (None, None, None)
        );
        assert_eq!(mapping.range_nm(), (100.0, 298.0));
    }

    #[test]
    fn widths_alone_make_a_mapping_that_draws_each_as_often() {
        let mut counts = vec![0; 301];
        (counts[0], counts[100], counts[200], counts[300]) = (999, 1, 2, 1);
        let mapping = Mapping::of_widths([counts.clone(), counts]).unwrap();
        assert_eq!(
            [0.1, 0.3, 0.7, 0.8].map(|u| mapping.width_nm(u)),
            [100.0, 200.0, 200.0, 300.0]
        );
        assert!(Mapping::of_widths([vec![7]]).is_err());
        assert!(Mapping::of_widths([]).is_err());
    }

    #[test]
    fn a_width_with_two_phases_has_none() {
        let mapping = Mapping::new(|u| if (0.25..0.5).contains(&u) { 200 } else { 100 });
        assert_eq!(mapping.phase(100), None);
        assert!((mapping.phase(200).unwrap() - 0.375).abs() < 1.0 / SAMPLES as f64);
    }
}
