//! The file that a conversion writes, compressed if its name ends in `.gz`.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use metalith_core::{AtomicFile, Error, Result};

/// Level of compression.
const LEVEL: u32 = 6;

/// A file that replaces the old one when all of it is written.
pub(super) enum Output {
    Plain(BufWriter<AtomicFile>),
    Gzip(Box<GzEncoder<BufWriter<AtomicFile>>>),
}

impl Output {
    /// Begin the file at a path.
    pub(crate) fn create(path: &Path) -> Result<Self> {
        let file = BufWriter::new(AtomicFile::create(path)?);
        Ok(if crate::format::is_gzip(path) {
            Self::Gzip(Box::new(GzEncoder::new(file, Compression::new(LEVEL))))
        } else {
            Self::Plain(file)
        })
    }

    /// End the file, and put it in the place of the old one.
    pub(crate) fn commit(self, path: &Path) -> Result<()> {
        let io = |error| Error::io("write", path)(error);
        let mut file = match self {
            Self::Plain(file) => file,
            Self::Gzip(encoder) => encoder.finish().map_err(io)?,
        };
        file.flush().map_err(io)?;
        file.into_inner().map_err(|e| io(e.into_error()))?.commit()
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Plain(file) => file.write(bytes),
            Self::Gzip(encoder) => encoder.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Plain(file) => file.flush(),
            Self::Gzip(encoder) => encoder.flush(),
        }
    }
}
