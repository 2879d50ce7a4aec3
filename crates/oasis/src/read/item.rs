//! Items that reading returns.

use crate::error::OasisFault;
use crate::repetition::Repetition;

/// A departure from the format that was read over.
#[derive(Clone, Debug, PartialEq)]
pub struct OasisWarning {
    /// Place of the record in the file, of the CBLOCK if it is in one.
    pub offset: u64,
    pub fault: OasisFault,
    /// What was taken instead.
    pub taken: &'static str,
}

/// Details of the format of a file that was read to its end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OasisDetails {
    /// CBLOCK records.
    pub compressed_blocks: u64,
    /// True if the offsets of the tables of names are in END, not in START.
    pub table_offsets_in_end: bool,
    /// True if some table of names is in strict mode: all of its records stand at its offset.
    pub strict_tables: bool,
    /// Checksum in END.
    pub checksum: Option<&'static str>,
}

/// Place where a record begins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct OasisPlace {
    /// Offset from the start of the file; of the CBLOCK record if the record is in one.
    pub offset: u64,
    /// Offset in what the CBLOCK unpacks to.
    pub inner: Option<u64>,
}

/// One record that holds something.
#[derive(Debug)]
pub enum OasisItem<'a> {
    /// A cell begins; what follows up to the next cell or name is in it.
    Cell(CellReference<'a>),
    Element(OasisElement<'a>),
    /// An entry of a table of names.
    Name(NameEntry<'a>),
    /// Belongs to the element, name or cell before it, to the file if there is none.
    Property {
        name: CellReference<'a>,
        /// A name that the format itself gives a meaning.
        standard: bool,
        values: &'a [OasisValue],
    },
    End,
}

/// A cell, text or property by its number in a table of names, or by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellReference<'a> {
    Number(u64),
    Name(&'a [u8]),
}

/// An element of a cell. Lengths and places in grid steps.
#[derive(Clone, Copy, Debug)]
pub struct OasisElement<'a> {
    pub place: OasisPlace,
    pub shape: OasisShape<'a>,
    /// Zero for placements.
    pub layer: u32,
    /// Text type of a text.
    pub datatype: u32,
    /// Place of the first copy.
    pub at: [i64; 2],
    pub repetition: Option<&'a Repetition>,
    /// One, or those of the repetition; at most `u64::MAX`.
    pub copies: u64,
    /// Left, bottom, right, top of the places of all copies, from the first.
    pub reach: [i64; 4],
}

/// Shape of an element. Points are from [`OasisElement::at`].
#[derive(Clone, Copy, Debug)]
pub enum OasisShape<'a> {
    /// Lower left corner at the place.
    Rectangle {
        size: [i64; 2],
    },
    /// A closed outline, the first point not repeated; trapezoids too.
    Polygon {
        points: &'a [[i64; 2]],
    },
    /// A pen drawn along a line, beyond its first and last point by `extensions`.
    Path {
        points: &'a [[i64; 2]],
        half_width: i64,
        extensions: [i64; 2],
    },
    Circle {
        radius: i64,
    },
    Text {
        string: CellReference<'a>,
    },
    /// A cell, mirrored at the x axis, then magnified and turned counter-clockwise.
    Placement {
        cell: CellReference<'a>,
        mirrored: bool,
        magnification: f64,
        angle_deg: f64,
    },
    /// XELEMENT and XGEOMETRY: of a meaning that the file and its reader have agreed on.
    Private {
        attribute: u64,
    },
}

/// Table of names that an entry is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NameTable {
    Cells,
    Texts,
    Properties,
    PropertyTexts,
    Layers,
    Private,
}

impl NameTable {
    /// Name of its records.
    pub(crate) fn words(self) -> &'static str {
        ["CELLNAME", "TEXTSTRING", "PROPNAME", "PROPSTRING", "LAYERNAME", "XNAME"][self as usize]
    }
}

/// An entry of a table of names.
#[derive(Clone, Copy, Debug)]
pub struct NameEntry<'a> {
    pub table: NameTable,
    /// Number by which records refer to the name; of layers it has no meaning.
    pub number: u64,
    pub name: &'a [u8],
}

/// A value of a property.
#[derive(Clone, Debug, PartialEq)]
pub enum OasisValue {
    Real(f64),
    Unsigned(u64),
    Signed(i64),
    Text(Vec<u8>),
    /// Number in the table of property texts.
    TextNumber(u64),
}

/// Outcome of reading a record, without borrowing it.
#[derive(Clone, Copy, Debug)]
pub(super) enum Step {
    Cell,
    Element(Kind),
    Name(NameTable, u64),
    Property { standard: bool },
    End,
}

/// Kinds of elements, their content being in the modal variables.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    Rectangle,
    Polygon,
    Trapezoid,
    Path,
    Circle,
    Text,
    Placement,
    Private(u64),
}
