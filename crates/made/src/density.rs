//! How much is exposed around a pillar.

use metalith_core::WidthMap;
use rayon::prelude::*;

/// Range of the backscattered electrons over which fill is averaged (um): exp(-r^2 / range^2).
pub const RANGE_UM: f64 = 31.0;

/// Ranges after which the Gaussian is cut: 1e-4 of it is left.
const CUT_RANGES: f64 = 3.0;

/// Rows or columns that a task copies at once: a few cache lines of either side.
const STRIP: usize = 16;

/// Area fraction around each site, averaged with a Gaussian of [`RANGE_UM`]. Row by row, `sites * sites`
/// values, each between 0 and 1; what is around the lattice counts as empty.
pub fn fill(pillars: &WidthMap) -> Vec<f32> {
    let lattice = pillars.lattice;
    let (n, pitch) = (lattice.sites(), lattice.pitch_um());
    let reach = (CUT_RANGES * RANGE_UM / pitch).ceil() as usize;
    let kernel: Vec<f32> = (0..=reach)
        .map(|k| (-(k as f64 * pitch / RANGE_UM).powi(2)).exp() as f32)
        .collect();
    let total = kernel[0] + 2.0 * kernel[1..].iter().sum::<f32>();
    let kernel: Vec<f32> = kernel.into_iter().map(|k| k / total).collect();
    let area = |w: u16| (f64::from(w) / f64::from(lattice.pitch_nm())).powi(2) as f32;
    let mut plane: Vec<f32> = pillars.width_nm.iter().map(|&w| area(w)).collect();
    // Rows, then columns as the rows of the transposed plane.
    for _ in 0..2 {
        blur_rows(&mut plane, n, &kernel);
        plane = transposed(&plane, n);
    }
    plane
}

/// Convolve each row with a symmetric kernel, given from its middle on; zeros beyond the ends.
fn blur_rows(plane: &mut [f32], n: usize, kernel: &[f32]) {
    let reach = kernel.len() - 1;
    plane.par_chunks_exact_mut(n).for_each_init(
        || vec![0.0; n + 2 * reach],
        |padded, line| {
            padded[reach..reach + n].copy_from_slice(line);
            line.fill(0.0);
            // One tap over the whole line at a time: a loop that compilers vectorise.
            for (k, weight) in kernel.iter().enumerate() {
                let (left, right) = (&padded[reach - k..][..n], &padded[reach + k..][..n]);
                let share = if k == 0 { 0.5 * weight } else { *weight };
                for ((to, a), b) in line.iter_mut().zip(left).zip(right) {
                    *to += share * (a + b);
                }
            }
        },
    );
}

fn transposed(plane: &[f32], n: usize) -> Vec<f32> {
    let mut out = vec![0.0; n * n];
    out.par_chunks_mut(STRIP * n).enumerate().for_each(|(strip, rows)| {
        for y in 0..n {
            for (i, row) in rows.chunks_exact_mut(n).enumerate() {
                row[y] = plane[y * n + strip * STRIP + i];
            }
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_core::Lattice;

    #[test]
    fn fill_is_the_share_of_area_inside_and_half_of_it_at_an_edge() {
        let mut map = WidthMap::empty(Lattice::new(350, 1000).unwrap());
        for iy in 0..1000 {
            for ix in 0..500 {
                map.width_nm[[iy, ix]] = 175;
            }
        }
        let fill = fill(&map);
        let at = |ix: usize| f64::from(fill[500 * 1000 + ix]);
        // What the cut of the kernel leaves out, and a step of the lattice at the edge.
        const CUT: f64 = 1e-3;
        assert!((at(200) - 0.25).abs() < CUT);
        assert!((0.5 * (at(499) + at(500)) - 0.125).abs() < CUT);
    }

    #[test]
    fn fill_is_the_direct_sum_at_single_sites() {
        let mut map = WidthMap::empty(Lattice::new(350, 70).unwrap());
        for (i, w) in map.width_nm.iter_mut().enumerate() {
            *w = (i * 7919 % 200) as u16;
        }
        let fill = fill(&map);
        let along = |k: i64| (-(k as f64 * 0.35 / RANGE_UM).powi(2)).exp();
        let reach = (CUT_RANGES * RANGE_UM / 0.35).ceil() as i64;
        // Sums over a few hundred taps in single precision, three times: along both axes and in the norm.
        const SINGLE: f64 = 1e-5;
        let total: f64 = (-reach..=reach).map(along).sum();
        for (x, y) in [(0, 0), (31, 5), (69, 40)] {
            let sum: f64 = map
                .width_nm
                .indexed_iter()
                .map(|((iy, ix), w)| {
                    let area = (f64::from(*w) / 350.0).powi(2);
                    area * along(ix as i64 - x) * along(iy as i64 - y) / (total * total)
                })
                .sum();
            let got = f64::from(fill[(y * 70 + x) as usize]);
            assert!((got - sum).abs() < SINGLE * sum, "{got} is not {sum}");
        }
    }
}
