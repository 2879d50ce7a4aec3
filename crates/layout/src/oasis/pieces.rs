//! Encoded pillars kept in a folder: a run that was stopped goes on, and several machines make one file.

use std::fs;
use std::path::{Path, PathBuf};

use metalith_core::{AtomicFile, Error, FolderLock, Progress, Result};
use metalith_oasis::CompressedBlock;
use sha2::{Digest, Sha256};

use super::encode::Encoded;

/// First bytes of a file of a piece; the number is that of the form of pieces.
const MAGIC: &[u8; 20] = b"metalith layout 1  \n";
/// Bytes of a digest.
const DIGEST: usize = 32;
/// Name of the file that says which layout the pieces are of.
const KEY: &str = "layout.txt";
/// Ending of the names of pieces.
const ENDING: &str = "piece";

/// Folder of encoded pieces of one layout.
#[derive(Clone, Debug)]
pub struct KeptPieces {
    folder: PathBuf,
}

/// Shard of the pieces: of each `of` pieces the one with this number, from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PieceShard {
    pub number: usize,
    pub of: usize,
}

/// Pieces that are taken and kept while pillars are encoded.
#[derive(Clone, Copy)]
pub(in super::super) enum PiecesOf<'a> {
    None,
    All(&'a KeptPieces),
    /// Only these are made.
    Shard(&'a KeptPieces, PieceShard),
}

impl KeptPieces {
    /// Pieces in a folder, which is created if it does not exist. `layout` says all that decides on the bytes of the layout, such as
    /// digests of its design and its options.
    ///
    /// # Errors
    /// If the folder holds something else, or pieces of another layout, or cannot be written, or the user stopped it.
    pub fn open(folder: &Path, layout: &str, progress: &dyn Progress) -> Result<Self> {
        let key = folder.join(KEY);
        let own = Self {
            folder: folder.to_owned(),
        };
        // Shards begin at once.
        let _turn = FolderLock::wait(folder, progress, || ())?;
        let refused = |what: String| {
            let hint = "give the folder of the pieces of this layout, or a new one";
            Err(Error::refused("layout/other-pieces", what, hint))
        };
        match fs::read(&key) {
            Ok(found) if found == layout.as_bytes() => return Ok(own),
            Ok(_) => {
                return refused(format!(
                    "{} holds pieces of another layout, or of another version: {KEY} in it says which",
                    folder.display()
                ));
            }
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(Error::io("read", &key)(error)),
            Err(_) => {}
        }
        let mut others = fs::read_dir(folder).map_err(Error::io("read", folder))?;
        if others.next().is_some() {
            return refused(format!(
                "{} holds files that are no pieces of a layout",
                folder.display()
            ));
        }
        AtomicFile::write(&key, layout.as_bytes())?;
        Ok(own)
    }

    /// Number of the pieces that are kept.
    ///
    /// # Errors
    /// If the folder cannot be read.
    pub fn count(&self) -> Result<usize> {
        let entries = fs::read_dir(&self.folder).map_err(Error::io("read", &self.folder))?;
        let is_piece = |path: &Path| path.extension().is_some_and(|ending| ending == ENDING);
        Ok(entries
            .filter(|entry| entry.as_ref().is_ok_and(|e| is_piece(&e.path())))
            .count())
    }

    /// Remove the pieces, once their layout is in its place, and the folder, if nothing else is in it.
    ///
    /// # Errors
    /// If a piece cannot be removed.
    pub fn remove(self) -> Result<()> {
        let entries = fs::read_dir(&self.folder).map_err(Error::io("read", &self.folder))?;
        for path in entries.filter_map(|entry| Some(entry.ok()?.path())) {
            if path.extension().is_some_and(|ending| ending == ENDING) {
                AtomicFile::discard(&path)?;
            }
        }
        AtomicFile::discard(&self.folder.join(KEY))?;
        // What else is there is not ours.
        let _ = fs::remove_dir(&self.folder);
        Ok(())
    }

    /// File that is begun around the pieces of a shard, and never completed.
    pub(super) fn file_of(&self, shard: PieceShard) -> PathBuf {
        self.folder.join(format!("shard_{}_of_{}.oas", shard.number, shard.of))
    }

    fn path_of(&self, [element, number]: [usize; 2]) -> PathBuf {
        self.folder.join(format!("{element}_{number}.{ENDING}"))
    }

    /// The piece with these numbers, if it is there and whole.
    fn read(&self, piece: [usize; 2], progress: &dyn Progress) -> Result<Option<Vec<Encoded>>> {
        let path = self.path_of(piece);
        let bytes = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(Error::io("read", &path)(error)),
        };
        let found = decoded(&bytes);
        if found.is_none() {
            progress.warn(&format!("{} is damaged: made again", path.display()));
        }
        Ok(found)
    }

    fn made(
        &self,
        piece: [usize; 2],
        encode: impl FnOnce() -> Vec<Encoded>,
        progress: &dyn Progress,
    ) -> Result<Vec<Encoded>> {
        if let Some(parts) = self.read(piece, progress)? {
            return Ok(parts);
        }
        let parts = encode();
        AtomicFile::write(&self.path_of(piece), &encoded(&parts))?;
        Ok(parts)
    }
}

