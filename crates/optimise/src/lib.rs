//! The radial phase that all elements share, optimised ring by ring.
//!
//! ```text
//! Design -> OptimiseTask -> (cells) -> kernels -> Exchange, BlockExchange or Adam -> Optimised -> phase table, OptimiseReport
//! ```
//!
//! The field of one lens at one wavelength and angle is linear in the complex transmission of its
//! [`Rings`]. Two kernels are built once from the real sites of the lattice: that of the field at a few
//! points on or near the axis ([`Lens::focal_rows`], [`FieldProblem`]) and that of the field over a wide
//! window about the chief ray ([`Pupil`], [`Deconvolution`]). Both are an [`Objective`].
//!
//! [`Exchange`] sets one ring after the other to the best of all widths there are, which takes a merit that
//! is cheap to change one ring at a time: that of a few points. [`BlockExchange`] moves many rings at once
//! and takes any objective. [`Adam`] climbs an objective's gradient. All keep the [`StepLimit`] from ring to
//! ring at all times, since a cell's transmission is that of a lattice of its like.
//!
//! Merits are such that larger is better: the mean Strehl ratio (`sum`, the paper's first stage), the mean
//! of its logarithm (`log`), less the energy in side lobes (`side_lobes`), less the expected error of
//! restored images (`deconvolution`), any weighted sum, and the expectation of the first three over errors
//! of fabrication (`robust`).

pub mod camera;
mod cells;
mod image;
mod merit;
mod page;
mod problem;
mod rings;
mod run;
mod solvers;
mod strehl_gain;

pub use cells::TaskCells;
pub use image::deconvolution::Deconvolution;
pub use image::pupil::Pupil;
pub use image::scene::Scene;
pub use image::views::Views;
pub use image::window::PixelWindow;
pub use merit::fabrication_errors::{cells_off_height, draw};
pub use merit::field::{FieldProblem, MeritKind};
pub use merit::field_point::{Condition, FieldPoint};
pub use merit::focus::{FabricationError, Lens, Strehl, judging_wavelengths, wavelengths};
pub use merit::objective::{Objective, Sum};
pub use merit::spectrum::OverWavelength;
pub use page::{OptimiseReport, mean_and_deviation};
pub use problem::views;
pub use rings::kernel::RingField;
pub use rings::mapping::{Mapping, WidthChoice, step};
pub use rings::neighbour_links::{Link, Links};
pub use rings::phase_file::write_phase_table;
pub use rings::phase_step_limit::{StepLimit, largest_step, largest_step_in_layout};
pub use rings::sites::Rings;
pub use run::{OptimiseTask, Optimised};
pub use solvers::adam::Adam;
pub use solvers::blocks::BlockExchange;
pub use solvers::checkpoint::Checkpoint;
pub use solvers::exchange::{Exchange, Schedule};
pub use solvers::start::Start;
pub use strehl_gain::{StrehlSummary, lens_alone};
