//! Gridding: how a site is spread over the cells around it, and what undoes that in the window.

use std::f64::consts::{PI, TAU};

use metalith_wave::kernels::fade;

use super::geometry::SitePair;

/// Cells an axis that a site is spread over.
pub(super) const SPREAD: usize = 4;
/// Part of the window that is used, 1 / 1.25 of it. The rest keeps aliases of the gridding, which are of
/// exp(-pi SPREAD sqrt(1 - 1 / 1.25)) = 4e-3 of the field at the edge of that part, away from it.
pub(crate) const USED: f64 = 0.8;
/// Shape of the spreading kernel exp(SHAPE (sqrt(1 - (z / 2)^2) - 1)), 0.97 pi SPREAD (1 - USED / 2)
/// (Barnett, Magland, af Klinteberg 2019).
const SHAPE: f64 = 0.97 * PI * SPREAD as f64 * (1.0 - 0.5 * USED);
/// Samples a cell of the tabulated spreading kernel.
const SAMPLES: usize = 512;

/// The kernel that sites are spread with, tabulated from its middle to its end.
pub(super) struct Spreading {
    table: Vec<f32>,
}

impl Spreading {
    pub(super) fn new() -> Self {
        let count = SPREAD / 2 * SAMPLES;
        let table = (0..=count + 1)
            .map(|i| spreading(i as f64 / SAMPLES as f64) as f32)
            .collect();
        Self { table }
    }

    /// First cell of those that a place is spread over, and their weights.
    fn weights(&self, at: f64) -> (i32, [f32; SPREAD]) {
        let first = first_cell(at);
        let mut weights = [0.0; SPREAD];
        for (i, weight) in weights.iter_mut().enumerate() {
            let z = ((first + i as f64 - at).abs() * SAMPLES as f64) as f32;
            let low = z as usize;
            let part = z - low as f32;
            *weight = self.table[low] + part * (self.table[low + 1] - self.table[low]);
        }
        (first as i32, weights)
    }

    /// Visit every cell at y >= 0 that a site and its mirror image touch.
    pub(super) fn spread(
        &self,
        site: &SitePair,
        first_x: i32,
        cells: (usize, usize),
        mut visit: impl FnMut(usize, f32),
    ) {
        let (n_x, w_x) = self.weights(site.q.0);
        let (n_y, w_y) = self.weights(site.q.1);
        for (j, w_y) in w_y.iter().enumerate() {
            let y = n_y + j as i32;
            for y in [y, -y] {
                if (0..cells.1 as i32).contains(&y) {
                    let base = y as usize * cells.0 + (n_x - first_x) as usize;
                    for (i, w_x) in w_x.iter().enumerate() {
                        visit(base + i, w_x * w_y);
                    }
                }
            }
        }
    }
}

/// First cell of those that a place is spread over.
pub(super) fn first_cell(at: f64) -> f64 {
    (at - 0.5 * SPREAD as f64).ceil()
}

/// exp(SHAPE (sqrt(1 - (z / 2)^2) - 1)) within two cells, zero outside.
fn spreading(z: f64) -> f64 {
    let inside = 1.0 - (2.0 * z / SPREAD as f64).powi(2);
    if inside < 0.0 {
        0.0
    } else {
        (SHAPE * (inside.sqrt() - 1.0)).exp()
    }
}

/// Weights by distance from the middle of the window in samples, 0 to size / 2: one over the squared transform of the
/// spreading kernel, times a fade to zero at the end of the part that is used.
pub(super) fn intensity_weights(size: usize) -> Vec<f32> {
    /// Midpoint rule; the kernel is smooth but for steps of exp(-SHAPE) at its ends.
    const POINTS: u32 = 400;
    /// Place where the fade begins, as part of the window's half.
    const FADE: f64 = 0.9 * USED;
    (0..=size / 2)
        .map(|m| {
            let x = m as f64 / size as f64;
            let step = SPREAD as f64 / f64::from(POINTS);
            let transform = (0..POINTS)
                .map(|i| -0.5 * SPREAD as f64 + (f64::from(i) + 0.5) * step)
                .map(|z| spreading(z) * (TAU * z * x).cos())
                .sum::<f64>()
                * step;
            let faded = f64::from(fade(((2.0 * x - FADE) / (USED - FADE)) as f32));
            (faded / transform.powi(2)) as f32
        })
        .collect()
}
