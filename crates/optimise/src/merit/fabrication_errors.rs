//! Errors of fabrication, drawn.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::merit::focus::FabricationError;
use metalith_cell::{CellStack, CellTable, RigorousCell, TableSpec};
use metalith_core::{Progress, Result};
use metalith_design::RobustSpec;

/// Film heights that have their own table, in standard deviations; draws go to the nearest. The
/// nominal one is the cell that a design is optimised with, the first.
const HEIGHTS: [f64; 5] = [0.0, -2.0, -1.0, 1.0, 2.0];

/// The rigorous cell at film heights off the nominal one, in the order that [`draw`] counts them after the
/// nominal cell.
///
/// Nine orders (median phase error 0.011 rad) and a tolerance of 0.03 between wavelengths: for an
/// expectation over widths that are 6 nm off, a fifth of the time of the design's own table.
///
/// # Errors
/// As [`CellTable::obtain`].
pub fn cells_off_height(
    nominal: &TableSpec,
    robust: &RobustSpec,
    cache: Option<&std::path::Path>,
    progress: &dyn Progress,
) -> Result<Vec<RigorousCell>> {
    HEIGHTS[1..]
        .iter()
        .map(|sigmas| {
            let spec = TableSpec {
                stack: CellStack {
                    height_nm: nominal.stack.height_nm * (1.0 + sigmas * robust.height),
                    ..nominal.stack.clone()
                },
                tolerance: 0.03,
                orders: 9,
                ..nominal.clone()
            };
            Ok(RigorousCell::new(CellTable::obtain(&spec, cache, progress)?.0))
        })
        .collect()
}

/// Draw errors: normal, beyond three standard deviations cut. `cells` is the number of cells at hand;
/// with one only, the height stays nominal.
pub fn draw(robust: &RobustSpec, count: usize, cells: usize, seed: u64) -> Vec<FabricationError> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    (0..count)
        .map(|_| {
            let mut normal = || {
                // Box and Muller.
                let (a, b) = (1.0 - random.random::<f64>(), random.random::<f64>());
                ((-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()).clamp(-3.0, 3.0)
            };
            let (bias, height, gap) = (normal(), normal(), normal());
            let cell = (0..HEIGHTS.len().min(cells))
                .min_by(|&a, &b| (HEIGHTS[a] - height).abs().total_cmp(&(HEIGHTS[b] - height).abs()))
                .unwrap_or(0);
            FabricationError {
                width_bias_nm: robust.width_bias_nm * bias,
                cell: if robust.height > 0.0 { cell } else { 0 },
                defocus_um: robust.defocus_um * gap,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_have_the_deviations_asked_for() {
        /// Tolerance of four thousand draws: four standard errors of a standard deviation, and the cut and the grid of
        /// heights.
        const TOLERANCE: f64 = 0.06;
        let robust = RobustSpec {
            width_bias_nm: 6.0,
            height: 0.02,
            defocus_um: 10.0,
            draws: 1,
        };
        let drawn = draw(&robust, 4000, 5, 7);
        let deviation = |value: &dyn Fn(&FabricationError) -> f64| {
            (drawn.iter().map(|e| value(e).powi(2)).sum::<f64>() / drawn.len() as f64).sqrt()
        };
        assert!((deviation(&|e| e.width_bias_nm) / 6.0 - 1.0).abs() < TOLERANCE);
        assert!((deviation(&|e| e.defocus_um) / 10.0 - 1.0).abs() < TOLERANCE);
        assert!((deviation(&|e| HEIGHTS[e.cell]) - 1.0).abs() < TOLERANCE);
        assert!(draw(&robust, 100, 1, 7).iter().all(|e| e.cell == 0));
        assert_eq!(drawn, draw(&robust, 4000, 5, 7));
    }
}
