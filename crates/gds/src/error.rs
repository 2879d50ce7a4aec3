//! Errors of reading a layout: causes with numbers and places, and for each a remedy.

use std::path::{Path, PathBuf};

use metalith_core::text::{count, quoted};

use metalith_oasis::OasisFault;

use super::extract::ReasonCounts;
use super::record;

/// Result of reading a layout.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Reason why a layout could not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        action: &'static str,
        path: PathBuf,
        source: std::io::Error,
    },

    /// A folder, a device or a pipe.
    #[error("{} is not a file", path.display())]
    NotAFile { path: PathBuf },

    /// Somebody wrote the file while it was read.
    #[error("{} changed from {before} to {now} bytes while it was read", path.display())]
    Changed { path: PathBuf, before: u64, now: u64 },

    /// The file breaks the format, has a faulty tree of cells, or is beyond a limit.
    #[error("{}, byte {offset}: {cause}", path.display())]
    Layout {
        path: PathBuf,
        /// Offset of the record at fault from the start of the file.
        offset: u64,
        #[source]
        cause: LayoutError,
    },

    /// Error of extraction: what was to be read out of the layout is not there or too much.
    #[error("{}: {cause}", path.display())]
    Extraction {
        path: PathBuf,
        #[source]
        cause: ExtractionError,
    },

    /// The caller asked to stop.
    #[error("interrupted")]
    Interrupted,

    /// Error that a [`super::Visitor`] returned.
    #[error(transparent)]
    Visitor(metalith_core::Error),
}

