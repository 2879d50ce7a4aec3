//! A camera with a mask in place of a lens, whose frame is a product: rows of the mask act on columns of the scene, columns
//! on rows (Asif et al., IEEE Trans. Comput. Imaging 3, 384 (2017)).
//!
//! The mask is open where both of two sequences of maximum length are. Its shadow is that of diffraction along the normal,
//! wavelength by wavelength, and moves with the direction of arrival. What a restoration knows is one shadow for each channel,
//! of a grey surface.

mod mask;
mod tikhonov;

use metalith_core::{Progress, Result};
use metalith_imaging::scene::SceneImage;
use metalith_imaging::{Frame, SceneView};
use metalith_restoration::SceneStatistics;
use metalith_sensor::Camera;
use nalgebra::DMatrix;
use ndarray::{Array2, Axis, Slice};
use rayon::prelude::*;

use crate::lensless::{Lensless, LenslessBench};
use crate::post_processing::{PICTURES, Stage, StageKind};
pub use mask::MaskSpec;
use mask::Shadow;
use tikhonov::{Factor, TwoFactors};

/// Distance of the wavelengths that shadows are simulated at (nm).
const STEP_NM: f64 = 25.0;
/// Strengths of the prior that are tried on a random scene: powers of ten from the first to the last, relative to the
/// largest singular value, in steps.
const STRENGTHS: ([f64; 2], usize) = ([-9.0, -1.0], 17);
/// Strengths of the pictures that the learnt last stage sees, over the chosen one: that one first. What it does with them is a filter of
/// separate singular values, as these pictures can be added with any weights.
const STAGE_STRENGTHS: [f64; PICTURES] = [1.0, 0.1, 10.0, 0.01, 100.0];
/// Seed of the random scene and of its noise.
const SEED: u64 = 1;

/// A mask before a sensor, ready for scenes of one size and field.
pub struct FlatCam {
    bench: LenslessBench,
    /// Shadows by wavelength: along rows and along columns of the frame, `[pixel, place of the scene]`.
    shadows: Vec<[Array2<f32>; 2]>,
    /// Systems by channel, for each place of its pixels in the square of two by two.
    systems: Vec<Vec<([usize; 2], TwoFactors)>>,
    /// Strength of the prior by channel.
    strength: Vec<f64>,
    stage: Option<Stage>,
}

impl FlatCam {
    /// Camera of a mask before the sensor of a camera. The strength of the prior is chosen on a random scene, not on
    /// those that will be taken.
    ///
    /// # Errors
    /// If the camera distinguishes no colours, the scene is near, a decomposition fails, or the user stopped it.
    pub fn new(mask: &MaskSpec, camera: &Camera, view: SceneView, progress: &dyn Progress) -> Result<Self> {
        let bench = LenslessBench::new(camera, view, STEP_NM)?;
        let [rows, columns] = bench.frame();
        let pixel = camera.sensor.pixel_um;
        let places = |n: usize, place: fn(&SceneView, f64) -> f64| -> Vec<f64> {
            (0..n).map(|i| place(&view, i as f64)).collect()
        };
        let tangents_y = places(view.rows, |v, i| v.tangents(i, 0.0)[1]);
        let tangents_x = places(view.columns, |v, i| v.tangents(0.0, i)[0]);
        let reach = rows.max(columns) as f64 * pixel + 2.0 * mask.distance_um * tangents_x[0].hypot(tangents_y[0]);
        mask.check_reach(reach)?;
        progress.begin("shadows of the mask", bench.sampling.wavelengths_nm.len() as u64);
        let both = |shadow: &Shadow| {
            [
                shadow.on_pixels(rows, pixel, &tangents_y, view.pixel()),
                shadow.on_pixels(columns, pixel, &tangents_x, view.pixel()),
            ]
        };
        let patterns: Vec<Shadow> = bench
            .sampling
            .wavelengths_nm
            .par_iter()
            .map(|nm| {
                let shadow = mask.shadow(nm * 1e-3, reach);
                progress.advance(1);
                shadow
            })
            .collect();
        let shadows: Vec<[Array2<f32>; 2]> = patterns
            .par_iter()
            .map(|s| both(s).map(|m| Array2::from_shape_fn(m.shape(), |at| m[at] as f32)))
            .collect();
        progress.begin("singular values of the mask", bench.channels() as u64);
        let systems = (0..bench.channels())
            .into_par_iter()
            .map(|channel| {
                let known = both(&Shadow::mean(&patterns, &bench.grey_weights(channel)));
                let found = bench
                    .places(channel)
                    .into_iter()
                    .map(|[r, c]| {
                        let own = |m: &DMatrix<f64>, first: usize| Factor::new(m, first);
                        Ok(([r, c], TwoFactors::new(own(&known[0], r)?, own(&known[1], c)?)))
                    })
                    .collect::<Result<Vec<_>>>();
                progress.advance(1);
                found
            })
            .collect::<Result<Vec<_>>>()?;
        progress.check_stopped()?;
        let mut camera = Self {
            bench,
            shadows,
            systems,
            strength: Vec::new(),
            stage: None,
        };
        let white = camera.light(&camera.bench.white());
        // Light is the mean over the pixels of the scene of what each sends through the mask.
        let solid_angle = (view.rows * view.columns) as f64 * view.pixel().powi(2);
        camera.bench = camera.bench.exposed(&white, pixel * pixel * solid_angle)?;
        camera.strength = camera.chosen_strengths();
        Ok(camera)
    }

