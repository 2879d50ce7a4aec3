//! How things end: the raised cosine, and the transform of a sharp edge.

/// From one at `share` <= 0 to zero at `share` >= 1 along half a period of a cosine.
pub fn raised_cosine(share: f64) -> f64 {
    0.5 * (1.0 + (std::f64::consts::PI * share.clamp(0.0, 1.0)).cos())
}

/// sin(pi x) / (pi x): what integration over a pixel leaves of a wave with x periods in it.
pub fn sinc(x: f64) -> f64 {
    // Below, the next term of the series is less than rounding.
    const NEAR_ZERO: f64 = 1e-9;
    let p = std::f64::consts::PI * x;
    if p.abs() < NEAR_ZERO { 1.0 } else { p.sin() / p }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        // Rounding of values of size one.
        const ROUNDING: f64 = 1e-15;
        for (share, want) in [(-1.0, 1.0), (0.0, 1.0), (0.5, 0.5), (1.0, 0.0), (2.0, 0.0)] {
            assert!((raised_cosine(share) - want).abs() < ROUNDING);
        }
        for (x, want) in [
            (0.0, 1.0),
            (0.5, std::f64::consts::FRAC_2_PI),
            (1.0, 0.0),
            (-1.5, -2.0 / 3.0 / std::f64::consts::PI),
        ] {
            assert!((sinc(x) - want).abs() < ROUNDING);
        }
    }
}
