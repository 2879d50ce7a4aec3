//! The designs that come with the program, to start from.

use std::path::{Path, PathBuf};

use include_dir::{Dir, include_dir};
use metalith::{AtomicFile, Design, Error, Result};

static DESIGNS: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/designs");

/// A design of the repository, with the files that it names.
pub(crate) struct ShippedDesign {
    name: String,
    text: &'static str,
    /// Files by their paths from the design.
    files: Vec<(&'static Path, &'static [u8])>,
}

impl ShippedDesign {
    /// The names of all, in the order of the alphabet.
    pub(crate) fn names() -> Vec<&'static str> {
        let toml = DESIGNS
            .files()
            .filter(|f| f.path().extension().is_some_and(|e| e == "toml"));
        let mut names: Vec<_> = toml.filter_map(|f| f.path().file_stem()?.to_str()).collect();
        names.sort_unstable();
        names
    }

    /// Design of one of [`ShippedDesign::names`].
    ///
    /// # Panics
    /// If it is none of them.
    pub(crate) fn of(name: &str) -> Self {
        let file = DESIGNS.get_file(format!("{name}.toml")).expect("one of the names");
        let text = file.contents_utf8().expect("designs are text");
        let named = DESIGNS.dirs().flat_map(Dir::files).filter(|f| {
            let path = f.path().to_str().expect("a path of the repository");
            text.contains(&format!("\"{path}\""))
        });
        Self {
            name: name.to_owned(),
            text,
            files: named.map(|f| (f.path(), f.contents())).collect(),
        }
    }

    /// Write it under another name and as `change` makes it, with its files beside it, and give the paths of all.
    ///
    /// # Errors
    /// If a file is there that says something else, the name is none of a design, or a file cannot be written, and those of `change`:
    /// then none of them is left.
    pub(crate) fn write(
        &self,
        design: &Path,
        name: &str,
        change: impl FnOnce(String) -> Result<String>,
    ) -> Result<Vec<PathBuf>> {
        let folder = design.parent().unwrap_or(Path::new(""));
        let beside: Vec<(PathBuf, &[u8])> = self
            .files
            .iter()
            .map(|(path, bytes)| (folder.join(path), *bytes))
            .collect();
        for (path, bytes) in &beside {
            // A file of another size, however large, is not read.
            let is_as_long =
                || std::fs::metadata(path).is_ok_and(|found| found.is_file() && found.len() == bytes.len() as u64);
            let is_it = || is_as_long() && std::fs::read(path).is_ok_and(|found| found == *bytes);
            if path.exists() && !is_it() {
                return Err(Error::refused(
                    "new/exists",
                    format!("{} exists and has other contents", path.display()),
                    "write the design to another folder, or move the file away",
                ));
            }
        }
        let missing: Vec<_> = beside.into_iter().filter(|(path, _)| !path.exists()).collect();
        let written = (|| {
            for (path, bytes) in &missing {
                let parent = path.parent().expect("it is in a folder");
                std::fs::create_dir_all(parent).map_err(Error::io("create the folder", parent))?;
                AtomicFile::write(path, bytes)?;
            }
            let [own, new] = [&self.name, name].map(|name| format!("name = \"{name}\""));
            let text = change(self.text.replacen(&own, &new, 1))?;
            Design::parse(design, &text)?;
            AtomicFile::write(design, text.as_bytes())?;
            Ok::<_, Error>(text)
        })();
        let text = written.as_deref().unwrap_or_default();
        let (files, unnamed): (Vec<_>, Vec<_>) = missing.into_iter().map(|(path, _)| path).partition(|path| {
            let from_design = path
                .strip_prefix(folder)
                .unwrap_or(path)
                .to_string_lossy()
                .replace('\\', "/");
            text.contains(&format!("\"{from_design}\""))
        });
        for path in unnamed {
            let _ = std::fs::remove_file(&path);
            // A folder that holds other files stays.
            let _ = path.parent().map(std::fs::remove_dir);
        }
        written?;
        Ok(std::iter::once(design.to_owned()).chain(files).collect())
    }
}
