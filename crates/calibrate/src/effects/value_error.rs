//! What the values of effects err by besides the cell, as it was measured.

use super::Stage;

/// Errors of the values of an effect that intervals count with beside noise and the cell, each as one standard deviation.
///
/// Those of effects are root mean square errors in sets without noise whose cells are solved with 15 orders and whose spectra,
/// layouts and planes are sampled otherwise than in fits, of no effect and of one of 0.8 and 1.5 typical sizes: `metalith calibrate
/// SET --validate --noiseless --orders 15 --nulls 1 --trial gap=0.8 --trial gap=-1.5 ...`. What the cell explains is left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValueError {
    /// Whatever the value is, in typical sizes: what a lamp with one peak more makes of a width of its spectrum, for one.
    pub of_typical: f64,
    /// Relative to the value.
    pub of_value: f64,
}

/// How far a refined fit is from its minimum, in typical sizes: it ends when a step is below 2e-2 of these, and the next one is
/// at most a sixteenth of it (test `refinement_converges_to_the_minimum`). Aberrations of 0.5 to 2 typical sizes err
/// by 3e-4 (rms), noise and what they change included.
const OF_SEARCH: f64 = 1.5e-4;

/// Of effects that were not measured one by one, relative to the value: taper, index and rim of the stack in the sets of a
/// validation, and the largest of all others but the aperture and stray light.
const OF_STACK: f64 = 4e-3;
const OF_OTHERS: f64 = 2e-3;

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

    /// Of effects of a stage that were not measured one by one.
    pub const fn of_stage(stage: Stage) -> Self {
        match stage {
            Stage::Stack => Self::of_value(OF_STACK),
            Stage::Geometry | Stage::Diffraction | Stage::Source | Stage::Camera => Self::of_value(OF_OTHERS),
        }
    }

    /// As a standard deviation of a value whose typical size is given, with that of the search.
    pub fn sigma(&self, value: f64, typical: f64) -> f64 {
        let known = (self.of_typical * typical).hypot(self.of_value * value);
        known.hypot(OF_SEARCH * typical)
    }
}

#[cfg(test)]
mod tests {
    use super::super::of_any_chip;
    use super::*;

    #[test]
    fn an_error_is_never_below_that_of_the_search() {
        let relative = ValueError::of_value(1e-2);
        assert_eq!(relative.sigma(0.0, 2.0), 2.0 * OF_SEARCH);
        assert!((relative.sigma(-5.0, 2.0) / 5e-2f64.hypot(2.0 * OF_SEARCH) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn what_nobody_measured_has_the_error_of_its_stage() {
        let own = |name: &str| {
            let effects = of_any_chip();
            effects.iter().find(|e| e.name() == name).map(|e| e.value_error())
        };
        assert_eq!(own("gap"), Some(ValueError::of_value(1e-4)));
        assert_eq!(own("film_index"), Some(ValueError::of_value(OF_STACK)));
        assert_eq!(own("cd_bias_density"), Some(ValueError::of_value(OF_OTHERS)));
    }
}
