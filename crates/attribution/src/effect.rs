//! Effects as the statistics see them: parameters with ranges, and what their values err by.

/// A parameter of an effect, chosen so that predictions depend on it almost linearly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Physical limits.
    pub range: (f64, f64),
    /// A typical magnitude.
    pub typical: f64,
    /// A value that is sound although it may be an end of the range: no effect, or a size of zero.
    pub sound_end: f64,
}

impl Parameter {
    /// Parameter with physical limits and a typical magnitude; zero is sound.
    pub const fn new(low: f64, high: f64, typical: f64) -> Self {
        Self {
            range: (low, high),
            typical,
            sound_end: 0.0,
        }
    }

    /// True if it can only be positive.
    pub fn one_sided(&self) -> bool {
        self.range.0 >= 0.0
    }
}

/// One parameter of one effect.
#[derive(Clone, Copy, Debug)]
pub struct Slot {
    /// Number of the effect.
    pub effect: usize,
    /// Index of the parameter among those of the effect.
    pub index: usize,
    pub parameter: Parameter,
}

/// Errors of the values of an effect that intervals count with beside noise and smooth terms, each as one standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValueError {
    /// Whatever the value is, in typical sizes: what a second peak makes of the width of a line, for one.
    pub of_typical: f64,
    /// Relative to the value.
    pub of_value: f64,
}

/// Distance of a refined fit from its minimum, in typical sizes: it ends when a step is below 2e-2 of these, and the next one is
/// at most a sixteenth of it (test `refinement_converges_to_the_minimum`). Effects of 0.5 to 2 typical sizes err by
/// 3e-4 (rms), noise and what they change included.
const OF_SEARCH: f64 = 1.5e-4;

impl ValueError {
    /// None.
    pub const NONE: Self = Self {
        of_typical: 0.0,
        of_value: 0.0,
    };

    /// Relative to the value.
    pub const fn of_value(of_value: f64) -> Self {
        Self { of_value, ..Self::NONE }
    }

    /// Whatever the value is, in typical sizes.
    pub const fn of_typical(of_typical: f64) -> Self {
        Self {
            of_typical,
            ..Self::NONE
        }
    }

    /// Standard deviation of a value whose typical size is given, with that of the search.
    pub fn sigma(&self, value: f64, typical: f64) -> f64 {
        let known = (self.of_typical * typical).hypot(self.of_value * value);
        known.hypot(OF_SEARCH * typical)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_is_never_below_that_of_the_search() {
        let relative = ValueError::of_value(1e-2);
        assert_eq!(relative.sigma(0.0, 2.0), 2.0 * OF_SEARCH);
        assert!((relative.sigma(-5.0, 2.0) / 5e-2f64.hypot(2.0 * OF_SEARCH) - 1.0).abs() < 1e-12);
    }
}
