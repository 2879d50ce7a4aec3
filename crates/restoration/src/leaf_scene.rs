//! Random scenes of objects that hide one another, as in photographs.

use ndarray::Array2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use crate::frame_model::Planes;
use crate::scene_statistics::{MEAN_LIGHT, SceneStatistics};

/// Points along an axis of a pixel.
const POINTS: usize = 4;
/// Radius of the smallest leaf (pixels): finer ones are grey in a pixel.
const SMALLEST: f64 = 0.35;
/// Radius of the largest leaf over the shorter side: each cell of a forecast has edges.
const LARGEST: f64 = 1.0 / 12.0;
/// Deviation of the logarithm of the light of a leaf, that of the other planes of colour in proportion.
const DEVIATION: f64 = 0.75;
/// Share of the points that may stay without a leaf.
const BARE: f64 = 5e-4;

impl SceneStatistics {
    /// A scene of round leaves of one light each that hide one another (dead leaves: Lee, Mumford and Huang, Int. J. Comput. Vis. 41,
    /// 35 (2001)): planes of the picture, light from 0 to 1.
    ///
    /// The density of radii falls as 1 / r^3, so the scene looks the same at all sizes and its power falls as 1 / f^2. Detail stands at
    /// edges, where [`SceneStatistics::random_scene`] has as much of it everywhere.
    pub fn leaf_scene(&self, shape: (usize, usize), seed: u64) -> Planes {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (rows, columns) = (shape.0 * POINTS, shape.1 * POINTS);
        let smallest = SMALLEST * POINTS as f64;
        let largest = (LARGEST * rows.min(columns) as f64).max(2.0 * smallest);
        let inverse_squares = [smallest, largest].map(|r: f64| 1.0 / (r * r));
        // The first leaf that covers a point is the nearest; which one it is, by number plus one.
        let mut leaf_of = Array2::<u32>::zeros((rows, columns));
        let mut light: Vec<Vec<f32>> = vec![vec![MEAN_LIGHT; self.planes()]];
        let mut bare = rows * columns;
        while bare as f64 > BARE * (rows * columns) as f64 {
            let share: f64 = random.random();
            let radius = (inverse_squares[0] - share * (inverse_squares[0] - inverse_squares[1]))
                .sqrt()
                .recip();
            let mut place = |n: usize| random.random_range(-radius..n as f64 + radius);
            let [y, x] = [place(rows), place(columns)];
            let planes = (0..self.planes()).map(|_| {
                let normal: f64 = random.sample(StandardNormal);
                Array2::from_elem((1, 1), (DEVIATION * normal) as f32)
            });
            let logarithms = self.of_unit_grey(&planes.collect::<Planes>());
            let mean = -0.5 * (DEVIATION * DEVIATION) as f32;
            light.push(
                logarithms
                    .iter()
                    .map(|l| (MEAN_LIGHT * (l[[0, 0]] + mean).exp()).min(1.0))
                    .collect(),
            );
            let number = (light.len() - 1) as u32;
            let from = |centre: f64| (centre - radius).ceil().max(0.0) as usize;
            let to = |centre: f64, n: usize| ((centre + radius).floor() + 1.0).clamp(0.0, n as f64) as usize;
            for iy in from(y)..to(y, rows) {
                let half = (radius * radius - (iy as f64 - y).powi(2)).max(0.0).sqrt();
                let (first, end) = (
                    (x - half).ceil().max(0.0) as usize,
                    ((x + half).floor() + 1.0).clamp(0.0, columns as f64) as usize,
                );
                for ix in first..end {
                    let leaf = &mut leaf_of[[iy, ix]];
                    if *leaf == 0 {
                        *leaf = number;
                        bare -= 1;
                    }
                }
            }
        }
        let plane = |c: usize| {
            Array2::from_shape_fn(shape, |(y, x)| {
                let points = (0..POINTS * POINTS).map(|k| leaf_of[[y * POINTS + k / POINTS, x * POINTS + k % POINTS]]);
                points.map(|leaf| light[leaf as usize][c]).sum::<f32>() / (POINTS * POINTS) as f32
            })
        };
        (0..self.planes()).map(plane).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leaves_have_the_light_of_scenes_and_their_edges() {
        /// Deviation of the mean of some hundred leaves that can be seen.
        const MEAN: f32 = 0.05;
        let scene = SceneStatistics::colours().leaf_scene((120, 90), 3);
        assert_eq!((scene.len(), scene[0].dim()), (3, (120, 90)));
        assert!(scene.iter().flatten().all(|v| (0.0..=1.0).contains(v)));
        for plane in &scene {
            assert!((plane.mean().unwrap() - MEAN_LIGHT).abs() < MEAN, "{:?}", plane.mean());
        }
        // Differences of neighbours are few and large: their fourth moment is far over the three of a normal one.
        let differences = scene[1].rows().into_iter().flat_map(|row| {
            let pairs = row.to_vec();
            pairs.windows(2).map(|w| f64::from(w[1] - w[0])).collect::<Vec<_>>()
        });
        let (mut second, mut fourth, mut n) = (0.0, 0.0, 0.0);
        for d in differences {
            (second, fourth, n) = (second + d * d, fourth + d.powi(4), n + 1.0);
        }
        assert!(
            fourth * n / (second * second) > 6.0,
            "{}",
            fourth * n / (second * second)
        );
        assert_eq!(scene, SceneStatistics::colours().leaf_scene((120, 90), 3));
        assert_ne!(scene, SceneStatistics::colours().leaf_scene((120, 90), 4));
    }
}
