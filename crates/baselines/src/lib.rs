//! Cameras side by side: the same scenes, sensor, exposure and noise, behind different optics.
//!
//! ```text
//! a camera that is ready, photographs  ->  ComparedCamera: scores by method and zone, CPU seconds
//! all of them                          ->  ComparisonResult: a table in Markdown, a page, JSON
//! ```
//!
//! | question | file |
//! | --- | --- |
//! | what a camera must be able to do | `baseline_camera` |
//! | the chip of a design before its sensor | `array` |
//! | what cameras without a lens have in common | `lensless` |
//! | a mask that is a product of two sequences | `flatcam/` |
//! | the caustic of a random surface | `diffusercam/` |
//! | learnt last stages, what they are trained by, and pictures by Wiener filters for one of them | `post_processing`, `provenance`, `training_stacks` (feature `training`), `wiener` |
//! | which cameras, from their files | `comparison` |
//! | scores of all photographs | `compare` |
//! | the table, the page | `table`, `page` |

mod array;
mod baseline_camera;
mod compare;
mod comparison;
mod diffusercam;
mod flatcam;
mod lensless;
mod page;
mod post_processing;
mod provenance;
mod table;
#[cfg(feature = "training")]
mod training_stacks;
mod wiener;

pub use array::ArrayCamera;
pub use baseline_camera::{BaselineCamera, Method};
pub use compare::{ComparedCamera, ComparisonResult, MethodScores, compare};
pub use comparison::{Comparison, ExposureTimes, Lensless, ListedDesign, OpenComparison};
pub use diffusercam::{DiffuserCam, DiffuserSpec};
pub use flatcam::{FlatCam, MaskSpec};
pub use page::write_comparison;
pub use post_processing::{Stage, StageKind};
#[cfg(feature = "training")]
pub use training_stacks::{TrainedStage, TrainingStacks};
