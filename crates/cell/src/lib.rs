//! The cell: a pillar on its lattice site, and how light passes it.

mod cache;
mod column;
mod curve;
mod exact;
mod fit;
mod illumination;
pub mod kept;
mod library;
mod mapped_cell;
mod model;
mod neighbours;
mod pointwise;
mod polarisation;
mod polarising;
mod polynomial;
mod published;
mod rectangle;
mod response;
mod rigorous;
mod rotated;
mod rotation;
mod stack;
mod table;
mod unit_cells;
mod upright;

pub use cache::cache_folder;
pub use curve::{BadCell, PhaseCurve, bad_cells};
pub use exact::{AVOIDED_BELOW, MappingTable, RampOrders, SolvedMapping, simplex};
pub use fit::{
    FittedCell, ForwardFit, InverseFit, MappingError, RotationCurve, RotationFit, curves_over, fit_forward,
    fit_inverse, forward_errors, round_trip,
};
pub use illumination::{Illumination, Incidence, Spectral};
pub use library::{LibraryErrors, LibraryPillar, PillarLibrary};
pub use mapped_cell::{MappedCell, MappedDifference, MappedValue};
pub use metalith_rcwa::Material;
pub use model::{CellModel, Fidelity};
pub use neighbours::{
    BandNode, BandResponse, Blaze, CoarseCell, ElementRow, FittedNeighbours, Mapping, NEIGHBOUR_DEGREE,
    NEIGHBOUR_TERMS, NEIGHBOURS, NeighbourBasis, NeighbourCell, NeighbourResponse, NeighbourTable, NeighbourTableSpec,
    Orientation, RealRow, SiteGrid, SiteResponse, SolvedRow, neighbours, sites_by,
};
pub use pointwise::PointwiseCell;
pub use pointwise::{BAND_ORDERS, OBLIQUE_BAND_ORDERS, OBLIQUE_ORDERS, ORDERS};
pub use polarisation::{
    Analyser, AxisTables, FocusedLight, HandTables, LitStack, PassedTable, Polarisation, PolarisationAxis,
    PolarisedLight, PolarisedTables,
};
pub use polarising::polarising_cell;
pub use polynomial::{Basis, ForwardPolynomial, InversePolynomial};
pub use published::PublishedCell;
pub use rectangle::{Handedness, OBLIQUE_RECTANGLES, RotatedRectangle, oblique_refused};
pub use response::{CellResponse, JonesTables, NeighbourTables, ObliqueTables, POLARISATION_SHARE, dark};
pub use rigorous::RigorousCell;
pub use rotated::{RotatedCell, RotationResponse, RotationSamples, Truncation};
pub use rotation::RotationMapping;
pub use stack::{CellStack, MOST_SUBSTRATE_K, UniformLayer};
pub use table::{CellTable, Origin, TableSpec};
pub use unit_cells::{PhaseConvention, TabulatedCells, TabulatedPhase, UnitCellTable};
pub use upright::{Along, UPRIGHT_ORDERS, UprightCell, birefringent_pillars, birefringent_stacks};
