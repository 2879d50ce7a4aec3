//! The cell: a pillar on its lattice site, and how light passes it.

pub mod cache_file;
mod coupled;
mod fit;
mod illumination;
mod library;
mod local_periodic;
mod mapped_cell;
mod mapping_table;
mod model;
mod phase_curve;
mod polarisation;
mod polarising_cell;
mod polynomial;
mod published;
mod response;
mod rotated;
mod rotation_mapping;
mod stack;
mod unit_cells;
mod upright;

pub use cache_file::cache_folder;
pub use coupled::{
    BandNode, BandResponse, Blaze, CoarseCell, ElementRow, FittedNeighbours, Mapping, NEIGHBOUR_DEGREE,
    NEIGHBOUR_TERMS, NEIGHBOURS, NeighbourBasis, NeighbourCell, NeighbourResponse, NeighbourTable, NeighbourTableSpec,
    Orientation, RealRow, SiteGrid, SiteResponse, SolvedRow, neighbours, sites_by,
};
pub use fit::{
    FittedCell, ForwardFit, InverseFit, MappingError, RotationCurve, RotationFit, curves_over, fit_forward,
    fit_inverse, forward_errors, round_trip,
};
pub use illumination::{Illumination, Incidence, Spectral};
pub use library::{LibraryErrors, LibraryPillar, PillarLibrary};
pub use local_periodic::{
    BAND_ORDERS, CellTable, MixedCell, OBLIQUE_BAND_ORDERS, OBLIQUE_ORDERS, ORDERS, Origin, PointwiseCell,
    RigorousCell, TableInterpolation, TableSpec,
};
pub use mapped_cell::{MappedCell, MappedDifference, MappedValue};
pub use mapping_table::{AVOIDED_BELOW, MappingTable, RampOrders, SolvedMapping, simplex};
pub use metalith_rcwa::Material;
pub use model::{CellModel, Fidelity};
pub use phase_curve::{BadCell, PhaseCurve, bad_cells};
pub use polarisation::{
    Analyser, CircularTables, FocusedLight, FocusingStack, LinearTables, PassedTable, Polarisation, PolarisationAxis,
    PolarisedLight, PolarisedTables,
};
pub use polarising_cell::polarising_cell;
pub use polynomial::{Basis, ForwardPolynomial, InversePolynomial};
pub use published::PublishedCell;
pub use response::{CellResponse, JonesTables, NeighbourTables, ObliqueTables, POLARISATION_SHARE, dark};
pub use rotated::{
    Handedness, OBLIQUE_RECTANGLES, RotatedCell, RotatedRectangle, RotationResponse, RotationSamples, Truncation,
    oblique_refused,
};
pub use rotation_mapping::RotationMapping;
pub use stack::{CellStack, MOST_SUBSTRATE_K, UniformLayer};
pub use unit_cells::{PhaseConvention, TabulatedCells, TabulatedPhase, UnitCellTable};
pub use upright::{Along, UPRIGHT_ORDERS, UprightCell, birefringent_pillars, birefringent_stacks};
