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

mod adam;
mod blocks;
mod cells;
mod chain;
mod checkpoint;
mod deconvolution;
mod exchange;
mod field;
mod field_merit;
mod focus;
mod image_error;
mod image_slopes;
mod imaging;
mod judge;
mod kernel;
mod limit;
mod links;
mod mapping;
mod neighbour_terms;
mod objective;
mod page;
mod pair_response;
mod planes;
mod problem;
mod pupil;
mod rings;
mod robust;
mod run;
mod scene;
mod score;
mod solve;
mod spectrum;
mod start;
mod table;
mod views;
mod wiener;
mod window;

pub use adam::Adam;
pub use blocks::BlockExchange;
pub use cells::TaskCells;
pub use checkpoint::Checkpoint;
pub use deconvolution::Deconvolution;
pub use exchange::{Exchange, Schedule};
pub use field::{Condition, FieldPoint, FieldProblem, MeritKind};
pub use focus::{FabricationError, Lens, Strehl, judging_wavelengths, wavelengths};
pub use judge::{Judged, lens_alone};
pub use kernel::RingField;
pub use limit::{StepLimit, largest_step, largest_step_in_layout};
pub use links::{Link, Links};
pub use mapping::{Mapping, WidthChoice, step};
pub use objective::{Objective, Sum};
pub use page::{OptimiseReport, mean_and_deviation};
pub use problem::views;
pub use pupil::Pupil;
pub use rings::Rings;
pub use robust::{cells_off_height, draw};
pub use run::{OptimiseTask, Optimised};
pub use scene::Scene;
pub use spectrum::OverWavelength;
pub use start::Start;
pub use table::write_phase_table;
pub use views::Views;
pub use window::PixelWindow;
