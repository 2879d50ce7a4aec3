//! Record types by number, and the bits of their info bytes.

pub(crate) mod kind {
    pub(crate) const PAD: u8 = 0;
    pub(crate) const START: u8 = 1;
    pub(crate) const END: u8 = 2;
    pub(crate) const CELLNAME: u8 = 3;
    pub(crate) const CELLNAME_NUMBERED: u8 = 4;
    pub(crate) const TEXTSTRING: u8 = 5;
    pub(crate) const TEXTSTRING_NUMBERED: u8 = 6;
    pub(crate) const PROPNAME: u8 = 7;
    pub(crate) const PROPNAME_NUMBERED: u8 = 8;
    pub(crate) const PROPSTRING: u8 = 9;
    pub(crate) const PROPSTRING_NUMBERED: u8 = 10;
    pub(crate) const LAYERNAME: u8 = 11;
    pub(crate) const LAYERNAME_OF_TEXT: u8 = 12;
    pub(crate) const CELL: u8 = 13;
    pub(crate) const CELL_NAMED: u8 = 14;
    pub(crate) const XYABSOLUTE: u8 = 15;
    pub(crate) const XYRELATIVE: u8 = 16;
    pub(crate) const PLACEMENT: u8 = 17;
    pub(crate) const PLACEMENT_GENERAL: u8 = 18;
    pub(crate) const TEXT: u8 = 19;
    pub(crate) const RECTANGLE: u8 = 20;
    pub(crate) const POLYGON: u8 = 21;
    pub(crate) const PATH: u8 = 22;
    pub(crate) const TRAPEZOID: u8 = 23;
    pub(crate) const TRAPEZOID_A: u8 = 24;
    pub(crate) const TRAPEZOID_B: u8 = 25;
    pub(crate) const CTRAPEZOID: u8 = 26;
    pub(crate) const CIRCLE: u8 = 27;
    pub(crate) const PROPERTY: u8 = 28;
    pub(crate) const PROPERTY_REPEATED: u8 = 29;
    pub(crate) const XNAME: u8 = 30;
    pub(crate) const XNAME_NUMBERED: u8 = 31;
    pub(crate) const XELEMENT: u8 = 32;
    pub(crate) const XGEOMETRY: u8 = 33;
    pub(crate) const CBLOCK: u8 = 34;
}

/// Bits of the info bytes of areas; texts and areas share the lower five.
pub(crate) mod info {
    /// Square, vertical trapezoid, path with extensions, compact trapezoid with its type.
    pub(crate) const FIRST: u8 = 0x80;
    pub(crate) const WIDTH: u8 = 0x40;
    /// Height, or the points of polygons and paths, or the radius.
    pub(crate) const HEIGHT: u8 = 0x20;
    pub(crate) const X: u8 = 0x10;
    pub(crate) const Y: u8 = 0x08;
    pub(crate) const REPETITION: u8 = 0x04;
    pub(crate) const DATATYPE: u8 = 0x02;
    pub(crate) const LAYER: u8 = 0x01;
}

/// Bits of the info bytes of placements, and of their names in texts (one place lower).
pub(crate) mod placed {
    pub(crate) const CELL: u8 = 0x80;
    pub(crate) const NUMBER: u8 = 0x40;
    pub(crate) const X: u8 = 0x20;
    pub(crate) const Y: u8 = 0x10;
    pub(crate) const REPETITION: u8 = 0x08;
    pub(crate) const MAGNIFICATION: u8 = 0x04;
    pub(crate) const ANGLE: u8 = 0x02;
    pub(crate) const FLIP: u8 = 0x01;
}

/// Length of the END record, and its place before the end of the file.
pub(crate) const END_BYTES: usize = 256;

/// Validation schemes of END.
pub(crate) mod validation {
    pub(crate) const NONE: u64 = 0;
    pub(crate) const CRC32: u64 = 1;
    pub(crate) const CHECKSUM32: u64 = 2;
}

/// Name of a record type, for messages.
pub(crate) fn name(kind: u8) -> &'static str {
    const NAMES: &str = "PAD START END CELLNAME CELLNAME TEXTSTRING TEXTSTRING PROPNAME PROPNAME PROPSTRING \
        PROPSTRING LAYERNAME LAYERNAME CELL CELL XYABSOLUTE XYRELATIVE PLACEMENT PLACEMENT TEXT RECTANGLE \
        POLYGON PATH TRAPEZOID TRAPEZOID TRAPEZOID CTRAPEZOID CIRCLE PROPERTY PROPERTY XNAME XNAME XELEMENT \
        XGEOMETRY CBLOCK";
    NAMES.split(' ').nth(kind.into()).unwrap_or("unknown")
}