impl PiecesOf<'_> {
    /// The piece of an element with its number, from the folder or else made, in parts; of a shard, the number of its pillars alone.
    pub(super) fn piece(
        &self,
        piece: [usize; 2],
        encode: impl FnOnce() -> Vec<Encoded>,
        progress: &dyn Progress,
    ) -> Result<Vec<Encoded>> {
        match self {
            Self::None => Ok(encode()),
            Self::All(kept) => kept.made(piece, encode, progress),
            Self::Shard(_, shard) if (piece[0] + piece[1]) % shard.of != shard.number - 1 => Ok(Vec::new()),
            Self::Shard(kept, _) => {
                let mut parts = kept.made(piece, encode, progress)?;
                parts.iter_mut().for_each(|part| part.blocks.clear());
                Ok(parts)
            }
        }
    }
}

/// Bytes of the file of a piece: [`MAGIC`], SHA-256 of the rest, and for each part the box, the number of pillars, and the blocks.
fn encoded(parts: &[Encoded]) -> Vec<u8> {
    let mut body = Vec::new();
    let mut put = |number: i64| body.extend(number.to_le_bytes());
    put(parts.len() as i64);
    for part in parts {
        part.bounds.into_iter().for_each(&mut put);
        put(part.pillars as i64);
        put(part.blocks.len() as i64);
        for block in &part.blocks {
            put(block.unpacked().map_or(-1, |length| length as i64));
            put(block.bytes().len() as i64);
        }
    }
    let blocks = parts.iter().flat_map(|part| &part.blocks);
    blocks.for_each(|block| body.extend(block.bytes()));
    [&MAGIC[..], &Sha256::digest(&body), &body].concat()
}

/// The parts of a piece, if the file is as it was written.
fn decoded(bytes: &[u8]) -> Option<Vec<Encoded>> {
    let rest = bytes.strip_prefix(MAGIC)?;
    let (digest, mut body) = rest.split_at_checked(DIGEST)?;
    if Sha256::digest(body)[..] != *digest {
        return None;
    }
    let mut take = || {
        let (number, rest) = body.split_first_chunk()?;
        body = rest;
        Some(i64::from_le_bytes(*number))
    };
    let mut heads = Vec::new();
    for _ in 0..take()? {
        let bounds = [take()?, take()?, take()?, take()?];
        let pillars = take()? as u64;
        let mut blocks = Vec::new();
        for _ in 0..take()? {
            blocks.push((u64::try_from(take()?).ok(), usize::try_from(take()?).ok()?));
        }
        heads.push((bounds, pillars, blocks));
    }
    let mut block = |(unpacked, length)| {
        let (bytes, rest) = body.split_at_checked(length)?;
        body = rest;
        Some(CompressedBlock::from_parts(unpacked, bytes.to_vec()))
    };
    let mut parts = Vec::new();
    for (bounds, pillars, blocks) in heads {
        let blocks: Option<Vec<_>> = blocks.into_iter().map(&mut block).collect();
        parts.push(Encoded {
            blocks: blocks?,
            bounds,
            pillars,
        });
    }
    Some(parts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_piece_is_read_as_it_was_written_or_not_at_all() {
        let blocks = [vec![7; 5000], vec![1, 2, 3], Vec::new()].map(|bytes| CompressedBlock::of(&bytes, 6));
        let parts = vec![
            Encoded {
                blocks: blocks.to_vec(),
                bounds: [-5, 0, 7, i64::MAX],
                pillars: 12,
            },
            Encoded::EMPTY,
        ];
        let bytes = encoded(&parts);
        assert_eq!(decoded(&bytes), Some(parts));
        for length in 0..bytes.len() {
            assert_eq!(decoded(&bytes[..length]), None);
        }
        for place in 0..bytes.len() {
            let mut other = bytes.clone();
            other[place] ^= 4;
            assert_eq!(decoded(&other), None);
        }
    }
}
