//! Errors of solving a cell: causes with numbers, and for each a remedy.

use std::path::{Path, PathBuf};

use num_complex::Complex64;

use super::{Orders, SiteLattice};

/// Result of solving a cell.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Reason why a cell was not solved, or a material is not known.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    #[error("the wavelength is {wavelength_um} um")]
    Wavelength { wavelength_um: f64 },
    #[error("the angle of incidence is not a number")]
    Angle,
    /// The wave is evanescent in the half-space that it comes from, or that absorbs.
    #[error("no wave arrives at a sine of {sine:.4} through a medium of index {} + {} i", index.re, index.im)]
    NoIncidentWave { sine: f64, index: Complex64 },
    #[error("there are {along_axis} diffraction orders along an axis")]
    Orders { along_axis: usize },
    #[error("{along_axis} x {along_axis} orders without symmetry are {unknowns} unknowns")]
    TooLarge {
        along_axis: usize,
        unknowns: usize,
        most: usize,
    },
    #[error("the supercell has {sites} sites")]
    Sites { sites: usize },
    #[error("there are {cells} cells for {sites} sites")]
    CellCount { cells: usize, sites: usize },
    /// Cells are counted from one.
    #[error("cell {cell} of a supercell differs from the first in pitch, in heights or in materials")]
    UnlikeCells { cell: usize },
    /// Layers are counted from one, the lowest.
    #[error("layer {layer} of a supercell has {outlines} outlines on {sites} sites")]
    OutlineCount {
        layer: usize,
        outlines: usize,
        sites: usize,
    },
    /// Sites are counted from one.
    #[error("site {site} of the supercell has a rotated rectangle")]
    RotatedSite { site: usize },
    #[error("the diffraction orders go up to {highest} for each cell of the supercell")]
    SupercellOrders { highest: usize },
    #[error("{sites} sites with orders up to {highest} for each are {unknowns} unknowns")]
    SupercellTooLarge {
        sites: usize,
        highest: usize,
        unknowns: usize,
        most: usize,
    },
    #[error("the pitch of the lattice is {pitch_nm} nm")]
    Pitch { pitch_nm: f64 },
    #[error("the rows are {row_nm} nm apart")]
    Row { row_nm: f64 },
    /// Layers count from one, the lowest.
    #[error("layer {layer} of a cell of staggered rows has a pillar that is no circle")]
    StaggeredOutline { layer: usize },
    #[error("a medium has the index {} + {} i", index.re, index.im)]
    Index { index: Complex64 },
    /// Layers count from one, the lowest.
    #[error("layer {layer} of the cell is {height_nm} nm thick")]
    Height { layer: usize, height_nm: f64 },
    #[error("a pillar {width_nm} nm wide on a lattice with a pitch of {pitch_nm} nm")]
    Width { width_nm: f64, pitch_nm: f64 },
    #[error("the transmission of the cell depends on polarisation")]
    Polarising,
    /// The eigenvalue problem of a layer was not solved.
    #[error("the modes of a layer were not found ({reason})")]
    NoModes { reason: String },
    /// A diffraction order or a mode of a layer at its very cutoff: the field is not finite.
    #[error(
        "the solver lost the field in this cell: at this wavelength and angle the lattice just begins to diffract, or a mode of a \
         layer to exist"
    )]
    Cutoff,

    #[error("no material is called \"{}\"", metalith_core::text::quoted(name))]
    UnknownMaterial { name: String, known: Vec<&'static str> },
    #[error("a material has the index {n} + {k} i")]
    MaterialIndex { n: f64, k: f64 },
    #[error(
        "{material} is known from {} to {} nm, not at {} nm",
        in_nm(*from_um, f64::ceil),
        in_nm(*to_um, f64::floor),
        in_nm(*wavelength_um, f64::round)
    )]
    OutOfRange {
        material: String,
        from_um: f64,
        to_um: f64,
        wavelength_um: f64,
    },
    /// A table of indices cannot be read from the disk.
    #[error("cannot read {}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    /// A table of indices does not hold what was expected. Lines count from one.
    #[error("{}{}: {cause}", path.display(), line.map_or_else(String::new, |l| format!(", line {l}")))]
    Table {
        path: PathBuf,
        line: Option<usize>,
        #[source]
        cause: TableError,
    },
}

/// Fault in a table of indices.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    #[error("{bytes} bytes are not a table of indices")]
    TooLong { bytes: u64 },
    #[error("it is not an ordinary file")]
    NotAFile,
    #[error("{what}")]
    NotTheColumns { what: String },
    #[error("a value is missing")]
    Missing,
    #[error("\"{text}\" is not a number")]
    NotANumber { text: String },
    #[error("{what}")]
    NotPhysical { what: String },
    #[error("the wavelengths do not rise")]
    NotRising,
    #[error("the table has fewer than two rows")]
    TooFewRows,
    #[error("{what}")]
    NotOfDatabase { what: String },
}

