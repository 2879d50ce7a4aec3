//! A random smooth surface, and the light that rays bent by it bring to the sensor.

use ndarray::Array2;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use super::DiffuserSpec;

/// Heights between random numbers on a grid, by cubic B-splines: slopes and curvatures are continuous.
pub(crate) struct RoughSurface {
    numbers: Array2<f64>,
    grain_um: f64,
    /// Distance beyond the opening at which rays may land (um): four standard deviations of their way.
    border_um: f64,
}

/// Rays of a pixel along each axis.
const RAYS: usize = 4;
/// Root mean square over all places of the second derivative along one axis, for random numbers of deviation one, a grid of
/// one: of both splines, the integrals 8/3 and 151/315.
const BEND: f64 = 1.130_6;
/// Index of the substrate and the resist that such surfaces are made of, where the power is stated (550 nm).
const INDEX: f64 = 1.46;
/// Root mean square of the first derivative, as [`BEND`]: the integrals 2/3 and 151/315.
const SLOPE: f64 = 0.565_3;
/// More than the index less one of fused silica in visible light.
const MOST_BENT: f64 = 0.5;

impl RoughSurface {
    /// Surface with an opening of this height and width (um).
    pub(crate) fn new(spec: &DiffuserSpec, opening_um: [f64; 2]) -> Self {
        let [rows, columns] = opening_um.map(|um| (um / spec.grain_um).ceil() as usize + 4);
        let mut random = ChaCha8Rng::seed_from_u64(spec.seed);
        // Curvature times (n - 1) times the distance is the power.
        let curvature = spec.power / (spec.distance_um * (INDEX - 1.0));
        let height = curvature * spec.grain_um.powi(2) / BEND;
        let numbers = Array2::from_shape_simple_fn((rows, columns), || {
            let number: f64 = StandardNormal.sample(&mut random);
            height * number
        });
        Self {
            numbers,
            grain_um: spec.grain_um,
            border_um: 4.0 * spec.distance_um * MOST_BENT * SLOPE * height / spec.grain_um,
        }
    }

    /// Pixels of this size around the opening that rays may land on.
    pub(crate) fn border(&self, pixel_um: f64) -> usize {
        (self.border_um / pixel_um).ceil() as usize
    }

    /// Slope along y and along x at a place from the first corner of the opening (um).
    fn slope(&self, y_um: f64, x_um: f64) -> [f64; 2] {
        let (i, wy, dy) = spline(y_um / self.grain_um);
        let (j, wx, dx) = spline(x_um / self.grain_um);
        let mut slope = [0.0; 2];
        for a in 0..4 {
            for b in 0..4 {
                let number = self.numbers[[i + a, j + b]];
                slope[0] += number * dy[a] * wx[b];
                slope[1] += number * wy[a] * dx[b];
            }
        }
        slope.map(|s| s / self.grain_um)
    }

    /// Share of the light of the opening in each pixel below it, for rays that land by `bent_um` times the slope from where
    /// they passed: the distance times the index less one. `opening` is in pixels; the grid is wider by a border on all
    /// sides, and its middle is that of the opening.
    pub(crate) fn caustic(&self, opening: [usize; 2], pixel_um: f64, bent_um: f64) -> Array2<f32> {
        let [rows, columns] = opening;
        let border = self.border(pixel_um);
        let shape = (rows + 2 * border, columns + 2 * border);
        let share = 1.0 / (rows * columns * RAYS * RAYS) as f32;
        let at = |i: usize| (i as f64 + 0.5) / RAYS as f64;
        let landed: Vec<(usize, usize)> = (0..rows * RAYS)
            .into_par_iter()
            .flat_map_iter(|i| {
                (0..columns * RAYS).filter_map(move |j| {
                    let (y, x) = (at(i), at(j));
                    let slope = self.slope(y * pixel_um, x * pixel_um);
                    let to = |from: f64, s: f64, n: usize| {
                        let place = (from + border as f64 + bent_um * s / pixel_um).floor();
                        (place >= 0.0 && place < n as f64).then_some(place as usize)
                    };
                    Some((to(y, slope[0], shape.0)?, to(x, slope[1], shape.1)?))
                })
            })
            .collect();
        let mut light = Array2::zeros(shape);
        for at in landed {
            light[at] += share;
        }
        light
    }
}

/// The first of four numbers at a place of the grid, their weights, and the slopes of these.
fn spline(place: f64) -> (usize, [f64; 4], [f64; 4]) {
    let i = place.floor().max(0.0);
    let t = place - i;
    let (s, t2, t3) = (1.0 - t, t * t, t * t * t);
    let weights = [
        s * s * s / 6.0,
        (3.0 * t3 - 6.0 * t2 + 4.0) / 6.0,
        (-3.0 * t3 + 3.0 * t2 + 3.0 * t + 1.0) / 6.0,
        t3 / 6.0,
    ];
    let slopes = [-0.5 * s * s, 1.5 * t2 - 2.0 * t, -1.5 * t2 + t + 0.5, 0.5 * t2];
    (i as usize, weights, slopes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_surface_has_its_power_and_keeps_the_light() {
        /// Tolerance of a mean over some hundred bumps.
        const DRAW: f64 = 0.1;
        let spec = DiffuserSpec {
            grain_um: 40.0,
            ..DiffuserSpec::standard()
        };
        let surface = RoughSurface::new(&spec, [1600.0, 1600.0]);
        let (mut sum, h) = (0.0, 0.5);
        for k in 0..10_000usize {
            let (y, x) = (8.0 + 15.7 * (k / 100) as f64, 8.0 + 15.7 * (k % 100) as f64);
            let bend = (surface.slope(y, x + h)[1] - surface.slope(y, x - h)[1]) / (2.0 * h);
            sum += (bend * spec.distance_um * (INDEX - 1.0)).powi(2);
        }
        let power = (sum / 1e4).sqrt();
        assert!((power / spec.power - 1.0).abs() < DRAW, "{power}");
        let caustic = surface.caustic([270, 270], 5.86, spec.distance_um * 0.46);
        let light: f32 = caustic.iter().sum();
        // Rays beyond four standard deviations of their way, and beyond the border of the surface, are lost.
        assert!((light - 1.0).abs() < 1e-3, "{light}");
        let most = caustic.iter().copied().fold(0.0, f32::max) * (270.0 * 270.0);
        assert!(most > 5.0, "bright lines: {most}");
    }
}
