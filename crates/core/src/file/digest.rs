//! Digests of files.

use std::fs;
use std::io::{ErrorKind, Read};
use std::path::Path;

use sha2::{Digest, Sha256};

use crate::error::{Error, Result};

/// Bytes that are read at a time.
const PIECE: usize = 1 << 16;

/// SHA-256 of a file, read piece by piece.
///
/// # Errors
/// If it cannot be read, or is a device or a pipe: these may have no end.
pub fn file_digest(path: &Path) -> Result<[u8; 32]> {
    let found = fs::metadata(path).map_err(Error::io("read", path))?;
    if !found.is_file() {
        let what = format!("{} is not an ordinary file", path.display());
        return Err(Error::refused("file/not-regular", what, "give the path of a file"));
    }
    let mut file = fs::File::open(path).map_err(Error::io("read", path))?;
    let mut hash = Sha256::new();
    let mut piece = vec![0; PIECE];
    loop {
        match file.read(&mut piece) {
            Ok(0) => return Ok(hash.finalize().into()),
            Ok(length) => hash.update(&piece[..length]),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(Error::io("read", path)(error)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_may_have_no_end_has_no_digest() {
        assert_eq!(
            file_digest(Path::new("/dev/zero")).unwrap_err().id(),
            "file/not-regular"
        );
    }
}
