//! Format in which a layout is written.

use std::path::Path;

/// Format of a layout.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LayoutFormat {
    /// GDSII, which every writer of masks takes.
    #[default]
    Gds,
    /// A hundredth of the size.
    Oasis(OasisEncoding),
}

/// Encoding of pillars in OASIS. All hold the same geometry.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OasisEncoding {
    /// Strips of 32 columns; in each, one list of places for each width. Cells of which outlines take less than two thirds of
    /// the bytes are as in `Plain`.
    #[default]
    Compact,
    /// One rectangle for each pillar, no repetitions, at most three levels of cells and one layer a file.
    Plain,
    /// Each cell as lists of places or as one reference for each pillar, whichever is smaller.
    Smallest,
}

impl LayoutFormat {
    /// Extension of the names of its files.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Gds => "gds",
            Self::Oasis(_) => "oas",
        }
    }

    /// The format that a name of a file asks for by its end: OASIS for `.oas` and `.oasis`, in any case of letters, also
    /// before `.gz`.
    pub fn of_name(path: &Path) -> Self {
        let unpacked = if is_gzip(path) {
            path.with_extension("")
        } else {
            path.to_owned()
        };
        let oasis = unpacked
            .extension()
            .is_some_and(|end| end.eq_ignore_ascii_case("oas") || end.eq_ignore_ascii_case("oasis"));
        if oasis {
            Self::Oasis(OasisEncoding::Compact)
        } else {
            Self::Gds
        }
    }
}

/// True if the name of a file asks for compression by gzip.
pub(crate) fn is_gzip(path: &Path) -> bool {
    path.extension().is_some_and(|end| end.eq_ignore_ascii_case("gz"))
}