/// Fault at a place of a layout.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LayoutError {
    #[error("{}", if *held == 0 { "the file ends before ENDLIB".to_owned() } else { format!("the file ends {held} bytes into a record, before ENDLIB") })]
    EndsEarly { held: usize },
    #[error("the file ends inside a {} record of {length} bytes, {held} of them there", record::name(*kind))]
    EndsInRecord { kind: u8, length: usize, held: usize },
    #[error("a record of length {length}; it must be even and at least 4")]
    RecordLength { length: usize, first: bool },
    #[error("record type 0x{kind:02X} is not GDSII")]
    RecordKind { kind: u8 },
    #[error(
        "a {} record of data type {data} and {bytes} bytes; it must be of type {wanted} in steps of {unit} bytes",
        record::name(*kind)
    )]
    RecordBody {
        kind: u8,
        data: u8,
        bytes: usize,
        wanted: u8,
        unit: usize,
    },
    #[error("a {} record of data type {data}", record::name(*kind))]
    NotText { kind: u8, data: u8 },
    #[error("the file does not begin with HEADER")]
    NoHeader,
    /// A drawing in DXF with something that is not read.
    #[error("line {line} of the drawing: {what}")]
    Drawing { line: u64, what: &'static str },
    #[error("this is {format}, which is not read as a layout")]
    OtherFormat { format: &'static str, remedy: &'static str },
    #[error("a file compressed by gzip that does not unpack: {0}")]
    Gzip(String),
    #[error("a file compressed by gzip of more than {most} bytes unpacked")]
    Unpacked { most: u64 },
    #[error("the file has no UNITS")]
    NoUnits,
    #[error("a cell begins before UNITS")]
    UnitsMissingBeforeCell,
    /// Database unit in metres and in user units.
    #[error("a database unit of {metres:e} m, {user:e} user units")]
    UnitSize { metres: f64, user: f64 },
    #[error("a database unit of {nm} nm is no ratio of whole nanometres")]
    UnitRatio { nm: f64 },
    #[error("a {} record outside every cell", record::name(*kind))]
    OutsideCells { kind: u8 },
    #[error("a {} record inside a cell: ENDSTR is missing", record::name(*kind))]
    CellNotEnded { kind: u8 },
    #[error("a {} record inside the element that begins at byte {begin}: ENDEL is missing", record::name(*kind))]
    ElementNotEnded { kind: u8, begin: u64 },
    #[error("a cell begins with {}, not with its name", record::name(*kind))]
    NoCellName { kind: u8 },
    #[error("a cell name of {bytes} bytes")]
    CellName { bytes: usize },
    #[error("a reference to a cell whose name has {bytes} bytes")]
    ReferenceName { bytes: usize },
    #[error("a {element} with {points} points")]
    Points { element: &'static str, points: usize },
    #[error("a {element} without {lacks}")]
    Lacks { element: &'static str, lacks: &'static str },
    #[error("a BOX of {points} points that is no upright rectangle")]
    BoxForm { points: usize },
    #[error("an element of type 0x{kind:02X}, which is not GDSII")]
    PrivateElement { kind: u8 },
    #[error("an AREF of {columns} x {rows}")]
    ArraySize { columns: i16, rows: i16 },
    #[error("a {element} with absolute magnification or angle")]
    Absolute { element: &'static str },
    #[error("a PATH whose width is absolute (below zero), and a reference that magnifies")]
    AbsoluteWidth,
    #[error("a {element} with magnification {magnification:e}, angle {angle_deg}")]
    Magnification {
        element: &'static str,
        magnification: f64,
        angle_deg: f64,
    },
    #[error("a reference inside references whose magnifications multiply beyond 1e6 or 1e-6")]
    Magnifications,
    /// A file that breaks OASIS; `inner` is the byte of what the CBLOCK at the place unpacks to.
    #[error("{}{fault}", in_block(*inner))]
    Oasis {
        inner: Option<u64>,
        #[source]
        fault: OasisFault,
    },
    #[error("layer {layer}/{datatype}")]
    LayerNumber { layer: u32, datatype: u32 },
    #[error("a cell of number {number}")]
    CellNumber { number: u64 },
    #[error("a text of number {number}, which is in no table")]
    TextNumber { number: u64 },
    /// The bytes at a place are not those of the first reading.
    #[error("the file changed while it was read")]
    Rewritten,

    #[error("cell {cell} refers to {name}, which contains it")]
    Circle { cell: String, name: String },
    #[error("cell {cell} refers to {name}, which is not in the file")]
    Dangling { cell: String, name: String },
    #[error("a second cell with the name {name}")]
    Doubled { name: String },
    #[error("there is no cell in the file")]
    NoCells,
    /// Names of the first cells that no other refers to.
    #[error("there is no cell {}", quoted(name))]
    NoSuchCell { name: String, tops: Vec<String> },
    #[error("{count} cells at the top: {}", tops.join(", "))]
    SeveralTops { count: usize, tops: Vec<String> },

    /// Beyond one of [`super::ReadLimits`].
    #[error("{}", limit.words(*found, *most))]
    Limit { limit: Limit, found: u64, most: u64 },
}

/// Limit of [`super::ReadLimits`] that was exceeded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Limit {
    Cells,
    /// Distinct names of cells that are referred to.
    Names,
    /// Distinct layers of cells.
    Layers,
    /// Distinct pairs of a cell and one that it refers to.
    References,
    Vertices,
    Depth,
    /// Copies of cells that are placed as a whole.
    Placements,
    /// Shapes, every reference followed.
    FlatShapes,
    /// Limit of the flat shapes of a file as short as this one.
    FlatShapesOfShortFile,
    /// Bytes of texts, every reference followed.
    FlatTexts,
}

impl Limit {
    fn words(self, found: u64, most: u64) -> String {
        match self {
            Self::Cells => format!("more than {most} cells"),
            Self::Names => "more distinct names in cells than are read".into(),
            Self::Layers => "more distinct layers in cells than are read".into(),
            Self::References => "more distinct references in cells than are read".into(),
            Self::Vertices => format!("an element of more than {most} vertices"),
            Self::Depth => format!("references {found} deep, {most} are followed"),
            Self::Placements => {
                format!("{found} copies of cells that have references or are large, {most} are followed")
            }
            Self::FlatShapes => format!("{found} shapes with all references followed, {most} are read"),
            Self::FlatShapesOfShortFile => {
                format!("{found} shapes with all references followed, {most} are read from a file as short as this")
            }
            Self::FlatTexts => format!("texts of {found} bytes with all references followed, {most} are read"),
        }
    }

    fn remedy(self) -> &'static str {
        match self {
            Self::Cells => "draw shapes that occur once where they stand",
            Self::Vertices => "split the polygon; the format says 8191 at most",
            Self::Names | Self::Layers | Self::References => "this is not the layout of a lens; is the file damaged?",
            Self::Depth | Self::Placements | Self::FlatShapes => "write the layout with fewer levels or in parts",
            Self::FlatShapesOfShortFile => {
                "arrays of arrays multiply: is this the layout that was meant? Write it in parts"
            }
            Self::FlatTexts => "references multiply the texts of cells: write each text once, at the top",
        }
    }
}