    /// This camera with a learnt last stage behind it.
    #[must_use]
    pub fn with_stage(mut self, stage: Option<Stage>) -> Self {
        self.stage = stage;
        self
    }

    /// Strength by channel that restores a random scene best.
    fn chosen_strengths(&self) -> Vec<f64> {
        let scene = self
            .bench
            .scene_of(SceneStatistics::colours().random_scene(self.bench.shape(), SEED));
        let frame = self.bench.record(&self.light(&scene), SEED);
        let truth = self.bench.ideal(&scene);
        let light = frame.recorded_light(&self.bench.camera);
        let ([first, last], steps) = STRENGTHS;
        let tried: Vec<f64> = (0..steps)
            .map(|k| 10f64.powf(first + (last - first) * k as f64 / (steps - 1) as f64))
            .collect();
        (0..self.bench.channels())
            .into_par_iter()
            .map(|c| {
                let error = |sent: Array2<f32>| -> f64 {
                    let picture = self.bench.unsent(&[sent]).remove(0);
                    let off = picture.iter().zip(&truth[c]);
                    off.map(|(a, b)| f64::from(a - b).powi(2)).sum()
                };
                let errors = self.solved(c, &light[c], &tried).into_iter().map(error);
                let best = errors.zip(&tried).min_by(|a, b| a.0.total_cmp(&b.0));
                best.map_or(tried[0], |(_, strength)| *strength)
            })
            .collect()
    }

    /// Sent light of a channel, the mean over the places of its pixels, for each strength.
    fn solved(&self, channel: usize, light: &Array2<f32>, strengths: &[f64]) -> Vec<Array2<f32>> {
        let view = &self.bench.view;
        let places = &self.systems[channel];
        let mut sums = vec![Array2::<f32>::zeros((view.rows, view.columns)); strengths.len()];
        for ([row, column], system) in places {
            let mut own = light.view();
            own.slice_axis_inplace(Axis(0), Slice::new(*row as isize, None, 2));
            own.slice_axis_inplace(Axis(1), Slice::new(*column as isize, None, 2));
            let solved = system.solve(&own, strengths);
            sums.iter_mut().zip(&solved).for_each(|(sum, own)| *sum += own);
        }
        let scale = (view.rows * view.columns) as f32 / places.len() as f32;
        sums.into_iter().map(|sum| sum.mapv(|v| v * scale)).collect()
    }

    /// Light of each channel sent by the scene, by relative strength.
    fn sent_by(&self, frame: &Frame, relative: &[f64], progress: &dyn Progress) -> Vec<Vec<Array2<f32>>> {
        progress.begin("restoring", self.bench.channels() as u64);
        let light = frame.recorded_light(&self.bench.camera);
        let by_channel: Vec<Vec<Array2<f32>>> = light
            .par_iter()
            .enumerate()
            .map(|(c, l)| {
                let strengths: Vec<f64> = relative.iter().map(|r| r * self.strength[c]).collect();
                let own = self.solved(c, l, &strengths);
                progress.advance(1);
                own
            })
            .collect();
        let one = |k: usize| by_channel.iter().map(|own| own[k].clone()).collect();
        (0..relative.len()).map(one).collect()
    }
}

impl Lensless for FlatCam {
    fn bench(&self) -> &LenslessBench {
        &self.bench
    }

