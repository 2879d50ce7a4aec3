//! The radial phase that all elements share, optimised ring by ring.
//!
//! ```text
//! Design -> Task -> (cells) -> kernels -> Exchange or Adam -> Optimised -> phase table, Findings
//! ```
//!
//! The field of one lens at one wavelength and angle is linear in the complex transmission of its
//! [`Rings`]. Two kernels are built once from the real sites of the lattice: that of the field at a few
//! points on or near the axis ([`Lens::focal_rows`], [`FieldProblem`]) and that of the field over a wide
//! window about the chief ray ([`Pupil`], [`Deconvolution`]). [`Exchange`] sets one ring after the other to
//! the best of all widths there are; [`Adam`] climbs an [`Objective`]'s gradient. Both keep the
//! [`StepLimit`] from ring to ring at all times, since a cell's transmission is that of a lattice of its like.
//!
//! Merits are such that larger is better: the mean Strehl ratio (`sum`, the paper's first stage), the mean
//! of its logarithm (`log`), less the energy in side lobes (`side_lobes`), less the expected error of
//! restored images (`deconvolution`), any weighted sum, and the expectation of the first three over errors
//! of fabrication (`robust`).

mod adam;
mod bessel;
mod checkpoint;
mod deconvolution;
mod exchange;
mod field;
mod focus;
mod imaging;
mod judge;
mod kernel;
mod limit;
mod mapping;
mod objective;
mod page;
mod photograph;
mod planes;
mod problem;
mod pupil;
mod rings;
mod robust;
mod run;
mod score;
mod spectrum;
mod start;
mod table;
mod wiener;

pub use adam::Adam;
pub use bessel::Bessel;
pub use checkpoint::Checkpoint;
pub use deconvolution::{Deconvolution, Views};
pub use exchange::{Exchange, Schedule};
pub use field::{Condition, FieldProblem, Kind, Row};
pub use focus::{FabricationError, Lens, Strehl, judging_wavelengths, wavelengths};
pub use imaging::Transfer;
pub use judge::Judged;
pub use kernel::RingField;
pub use limit::{StepLimit, largest_step, largest_step_in_layout};
pub use mapping::{Choice, Mapping, step};
pub use objective::{Objective, Sum};
pub use page::{Findings, mean_and_deviation};
pub use photograph::{Camera, Restored, psnr, ssim};
pub use problem::views;
pub use pupil::{Pupil, Window};
pub use rings::Rings;
pub use robust::{cells_off_height, draw};
pub use run::{Optimised, Task, turns_of};
pub use spectrum::OverWavelength;
pub use start::Start;
pub use table::write_phase_table;
pub use wiener::Scene;
