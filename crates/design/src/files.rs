//! Files that a design is read from.

use std::path::{Path, PathBuf};

use crate::design::Design;

impl Design {
    /// Tables that the design names, each with its purpose: the mapping, the library, phases of its lenses.
    pub fn tables(&self) -> Vec<(&Path, &'static str)> {
        let mut files: Vec<(&Path, &'static str)> = Vec::new();
        if let Some(table) = &self.mapping.table_file {
            files.push((table, "phase to width, the mapping of the design"));
        }
        if let Some(library) = &self.mapping.pillar_library_file {
            files.push((library, "phases of upright pillars, the library of the design"));
        }
        let own = self.array.placed.iter().filter_map(|placed| placed.lens.as_ref());
        files.extend(
            std::iter::once(&self.lens)
                .chain(own)
                .flat_map(|lens| lens.phase_files()),
        );
        files
    }

    /// The design file, its tables and its camera: what no result of the design replaces. A library that is to be made anew is a
    /// result itself.
    pub fn inputs(&self) -> Vec<PathBuf> {
        let is_to_be_made = self.mapping.pillar_library_file.is_some() && self.mapping.pillar_library.is_none();
        let library = self.mapping.pillar_library_file.as_deref().filter(|_| is_to_be_made);
        let tables = self
            .tables()
            .into_iter()
            .map(|(file, _)| file)
            .filter(|file| Some(*file) != library);
        let files = std::iter::once(self.path.as_path()).chain(tables);
        files.chain(self.verify.camera.as_deref()).map(Path::to_owned).collect()
    }
}
