//! Records: the two-byte length, type and data type that everything in a GDSII file comes wrapped in.

/// Record types by number. Those not named here hold nothing that changes geometry.
pub(super) mod kind {
    pub(crate) const HEADER: u8 = 0x00;
    pub(crate) const BGNLIB: u8 = 0x01;
    pub(crate) const LIBNAME: u8 = 0x02;
    pub(crate) const UNITS: u8 = 0x03;
    pub(crate) const ENDLIB: u8 = 0x04;
    pub(crate) const BGNSTR: u8 = 0x05;
    pub(crate) const STRNAME: u8 = 0x06;
    pub(crate) const ENDSTR: u8 = 0x07;
    pub(crate) const BOUNDARY: u8 = 0x08;
    pub(crate) const PATH: u8 = 0x09;
    pub(crate) const SREF: u8 = 0x0A;
    pub(crate) const AREF: u8 = 0x0B;
    pub(crate) const TEXT: u8 = 0x0C;
    pub(crate) const LAYER: u8 = 0x0D;
    pub(crate) const DATATYPE: u8 = 0x0E;
    pub(crate) const WIDTH: u8 = 0x0F;
    pub(crate) const XY: u8 = 0x10;
    pub(crate) const ENDEL: u8 = 0x11;
    pub(crate) const SNAME: u8 = 0x12;
    pub(crate) const COLROW: u8 = 0x13;
    pub(crate) const NODE: u8 = 0x15;
    pub(crate) const TEXTTYPE: u8 = 0x16;
    pub(crate) const STRING: u8 = 0x19;
    pub(crate) const STRANS: u8 = 0x1A;
    pub(crate) const MAG: u8 = 0x1B;
    pub(crate) const ANGLE: u8 = 0x1C;
    pub(crate) const PATHTYPE: u8 = 0x21;
    pub(crate) const NODETYPE: u8 = 0x2A;
    pub(crate) const PROPATTR: u8 = 0x2B;
    pub(crate) const BOX: u8 = 0x2D;
    pub(crate) const BOXTYPE: u8 = 0x2E;
    pub(crate) const BGNEXTN: u8 = 0x30;
    pub(crate) const ENDEXTN: u8 = 0x31;
    /// Last number that release 6 gives a meaning.
    pub(crate) const LAST: u8 = 0x3B;
    /// Last number that elements of other programs' own are passed over for.
    pub(crate) const LAST_PRIVATE: u8 = 0x7F;
}

/// Data types by number.
pub(super) mod data {
    pub(crate) const BITS: u8 = 1;
    pub(crate) const INT2: u8 = 2;
    pub(crate) const INT4: u8 = 3;
    pub(crate) const REAL8: u8 = 5;
    pub(crate) const ASCII: u8 = 6;
}

/// One record; its body stands in the buffer of the input it came from until the next is read.
#[derive(Clone, Copy, Debug)]
pub(super) struct Record {
    /// Place of its first byte in the file.
    pub offset: u64,
    pub kind: u8,
    pub data: u8,
    pub(super) from: usize,
    pub(super) to: usize,
}

/// Name of a record type, for messages.
pub(super) fn name(kind: u8) -> String {
    const NAMES: &str = "HEADER BGNLIB LIBNAME UNITS ENDLIB BGNSTR STRNAME ENDSTR BOUNDARY PATH SREF AREF TEXT \
        LAYER DATATYPE WIDTH XY ENDEL SNAME COLROW TEXTNODE NODE TEXTTYPE PRESENTATION SPACING STRING STRANS \
        MAG ANGLE UINTEGER USTRING REFLIBS FONTS PATHTYPE GENERATIONS ATTRTABLE STYPTABLE STRTYPE ELFLAGS ELKEY \
        LINKTYPE LINKKEYS NODETYPE PROPATTR PROPVALUE BOX BOXTYPE PLEX BGNEXTN ENDEXTN";
    let known = NAMES.split(' ').nth(kind.into());
    known.map_or_else(|| format!("0x{kind:02X}"), str::to_owned)
}
