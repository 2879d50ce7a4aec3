//! Jones matrices in circular polarisation.

use num_complex::Complex64;

/// A Jones matrix `[out][in]` of fields along x (0) and y (1), in circular polarisation: `[out][in]`, 0 for (x + i y) / sqrt 2,
/// 1 for (x - i y) / sqrt 2. With exp(-i w t) and a wave along +z the first is left circular seen against the light.
///
/// An element that is rotated by an angle about its axis, and apart from that alone, converts 0 to 1 with twice that angle as
/// phase (`[1][0]`), and 1 to 0 with minus twice; what it does not convert keeps its phase (M. Berry, J. Mod. Opt. 34, 1401
/// (1987)).
pub fn circular(jones: [[Complex64; 2]; 2]) -> [[Complex64; 2]; 2] {
    let sign = |circular: usize| if circular == 0 { 1.0 } else { -1.0 };
    let unit = |circular: usize| [Complex64::ONE, Complex64::new(0.0, sign(circular))];
    let entry = |out: usize, input: usize| -> Complex64 {
        let (left, right) = (unit(out), unit(input));
        let products = [0, 1].map(|a| [0, 1].map(|b| left[a].conj() * jones[a][b] * right[b]));
        0.5 * products.iter().flatten().sum::<Complex64>()
    };
    [0, 1].map(|out| [0, 1].map(|input| entry(out, input)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A few products of numbers of size one.
    const ROUNDING: f64 = 1e-15;

    #[test]
    fn a_rotated_half_wave_plate_converts_with_twice_its_angle() {
        for angle in [0.0_f64, 0.3, 1.2, 2.9] {
            let (s, c) = (2.0 * angle).sin_cos();
            let plate = [[c, s], [s, -c]].map(|row| row.map(Complex64::from));
            let found = circular(plate);
            assert!((found[1][0] - Complex64::cis(2.0 * angle)).norm() < ROUNDING);
            assert!((found[0][1] - Complex64::cis(-2.0 * angle)).norm() < ROUNDING);
            assert!(found[0][0].norm() < ROUNDING && found[1][1].norm() < ROUNDING);
        }
    }
}
