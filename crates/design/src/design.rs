//! The design file: everything that a person decides, read with a place for every mistake.

use std::path::{Path, PathBuf};

use serde::Serialize;
use sha2::{Digest, Sha256};

use metalith_core::document::{Document, Section, load};
use metalith_core::{Lattice, Result};

use crate::spec::{ArraySpec, CellSpec, Element, LayoutSpec, LensSpec, MappingSpec, OptimiseSpec, VerifySpec};

/// Version of the format of design files that this program reads.
const SCHEMA: i64 = 1;

/// A design: what is to be built, how it is to be written, and what must hold of the result.
#[derive(Clone, Debug)]
pub struct Design {
    /// Name of the design; the files it leaves are named after it, so only letters, digits, `_` and `-`.
    pub name: String,
    /// One line for people.
    pub title: String,
    /// Where the design was read from.
    pub path: PathBuf,
    pub cell: CellSpec,
    pub lens: LensSpec,
    pub array: ArraySpec,
    pub mapping: MappingSpec,
    pub layout: LayoutSpec,
    pub verify: VerifySpec,
    /// How `metalith optimize` finds the phase; decides nothing of the layout.
    pub optimise: OptimiseSpec,
}

impl Design {
    /// Read the design file at `path`, and the files that it names.
    ///
    /// # Errors
    /// [`metalith_core::Error::Text`] with every mistake of the file, each with line, column and remedy;
    /// [`metalith_core::Error::Table`] for a phase table that cannot be used.
    pub fn read(path: &Path) -> Result<Self> {
        let text = load(path)?;
        let design = Document::read(path, &text, |root| Self::sections(path, root))?;
        design?.with_files()
    }

    fn sections(path: &Path, root: &Section<'_, '_>) -> Result<Self> {
        root.integer("schema", SCHEMA..=SCHEMA, "");
        let name = root.text("name");
        let legal = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        if root.has("name") && (name.is_empty() || name.len() > MAX_NAME || !name.chars().all(legal)) {
            root.fault(
                "name",
                format!("\"{name}\" cannot name files and cells"),
                format!("use 1 to {MAX_NAME} of the characters A-Z a-z 0-9 _ -"),
            );
        }
        let title = root.optional_text("title").unwrap_or_else(|| name.clone());
        let cell = CellSpec::read(&root.section("cell"));
        let lens = LensSpec::read(&root.section("lens"), &root.section("phase"), &cell);
        let array = ArraySpec::read(&root.section("array"), &lens);
        let mapping = MappingSpec::read(&root.section("mapping"), &cell);
        let layout = LayoutSpec::read(root, &lens, &array);
        let verify = VerifySpec::read(&root.section("verify"));
        let optimise = OptimiseSpec::read(root.optional_section("optimise").as_ref());
        Ok(Self {
            name,
            title,
            path: path.to_owned(),
            cell,
            lens,
            array,
            mapping,
            layout,
            verify,
            optimise,
        })
    }

    /// Read the files that the design names, after all its own mistakes are known to be none.
    fn with_files(mut self) -> Result<Self> {
        self.lens.phase.load(self.lens.radius_um())?;
        self.mapping.load(&self.cell)?;
        Ok(self)
    }

    /// The lattice that the pillars of each element stand on.
    pub fn lattice(&self) -> Lattice {
        Lattice::covering(self.lens.diameter_nm, self.cell.pitch_nm).expect("checked when the design was read")
    }

    /// Radius of the openings in the metal around the lenses [um].
    pub fn aperture_radius_um(&self) -> f64 {
        self.lens.radius_um() + self.layout.apertures.margin_nm as f64 * 1e-3
    }

    /// The elements of the array, row by row from the lowest.
    pub fn elements(&self) -> Vec<Element> {
        self.array.elements()
    }

    /// SHA-256 of all that decides the layout (not of what is verified): two designs with the same
    /// digest give the same bytes. In hexadecimal.
    pub fn digest(&self) -> String {
        #[derive(Serialize)]
        struct Decisive<'a>(
            &'a str,
            &'a CellSpec,
            &'a LensSpec,
            &'a ArraySpec,
            &'a MappingSpec,
            &'a LayoutSpec,
        );
        let decisive = Decisive(
            &self.name,
            &self.cell,
            &self.lens,
            &self.array,
            &self.mapping,
            &self.layout,
        );
        let bytes = serde_json::to_vec(&decisive).expect("plain data serialises");
        Sha256::digest(&bytes).iter().map(|b| format!("{b:02x}")).collect()
    }
}

/// Leaves room within the 32 characters of a GDSII cell name for the parts a layout adds.
const MAX_NAME: usize = 24;
