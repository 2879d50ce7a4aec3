//! A picture for the page of another report.

use std::path::Path;

use metalith_core::{Progress, Result};
use metalith_design::Design;
use metalith_optics::CalibratedModel;
use metalith_report::{Figure, fixed};
use metalith_restoration::RestorationMethod;
use metalith_sensor::Camera;

use crate::field_of_view::widest_field_deg;
use crate::forecast_scene::ForecastScene;
use crate::imaging_system::ImagingSystem;
use crate::page::pictures_side_by_side;
use crate::scene::{BuiltIn, chart};
use crate::score::scores;

/// Pixels an axis of the scene.
const PIXELS: usize = 512;
/// Angle from its left to its right edge (degrees), or less where the array does not see as much.
const MOST_DEG: u32 = 80;
/// Seed of the noise.
const SEED: u64 = 1;

/// Scene, frame and picture of a Siemens star in the camera of a layout, by Tikhonov and all elements. The star fills 80 degrees,
/// or the widest field that the array sees.
///
/// # Errors
/// As [`ImagingSystem::open`] and [`ImagingSystem::restore`]; if the camera does not see the chip.
pub fn thumbnail(
    design: &Design,
    layout: &Path,
    camera: &Camera,
    model: Option<&CalibratedModel>,
    progress: &dyn Progress,
) -> Result<Figure> {
    let field_deg = widest_field_deg(design, camera, PIXELS, MOST_DEG)?;
    let scene = chart(BuiltIn::Star, PIXELS, field_deg, f64::INFINITY);
    let system = ImagingSystem::open(design, layout, camera, model, &scene, progress)?;
    let frame = system.record(&system.simulation(), &scene, SEED)?;
    let operator = system.restoration();
    let error = ForecastScene::new(&system, &operator).operator_error;
    let picture = system.restore(&operator, &error, &frame, RestorationMethod::Tikhonov, true, progress)?;
    let truth = system.truth(&scene);
    let names = camera.channel_names();
    let whole = scores(&picture, &truth)?[0];
    Ok(pictures_side_by_side(&truth, &frame, &picture, &names).caption(format!(
        "What `{}` takes of a Siemens star over {field_deg} degrees, far away, and what is restored from this frame: PSNR {} dB, SSIM {}. `metalith picture` says more.",
        camera.name,
        fixed(whole.psnr_db, 1),
        fixed(whole.ssim, 2)
    )))
}
