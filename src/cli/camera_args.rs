//! Options of all commands that take pictures.

use std::path::{Path, PathBuf};

use clap::Args;
use metalith::sensor::Camera;
use metalith::{CalibratedModel, Design, Error, Result};

use super::exposure_args::ExposureArgs;
use super::paths::inputs_of;
use super::{Terminal, standard_input};

/// The chip, the camera that it is in, and the field of its scenes.
#[derive(Args)]
pub(crate) struct CameraArgs {
    /// The design of the layout: elements, wedges, cell; `-` for standard input.
    #[arg(long)]
    pub design: PathBuf,

    /// The camera file.
    #[arg(long)]
    pub camera: PathBuf,

    /// Simulate the chip as fabricated, by the `model.toml` of `metalith calibrate`.
    #[arg(long, value_name = "MODEL")]
    pub model: Option<PathBuf>,

    /// Angle from the left to the right edge of a scene (degrees).
    #[arg(long, default_value_t = 90.0)]
    pub field_deg: f64,

    #[command(flatten)]
    pub exposure: ExposureArgs,
}

/// Contents of the files of [`CameraArgs`].
pub(crate) struct CameraFiles {
    pub design: Design,
    pub camera: Camera,
    pub model: Option<CalibratedModel>,
}

/// The distance (um) that an option says in millimetres; none is far.
///
/// # Errors
/// If it is none that a scene can have.
pub(crate) fn distance_um(distance_mm: Option<f64>) -> Result<f64> {
    match distance_mm {
        None => Ok(f64::INFINITY),
        Some(mm) if mm > 0.0 => Ok(mm * 1e3),
        Some(_) => Err(Error::refused(
            "option/out-of-range",
            "the distance of the scene is not positive",
            "give a positive --distance-mm",
        )),
    }
}

impl CameraFiles {
    /// Paths of these files, and others that a command reads: what no result replaces.
    pub(crate) fn inputs<'p>(
        &'p self,
        args: &'p CameraArgs,
        others: impl IntoIterator<Item = &'p Path>,
    ) -> Vec<PathBuf> {
        let camera = self.camera.files.iter().map(PathBuf::as_path);
        let named = camera.chain(args.model.as_deref());
        inputs_of(&self.design, named.chain(others))
    }
}

impl CameraArgs {
    /// Read all files, and say what of the model pictures leave out.
    ///
    /// # Errors
    /// If one cannot be read.
    pub(crate) fn read(&self, terminal: &Terminal) -> Result<CameraFiles> {
        let model = self.model.as_deref().map(CalibratedModel::read).transpose()?;
        for quantity in model.iter().flat_map(|m| m.perturbation.not_applied()) {
            terminal.say(&quantity.to_string());
        }
        let design = standard_input::design(&self.design, terminal)?;
        model
            .iter()
            .try_for_each(|model| model.check_shape(design.cell.shape))?;
        Ok(CameraFiles {
            design,
            camera: Camera::read(&self.camera)?.stated(&self.exposure.stated())?,
            model,
        })
    }
}
