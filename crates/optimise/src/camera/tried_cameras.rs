//! Cameras that a search has tried, kept on the disk: a search that ended early goes on with the same numbers.

use std::path::{Path, PathBuf};

use metalith_core::file::read_at_most;
use metalith_core::text::hex;
use metalith_core::{AtomicFile, Error, Result};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::search::Arrangement;
use super::task::TriedCamera;

/// Longest file (bytes): some kilobytes a camera.
const LONGEST: u64 = 64 << 20;

/// Contents of the file.
#[derive(Serialize, Deserialize)]
struct Kept {
    /// Digest of what decides the search.
    of: String,
    /// SHA-256 of the cameras as they stand here.
    sha256: String,
    tried: Vec<TriedCamera>,
}

/// Cameras of one search, in the order in which they were tried.
#[derive(Debug)]
pub struct TriedCameras {
    path: PathBuf,
    of: String,
    tried: Vec<TriedCamera>,
}

impl TriedCameras {
    /// Cameras that a file keeps of the search that a text decides; none if it is of another search, damaged or not there.
    pub fn open(path: &Path, decides: &str) -> Self {
        let of = hex(&Sha256::digest(decides));
        let kept = read_at_most(path, LONGEST, "cameras of a search")
            .ok()
            .and_then(|bytes| serde_json::from_slice::<Kept>(&bytes).ok())
            .filter(|kept| kept.of == of && kept.sha256 == digest(&kept.tried));
        Self {
            path: path.to_owned(),
            of,
            tried: kept.map_or_else(Vec::new, |kept| kept.tried),
        }
    }

    /// Number of cameras.
    pub fn count(&self) -> usize {
        self.tried.len()
    }

    /// The camera of an arrangement in a light (lux), if it was tried.
    pub(super) fn find(&self, lux: f64, arrangement: &Arrangement) -> Option<&TriedCamera> {
        self.tried
            .iter()
            .find(|c| c.lux == lux && c.arrangement == *arrangement)
    }

    /// Keep one more.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub(super) fn add(&mut self, camera: TriedCamera) -> Result<()> {
        self.tried.push(camera);
        let kept = Kept {
            of: self.of.clone(),
            sha256: digest(&self.tried),
            tried: self.tried.clone(),
        };
        AtomicFile::write(&self.path, &bytes(&kept)?)
    }

    /// Remove the file: the search is at its end.
    ///
    /// # Errors
    /// If it cannot be removed.
    pub fn discard(self) -> Result<()> {
        AtomicFile::discard(&self.path)
    }
}

fn bytes(of: &impl Serialize) -> Result<Vec<u8>> {
    serde_json::to_vec(of).map_err(|e| Error::refused("internal/serialisation-failed", e.to_string(), "report this"))
}

fn digest(tried: &[TriedCamera]) -> String {
    bytes(&tried).map_or_else(|_| String::new(), |bytes| hex(&Sha256::digest(bytes)))
}
