//! The transfer function of sRGB (IEC 61966-2-1): values of a picture, and the light they stand for.

/// Light from 0 to 1 of a value from 0 to 1.
pub fn linear(value: f64) -> f64 {
    if value <= 0.04045 {
        value / 12.92
    } else {
        ((value + 0.055) / 1.055).powf(2.4)
    }
}

/// Value from 0 to 1 of light, which is cut to 0 to 1.
pub fn encoded(light: f64) -> f64 {
    let light = light.clamp(0.0, 1.0);
    if light <= 0.003_130_8 {
        12.92 * light
    } else {
        1.055 * light.powf(1.0 / 2.4) - 0.055
    }
}

/// Slope of the value over light from 0 to 1.
pub fn slope(light: f64) -> f64 {
    if light <= 0.003_130_8 {
        12.92
    } else {
        1.055 / 2.4 * light.powf(1.0 / 2.4 - 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_is_that_of_differences() {
        /// A central difference over a thousandth of the light.
        const QUOTIENT: f64 = 1e-5;
        for light in [0.001, 0.01, 0.2, 0.9] {
            let step = 1e-3 * light;
            let quotient = (encoded(light + step) - encoded(light - step)) / (2.0 * step);
            assert!((quotient / slope(light) - 1.0).abs() < QUOTIENT, "{light}");
        }
    }

    #[test]
    fn one_undoes_the_other() {
        // The standard's constants meet to seven digits where the straight part ends.
        const STANDARD: f64 = 1e-7;
        for i in 0..=1000 {
            let value = f64::from(i) / 1000.0;
            assert!((encoded(linear(value)) - value).abs() < STANDARD, "{value}");
        }
        assert!(encoded(-1.0) == 0.0 && (encoded(2.0) - 1.0).abs() < STANDARD);
        // Middle grey: 21.4 % of the light, to the digits that are printed.
        const PRINTED: f64 = 5e-4;
        assert!((linear(0.5) - 0.214).abs() < PRINTED);
    }
}
