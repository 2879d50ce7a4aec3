//! Photographs taken through a lens, restored, and compared with what was in front of it.

use metalith_core::srgb::{encoded, linear};
use ndarray::{Array3, Axis};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::camera::Blur;
use crate::error::{Result, WaveError};
use crate::restore::{Restoration, psnr_db, ssim_colour};

/// One photograph, and how well it was restored.
#[derive(Clone, Debug, PartialEq)]
pub struct Photograph {
    /// As the sensor saw it, light from 0 to 1. Shape `[row, column, colour]`.
    pub seen: Array3<f64>,
    /// Restored, sRGB from 0 to 1. Same shape.
    pub restored: Array3<f64>,
    /// Peak signal to noise ratio of the restored image, over all colours (dB).
    pub psnr_db: f64,
    /// Structural similarity of the restored image, mean over the colours.
    pub ssim: f64,
}

impl Photograph {
    /// Take a photograph of `image` (`[row, column, colour]`, sRGB from 0 to 1) through one blur a colour, with noise
    /// drawn from `seed`, and restore it with the filters of these blurs.
    ///
    /// Blur and noise act on light; images are compared in sRGB, as they are looked at.
    ///
    /// # Errors
    /// If there is not one blur for each colour, or the image is smaller than the window of the similarity.
    pub fn take(image: &Array3<f64>, blurs: &[Blur], expected: &Restoration, seed: u64) -> Result<Self> {
        if image.len_of(Axis(2)) != blurs.len() {
            return Err(WaveError::Count {
                what: "blurs",
                given: blurs.len(),
                needed: image.len_of(Axis(2)),
            });
        }
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (mut seen, mut restored) = (image.clone(), image.clone());
        for (colour, blur) in blurs.iter().enumerate() {
            let light = image.index_axis(Axis(2), colour).map(|v| linear(*v));
            let exposed = expected.noise.expose(&blur.image(&light), &mut random);
            let filtered = expected.restore(&exposed, blur);
            seen.index_axis_mut(Axis(2), colour).assign(&exposed);
            restored
                .index_axis_mut(Axis(2), colour)
                .assign(&filtered.map(|v| encoded(*v)));
        }
        Ok(Self {
            psnr_db: psnr_db(restored.view(), image.view())?,
            ssim: ssim_colour(restored.view(), image.view())?,
            seen,
            restored,
        })
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;
    use crate::camera::Noise;
    use crate::restore::Scene;

    fn image() -> Array3<f64> {
        Array3::from_shape_fn((40, 36, 3), |(y, x, c)| {
            0.5 + 0.3 * (0.4 * x as f64 + c as f64).sin() * (0.3 * y as f64).cos()
        })
    }

    fn expected(noise: Noise) -> Restoration {
        Restoration {
            scene: Scene::default(),
            noise,
            longest_pixels: 40.0,
        }
    }

    fn perfect() -> Blur {
        Blur::uniform(Array2::ones((1, 1))).unwrap()
    }

    #[test]
    fn a_perfect_lens_leaves_the_noise_alone() {
        let blurs = [perfect(), perfect(), perfect()];
        // Noise of 1e-6 on light of the size of one, through the slope of sRGB, and a margin.
        const PSNR_DB: f64 = 60.0;
        const SSIM: f64 = 0.999;
        let quiet = Noise {
            photon: 1e-12,
            read: 1e-8,
        };
        let found = Photograph::take(&image(), &blurs, &expected(quiet), 1).unwrap();
        assert!(found.psnr_db > PSNR_DB && found.ssim > SSIM, "{found:?}");
        let noise = Noise::default();
        let found = Photograph::take(&image(), &blurs, &expected(noise), 1).unwrap();
        let light = image().mapv(linear);
        let error = (&found.seen - &light).mapv(|d| d * d).mean().unwrap();
        let want = light.mapv(|v| noise.variance(v)).mean().unwrap();
        // Of 4320 numbers, five standard errors of their variance.
        const FIVE_SIGMA: f64 = 0.11;
        assert!((error / want - 1.0).abs() < FIVE_SIGMA);
        // The same seed, the same photograph.
        assert_eq!(found, Photograph::take(&image(), &blurs, &expected(noise), 1).unwrap());
    }

    #[test]
    fn each_colour_has_its_blur() {
        let blurs = [perfect(), perfect()];
        let error = Photograph::take(&image(), &blurs, &expected(Noise::default()), 1).unwrap_err();
        assert!(matches!(
            error,
            WaveError::Count {
                given: 2,
                needed: 3,
                ..
            }
        ));
    }
}