/// Reason why nothing was extracted from a layout.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExtractionError {
    #[error("{elements} elements with {sites} lattice sites together")]
    Sites { elements: usize, sites: u64, most: u64 },
    #[error("no element found on layer {layers}{}", contents.as_ref().map_or_else(String::new, |held| format!("; the layout holds {held}")))]
    NoElements {
        layers: String,
        /// What other layers hold, if that was looked for.
        contents: Option<String>,
    },
    /// No layer is named, and several may be meant.
    #[error("several layers hold shapes, and 1/0 none: {contents}")]
    WhichLayer { contents: String },
    #[error("{groups} separate groups of shapes on layer {layers}")]
    Groups { groups: usize, layers: String, most: usize },
    #[error("small shapes are spread over more than {most} places of 33 um")]
    Scattered { most: usize },
    /// Pillars that would take far more lattice sites than there are pillars.
    #[error(
        "{pillars} pillars about ({}, {}) nm spread over {columns} x {rows} sites of {pitch_nm} nm",
        at_nm[0], at_nm[1]
    )]
    Sparse {
        pillars: u64,
        at_nm: [i64; 2],
        columns: i64,
        rows: i64,
        pitch_nm: f64,
    },
    /// Shapes of elements that a design gives, before the first pillar on their lattices.
    #[error(
        "none of the first {} shapes on the pillar layer is a pillar on the lattices of the design: {}",
        count(reasons.total()),
        reasons.words()
    )]
    NotOfDesign { reasons: ReasonCounts },
    #[error("a lattice of pitch {pitch_nm} nm about ({}, {}) nm", centre_nm[0], centre_nm[1])]
    Lattice { pitch_nm: f64, centre_nm: [f64; 2] },
}

const REWRITE: &str = "the file is damaged here: write it again";
const REPORT: &str = "the tool that wrote this file breaks the format: report it there";
const CUT_SHORT: &str = "the file is cut short: copy or write it again";
const BEING_WRITTEN: &str = "wait until whoever writes it is done";

fn in_block(inner: Option<u64>) -> String {
    inner.map_or_else(String::new, |inner| format!("byte {inner} of the CBLOCK there: "))
}

impl LayoutError {
    /// True if the file is sound: what was asked of it does not say which cell is meant.
    fn is_of_selection(&self) -> bool {
        matches!(self, Self::NoSuchCell { .. } | Self::SeveralTops { .. })
    }

    /// Identity of the error, `subject/cause`.
    fn id(&self) -> &'static str {
        match self {
            Self::NoSuchCell { .. } => "layout/no-such-cell",
            Self::SeveralTops { .. } => "layout/several-tops",
            _ => "layout/malformed",
        }
    }

    /// Remedy for the error.
    pub fn remedy(&self) -> String {
        match self {
            Self::EndsEarly { .. } | Self::EndsInRecord { .. } => CUT_SHORT.into(),
            Self::RecordLength { first: true, .. } => {
                "this does not begin like GDSII; is it another format, or compressed?".into()
            }
            Self::RecordLength { .. } => {
                "the file is damaged from here on, or was changed by a text tool: write it again".into()
            }
            Self::RecordKind { .. } => "the file is damaged from here on, or is another format".into(),
            Self::NotText { .. } => {
                "it must be text (data type 6): the tool that wrote this file breaks the format".into()
            }
            Self::NoHeader => "is this a GDSII or OASIS file? Of compressed files those of gzip are read".into(),
            Self::OtherFormat { remedy, .. } => (*remedy).into(),
            Self::Drawing { .. } => {
                "closed polylines, circles, ellipses, solids, arcs, lines that meet, texts and blocks of DXF are read, each code and \
                 value on separate lines"
                    .into()
            }
            Self::Gzip(_) => CUT_SHORT.into(),
            Self::Unpacked { .. } => "is this the layout that was meant? Unpack it by gunzip, then read it".into(),
            Self::Oasis { fault, .. } => fault.remedy().into(),
            Self::LayerNumber { .. } => "layers and datatypes up to 65535 are read".into(),
            Self::CellNumber { .. } => "numbers of cells below 2^56 are read".into(),
            Self::TextNumber { .. } => REPORT.into(),
            Self::RecordBody { .. }
            | Self::NoUnits
            | Self::UnitsMissingBeforeCell
            | Self::NoCellName { .. }
            | Self::Points { .. }
            | Self::Lacks { .. }
            | Self::BoxForm { .. }
            | Self::PrivateElement { .. }
            | Self::ArraySize { .. } => REPORT.into(),
            Self::UnitSize { .. } => "database units from 1e-13 to 1e-3 m are read; layouts are in 1e-9".into(),
            Self::UnitRatio { .. } => "write the layout with a database unit of 1 nm".into(),
            Self::OutsideCells { .. } | Self::CellNotEnded { .. } | Self::ElementNotEnded { .. } => REWRITE.into(),
            Self::CellName { .. } | Self::ReferenceName { .. } => "give cells names of 1 to 32 characters".into(),
            Self::Absolute { .. } => {
                "few tools agree on what this means: write the reference with relative ones".into()
            }
            Self::AbsoluteWidth => {
                "few tools agree on what this means: write the path with a positive width, or the cells at their true size".into()
            }
            Self::Magnification { .. } => "magnifications from 1e-6 to 1e6 are read".into(),
            Self::Magnifications => "write the cell at its true size".into(),
            Self::Rewritten => BEING_WRITTEN.into(),
            Self::Circle { .. } => "remove the reference: a cell cannot contain itself".into(),
            Self::Dangling { .. } => "write the file with all cells that it needs".into(),
            Self::Doubled { .. } => "rename one of them: references cannot tell which is meant".into(),
            Self::NoCells => "is this the right file?".into(),
            Self::NoSuchCell { tops, .. } => format!("cells at the top: {}", tops.join(", ")),
            Self::SeveralTops { .. } => {
                "name the one to be read by --top, or write it to a separate file".into()
            }
            Self::Limit { limit, .. } => limit.remedy().into(),
        }
    }
}

