//! The cell of a file that need not be a whole design.

use std::path::{Path, PathBuf};

use metalith_cell::CellStack;
use metalith_core::Result;
use metalith_core::document::{Document, load};

use crate::CellSpec;

/// The section `[cell]` of a file. Other sections, as those of a design, are not looked at.
#[derive(Clone, Debug)]
pub struct CellFile {
    pub path: PathBuf,
    pub cell: CellSpec,
}

impl CellFile {
    /// Read the section `[cell]` of the file at `path`.
    ///
    /// # Errors
    /// If the file cannot be read; with every mistake of its section, each with line, column and remedy.
    pub fn read(path: &Path) -> Result<Self> {
        let cell = Document::read(path, &load(path)?, |root| {
            root.accept_others();
            CellSpec::read(&root.section("cell"))
        })?;
        Ok(Self {
            path: path.to_owned(),
            cell,
        })
    }

    /// The cell with upright walls, sharp corners and no mask.
    ///
    /// # Errors
    /// If a material is not known or its table cannot be read.
    pub fn stack(&self) -> Result<CellStack> {
        self.cell.stack(self.path.parent().unwrap_or(Path::new("")))
    }
}
