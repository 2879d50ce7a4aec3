//! Density: area that is exposed around a pillar.

use metalith_pillars::{PillarId, PillarMap, PillarShape};
use rayon::prelude::*;

/// Range of the backscattered electrons over which fill is averaged where a model states none (um): exp(-r^2 / range^2).
pub const RANGE_UM: f64 = 31.0;

/// Ranges after which the Gaussian is cut: 1e-4 of it is left.
const CUT_RANGES: f64 = 3.0;

/// Rows or columns that a task copies at once: a few cache lines of either side.
const STRIP: usize = 16;

/// Area fraction of pillars of a shape around each site, averaged with a Gaussian of a range (um). Row by row, `sites * sites`
/// values, each between 0 and 1; what is around the lattice counts as empty.
pub fn fill(pillars: &PillarMap, shape: PillarShape, range_um: f64) -> Vec<f32> {
    let lattice = pillars.lattice;
    let n = lattice.sites();
    let steps_nm = lattice.steps_nm();
    // Of the place in the grid of the lattice: beside each pillar of a hexagonal one is an empty place.
    let area = |w: u16| match shape.has_width() {
        true => (f64::from(w) / steps_nm[0] * (f64::from(w) / steps_nm[1]) * shape.area_share()) as f32,
        false if w == 0 => 0.0,
        false => (shape.area_nm2(PillarId(w)) / (steps_nm[0] * steps_nm[1])) as f32,
    };
    let mut plane: Vec<f32> = pillars.number.iter().map(|&w| area(w)).collect();
    // Rows, then columns as the rows of the transposed plane.
    for step_um in lattice.steps_um() {
        blur_rows(&mut plane, n, &kernel(step_um, range_um));
        plane = transposed(&plane, n);
    }
    plane
}

/// The Gaussian from its middle on, a step of the lattice's grid apart; with its other half it adds up to one.
fn kernel(step_um: f64, range_um: f64) -> Vec<f32> {
    let reach = (CUT_RANGES * range_um / step_um).ceil() as usize;
    let kernel: Vec<f32> = (0..=reach)
        .map(|k| (-(k as f64 * step_um / range_um).powi(2)).exp() as f32)
        .collect();
    let total = kernel[0] + 2.0 * kernel[1..].iter().sum::<f32>();
    kernel.into_iter().map(|k| k / total).collect()
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
    use metalith_pillars::{Lattice, LatticeKind};

    #[test]
    fn fill_is_the_share_of_area_inside_and_half_of_it_at_an_edge() {
        let mut map = PillarMap::empty(Lattice::new(350, 1000).unwrap());
        for iy in 0..1000 {
            for ix in 0..500 {
                map.number[[iy, ix]] = 175;
            }
        }
        let fill = fill(&map, PillarShape::Square, RANGE_UM);
        let at = |ix: usize| f64::from(fill[500 * 1000 + ix]);
        // What the cut of the kernel leaves out, and a step of the lattice at the edge.
        const CUT: f64 = 1e-3;
        assert!((at(200) - 0.25).abs() < CUT);
        assert!((0.5 * (at(499) + at(500)) - 0.125).abs() < CUT);
    }

    #[test]
    fn fill_of_a_hexagonal_lattice_is_the_share_of_its_cells() {
        let lattice = Lattice::of_kind_covering(LatticeKind::Hexagonal, 300_000, 600).unwrap();
        let mut map = PillarMap::empty(lattice);
        let n = lattice.sites();
        // Half of the lattice: what is to the left of its middle.
        for (iy, ix) in (0..n * n).map(|k| (k / n, k % n)).filter(|(_, ix)| *ix < n / 2) {
            if lattice.has(ix, iy) {
                map.number[[iy, ix]] = 300;
            }
        }
        let fill = fill(&map, PillarShape::Circle, RANGE_UM);
        let share = 0.25 * std::f64::consts::PI * 0.09 / lattice.cell_um2();
        // What the cut of the kernel leaves out, and a step of the lattice at the edge.
        const CUT: f64 = 2e-3;
        let middle = n / 2;
        for (ix, iy, want) in [
            (middle / 2, middle, share),
            (middle, middle, 0.5 * share),
            (middle / 2, middle + 1, share),
        ] {
            let got = f64::from(fill[iy * n + ix]);
            assert!((got - want).abs() < CUT, "{ix} {iy}: {got}, not {want}");
        }
    }

    #[test]
    fn fill_is_the_direct_sum_at_single_sites() {
        let mut map = PillarMap::empty(Lattice::new(350, 70).unwrap());
        for (i, w) in map.number.iter_mut().enumerate() {
            *w = (i * 7919 % 200) as u16;
        }
        let fill = fill(&map, PillarShape::Square, RANGE_UM);
        let along = |k: i64| (-(k as f64 * 0.35 / RANGE_UM).powi(2)).exp();
        let reach = (CUT_RANGES * RANGE_UM / 0.35).ceil() as i64;
        // Sums over a few hundred taps in single precision, three times: along both axes and in the norm.
        const SINGLE: f64 = 1e-5;
        let total: f64 = (-reach..=reach).map(along).sum();
        for (x, y) in [(0, 0), (31, 5), (69, 40)] {
            let sum: f64 = map
                .number
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
