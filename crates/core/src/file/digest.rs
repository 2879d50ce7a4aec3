//! Digests of files.

use std::fs;
use std::io;
use std::path::Path;

use sha2::{Digest, Sha256};

use crate::error::{Error, Result};

/// SHA-256 of a file, read piece by piece.
///
/// # Errors
/// If it cannot be read.
pub fn file_digest(path: &Path) -> Result<[u8; 32]> {
    let mut file = fs::File::open(path).map_err(Error::io("read", path))?;
    let mut hash = Sha256::new();
    io::copy(&mut file, &mut hash).map_err(Error::io("read", path))?;
    Ok(hash.finalize().into())
}
