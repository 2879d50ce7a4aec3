//! Scores of pictures under each approximation of such cameras, which show what the approximation is worth.

use metalith_core::{Progress, Result};
use metalith_design::Design;
use metalith_restoration::RestorationMethod;
use metalith_sensor::{Camera, Channel, ChannelSampling, Exposure, Illuminant, LightLevel, Response, SceneLight};
use serde::Serialize;

use crate::approximation_set::{ApproximationSet, PATCH};
use crate::forecast_scene::ForecastScene;
use crate::imaging_system::ImagingSystem;
use crate::kernel_cache::KernelCache;
use crate::kernel_plan::KernelPlan;
use crate::scene::SceneImage;
use crate::score::{ZoneScore, scores};
use crate::stray_light::StrayLight;

/// A camera of the same kind whose channels count one wavelength each, their mean (um), and as much of it as they counted of
/// all light.
pub fn without_dispersion(camera: &Camera, channels: &[ChannelSampling]) -> Camera {
    let channel_um: Vec<f64> = channels.iter().map(ChannelSampling::mean_um).collect();
    // In light of equal energy a channel counts so many photons for each nm.
    let counted: Vec<f64> = channels
        .iter()
        .zip(&channel_um)
        .map(|(c, um)| c.parts.iter().map(|p| p.weight).sum::<f64>() / um)
        .collect();
    let most = counted.iter().copied().fold(0.0, f64::max);
    let line = |(channel, (um, counted)): (&Channel, (&f64, &f64))| {
        let nm = um * 1e3;
        Channel {
            name: channel.name.clone(),
            response: Response::Band {
                band_nm: [nm - 0.5, nm + 0.5],
                efficiency: counted / most,
            },
        }
    };
    let lines = camera.channels.iter().zip(channel_um.iter().zip(&counted));
    Camera {
        channels: lines.map(line).collect(),
        // A mean may lie between two lamps.
        illuminant: Illuminant::EqualEnergy,
        exposure: Exposure {
            light: SceneLight {
                // As many electrons, from a band 1 nm wide: a thousandth of a um.
                level: Some(LightLevel::StandingFor {
                    spectral: camera.spectral_radiance() * most * 1e-3,
                    lux: camera.illuminance_lux(),
                    radiance: camera.radiance_w_m2_sr(),
                }),
                ..camera.exposure.light
            },
            ..camera.exposure
        },
        ..camera.clone()
    }
}

/// A picture as it would be if something that is assumed were so.
#[derive(Clone, Debug, Serialize)]
pub struct AssumedScore {
    /// Assumption in words.
    pub assumption: &'static str,
    pub scores: Vec<ZoneScore>,
    /// Error of the operator of the restoration, by channel.
    pub operator_error: Vec<f64>,
}

/// Scores of a scene under the paper's assumptions: none of them, each alone, and all; joint and by Tikhonov. `narrow` is
/// the same imaging system with one wavelength a channel.
///
/// # Errors
/// If no light reaches the sensor, or the user stopped it.
pub fn worth_of_assumptions(
    system: &ImagingSystem,
    narrow: &ImagingSystem,
    scene: &SceneImage,
    seed: u64,
    progress: &dyn Progress,
) -> Result<Vec<AssumedScore>> {
    let none = ApproximationSet::default();
    let fixed = ApproximationSet {
        fixed_kernels: true,
        ..none
    };
    let fading = ApproximationSet {
        butterworth: true,
        ..none
    };
    let clear = ApproximationSet {
        no_stray_light: true,
        ..none
    };
    let patches = ApproximationSet {
        patch_pixels: Some(PATCH),
        ..none
    };
    let all = ApproximationSet::paper();
    let cases = [
        ("none: all of the physics", system, none),
        ("one kernel for each element and colour", system, fixed),
        ("brightness by a Butterworth filter", system, fading),
        ("one wavelength for each colour", narrow, none),
        ("no stray light", system, clear),
        ("patches of 420 x 420 pixels", system, patches),
        ("all of them: the setting of the paper", narrow, all),
    ];
    cases
        .into_iter()
        .map(|(assumption, system, assumed)| {
            let system = system.assuming(assumed)?;
            let frame = system.record(&system.simulation_of(scene), scene, seed)?;
            let operator = system.restoration();
            let error = ForecastScene::new(&system, &operator).operator_error;
            let picture = system.restore(&operator, &error, &frame, RestorationMethod::Tikhonov, true, progress)?;
            Ok(AssumedScore {
                assumption,
                scores: scores(&picture, &system.truth(scene))?,
                operator_error: error.overall,
            })
        })
        .collect()
}

impl ImagingSystem {
    /// This system with other assumptions, and the exposure that suits them.
    ///
    /// # Errors
    /// If no light reaches the sensor.
    pub fn assuming(&self, assumed: ApproximationSet) -> Result<Self> {
        let stray_light = if assumed.no_stray_light {
            StrayLight::none(&self.camera.sensor, self.channels.len(), self.bank.bases)
        } else {
            self.stray_light.clone()
        };
        let mut other = self.clone();
        (other.assumed, other.stray_light) = (assumed, stray_light);
        other.exposed()
    }

    /// The imaging system of the same chip and scene with a camera that has no dispersion.
    ///
    /// # Errors
    /// As [`ImagingSystem::open`].
    pub fn open_without_dispersion(
        &self,
        design: &Design,
        layout: &std::path::Path,
        model: Option<&metalith_optics::CalibratedModel>,
        scene: &SceneImage,
        cache: &KernelCache,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let camera = without_dispersion(&self.camera, &self.channels);
        let plan = KernelPlan::new(design, &camera, scene)?.for_wide_bands();
        Self::open_planned(plan, design, layout, model, cache, progress)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_without_dispersion_counts_one_wavelength_a_channel() {
        let camera = Camera::three_bands(5.86);
        let all = camera.sampling([400.0, 700.0], 12.5).unwrap();
        let narrow = without_dispersion(&camera, &all.channels);
        let sampling = narrow.sampling([400.0, 700.0], 12.5).unwrap();
        let counted = |c: &ChannelSampling| c.parts.iter().map(|p| p.weight).sum::<f64>();
        for (k, middle) in [450.0, 550.0, 650.0].into_iter().enumerate() {
            // Photons of equal energy are as many as the wavelength is long: the mean of a band of 100 nm is beyond its middle.
            let nm = middle + 100f64.powi(2) / (12.0 * middle);
            let parts = &sampling.channels[k].parts;
            assert!(parts.iter().all(|p| p.nm.iter().all(|v| (v - nm).abs() < 0.51)));
            // The balance of the channels stays: sums over parts 1 nm wide.
            let ratio = |of: &[ChannelSampling]| counted(&of[k]) / counted(&of[0]);
            assert!((ratio(&sampling.channels) / ratio(&all.channels) - 1.0).abs() < 1e-6);
            // Both leave out thousandths at the ends of a band.
            let electrons =
                [(&narrow, &sampling), (&camera, &all)].map(|(c, s)| c.electrons_per_s(counted(&s.channels[k])));
            assert!((electrons[0] / electrons[1] - 1.0).abs() < 5e-3, "{electrons:?}");
        }
    }
}
