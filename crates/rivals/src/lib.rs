//! Cameras side by side: the same scenes, sensor, exposure and noise, behind different optics.
//!
//! ```text
//! a camera that is ready, photographs  ->  ComparedCamera: scores by method and zone, CPU seconds
//! all of them                          ->  Comparison: a table in Markdown, a page, JSON
//! ```
//!
//! | question | file |
//! | --- | --- |
//! | what a camera must be able to do | `contender` |
//! | the chip of a design before its sensor | `array` |
//! | what cameras without a lens have in common | `lensless` |
//! | a mask that is a product of two sequences | `flatcam/` |
//! | the caustic of a random surface | `diffusercam/` |
//! | learnt last stages, what they are taught by, and pictures by Wiener filters for one of them | `stage`, `teaching`, `wiener` |
//! | which cameras, from their files | `lineup` |
//! | scores of all photographs | `compare` |
//! | the table, the page | `table`, `page` |

mod array;
mod compare;
mod contender;
mod cpu;
mod diffusercam;
mod flatcam;
mod lensless;
mod lineup;
mod page;
mod stage;
mod table;
mod teaching;
mod wiener;

pub use array::ArrayCamera;
pub use compare::{ComparedCamera, Comparison, WayScores, compare};
pub use contender::{Contender, Way};
pub use diffusercam::{DiffuserCam, DiffuserSpec};
pub use flatcam::{FlatCam, MaskSpec};
pub use lineup::{Lensless, Lineup, ListedDesign, OpenLineup};
pub use page::write_comparison;
pub use stage::{Stage, StageKind};
