//! Tapers: the fade, and the transform of a sharp edge.

/// Fade from one at `share` <= 0 to zero at `share` >= 1: the polynomial of seventh degree whose first three
/// derivatives vanish at both ends. A raised cosine, whose second derivative jumps, lets through 1 % of the noise of a
/// bench more.
#[inline(always)]
pub fn fade(share: f32) -> f32 {
    let s = share.clamp(0.0, 1.0);
    let s2 = s * s;
    1.0 - s2 * s2 * (35.0 + s * (-84.0 + s * (70.0 - 20.0 * s)))
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
            assert_eq!(fade(share), want);
        }
        // Three derivatives vanish at the beginning: near it the polynomial is 1 - 35 s^4. The end mirrors it.
        const NEAR: f32 = 0.01;
        assert!((f64::from(1.0 - fade(NEAR)) - 35e-8).abs() < f64::from(f32::EPSILON));
        // Rounding of four terms of up to 84 in single precision.
        const TERMS: f32 = 1e-5;
        for share in [NEAR, 0.2, 0.37, 0.5, 0.81] {
            assert!((fade(share) + fade(1.0 - share) - 1.0).abs() < TERMS);
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
