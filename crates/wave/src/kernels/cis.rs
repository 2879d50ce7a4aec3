//! exp(2 pi i x) for phases in turns, and the loops over complex samples that dominate a propagation.
//!
//! The phase is formed and reduced in double precision, where a path of thousands of wavelengths keeps
//! its fraction; sine and cosine of what is left are single precision polynomials, good to [`CIS_ERROR`].
//! Loops go through `pulp`, which picks the widest vectors of the machine at run time; none of them
//! contracts or reorders arithmetic, so every machine gets the same bits.

use num_complex::{Complex32, Complex64};

/// Largest error of the real or the imaginary part of [`cis`]: two roundings of a number of size one in single
/// precision.
pub const CIS_ERROR: f64 = 1.5e-7;

/// Adding and subtracting it rounds to an integer, and leaves that integer in the low bits of the sum.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// Taylor coefficients of sin(pi r / 2) / r and cos(pi r / 2) in r^2, |r| <= 1/2: first term left out 2e-9.
const SIN: [f32; 5] = [
    std::f32::consts::FRAC_PI_2,
    -0.645_964_1,
    0.079_692_626,
    -0.004_681_754,
    1.604_411_8e-4,
];
const COS: [f32; 6] = [
    1.0,
    -1.233_700_5,
    0.253_669_5,
    -0.020_863_48,
    9.192_602_7e-4,
    -2.520_204e-5,
];

/// exp(2 pi i turns), for |turns| up to 2^48.
#[inline(always)]
pub fn cis(turns: f64) -> Complex32 {
    let quarters = turns * 4.0;
    let shifted = quarters + ROUND;
    let quadrant = shifted.to_bits() as u32;
    let r = (quarters - (shifted - ROUND)) as f32;
    let r2 = r * r;
    let s = r * (SIN[0] + r2 * (SIN[1] + r2 * (SIN[2] + r2 * (SIN[3] + r2 * SIN[4]))));
    let c = COS[0] + r2 * (COS[1] + r2 * (COS[2] + r2 * (COS[3] + r2 * (COS[4] + r2 * COS[5]))));
    let (sin, cos) = if quadrant & 1 == 0 { (s, c) } else { (c, s) };
    Complex32 {
        re: f32::from_bits(cos.to_bits() ^ ((quadrant.wrapping_add(1) & 2) << 30)),
        im: f32::from_bits(sin.to_bits() ^ ((quadrant & 2) << 30)),
    }
}

/// `out[i] = exp(2 pi i turns[i])`.
pub fn cis_all(turns: &[f64], out: &mut [Complex32]) {
    pulp::Arch::new().dispatch(|| {
        for (o, &t) in out.iter_mut().zip(turns) {
            *o = cis(t);
        }
    });
}

/// `out[i] = exp(2 pi i turns[i])`, zero where `turns` is NaN.
pub(crate) fn cis_where(turns: &[f32], out: &mut [Complex32]) {
    pulp::Arch::new().dispatch(|| {
        for (o, &t) in out.iter_mut().zip(turns) {
            let passes = if t.is_nan() { 0.0 } else { 1.0 };
            let v = cis(if t.is_nan() { 0.0 } else { f64::from(t) });
            *o = Complex32::new(passes * v.re, passes * v.im);
        }
    });
}

/// `a[i] *= b[i]`.
pub(crate) fn multiply(a: &mut [Complex32], b: &[Complex32]) {
    pulp::Arch::new().dispatch(|| {
        for (a, b) in a.iter_mut().zip(b) {
            *a = product(*a, *b);
        }
    });
}

/// `a[i] *= b[i] * c`.
pub(crate) fn multiply_by(a: &mut [Complex32], b: &[Complex32], c: Complex32) {
    pulp::Arch::new().dispatch(|| {
        for (a, b) in a.iter_mut().zip(b) {
            *a = product(*a, product(*b, c));
        }
    });
}

/// `a[i] *= conj(b[i])`.
pub(crate) fn multiply_conj(a: &mut [Complex32], b: &[Complex32]) {
    pulp::Arch::new().dispatch(|| {
        for (a, b) in a.iter_mut().zip(b) {
            *a = product(*a, b.conj());
        }
    });
}

/// `out[i] = a[i] * b[i]`.
pub(crate) fn multiply_to(out: &mut [Complex32], a: &[Complex32], b: &[Complex32]) {
    pulp::Arch::new().dispatch(|| {
        for ((o, a), b) in out.iter_mut().zip(a).zip(b) {
            *o = product(*a, *b);
        }
    });
}

/// `out[i] = a[i] * conj(b[i]) * c`.
pub(crate) fn multiply_conj_to(out: &mut [Complex32], a: &[Complex32], b: &[Complex32], c: Complex32) {
    pulp::Arch::new().dispatch(|| {
        for ((o, a), b) in out.iter_mut().zip(a).zip(b) {
            *o = product(product(*a, b.conj()), c);
        }
    });
}

/// `sum[i] += a[i] * b[i] * c`.
pub(crate) fn accumulate(sum: &mut [Complex32], a: &[Complex32], b: &[Complex32], c: Complex32) {
    pulp::Arch::new().dispatch(|| {
        for ((s, a), b) in sum.iter_mut().zip(a).zip(b) {
            let v = product(product(*a, *b), c);
            s.re += v.re;
            s.im += v.im;
        }
    });
}

/// Sum of a[i] conj(b[i]), in an order that does not depend on the machine.
pub(crate) fn product_sum(a: &[Complex32], b: &[Complex32]) -> Complex64 {
    const LANES: usize = 16;
    let (mut re, mut im) = ([0.0f32; LANES], [0.0f32; LANES]);
    pulp::Arch::new().dispatch(|| {
        let mut add = |i: usize, a: &Complex32, b: &Complex32| {
            re[i] += a.re * b.re + a.im * b.im;
            im[i] += a.im * b.re - a.re * b.im;
        };
        let (a_lanes, b_lanes) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
        for (i, (a, b)) in a_lanes.remainder().iter().zip(b_lanes.remainder()).enumerate() {
            add(i, a, b);
        }
        for (a, b) in a_lanes.zip(b_lanes) {
            for i in 0..LANES {
                add(i, &a[i], &b[i]);
            }
        }
    });
    let sum = |lanes: &[f32]| lanes.iter().map(|v| f64::from(*v)).sum::<f64>();
    Complex64::new(sum(&re), sum(&im))
}

/// A product without the checks for infinities.
#[inline(always)]
fn product(a: Complex32, b: Complex32) -> Complex32 {
    Complex32 {
        re: a.re * b.re - a.im * b.im,
        im: a.re * b.im + a.im * b.re,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_library_far_from_zero_and_in_every_quadrant() {
        for i in -40_000..40_000 {
            let turns = f64::from(i) * 0.012_345 + 7e4;
            let got = cis(turns);
            let (s, c) = (std::f64::consts::TAU * turns.fract()).sin_cos();
            assert!((f64::from(got.re) - c).abs() < CIS_ERROR, "cos of {turns} turns");
            assert!((f64::from(got.im) - s).abs() < CIS_ERROR, "sin of {turns} turns");
        }
    }

    #[test]
    fn quarter_turns_are_exact() {
        let quarters = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)];
        for (n, want) in quarters.iter().enumerate() {
            let got = cis(n as f64 / 4.0 - 3.0);
            assert_eq!((got.re, got.im), *want);
        }
    }
}
