//! Files of the cache: results that are kept on the disk between runs, such as tables of cells and checkpoints.
//!
//! A file of the cache is, in this order, little-endian: eight bytes of magic, which name the kind of content and its
//! version; the length (u32) and bytes of the inputs that it was made from; the content; SHA-256 of all before.
//! Magic, inputs or checksum that do not agree mean that the file is not what is needed; it is then made again.
//! The inputs hold [`SOLVER`], so that nothing outlives the solver that made it.

use std::fs::File;
use std::io::{self, BufReader, Read, Write};
use std::path::{Path, PathBuf};

use num_complex::Complex64;
use sha2::{Digest, Sha256};

use metalith_core::text::hex;
use metalith_core::{AtomicFile, Error, Progress, Result};
use metalith_pillars::PillarShape;

/// Raised whenever the solver or the sampling changes what it answers: kept results are then of no use.
pub const SOLVER: u32 = 1;

/// [`SOLVER`] for pillars of a shape: raised where the answers for that shape alone have changed.
pub fn solver_of(shape: PillarShape) -> u32 {
    SOLVER + shape.solver_revision()
}

/// The folder that libraries are kept in: `METALITH_CACHE` if set, else `metalith` in `XDG_CACHE_HOME` or
/// in `~/.cache`; none where there is no home.
pub fn cache_folder() -> Option<PathBuf> {
    let variable = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    variable("METALITH_CACHE").or_else(|| {
        let base = variable("XDG_CACHE_HOME").or_else(|| variable("HOME").map(|home| home.join(".cache")))?;
        Some(base.join("metalith"))
    })
}

/// Length of the checksum.
const CHECKSUM: usize = 32;

/// Reason why a cached file is not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Unusable {
    #[error("it is cut short")]
    CutShort,
    #[error("its checksum does not hold")]
    Damaged,
    #[error("it is of another kind or version")]
    OtherKind,
    #[error("it was made from other inputs")]
    OtherInputs,
}

/// The bytes of a file of the cache.
///
/// # Panics
/// If the inputs are longer than 4 GiB.
pub fn seal(magic: [u8; 8], inputs: &[u8], content: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(magic.len() + 4 + inputs.len() + content.len() + CHECKSUM);
    bytes.extend(before_content(magic, inputs));
    bytes.extend(content);
    let digest = Sha256::digest(&bytes);
    bytes.extend(digest);
    bytes
}

/// Header before the content.
fn before_content(magic: [u8; 8], inputs: &[u8]) -> Vec<u8> {
    let length = u32::try_from(inputs.len()).expect("inputs are short");
    [&magic[..], &length.to_le_bytes(), inputs].concat()
}

/// The content of a file of the cache.
///
/// # Errors
/// If the bytes are not whole, or of another kind or other inputs.
pub fn open<'b>(bytes: &'b [u8], magic: [u8; 8], inputs: &[u8]) -> Result<&'b [u8], Unusable> {
    let end = bytes.len().checked_sub(CHECKSUM).ok_or(Unusable::CutShort)?;
    let (body, digest) = bytes.split_at(end);
    if Sha256::digest(body).as_slice() != digest {
        return Err(Unusable::Damaged);
    }
    let rest = body.strip_prefix(&magic).ok_or(Unusable::OtherKind)?;
    let (length, rest) = rest.split_first_chunk().ok_or(Unusable::CutShort)?;
    let length = u32::from_le_bytes(*length) as usize;
    match rest.split_at_checked(length) {
        Some((found, content)) if found == inputs => Ok(content),
        _ => Err(Unusable::OtherInputs),
    }
}

/// Keep content in a file.
///
/// # Errors
/// If it cannot be written; what was there is then as it was.
pub fn write(file: &Path, magic: [u8; 8], inputs: &[u8], content: &[u8]) -> Result<()> {
    let mut kept = CacheFileWriter::create(file, magic, inputs)?;
    kept.add(content)?;
    kept.finish()
}

/// A file of the cache that is written piece by piece, with the bytes of [`seal`]: content of a gigabyte need not be held twice.
pub struct CacheFileWriter {
    path: PathBuf,
    file: AtomicFile,
    /// Digest of all that was written.
    digest: Sha256,
}

impl CacheFileWriter {
    /// Begin a file of the cache; nothing replaces the old one before [`CacheFileWriter::finish`].
    ///
    /// # Errors
    /// If it cannot be created.
    ///
    /// # Panics
    /// If the inputs are longer than 4 GiB.
    pub fn create(file: &Path, magic: [u8; 8], inputs: &[u8]) -> Result<Self> {
        let mut kept = Self {
            path: file.to_owned(),
            file: AtomicFile::create(file)?,
            digest: Sha256::new(),
        };
        kept.add(&before_content(magic, inputs))?;
        Ok(kept)
    }

