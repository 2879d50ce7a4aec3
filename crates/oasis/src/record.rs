//! Record types by number, and the bits of their info bytes.

pub(crate) mod kind {
    pub const PAD: u8 = 0;
    pub const START: u8 = 1;
    pub const END: u8 = 2;
    pub const CELLNAME: u8 = 3;
    pub const CELLNAME_NUMBERED: u8 = 4;
    pub const TEXTSTRING: u8 = 5;
    pub const TEXTSTRING_NUMBERED: u8 = 6;
    pub const PROPNAME: u8 = 7;
    pub const PROPNAME_NUMBERED: u8 = 8;
    pub const PROPSTRING: u8 = 9;
    pub const PROPSTRING_NUMBERED: u8 = 10;
    pub const LAYERNAME: u8 = 11;
    pub const LAYERNAME_OF_TEXT: u8 = 12;
    pub const CELL: u8 = 13;
    pub const CELL_NAMED: u8 = 14;
    pub const XYABSOLUTE: u8 = 15;
    pub const XYRELATIVE: u8 = 16;
    pub const PLACEMENT: u8 = 17;
    pub const PLACEMENT_GENERAL: u8 = 18;
    pub const TEXT: u8 = 19;
    pub const RECTANGLE: u8 = 20;
    pub const POLYGON: u8 = 21;
    pub const PATH: u8 = 22;
    pub const TRAPEZOID: u8 = 23;
    pub const TRAPEZOID_A: u8 = 24;
    pub const TRAPEZOID_B: u8 = 25;
    pub const CTRAPEZOID: u8 = 26;
    pub const CIRCLE: u8 = 27;
    pub const PROPERTY: u8 = 28;
    pub const PROPERTY_REPEATED: u8 = 29;
    pub const XNAME: u8 = 30;
    pub const XNAME_NUMBERED: u8 = 31;
    pub const XELEMENT: u8 = 32;
    pub const XGEOMETRY: u8 = 33;
    pub const CBLOCK: u8 = 34;
}

/// Bits of the info bytes of areas; texts and areas share the lower five.
pub(crate) mod info {
    /// Square, vertical trapezoid, path with extensions, compact trapezoid with its type.
    pub const FIRST: u8 = 0x80;
    pub const WIDTH: u8 = 0x40;
    /// Height, or the points of polygons and paths, or the radius.
    pub const HEIGHT: u8 = 0x20;
    pub const X: u8 = 0x10;
    pub const Y: u8 = 0x08;
    pub const REPETITION: u8 = 0x04;
    pub const DATATYPE: u8 = 0x02;
    pub const LAYER: u8 = 0x01;
}

/// Bits of the info bytes of placements, and of their names in texts (one place lower).
pub(crate) mod placed {
    pub const CELL: u8 = 0x80;
    pub const NUMBER: u8 = 0x40;
    pub const X: u8 = 0x20;
    pub const Y: u8 = 0x10;
    pub const REPETITION: u8 = 0x08;
    pub const MAGNIFICATION: u8 = 0x04;
    pub const ANGLE: u8 = 0x02;
    pub const FLIP: u8 = 0x01;
}

/// Length of the END record, and its place before the end of the file.
pub(crate) const END_BYTES: usize = 256;

/// Validation schemes of END.
pub(crate) mod validation {
    pub const NONE: u64 = 0;
    pub const CRC32: u64 = 1;
    pub const CHECKSUM32: u64 = 2;
}

/// Name of a record type, for messages.
pub(crate) fn name(kind: u8) -> &'static str {
    const NAMES: [&str; 35] = [
        "PAD",
        "START",
        "END",
        "CELLNAME",
        "CELLNAME",
        "TEXTSTRING",
        "TEXTSTRING",
        "PROPNAME",
        "PROPNAME",
        "PROPSTRING",
        "PROPSTRING",
        "LAYERNAME",
        "LAYERNAME",
        "CELL",
        "CELL",
        "XYABSOLUTE",
        "XYRELATIVE",
        "PLACEMENT",
        "PLACEMENT",
        "TEXT",
        "RECTANGLE",
        "POLYGON",
        "PATH",
        "TRAPEZOID",
        "TRAPEZOID",
        "TRAPEZOID",
        "CTRAPEZOID",
        "CIRCLE",
        "PROPERTY",
        "PROPERTY",
        "XNAME",
        "XNAME",
        "XELEMENT",
        "XGEOMETRY",
        "CBLOCK",
    ];
    NAMES.get(usize::from(kind)).copied().unwrap_or("unknown")
}
