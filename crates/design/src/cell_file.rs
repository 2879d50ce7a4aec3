//! The cell of a file that need not be a whole design.

use std::path::{Path, PathBuf};

use metalith_cell::CellStack;
use metalith_core::Result;
use metalith_core::document::{Document, Section, load};

use crate::CellSpec;
use crate::spec::{FOCAL_LENGTH, WAVELENGTH};

/// The section `[cell]` of a file, and the light of a design if the file is one. Other sections are not looked at.
#[derive(Clone, Debug)]
pub struct CellFile {
    pub path: PathBuf,
    pub cell: CellSpec,
    /// Focal length in `[lens]` (um).
    pub focal_length_um: Option<f64>,
    /// Wavelengths in `[verify]` (um).
    pub wavelengths_um: Vec<f64>,
}

impl CellFile {
    /// Read the section `[cell]` of the file at `path`, and focal length and wavelengths where it has them.
    ///
    /// # Errors
    /// If the file cannot be read; with every mistake of its section, each with line, column and remedy.
    pub fn read(path: &Path) -> Result<Self> {
        Document::read(path, &load(path)?, |root| {
            root.accept_others();
            let section = |key: &str| root.optional_section(key).inspect(Section::accept_others);
            let (lens, verify) = (section("lens"), section("verify"));
            let stated = verify.filter(|verify| verify.has("wavelengths_nm"));
            let wavelengths_nm = stated.map_or_else(Vec::new, |verify| verify.floats("wavelengths_nm", WAVELENGTH));
            Self {
                path: path.to_owned(),
                cell: CellSpec::read(&root.section("cell")),
                focal_length_um: lens.and_then(|lens| lens.optional_float("focal_length_um", FOCAL_LENGTH)),
                wavelengths_um: wavelengths_nm.into_iter().map(|nm| nm * 1e-3).collect(),
            }
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
