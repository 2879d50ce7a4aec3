//! Journal of what was judged so far, in a file: a validation takes long, and may be stopped.

use std::fs::{self, File};
use std::io::Write;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use super::ValidationTrial;
use metalith_core::{Error, Result};

/// A file of one line of JSON for each set, in the order in which they end; none if nobody asked for one.
pub(crate) struct Journal<'p>(Option<(&'p Path, Mutex<File>)>);

impl<'p> Journal<'p> {
    /// An empty one, in a folder that is made if need be.
    ///
    /// # Errors
    /// If folder or file cannot be made.
    pub(crate) fn new(path: Option<&'p Path>) -> Result<Self> {
        let Some(path) = path else {
            return Ok(Self(None));
        };
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(Error::io("make", folder))?;
        }
        let file = File::create(path).map_err(Error::io("make", path))?;
        Ok(Self(Some((path, Mutex::new(file)))))
    }

    /// Add a set.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub(crate) fn keep(&self, trial: &ValidationTrial) -> Result<()> {
        let Some((path, file)) = &self.0 else {
            return Ok(());
        };
        let mut line = serde_json::to_string(trial).expect("plain data serialises");
        line.push('\n');
        let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
        file.write_all(line.as_bytes()).map_err(Error::io("write", path))
    }
}
