//! Tables of the designs that come with the program: their supercells take minutes to solve.

use include_dir::{Dir, include_dir};

/// Made by `scripts/ship_tables.sh`; each file says of which inputs.
static TABLES: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/tables");

/// The bytes of a shipped file.
pub(crate) fn file(name: &str) -> Option<&'static [u8]> {
    TABLES.get_file(name).map(include_dir::File::contents)
}
