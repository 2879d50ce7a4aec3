//! Errors of the values of effects besides the cell, as measured.
//!
//! Those of effects are root mean square errors in sets without noise whose cells are solved with 15 orders and whose spectra,
//! layouts and planes are sampled otherwise than in fits, of no effect and of one of 0.8 and 1.5 typical sizes: `metalith calibrate
//! SET --validate --noiseless --orders 15 --nulls 1 --trial defocus=0.8 --trial defocus=-1.5 ...`. What the cell explains is left out.

use metalith_attribution::ValueError;

use super::Stage;

/// Error of effects that were not measured one by one, relative to the value: taper, index and rim of the stack in the sets of a
/// validation, and the largest of all others but the aperture and stray light.
const OF_STACK: f64 = 4e-3;
const OF_OTHERS: f64 = 2e-3;

/// The error of the values of effects of a stage that were not measured one by one.
pub(crate) const fn value_error_of(stage: Stage) -> ValueError {
    match stage {
        Stage::Stack => ValueError::of_value(OF_STACK),
        Stage::Geometry | Stage::Diffraction | Stage::Source | Stage::Camera => ValueError::of_value(OF_OTHERS),
    }
}

#[cfg(test)]
mod tests {
    use super::super::of_any_chip;
    use super::*;

    #[test]
    fn what_nobody_measured_has_the_error_of_its_stage() {
        let own = |name: &str| {
            let effects = of_any_chip();
            effects.iter().find(|e| e.name() == name).map(|e| e.value_error())
        };
        assert_eq!(own("defocus"), Some(ValueError::of_value(1e-4)));
        assert_eq!(own("film_index"), Some(ValueError::of_value(OF_STACK)));
        assert_eq!(own("cd_bias_density"), Some(ValueError::of_value(OF_OTHERS)));
    }
}
