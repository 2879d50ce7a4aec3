//! Parts of intervals, in the form of the report.

use metalith_attribution::IntervalParts;
use serde::Serialize;

/// Parts of a 95 % half-width: its size by each cause alone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct WidthParts {
    /// Noise, and that groups of measurements do not agree.
    pub noise: f64,
    /// The transmission of the stated cell: its amplitude, and its phase.
    pub cell_amplitude: f64,
    pub cell_phase: f64,
    /// Change by the effects that were found.
    pub change: f64,
    /// Known error of values of this effect.
    pub value: f64,
    /// Orders of cells, samples of spectra and steps of tables, which are finite.
    pub sampling: f64,
    /// How far another estimate of the same number is, where there is one: no half-width is less.
    pub least: f64,
}

impl WidthParts {
    /// All of them together; no number where measurements tell nothing.
    pub fn half_width(&self) -> f64 {
        self.parts().half_width()
    }

    /// Error of the model.
    pub fn of_model(&self) -> f64 {
        self.parts().of_model()
    }

    fn parts(&self) -> IntervalParts {
        IntervalParts {
            noise: self.noise,
            model: vec![self.cell_amplitude, self.cell_phase],
            change: self.change,
            value: self.value,
            sampling: self.sampling,
            least: self.least,
        }
    }

    /// Each by itself, changed in the same way.
    #[must_use]
    pub fn map(parts: &[Self], of: impl Fn(&[f64]) -> Vec<f64>) -> Vec<Self> {
        let each = |pick: fn(&Self) -> f64| of(&parts.iter().map(pick).collect::<Vec<_>>());
        let (noise, amplitude, phase) = (each(|p| p.noise), each(|p| p.cell_amplitude), each(|p| p.cell_phase));
        let (change, value, least) = (each(|p| p.change), each(|p| p.value), each(|p| p.least));
        let sampling = each(|p| p.sampling);
        (0..noise.len())
            .map(|k| Self {
                noise: noise[k],
                cell_amplitude: amplitude[k],
                cell_phase: phase[k],
                change: change[k],
                value: value[k],
                sampling: sampling[k],
                least: least[k],
            })
            .collect()
    }
}

impl From<&IntervalParts> for WidthParts {
    fn from(parts: &IntervalParts) -> Self {
        let of_cell = |kind: usize| parts.model.get(kind).copied().unwrap_or(0.0);
        Self {
            noise: parts.noise,
            cell_amplitude: of_cell(0),
            cell_phase: of_cell(1),
            change: parts.change,
            value: parts.value,
            sampling: parts.sampling,
            least: parts.least,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_part_is_changed_alone() {
        let parts = WidthParts {
            noise: 1.0,
            cell_amplitude: 2.0,
            cell_phase: 4.0,
            change: 6.0,
            value: 8.0,
            sampling: 0.0,
            least: 0.5,
        };
        assert_eq!(parts.half_width(), 11.0);
        let doubled = WidthParts::map(&[parts], |widths| widths.iter().map(|w| 2.0 * w).collect());
        assert_eq!(doubled[0].half_width(), 22.0);
    }
}
