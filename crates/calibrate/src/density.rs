//! How much is written around a pillar.

use metalith_core::WidthMap;

/// Range of the backscattered electrons over which fill is averaged [um]: exp(-r^2 / range^2).
pub const RANGE_UM: f64 = 31.0;

/// Area fraction around each site, averaged with a Gaussian of [`RANGE_UM`]; row by row.
pub fn fill(pillars: &WidthMap) -> Vec<f32> {
    let lattice = pillars.lattice;
    let (n, pitch) = (lattice.sites(), lattice.pitch_um());
    let reach = (3.0 * RANGE_UM / pitch).ceil() as usize;
    let kernel: Vec<f32> = (0..=reach)
        .map(|k| (-(k as f64 * pitch / RANGE_UM).powi(2)).exp() as f32)
        .collect();
    let total = kernel[0] + 2.0 * kernel[1..].iter().sum::<f32>();
    let blur = |line: &[f32], out: &mut [f32]| {
        for (i, to) in out.iter_mut().enumerate() {
            let (from, end) = (i.saturating_sub(reach), (i + reach + 1).min(line.len()));
            *to = (from..end).map(|j| line[j] * kernel[i.abs_diff(j)]).sum::<f32>() / total;
        }
    };
    let area = |w: u16| (f64::from(w) / f64::from(lattice.pitch_nm())).powi(2) as f32;
    let drawn: Vec<f32> = pillars.width_nm.iter().map(|&w| area(w)).collect();
    let mut along_x = vec![0.0; n * n];
    for (line, to) in drawn.chunks_exact(n).zip(along_x.chunks_exact_mut(n)) {
        blur(line, to);
    }
    let mut out = vec![0.0; n * n];
    let (mut line, mut blurred) = (vec![0.0; n], vec![0.0; n]);
    for x in 0..n {
        for y in 0..n {
            line[y] = along_x[y * n + x];
        }
        blur(&line, &mut blurred);
        for y in 0..n {
            out[y * n + x] = blurred[y];
        }
    }
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
        // A quarter of the area inside; the kernel is cut at three ranges, where 1e-4 of it is left.
        assert!((at(200) - 0.25).abs() < 1e-3);
        assert!((0.5 * (at(499) + at(500)) - 0.125).abs() < 1e-3);
    }
}
