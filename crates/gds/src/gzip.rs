//! Layouts compressed by gzip, unpacked into a temporary file: layouts are read more than once, and from any place.

use std::fs::File;
use std::io::{self, BufWriter, Read, Write};
use std::path::Path;

use flate2::read::MultiGzDecoder;
use tempfile::{NamedTempFile, TempPath};

use crate::error::{Error, LayoutError, Result};

/// First bytes of a file that gzip made.
const MAGIC: [u8; 2] = [0x1F, 0x8B];

/// Bytes that a short file may unpack to, and how many more for each of its bytes. Deflate reaches 1032; layouts of
/// lenses, whose coordinates grow from shape to shape, reach 20.
const SHORT_FILE: u64 = 1 << 26;
const PER_BYTE: u64 = 64;

/// What a compressed file holds; none if it is not compressed. The temporary file is removed with its path.
pub(super) fn unpacked(path: &Path, bytes: u64) -> Result<Option<TempPath>> {
    let mut file = File::open(path).map_err(Error::io("open", path))?;
    let mut first = Vec::new();
    let begun = (&mut file).take(MAGIC.len() as u64).read_to_end(&mut first);
    begun.map_err(Error::io("read", path))?;
    if first != MAGIC {
        return Ok(None);
    }
    let fault = |cause| Error::Layout {
        path: path.to_owned(),
        offset: 0,
        cause,
    };
    let most = SHORT_FILE.saturating_add(PER_BYTE.saturating_mul(bytes));
    let packed = io::BufReader::new(MAGIC.chain(file));
    let mut reader = MultiGzDecoder::new(packed).take(most + 1);
    let mut out = BufWriter::new(NamedTempFile::new().map_err(Error::io("unpack", path))?);
    let mut block = vec![0; 1 << 16];
    loop {
        match reader.read(&mut block) {
            Ok(0) => break,
            Ok(count) => out.write_all(&block[..count]).map_err(Error::io("unpack", path))?,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(fault(LayoutError::Gzip(e.to_string()))),
        }
    }
    if reader.limit() == 0 {
        return Err(fault(LayoutError::Unpacked { most }));
    }
    let file = out
        .into_inner()
        .map_err(|e| Error::io("unpack", path)(e.into_error()))?;
    Ok(Some(file.into_temp_path()))
}