    /// Write the next piece of the content.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn add(&mut self, bytes: &[u8]) -> Result<()> {
        self.digest.update(bytes);
        self.file.write_all(bytes).map_err(Error::io("write", &self.path))
    }

    /// Write the checksum and put the file in its place.
    ///
    /// # Errors
    /// If it cannot be written; what was there is then as it was.
    pub fn finish(mut self) -> Result<()> {
        let digest = self.digest.finalize();
        self.file.write_all(&digest).map_err(Error::io("write", &self.path))?;
        self.file.commit()
    }
}

/// The content kept in a file of at most `longest` bytes; none if there is no such file, a reason if it cannot be
/// used.
///
/// # Errors
/// The reason, in words.
pub fn read(file: &Path, magic: [u8; 8], inputs: &[u8], longest: u64) -> Result<Option<Vec<u8>>, String> {
    read_by(file, magic, inputs, longest, |content, length| {
        let mut bytes = Vec::with_capacity(length as usize);
        content.read_to_end(&mut bytes).ok()?;
        Some(bytes)
    })
}

/// Variant of [`read`] that returns what `decode` makes of the content of a file, which `decode` reads piece by piece
/// and whose length in bytes it receives. The checksum is known after the last piece alone: until then lengths in the
/// content may be wrong, and `decode` must take none for more than the content has.
///
/// # Errors
/// The reason, in words; also if `decode` makes nothing of it.
pub fn read_by<T>(
    file: &Path,
    magic: [u8; 8],
    inputs: &[u8],
    longest: u64,
    decode: impl FnOnce(&mut dyn Read, u64) -> Option<T>,
) -> Result<Option<T>, String> {
    let found = match std::fs::metadata(file) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        found => found.map_err(|e| e.to_string())?,
    };
    if !found.is_file() || found.len() > longest {
        return Err(format!("it is no ordinary file of at most {longest} bytes"));
    }
    let cut_short = || Unusable::CutShort.to_string();
    let before = before_content(magic, inputs);
    let around = (before.len() + CHECKSUM) as u64;
    let length = found.len().checked_sub(around).ok_or_else(cut_short)?;
    let mut all = Digested {
        from: BufReader::new(File::open(file).map_err(|e| e.to_string())?),
        digest: Sha256::new(),
    };
    let mut there = vec![0; before.len()];
    all.read_exact(&mut there).map_err(|e| e.to_string())?;
    if there[..magic.len()] != magic {
        return Err(Unusable::OtherKind.to_string());
    }
    if there != before {
        return Err(Unusable::OtherInputs.to_string());
    }
    let mut content = Read::take(&mut all, length);
    let decoded = decode(&mut content, length);
    // What was not asked for counts in the checksum too.
    io::copy(&mut content, &mut io::sink()).map_err(|e| e.to_string())?;
    let mut stated = [0; CHECKSUM];
    all.from.read_exact(&mut stated).map_err(|_| cut_short())?;
    if all.digest.finalize().as_slice() != stated {
        return Err(Unusable::Damaged.to_string());
    }
    decoded.map(Some).ok_or_else(|| Unusable::OtherKind.to_string())
}

/// A file whose checksum is formed while it is read.
struct Digested {
    from: BufReader<File>,
    digest: Sha256,
}

impl Read for Digested {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        let count = self.from.read(to)?;
        self.digest.update(&to[..count]);
        Ok(count)
    }
}

/// A small table that is kept in a folder under the name of its inputs, if there is a folder. That it cannot be read or kept
/// is a warning, and no reason to stop.
#[derive(Clone, Debug)]
pub struct CacheEntry {
    name: String,
    folder: Option<PathBuf>,
    shipped: Option<&'static [u8]>,
    magic: [u8; 8],
    inputs: Vec<u8>,
    what: &'static str,
}

/// Longest file of a [`CacheEntry`] that is read (bytes): weights and inputs are some hundred thousand at most.
const LONGEST_TABLE: u64 = 1 << 20;

impl CacheEntry {
    /// A table of `what`, such as "gratings": `kind` begins the name of its file.
    pub fn new(folder: Option<&Path>, kind: &str, magic: [u8; 8], inputs: Vec<u8>, what: &'static str) -> Self {
        Self {
            name: format!("{kind}-{}.bin", name_of(&inputs)),
            folder: folder.map(Path::to_owned),
            shipped: None,
            magic,
            inputs,
            what,
        }
    }

    /// This table, which may be shipped with the program: `find` gives the bytes of a file by its name. These count
    /// before those of the folder, so that every machine has the same.
    #[must_use]
    pub fn or_shipped(mut self, find: impl FnOnce(&str) -> Option<&'static [u8]>) -> Self {
        self.shipped = find(&self.name);
        self
    }

    /// True if it came with the program.
    pub fn is_shipped(&self) -> bool {
        self.shipped_content().is_some()
    }

