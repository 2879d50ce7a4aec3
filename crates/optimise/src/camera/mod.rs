//! A whole camera: elements before a sensor, judged by what is restored of their images together.

mod design_text;
mod diameters;
mod efficiency;
mod element;
mod lbfgs;
mod light;
mod model;
mod pupil;
mod readable;
mod report;
mod scene;
mod search;
mod task;
#[cfg(test)]
mod tests;
mod tried_cameras;
mod wiener;

pub use efficiency::efficiency;
pub use element::{CameraElement, POWERS, RADIAL, TERMS};
pub use light::{CameraLight, ChannelLight, Efficiency};
pub use model::{CameraModel, FieldPart, Judged, ModelSettings, WINDOW_UM};
pub use report::{CameraReport, CameraRow};
pub use scene::NaturalScene;
pub use search::{Arrangement, CameraStart};
pub use task::{CameraFindings, CameraTask, TriedCamera};
pub use tried_cameras::TriedCameras;
