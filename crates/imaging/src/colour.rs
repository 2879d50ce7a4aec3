//! Channels of a camera and colours of a picture.

use metalith_sensor::ChannelSampling;
use nalgebra::DMatrix;
use ndarray::{Array2, Array3};

use crate::scene::SceneImage;
use crate::spectra::{SceneSpectrum, rgb_basis};

/// Image of a scene by an ideal camera with the channels of this one: light of each channel at each place, the light of
/// a white surface being one.
#[derive(Clone, Debug)]
pub struct ChannelColours {
    /// Linear sRGB (rows) from the light of each channel (columns), where the camera has colours.
    to_rgb: Option<DMatrix<f64>>,
}

/// Share of a channel's light that a spectrum reflects.
pub(crate) fn share(channel: &ChannelSampling, spectrum: &SceneSpectrum) -> f64 {
    let sums = channel.parts.iter().fold((0.0, 0.0), |(a, b), p| {
        (a + p.weight * spectrum.at(0.5 * (p.nm[0] + p.nm[1])), b + p.weight)
    });
    sums.0 / sums.1
}

/// Channels whose colours are closer than this to one another cannot be distinguished.
const COLOURS: f64 = 1e-3;

impl ChannelColours {
    /// Colours of the channels of a camera in its light.
    pub fn of(channels: &[ChannelSampling]) -> Self {
        let from_rgb = DMatrix::from_fn(channels.len(), 3, |c, b| share(&channels[c], &rgb_basis()[b]));
        let singular = from_rgb.clone().svd(false, false).singular_values;
        let colours = channels.len() >= 3 && singular.min() > COLOURS * singular.max();
        let to_rgb = colours.then(|| from_rgb.pseudo_inverse(0.0).expect("a threshold that is not negative"));
        Self { to_rgb }
    }

    /// True if pictures have colours; else they are grey, the mean of all channels.
    pub fn has_colours(&self) -> bool {
        self.to_rgb.is_some()
    }

    /// Ideal light of each channel.
    pub fn ideal(channels: &[ChannelSampling], scene: &SceneImage) -> Vec<Array2<f32>> {
        let one = |channel: &ChannelSampling| {
            let mut sum = Array2::<f32>::zeros((scene.view.rows, scene.view.columns));
            for (spectrum, plane) in scene.basis.iter().zip(&scene.planes) {
                sum.scaled_add(share(channel, spectrum) as f32, plane);
            }
            sum
        };
        channels.iter().map(one).collect()
    }

    /// Linear sRGB `[row, column, colour]` of the light of each channel.
    pub fn rgb(&self, light: &[Array2<f32>]) -> Array3<f64> {
        let (rows, columns) = light[0].dim();
        Array3::from_shape_fn((rows, columns, 3), |(y, x, c)| match &self.to_rgb {
            Some(to) => light
                .iter()
                .enumerate()
                .map(|(k, l)| to[(c, k)] * f64::from(l[[y, x]]))
                .sum(),
            None => light.iter().map(|l| f64::from(l[[y, x]])).sum::<f64>() / light.len() as f64,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_sensor::Camera;

    #[test]
    fn colours_come_back_from_channels() {
        // Sums over some hundred parts in double precision, planes in single.
        const SINGLE: f64 = 1e-5;
        let camera = Camera::three_bands(5.86);
        let sampling = camera.sampling([400.0, 700.0], 12.5).unwrap();
        let colours = ChannelColours::of(&sampling.channels);
        assert!(colours.has_colours());
        let rgb = Array3::from_shape_fn((16, 16, 3), |(y, x, c)| ((y * 3 + x * 5 + c * 7) % 11) as f64 / 11.0);
        let scene = SceneImage::of_rgb("", &rgb, 60.0, f64::INFINITY);
        let light = ChannelColours::ideal(&sampling.channels, &scene);
        let back = colours.rgb(&light);
        assert!((&back - &rgb).iter().all(|d| d.abs() < SINGLE));
        let white = scene.white();
        let light = ChannelColours::ideal(&sampling.channels, &white);
        assert!(light.iter().flatten().all(|v| (f64::from(*v) - 1.0).abs() < SINGLE));
        assert!(!ChannelColours::of(&sampling.channels[..1]).has_colours());
    }
}
