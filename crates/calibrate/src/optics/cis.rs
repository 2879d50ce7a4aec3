//! exp(2 pi i turns), written so that compilers vectorise it.

use num_complex::Complex32;

/// exp(2 pi i turns) to single precision; the turns are reduced in double precision first.
#[inline(always)]
pub fn cis(turns: f64) -> Complex32 {
    // To the nearest quarter: |x| <= 1/8 turn, and the quarter says which of sine and cosine is which. Adding
    // and taking away 1.5 * 2^52 rounds, and leaves the whole number in the lowest bits on the way.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let shifted = 4.0 * turns + ROUND;
    let quarter = shifted.to_bits() as u32;
    let x = ((turns - 0.25 * (shifted - ROUND)) * std::f64::consts::TAU) as f32;
    let x2 = x * x;
    let sin = x * (1.0 + x2 * (-0.166_666_67 + x2 * (8.333_33e-3 + x2 * -1.984_1e-4)));
    let cos = 1.0 + x2 * (-0.5 + x2 * (0.041_666_67 + x2 * (-1.388_889e-3 + x2 * 2.480_2e-5)));
    let odd = quarter & 1 == 1;
    let (re, im) = if odd { (sin, cos) } else { (cos, sin) };
    // Real parts are negative in the second and third quarter, imaginary ones in the third and fourth.
    let flip_re = ((quarter + 1) & 2) << 30;
    let flip_im = (quarter & 2) << 30;
    Complex32::new(
        f32::from_bits(re.to_bits() ^ flip_re),
        f32::from_bits(im.to_bits() ^ flip_im),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first term that the sine's polynomial leaves out, at an eighth of a turn, and rounding.
    const ROUNDING: f32 = 6e-7;

    #[test]
    fn is_the_unit_circle() {
        for k in -2000..2000 {
            let turns = f64::from(k) * 0.001_37 + 12_345.0;
            let want = num_complex::Complex64::cis(std::f64::consts::TAU * turns.fract());
            let got = cis(turns);
            let miss = (f64::from(got.re) - want.re).hypot(f64::from(got.im) - want.im);
            assert!(miss < f64::from(ROUNDING), "{turns}: {got} is not {want}");
        }
    }
}
