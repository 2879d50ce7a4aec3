//! Cache of kernels and stray light between runs.

use std::path::{Path, PathBuf};

use metalith_cell::cache_folder;
use metalith_core::{Progress, Result};

/// Folder of kernels within that of a plan.
const KERNELS: &str = "kernels";

/// Cache of kernels and stray light between runs.
#[derive(Clone, Debug)]
pub struct KernelCache {
    /// Nowhere, if left out.
    pub(crate) folder: Option<PathBuf>,
    pub(crate) make: bool,
    /// True if the folder was asked for: what cannot be stored there is an error. The folder of a user only saves time.
    asked: bool,
}

impl KernelCache {
    /// Cache in the folder in which this user keeps tables of cells too.
    pub fn of_user() -> Self {
        Self {
            folder: cache_folder(),
            make: true,
            asked: false,
        }
    }

    /// Cache in a folder; kernels are made if they are not there.
    pub fn made(folder: &Path) -> Self {
        Self {
            folder: Some(folder.join(KERNELS)),
            make: true,
            asked: true,
        }
    }

    /// Cache in a folder where the kernels were made.
    pub fn only(folder: &Path) -> Self {
        Self {
            make: false,
            ..Self::made(folder)
        }
    }

    /// Keep something by what writes it into the folder, if there is one.
    pub(crate) fn keep(
        &self,
        what: &str,
        write: impl FnOnce(&Path) -> Result<()>,
        progress: &dyn Progress,
    ) -> Result<()> {
        match self.folder.as_deref().map(write) {
            Some(Err(error)) if !self.asked => {
                progress.warn(&format!("{what} not kept: {error}"));
                Ok(())
            }
            Some(done) => done,
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cache_file;
    use crate::stray_light::StrayLight;
    use metalith_sensor::Camera;
    use std::sync::Mutex;

    /// Holds the notes.
    struct Listener(Mutex<Vec<String>>);

    impl Progress for Listener {
        fn begin(&self, _what: &str, _steps: u64) {}

        fn advance(&self, _steps: u64) {}

        fn note(&self, text: &str) {
            self.0.lock().unwrap().push(text.into());
        }
    }

    #[test]
    fn what_cannot_be_kept_for_a_user_is_a_note() {
        let place = tempfile::tempdir().unwrap();
        // A file stands where a folder should.
        let file = place.path().join("file");
        std::fs::write(&file, "").unwrap();
        let sensor = Camera::three_bands(5.86).sensor;
        let stray_light = StrayLight::none(&sensor, 1, 1);
        let write = |folder: &Path| cache_file::cache_stray_light(folder, b"inputs", &stray_light);
        let listener = Listener(Mutex::default());
        let asked = KernelCache::made(&file);
        assert!(asked.keep("the stray light is", write, &listener).is_err());
        let of_user = KernelCache {
            folder: asked.folder.clone(),
            ..KernelCache::of_user()
        };
        of_user.keep("the stray light is", write, &listener).unwrap();
        let notes = listener.0.into_inner().unwrap();
        assert!(
            notes.len() == 1 && notes[0].starts_with("the stray light is not kept: "),
            "{notes:?}"
        );
    }
}