    fn shipped_content(&self) -> Option<&'static [u8]> {
        open(self.shipped?, self.magic, &self.inputs).ok()
    }

    fn file(&self) -> Option<PathBuf> {
        Some(self.folder.as_ref()?.join(&self.name))
    }

    /// Content of the cache, if it is there and `decode` knows it.
    pub fn read<T>(&self, decode: impl Fn(&[u8]) -> Option<T>, progress: &dyn Progress) -> Option<T> {
        if let Some(table) = self.shipped_content().and_then(&decode) {
            return Some(table);
        }
        let file = &self.file()?;
        let found = read(file, self.magic, &self.inputs, LONGEST_TABLE).and_then(|content| match content {
            Some(content) => decode(&content)
                .map(Some)
                .ok_or_else(|| format!("it holds other {}", self.what)),
            None => Ok(None),
        });
        found.unwrap_or_else(|why| {
            progress.warn(&format!("{} is not used: {why}", file.display()));
            None
        })
    }

    /// Keep it.
    pub fn write(&self, content: &[u8], progress: &dyn Progress) {
        if let Some(file) = self.file()
            && let Err(error) = write(&file, self.magic, &self.inputs, content)
        {
            progress.warn(&format!("the table of {} is not kept: {error}", self.what));
        }
    }
}

/// Bytes of numbers: real and imaginary parts (f64, little-endian).
pub fn bytes_of(numbers: impl IntoIterator<Item = Complex64>) -> Vec<u8> {
    let parts = numbers.into_iter().flat_map(|z| [z.re, z.im]);
    parts.flat_map(f64::to_le_bytes).collect()
}

/// The numbers that [`bytes_of`] has made such bytes of; none if the bytes are of something else, or a number is not finite.
pub fn complex_of(bytes: &[u8]) -> Option<Vec<Complex64>> {
    let (pairs, rest) = bytes.as_chunks::<16>();
    let part = |bytes: &[u8]| f64::from_le_bytes(bytes.try_into().expect("eight bytes"));
    let numbers = pairs
        .iter()
        .map(|pair| Complex64::new(part(&pair[..8]), part(&pair[8..])));
    let numbers: Vec<Complex64> = numbers.collect();
    (rest.is_empty() && numbers.iter().all(|z| z.is_finite())).then_some(numbers)
}

/// Sixteen hexadecimal digits that name a file by the inputs of its content.
pub fn name_of(inputs: &[u8]) -> String {
    hex(&Sha256::digest(inputs)[..8])
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAGIC: [u8; 8] = *b"MLTEST\0\x01";

    #[test]
    fn what_is_kept_comes_back_and_nothing_else_does() {
        let sealed = seal(MAGIC, b"inputs", b"content");
        assert_eq!(open(&sealed, MAGIC, b"inputs"), Ok(&b"content"[..]));
        assert_eq!(open(&sealed, MAGIC, b"others"), Err(Unusable::OtherInputs));
        assert_eq!(open(&sealed, *b"MLTEST\0\x02", b"inputs"), Err(Unusable::OtherKind));
        for end in 0..sealed.len() {
            assert!(open(&sealed[..end], MAGIC, b"inputs").is_err());
        }
        for at in 0..sealed.len() {
            for bit in 0..8 {
                let mut damaged = sealed.clone();
                damaged[at] ^= 1 << bit;
                assert_eq!(open(&damaged, MAGIC, b"inputs"), Err(Unusable::Damaged));
            }
        }
        // A whole checksum over a length that is beyond the end.
        let mut body = MAGIC.to_vec();
        body.extend(u32::MAX.to_le_bytes());
        let digest = Sha256::digest(&body);
        body.extend(digest);
        assert_eq!(open(&body, MAGIC, b"inputs"), Err(Unusable::OtherInputs));
    }
    /// Content decoded piece by piece has the same bytes, and damaged content gives nothing.
    #[test]
    fn pieces_are_the_bytes_of_the_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("kept.bin");
        let mut kept = CacheFileWriter::create(&path, MAGIC, b"inputs").unwrap();
        kept.add(b"con").unwrap();
        kept.add(b"tent").unwrap();
        assert!(!path.exists(), "nothing is there before the end");
        kept.finish().unwrap();
        let sealed = seal(MAGIC, b"inputs", b"content");
        assert_eq!(std::fs::read(&path).unwrap(), sealed);
        assert_eq!(
            read(&path, MAGIC, b"inputs", 1000).unwrap().as_deref(),
            Some(&b"content"[..])
        );
        let by = |inputs: &[u8], longest: u64| {
            read_by(&path, MAGIC, inputs, longest, |content, length| {
                // The rest is left, and still checked.
                let mut three = [0; 3];
                content.read_exact(&mut three).ok()?;
                (three == *b"con").then_some(length)
            })
        };
        assert_eq!(by(b"inputs", 1000), Ok(Some(7)));
        assert!(by(b"others", 1000).is_err() && by(b"inputs", 20).is_err());
        for at in 0..sealed.len() {
            let mut damaged = sealed.clone();
            damaged[at] ^= 1;
            std::fs::write(&path, damaged).unwrap();
            assert!(by(b"inputs", 1000).is_err(), "{at}");
            std::fs::write(&path, &sealed[..at]).unwrap();
            assert!(by(b"inputs", 1000).is_err(), "{at}");
        }
        std::fs::remove_file(&path).unwrap();
        assert_eq!(by(b"inputs", 1000), Ok(None));
    }
}
