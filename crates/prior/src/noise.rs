//! Noise for what a denoiser is tried on.

use ndarray::Array3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// A picture with independent normal noise.
pub fn with_noise(clean: &Array3<f32>, deviation: f32, seed: u64) -> Array3<f32> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    clean.mapv(|v| {
        let noise: f32 = StandardNormal.sample(&mut random);
        v + deviation * noise
    })
}