    fn method(&self) -> &'static str {
        "tikhonov"
    }

    fn light(&self, scene: &SceneImage) -> Vec<Array2<f32>> {
        let [rows, columns] = self.bench.frame();
        let scale = ((scene.view.rows * scene.view.columns) as f32).recip();
        let sent: Vec<Array2<f32>> = scene.planes.iter().map(|p| self.bench.sent(p)).collect();
        let channels = self.bench.channels();
        let weights: Vec<Vec<Vec<f64>>> = (0..channels)
            .map(|c| scene.basis.iter().map(|b| self.bench.weights(c, b)).collect())
            .collect();
        let nothing = || vec![Array2::<f32>::zeros((rows, columns)); channels];
        self.shadows
            .par_iter()
            .enumerate()
            .map(|(i, [down, across])| {
                let mut frames = nothing();
                for (frame, own) in frames.iter_mut().zip(&weights) {
                    let mut light = Array2::<f32>::zeros((scene.view.rows, scene.view.columns));
                    for (plane, w) in sent.iter().zip(own) {
                        light.scaled_add(w[i] as f32 * scale, plane);
                    }
                    if own.iter().any(|w| w[i] != 0.0) {
                        *frame = down.dot(&light).dot(&across.t());
                    }
                }
                frames
            })
            // In the order of the wavelengths, whoever was first.
            .collect::<Vec<_>>()
            .into_iter()
            .fold(nothing(), |mut sum, frames| {
                sum.iter_mut().zip(&frames).for_each(|(s, f)| *s += f);
                sum
            })
    }

    fn sent(&self, frame: &Frame, progress: &dyn Progress) -> Result<Vec<Array2<f32>>> {
        Ok(self.sent_by(frame, &[1.0], progress).remove(0))
    }

    fn stage_kind(&self) -> StageKind {
        StageKind::FlatNet
    }

    fn stage(&self) -> Option<&Stage> {
        self.stage.as_ref()
    }

    fn stage_light(&self, frame: &Frame, progress: &dyn Progress) -> Result<Vec<Vec<Array2<f32>>>> {
        Ok(self.sent_by(frame, &STAGE_STRENGTHS, progress))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baseline_camera::BaselineCamera;
    use crate::lensless::of_one_wavelength;
    use crate::lensless::tests::small;
    use metalith_core::Silent;
    use metalith_imaging::scores;

    #[test]
    fn a_picture_comes_out_of_the_shadows_of_a_mask() {
        /// A flat picture of the right brightness has 14 dB.
        const LEAST_DB: f64 = 20.0;
        let (camera, scene) = small(48, 300, 260);
        let mask = MaskSpec::standard();
        let flat = FlatCam::new(&mask, &camera, scene.view, &Silent).unwrap();
        let frame = flat.record(&scene, 1).unwrap();
        let picture = flat.restore(&frame, 0, &Silent).unwrap();
        let found = scores(&picture, &flat.truth(&scene)).unwrap()[0];
        assert!(found.psnr_linear_db > LEAST_DB, "{found:?}");
        assert!(flat.record(&small(40, 300, 260).1, 1).is_err());
        // The first picture of the last stage is this one, the others are of other strengths.
        let all = flat.pictures(&frame, StageKind::FlatNet, &Silent).unwrap();
        assert!(all.len() == PICTURES && all[0] == picture && all[1] != picture);
        assert!(flat.pictures(&frame, StageKind::Blending, &Silent).is_err());
    }

    /// Pixels at full scale count as they were recorded: zero in their place would be black holes in bright places of the frame.
    #[test]
    fn a_frame_that_is_too_bright_in_places_is_undone() {
        /// A picture of a frame whose brightest tenth is at full scale, against one with zero there.
        const GAINED_DB: f64 = 5.0;
        let (mut camera, scene) = small(48, 300, 260);
        let camera_of = |camera: &Camera| FlatCam::new(&MaskSpec::standard(), camera, scene.view, &Silent).unwrap();
        let frame = camera_of(&camera).record(&scene, 1).unwrap();
        let mut brightest: Vec<f32> = frame.planes[0].iter().copied().collect();
        brightest.sort_by(f32::total_cmp);
        camera.exposure.white *= f64::from(frame.full / brightest[brightest.len() * 9 / 10]);
        let flat = camera_of(&camera);
        let frame = flat.record(&scene, 1).unwrap();
        assert!(
            (0.05..0.2).contains(&frame.saturated_share()),
            "{}",
            frame.saturated_share()
        );
        let mut dark = frame.clone();
        dark.planes[0].mapv_inplace(|v| if v < frame.full { v } else { 0.0 });
        let [found, dark] = [frame, dark].map(|frame| {
            let picture = flat.restore(&frame, 0, &Silent).unwrap();
            scores(&picture, &flat.truth(&scene)).unwrap()[0].psnr_linear_db
        });
        println!("{found} dB, {dark} dB with zero");
        assert!(found > dark + GAINED_DB, "{found} {dark}");
    }

    /// Restoration with one wavelength a colour: the shadow that the restoration knows is the one that was cast.
    #[test]
    fn a_mask_is_undone_better_without_dispersion() {
        let (camera, scene) = small(48, 300, 260);
        let psnr_db = |camera: &Camera| {
            let flat = FlatCam::new(&MaskSpec::standard(), camera, scene.view, &Silent).unwrap();
            let picture = flat.restore(&flat.record(&scene, 1).unwrap(), 0, &Silent).unwrap();
            scores(&picture, &flat.truth(&scene)).unwrap()[0].psnr_linear_db
        };
        let (narrow, broad) = (psnr_db(&of_one_wavelength(&camera).unwrap()), psnr_db(&camera));
        assert!(narrow > broad, "{narrow} {broad}");
    }
}