impl Error {
    pub(super) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { path, source }
    }

    /// Identity of the error, `subject/cause`: the text may change, the identity stays.
    pub fn id(&self) -> &'static str {
        match self {
            Self::Wavelength { .. } => "rcwa/wavelength-out-of-range",
            Self::Angle => "rcwa/angle-not-a-number",
            Self::NoIncidentWave { .. } => "rcwa/no-incident-wave",
            Self::Orders { .. } => "rcwa/orders-out-of-range",
            Self::TooLarge { .. } => "rcwa/too-many-unknowns",
            Self::Sites { .. } => "rcwa/site-count-out-of-range",
            Self::CellCount { .. } => "rcwa/cell-count-differs",
            Self::UnlikeCells { .. } => "rcwa/cells-differ",
            Self::OutlineCount { .. } => "rcwa/outline-count-differs",
            Self::RotatedSite { .. } => "rcwa/rotated-rectangle",
            Self::SupercellOrders { .. } => "rcwa/supercell-orders-out-of-range",
            Self::SupercellTooLarge { .. } => "rcwa/supercell-too-many-unknowns",
            Self::Pitch { .. } => "rcwa/pitch-out-of-range",
            Self::Row { .. } => "rcwa/row-distance-out-of-range",
            Self::StaggeredOutline { .. } => "rcwa/staggered-without-circles",
            Self::Index { .. } => "rcwa/index-out-of-range",
            Self::Height { .. } => "rcwa/height-out-of-range",
            Self::Width { .. } => "rcwa/width-out-of-range",
            Self::Polarising => "rcwa/polarising-cell",
            Self::NoModes { .. } => "rcwa/modes-not-found",
            Self::Cutoff => "rcwa/field-lost-at-cutoff",
            Self::UnknownMaterial { .. } => "rcwa/unknown-material",
            Self::MaterialIndex { .. } => "rcwa/material-index-out-of-range",
            Self::OutOfRange { .. } => "rcwa/material-out-of-range",
            Self::Io { .. } => "file/operation-failed",
            Self::Table { .. } => "rcwa/material-table-malformed",
        }
    }

    /// Remedy for the error.
    pub fn remedy(&self) -> String {
        match self {
            Self::Wavelength { .. } => "use a positive number of micrometres".into(),
            Self::Angle => "give it in degrees".into(),
            Self::NoIncidentWave { .. } => {
                "use a medium without loss on the side of the light, and an angle that exists in it".into()
            }
            Self::Orders { .. } => format!(
                "use an odd number from 1 to {}: 13 resolves the pillar cell to about 0.005 rad",
                Orders::MOST
            ),
            Self::TooLarge { most, .. } => format!("use fewer orders: at most {most} unknowns are solved for"),
            Self::Sites { .. } => format!("use 1 to {} sites", SiteLattice::MOST),
            Self::CellCount { .. } => "give one cell for each site".into(),
            Self::UnlikeCells { .. } => {
                "let the cells of a supercell differ only in the outlines of their pillars".into()
            }
            Self::OutlineCount { .. } => {
                "give each layer one outline for each site, an empty one where nothing stands".into()
            }
            Self::RotatedSite { .. } => {
                "solve it in a separate cell: supercells know pillars that both axes mirror".into()
            }
            Self::SupercellOrders { .. } => format!("use at most {}", Orders::MOST / 2),
            Self::SupercellTooLarge { most, .. } => {
                format!("use fewer orders or fewer sites: at most {most} unknowns are solved for")
            }
            Self::Pitch { .. } => "use a positive number of nanometres".into(),
            Self::Row { .. } => "use a positive number of nanometres".into(),
            Self::StaggeredOutline { .. } => "use circles, or a square lattice".into(),
            Self::Index { .. } => "use n >= 0 and k >= 0, not both zero; gain is not supported".into(),
            Self::Height { .. } => "give a positive thickness, or leave the layer out".into(),
            Self::Width { .. } => {
                "make the width at most the distance of the nearest pillars; walls that lean outwards count at their foot".into()
            }
            Self::Polarising => "solve for its Jones matrix instead".into(),
            Self::NoModes { .. } => "change the wavelength, the width or the number of orders a little".into(),
            Self::Cutoff => "orders appear in a medium of index n at wavelengths below n times the pitch (of a hexagonal lattice, \
                             n times the distance of its rows), for light along the normal; by a sine s of the angle in air, \
                             below (n + s) times the pitch: use longer wavelengths or a smaller pitch, or change the wavelength, \
                             the angle or the width by a part in a million where it is a mode"
                .into(),
            Self::UnknownMaterial { known, .. } => {
                format!(
                    "use one of {}, a formula such as TiO2, SiO2 or a-Si, or the path of a .csv table of n and k or of a .yml file \
                     of refractiveindex.info",
                    known.join(", ")
                )
            }
            Self::MaterialIndex { .. } => "use n > 0 and k >= 0".into(),
            Self::OutOfRange { .. } => "choose wavelengths in that range, or another material".into(),
            Self::Io { .. } => "check the path; a relative path in a file counts from the folder of that file, another one from the folder where you are".into(),
            Self::Table { path, .. } if crate::material::is_yaml(path) => {
                "give a file as refractiveindex.info has it: `DATA` with tabulated nk, n or k of rising wavelengths, or formulas 1 to 9"
                    .into()
            }
            Self::Table { .. } => {
                "give columns wavelength_nm (or wavelength_um), n and, if it absorbs, k, and no others, with rising \
                                   wavelengths"
                    .into()
            }
        }
    }
}

/// One text with its remedy, for a program; the cause stays its source.
impl From<Error> for metalith_core::Error {
    fn from(error: Error) -> Self {
        match error {
            Error::Io { path, source } => Self::Io {
                action: "read",
                path,
                source,
            },
            other => Self::Invalid {
                id: other.id(),
                what: other.to_string(),
                hint: other.remedy(),
                source: Some(Box::new(other)),
            },
        }
    }
}

/// A wavelength (um) in nanometres, to the picometre.
fn in_nm(um: f64, whole: fn(f64) -> f64) -> f64 {
    /// Rounding of a wavelength that is written in nanometres (pm).
    const ROUNDING: f64 = 1e-3;
    let pm = um * 1e6;
    let near = pm.round();
    let pm = if (pm - near).abs() < ROUNDING { near } else { whole(pm) };
    pm / 1e3
}
