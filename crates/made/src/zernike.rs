//! Zernike polynomials over a lens, in Noll's order and normalised to an rms of one.

use metalith_core::Lattice;

/// First polynomial of the free term: a bench does not see piston and tilts, and defocus is a gap.
pub const FIRST: u32 = 5;

/// Radial order and azimuthal frequency of Noll's polynomial `j`; negative for sines.
fn noll(j: u32) -> (u32, i32) {
    let mut n = 0;
    while (n + 1) * (n + 2) / 2 < j {
        n += 1;
    }
    // Within an order, frequencies rise from n's parity, each but zero twice; even j is a cosine.
    let place = j - n * (n + 1) / 2 - 1;
    let m = if n.is_multiple_of(2) {
        place.div_ceil(2) * 2
    } else {
        (place / 2) * 2 + 1
    };
    (n, if j.is_multiple_of(2) { m as i32 } else { -(m as i32) })
}

/// The polynomial at a place of the unit disc.
pub fn value(j: u32, x: f64, y: f64) -> f64 {
    let (n, m) = noll(j);
    let r = x.hypot(y);
    let a = m.unsigned_abs();
    let factorial = |k: u32| (1..=k).map(f64::from).product::<f64>();
    let radial: f64 = (0..=(n - a) / 2)
        .map(|k| {
            let sign = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
            sign * factorial(n - k) / (factorial(k) * factorial((n + a) / 2 - k) * factorial((n - a) / 2 - k))
                * r.powi((n - 2 * k) as i32)
        })
        .sum();
    let angle = f64::from(a) * y.atan2(x);
    let norm = f64::from(n + 1).sqrt();
    match m {
        0 => norm * radial,
        m if m > 0 => norm * 2f64.sqrt() * radial * angle.cos(),
        _ => norm * 2f64.sqrt() * radial * angle.sin(),
    }
}

/// Optical path (um) on the sites of a lattice, for coefficients (nm) from [`FIRST`] on; zero outside.
pub fn map(coefficients_nm: &[f64], lattice: Lattice, radius_um: f64) -> Vec<f32> {
    let n = lattice.sites();
    (0..n * n)
        .map(|site| {
            let (x, y) = (
                lattice.coordinate_um(site % n) / radius_um,
                lattice.coordinate_um(site / n) / radius_um,
            );
            if x * x + y * y > 1.0 {
                return 0.0;
            }
            let sum: f64 = coefficients_nm
                .iter()
                .zip(FIRST..)
                .filter(|(c, _)| **c != 0.0)
                .map(|(c, j)| c * value(j, x, y))
                .sum();
            (sum * 1e-3) as f32
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_are_orthonormal_over_the_disc() {
        let grid = 200;
        let mut products = [[0.0; 12]; 12];
        let mut count = 0.0;
        for i in 0..grid * grid {
            let at = |k: i32| (f64::from(k) + 0.5) / f64::from(grid) * 2.0 - 1.0;
            let (x, y) = (at(i % grid), at(i / grid));
            if x * x + y * y > 1.0 {
                continue;
            }
            count += 1.0;
            let z: Vec<f64> = (1..=12).map(|j| value(j, x, y)).collect();
            for (a, row) in products.iter_mut().enumerate() {
                for (b, p) in row.iter_mut().enumerate() {
                    *p += z[a] * z[b];
                }
            }
        }
        // Midpoints of 200 x 200 squares cut the rim of the disc roughly.
        const RIM: f64 = 0.02;
        for (a, row) in products.iter().enumerate() {
            for (b, p) in row.iter().enumerate() {
                let want = f64::from(u8::from(a == b));
                assert!((p / count - want).abs() < RIM, "{} {}: {}", a + 1, b + 1, p / count);
            }
        }
        // Astigmatism along the axes, coma along x: polynomials of numbers below ten.
        const ROUNDING: f64 = 1e-12;
        assert!((value(6, 1.0, 0.0) - 6f64.sqrt()).abs() < ROUNDING);
        assert!((value(8, 1.0, 0.0) - 8f64.sqrt()).abs() < ROUNDING);
    }
}
