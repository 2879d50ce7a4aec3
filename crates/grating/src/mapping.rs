//! The mapping of phase to width of a design, forth and back.

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

    /// Drawn width (nm) for a phase (turns, 0 <= u < 1).
    pub fn width_nm(&self, phase: f64) -> f64 {
        let i = ((phase * SAMPLES as f64) as usize).min(SAMPLES - 1);
        f64::from(self.widths_nm[i])
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
    fn a_width_with_two_phases_has_none() {
        let mapping = Mapping::new(|u| if (0.25..0.5).contains(&u) { 200 } else { 100 });
        assert_eq!(mapping.phase(100), None);
        assert!((mapping.phase(200).unwrap() - 0.375).abs() < 1.0 / SAMPLES as f64);
    }
}