impl ExtractionError {
    /// Identity of the error, `subject/cause`: the text may change, the identity stays.
    pub fn id(&self) -> &'static str {
        match self {
            Self::Sites { .. } => "extract/too-many-sites",
            Self::NoElements { .. } => "extract/no-elements",
            Self::WhichLayer { .. } => "extract/which-layer",
            Self::Groups { .. } => "extract/too-many-groups",
            Self::Scattered { .. } => "extract/shapes-scattered",
            Self::Sparse { .. } => "extract/sites-mostly-empty",
            Self::NotOfDesign { .. } => "extract/not-of-design",
            Self::Lattice { .. } => "extract/pitch-out-of-range",
        }
    }

    /// Remedy for the error.
    pub fn remedy(&self) -> String {
        match self {
            Self::Sites { most, .. } => {
                format!(
                    "up to {most} sites are held at a time, an eighth of an element that is folded by all eight \
                     symmetries: a smaller lens, or fewer elements in one layout"
                )
            }
            Self::NoElements { .. } => {
                "name the layer that the pillars are on (`--layer 7/0`, or `layer` in a library call), or give a design that has them \
                 there"
                    .into()
            }
            Self::WhichLayer { .. } => "name the layer of the pillars with --layer".into(),
            Self::Groups { most, .. } => format!("up to {most} elements are read; is this the layer of the pillars?"),
            Self::Scattered { .. } => {
                "lenses of up to 50 mm are found without a design; give the design, which says where the elements are"
                    .into()
            }
            Self::Sparse { .. } => "this is no lens on a lattice; give the design to say where its elements are".into(),
            Self::NotOfDesign { .. } => {
                "give the design that this layout was made from; `metalith info LAYOUT` says what lenses it holds"
                    .into()
            }
            Self::Lattice { .. } => {
                "lattices with a pitch of whole steps of 0.05 nm about a whole nanometre are read".into()
            }
        }
    }
}

impl Error {
    /// An operating-system error with what was attempted.
    pub(crate) fn io(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { action, path, source }
    }

    /// Fault of the layout, and the byte that it is at, if the layout is the cause.
    pub fn in_layout(&self) -> Option<(u64, &LayoutError)> {
        match self {
            Self::Layout { offset, cause, .. } => Some((*offset, cause)),
            _ => None,
        }
    }
}

/// Error of a visitor, which ends the visit and comes back unchanged.
impl From<metalith_core::Error> for Error {
    fn from(error: metalith_core::Error) -> Self {
        match error {
            metalith_core::Error::Interrupted => Self::Interrupted,
            other => Self::Visitor(other),
        }
    }
}

/// One text with its remedy, for a program; the cause stays its source.
impl From<Error> for metalith_core::Error {
    fn from(error: Error) -> Self {
        let (id, what, hint) = match error {
            Error::Io { action, path, source } => return Self::Io { action, path, source },
            Error::Interrupted => return Self::Interrupted,
            Error::Visitor(error) => return error,
            Error::Layout {
                ref path, ref cause, ..
            } if cause.is_of_selection() => (cause.id(), format!("{}: {cause}", path.display()), cause.remedy()),
            Error::Layout {
                ref path,
                offset,
                ref cause,
            } => {
                return Self::Layout {
                    path: path.clone(),
                    offset,
                    what: cause.to_string(),
                    hint: cause.remedy(),
                    source: Some(Box::new(error)),
                };
            }
            Error::NotAFile { .. } => (
                "file/not-regular",
                error.to_string(),
                "name a GDSII or OASIS file".into(),
            ),
            Error::Changed { .. } => ("file/changed-meanwhile", error.to_string(), BEING_WRITTEN.into()),
            Error::Extraction { ref cause, .. } => (cause.id(), error.to_string(), cause.remedy()),
        };
        Self::Invalid {
            id,
            what,
            hint,
            source: Some(Box::new(error)),
        }
    }
}
