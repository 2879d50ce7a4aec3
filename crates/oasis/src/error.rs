//! Errors of reading and writing OASIS: causes with numbers and places, and for each a remedy.

use crate::record;

/// Reason why a layout could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OasisError {
    /// The operating system refused.
    #[error("cannot read or write the layout: {0}")]
    Io(#[from] std::io::Error),

    /// The file breaks the format, or is beyond a limit.
    #[error("byte {offset}{}: {fault}", inside(*inner))]
    Fault {
        /// Offset of the record at fault from the start of the file; that of the CBLOCK if it is in one.
        offset: u64,
        /// Offset in what the CBLOCK unpacks to.
        inner: Option<u64>,
        #[source]
        fault: OasisFault,
    },
}

fn inside(inner: Option<u64>) -> String {
    inner.map_or_else(String::new, |inner| format!(", byte {inner} of the CBLOCK there"))
}

/// Fault at a place of a layout.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OasisFault {
    #[error("the file does not begin as OASIS does")]
    NoMagic,
    #[error("the first record is not START")]
    NoStart,
    #[error("version \"{0}\"; 1.0 is read")]
    Version(String),
    #[error("a grid of {0} steps a micrometre")]
    Unit(f64),
    #[error("the file ends before END")]
    EndsEarly,
    #[error("the CBLOCK ends inside a record")]
    EndsInRecord,
    #[error("record type {0} is not OASIS")]
    RecordKind(u64),
    #[error("a {} record in a CBLOCK", record::name(*kind))]
    InBlock { kind: u8 },
    #[error("a {} record outside every cell", record::name(*kind))]
    OutsideCells { kind: u8 },
    #[error("a second START")]
    SecondStart,
    #[error("an integer of more than 64 bits")]
    IntegerSize,
    /// The last byte of an integer of several bytes adds nothing to it.
    #[error("an integer that is padded with zeros")]
    IntegerPadded,
    #[error("{value} where at most {most} is possible")]
    TooLarge { value: u64, most: u64 },
    #[error("a real number of type {0}")]
    RealKind(u64),
    #[error("a real number that is none")]
    RealValue,
    #[error("an info byte of {info:#04x} in a {} record", record::name(*kind))]
    Info { kind: u8, info: u8 },
    #[error("a {} record that relies on {what}, which no record before it set", record::name(*kind))]
    Undefined { kind: u8, what: &'static str },
    #[error("a repetition of type {0}")]
    RepetitionKind(u64),
    #[error("a point list of type {0}")]
    PointListKind(u64),
    #[error("a point list of {found} points in a {}", record::name(*kind))]
    Points { kind: u8, found: u64 },
    #[error("a compact trapezoid of type {kind}, {width} x {height}")]
    Trapezoid { kind: u64, width: i64, height: i64 },
    #[error("an extension scheme of {0}")]
    Extension(u64),
    #[error("a byte of {0:#04x} in a name")]
    NameByte(u8),
    #[error("a name of no characters")]
    EmptyName,
    #[error("{table} records with and without numbers in one file")]
    MixedNumbers { table: &'static str },
    #[error("a property value of type {0}")]
    ValueKind(u64),
    #[error("an interval of type {0}")]
    IntervalKind(u64),
    #[error("a magnification of {magnification:e}, angle {angle_deg}")]
    Magnification { magnification: f64, angle_deg: f64 },
    #[error("compression of type {0}")]
    Compression(u64),
    #[error("the CBLOCK does not unpack: {0}")]
    Deflate(String),
    #[error("the CBLOCK says {said} bytes unpacked and holds {}", if *more { "more" } else { "fewer" })]
    BlockLength { said: u64, more: bool },
    #[error("the END record begins {before_end} bytes before the end of the file, not 256")]
    EndPlace { before_end: u64 },
    #[error("the END record does not fill its 256 bytes")]
    EndLength,
    #[error("a validation scheme of {0}")]
    Validation(u64),
    #[error("the checksum of the file is {found:08x}, its END record says {said:08x}")]
    Checksum { found: u32, said: u32 },
    #[error("the {table} records begin at byte {found}, the table of offsets says {said}")]
    TableOffset { table: &'static str, found: u64, said: u64 },

    /// Beyond one of [`crate::OasisLimits`].
    #[error("{}", limit.words(*found, *most))]
    Limit { limit: OasisLimit, found: u64, most: u64 },
}

/// Limit of [`crate::OasisLimits`] that was exceeded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum OasisLimit {
    StringBytes,
    Points,
    ListPlaces,
    Values,
    /// A coordinate, or a copy, too far from the origin.
    Farthest,
    /// Bytes of all CBLOCKs unpacked.
    Unpacked,
}

impl OasisLimit {
    fn words(self, found: u64, most: u64) -> String {
        match self {
            Self::StringBytes => format!("a text of {found} bytes, {most} are read"),
            Self::Points => format!("an outline of {found} points, {most} are read"),
            Self::ListPlaces => format!("a list of {found} places, {most} are read"),
            Self::Values => format!("a property of {found} values, {most} are read"),
            Self::Farthest => format!("a place more than {most} grid steps from the origin"),
            Self::Unpacked => {
                format!("CBLOCKs of {found} bytes unpacked, {most} are read from a file as short as this")
            }
        }
    }
}

const REWRITE: &str = "the file is damaged: write or copy it again";
const REPORT: &str = "the tool that wrote this file breaks the format: report it there";

impl OasisFault {
    /// Remedy for the error.
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::NoMagic => "is this an OASIS file? It begins with %SEMI-OASIS",
            Self::EndsEarly | Self::EndPlace { .. } => {
                "the file is cut short or has bytes behind its end: copy it again"
            }
            Self::Checksum { .. } => "bytes were changed after the file was written: copy it again",
            Self::EndsInRecord | Self::Deflate(_) | Self::BlockLength { .. } | Self::RecordKind(_) => REWRITE,
            Self::Version(_) => "write the layout as OASIS 1.0",
            Self::Unit(_) => "grids from 1e-3 to 1e7 steps a micrometre are read; layouts have 1000",
            Self::Magnification { .. } => "magnifications from 1e-6 to 1e6 are read",
            Self::Limit { limit, .. } => match limit {
                OasisLimit::Farthest => "write the layout about the origin, on a coarser grid if need be",
                OasisLimit::Unpacked => "is this the layout that was meant? Write it without compression",
                OasisLimit::ListPlaces => "write shorter repetitions",
                OasisLimit::Points => "split the polygon",
                _ => "is the file damaged?",
            },
            _ => REPORT,
        }
    }
}
