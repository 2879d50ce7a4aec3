//! Metalens design, from the phase of a metalens array to the layout a cleanroom writes, and back from that file to the
//! image it makes.
//!
//! Data runs one way. The first line makes a file; the second begins at the bytes of that file, so that
//! what is simulated is what is sent to the writer, never what it was meant to be:
//!
//! ```text
//! design text -> Design -> LensPhase -> PillarRule -> PillarArray -> layout bytes
//! layout bytes -> Layout -> Extraction -> Field -> Psf -> Verification -> report
//! ```
//!
//! | stage | room | what it is a function of |
//! | --- | --- | --- |
//! | [`Design`] | [`design`] | the text of a TOML file, all its mistakes reported at once |
//! | [`LensPhase`](phase::LensPhase), [`ElementPhase`](phase::ElementPhase) | [`phase`] | the radial phase of a design and the wedge of an element |
//! | [`PillarArray`] | [`mod@array`] | phases, and the mapping from phase to width; copies are proven, not assumed |
//! | [`write_pillars`], [`write_apertures`] | [`layout`] | the array; bytes that depend on nothing else |
//! | [`Layout`], [`extract()`] | [`gds`], [`mod@extract`] | the bytes of any GDSII or OASIS file |
//! | [`CellModel`] | [`cell`] | a pillar's width and a wavelength: published, fitted or rigorous |
//! | [`Propagator`](wave::Propagator) | [`wave`] | transmissions on a lattice: folded, direct, by rings |
//! | [`Psf`](wave::Psf) | [`wave::psf`] | a field |
//! | [`ImagingSystem`](imaging::ImagingSystem) | [`imaging`], [`restoration`] | a layout, a camera and a scene: a frame, and the picture restored from it |
//! | [`verify()`] | [`mod@verify`] | a design, its array and the bytes of a layout |
//! | [`report`] | [`report`] | anything found: one HTML page and one JSON file |
//!
//! Beside the line stand [`optimise`], which finds the radial phase; [`drc`], [`mod@diff`] and [`handoff`], which
//! start from layouts too; [`calibrate`], which learns from captures what the model lacks; and [`compensate`],
//! which draws what comes out as meant on the line that was so measured. [`cell`] holds supercells of unlike
//! pillars too; layouts of the cell of the paper are simulated with the coupled model, unless a design says
//! otherwise. The names at the root are those that the line itself needs; each room has its own.
//!
//! # Conventions
//!
//! **Units.** Optics in micrometres, angles in radians inside the code and in degrees in files, layouts in
//! whole nanometres. Names carry the unit.
//!
//! **Waves.** Time factor exp(-i w t), a forward wave is exp(+i k z), z runs from the lens to the sensor.
//! A wider pillar is a longer optical path and has a larger phase; the phase of a converging lens falls
//! with the radius. A plane wave from (theta_x, theta_y) multiplies the aperture by
//! exp(+i k (x sin theta_x + y sin theta_y)).
//!
//! **Light path.** Scene, substrate, pillars, air, sensor. Transmission t is a field ratio: the zero order
//! in the plane of the pillar tops over the incident wave in the plane of the pillar base. The share of
//! power in the zero order is |t|^2 over the index of the substrate.
//!
//! **Where an element looks.** Its wedge brings to its axis the light that arrives with
//! sin theta = -sin psi lambda / lambda_w. That is the middle of its field; field angles count from there.
//!
//! **Lattice.** An even number of sites an axis, centres at odd multiples of half a pitch, widths even:
//! every edge is on the 1 nm grid, and a lens has all eight symmetries of the square exactly.
//!
//! **The array phase** (Chakravarthula et al. 2023, Eq. 3) is that of the lens plus
//! 2 pi / lambda_w (x sin psi_x + y sin psi_y), modulo one turn, then mapped to a duty cycle (Eq. 4), the
//! linear one: width over pitch.
//!
//! **Fields.** The element is a lattice of point samples of weight pitch^2. The PSF is |E|^2 / |E_inc|^2,
//! E_inc in the medium of incidence; Strehl is against the same aperture passing all its power in the zero
//! order with the perfect phase.
//!
//! # Example
//!
//! ```no_run
//! use metalith::{Accuracy, Design, PillarArray, Silent, SimulationCases, cell_models, verify, write_pillars};
//!
//! # fn main() -> metalith::Result<()> {
//! let design = Design::read("designs/mini_3x3.toml".as_ref())?;
//! let array = PillarArray::build(&design, &Silent)?;
//! let file = "mini.gds".as_ref();
//! write_pillars(&design, &array, design.layout.hierarchy, file, &Silent)?;
//! let cells = cell_models(&design, &[metalith::Fidelity::Rigorous])?;
//! let cases = SimulationCases::of_cells(&cells)?;
//! let found = verify(&design, &array, file, &cases, Accuracy::Accurate, &Silent)?;
//! assert!(found.passed());
//! # Ok(())
//! # }
//! ```

// The program says `metalith::` of the library, as any other program would.
#[cfg(feature = "cli")]
extern crate self as metalith;

#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;
mod frame_names;
mod new_design;
mod new_set;
pub mod schema;
mod session;

pub use metalith_attribution as attribution;
#[cfg(feature = "baselines")]
pub use metalith_baselines as baselines;
pub use metalith_bench_plan as bench_plan;
pub use metalith_calibrate as calibrate;
pub use metalith_cell as cell;
pub use metalith_cell_study as cell_study;
pub use metalith_design as design;
pub use metalith_design::{array, phase};
pub use metalith_drc as drc;
pub use metalith_drc::diff;
pub use metalith_gds as gds;
pub use metalith_gds::extract;
pub use metalith_handoff as handoff;
pub use metalith_imaging as imaging;
pub use metalith_layout as layout;
pub use metalith_metrology as metrology;
pub use metalith_optics as optics;
pub use metalith_optimise as optimise;
pub use metalith_prior as prior;
pub use metalith_rcwa as rcwa;
pub use metalith_report as report;
pub use metalith_restoration as restoration;
pub use metalith_sensor as sensor;
pub use metalith_study as study;
#[cfg(feature = "training")]
pub use metalith_training as training;
pub use metalith_verify as verify;
pub use metalith_verify::compensate;
pub use metalith_wave as wave;

pub use metalith_cell::{CellModel, Fidelity};
pub use metalith_core::{
    AtomicFile, Error, Fault, FaultKind, Faults, FolderLock, Progress, Result, Silent, Warning, Wedge, cpu_time, file,
    numerical_aperture, text,
};
pub use metalith_design::{Design, Hierarchy, PillarArray, cell_models};
pub use metalith_gds::Layout;
pub use metalith_gds::extract::{Extraction, ExtractionPlan, extract};
pub use metalith_layout::{write_apertures, write_layer_properties, write_pillars};
pub use metalith_optics::{AsBuiltChip, CalibratedModel};
pub use metalith_pillars::{
    DatabaseUnit, ElementSite, Lattice, LatticeKind, OutlineForm, PillarId, PillarKind, PillarMap, PillarRows,
    PillarShape, Pitch, PolarisationBasis, Rectangles, RotatedRectangles, UprightRectangles,
};
pub use metalith_verify::{SimulationCase, SimulationCases, Verification, verify, write_report};
pub use metalith_wave::Accuracy;
pub use new_design::{NewDesign, NewDesignText, pitch_of_nm};
pub use new_set::{NewSet, new_set};
pub use session::plan_session;
