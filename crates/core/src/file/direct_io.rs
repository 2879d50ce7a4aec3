//! Large files past the page cache.
//!
//! Gigabytes that go through the cache cost the kernel more than a layout costs to make, and drive out of
//! memory what others had there. Where the file system allows it, such a file goes straight between memory of
//! ours and the disk, in blocks whose place and length are multiples of [`PAGE`]; elsewhere it goes the
//! ordinary way, byte for byte the same.

use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver, Sender};

/// Bytes of which addresses, places and lengths must be multiples: no disk in use has larger sectors.
const PAGE: usize = 4096;

/// Bytes that go at once: enough that the disk, not the call, is the cost.
const BLOCK: usize = 1 << 20;

/// Memory for a stretch of a file, which begins on a page, with room before it for what was left of the last.
#[derive(Default)]
pub struct Block {
    pub bytes: Vec<u8>,
    /// Index in `bytes` where the stretch begins.
    pub start: usize,
    size: usize,
}

impl Block {
    pub fn new(room: usize, size: usize) -> Self {
        let bytes = vec![0; room + PAGE + size];
        let start = room + bytes[room..].as_ptr().align_offset(PAGE);
        Self { bytes, start, size }
    }

    pub fn stretch(&mut self) -> &mut [u8] {
        &mut self.bytes[self.start..self.start + self.size]
    }
}

/// Opens a file for transfers past the cache, if the system has them.
fn open(options: &mut OpenOptions, path: &Path) -> Option<File> {
    #[cfg(target_os = "linux")]
    {
        use std::os::unix::fs::OpenOptionsExt;
        options.custom_flags(libc::O_DIRECT).open(path).ok()
    }
    #[cfg(not(target_os = "linux"))]
    {
        let _ = (options, path);
        None
    }
}

/// Way in which the blocks of an [`Output`] are written.
enum Way {
    Untried,
    PastCache(File),
    Ordinary,
}

/// A file under way, written from its beginning to its end. What is smaller than a block never leaves the
/// ordinary way.
pub(super) struct Output {
    file: File,
    path: PathBuf,
    way: Way,
    block: Block,
    /// Bytes that wait in the block, and bytes of the file before it.
    waiting: usize,
    written: u64,
}

impl Output {
    /// `file` is the empty file at `path`, open for writing.
    pub(crate) fn new(file: File, path: &Path) -> Self {
        Self {
            file,
            path: path.to_owned(),
            way: Way::Untried,
            block: Block::new(0, BLOCK),
            waiting: 0,
            written: 0,
        }
    }

    /// The file as far as it is written.
    pub(crate) fn file(&self) -> &File {
        &self.file
    }

    /// Hand over what waits; the file, complete.
    pub(crate) fn finish(&mut self) -> io::Result<&File> {
        self.put(self.waiting)?;
        Ok(&self.file)
    }

    fn full(&mut self) -> io::Result<()> {
        if let Way::Untried = self.way {
            // The path is opened anew: only the same file will do.
            let direct = open(File::options().write(true), &self.path)
                .filter(|direct| super::part::is_same(direct, &self.file).unwrap_or(false));
            self.way = direct.map_or(Way::Ordinary, Way::PastCache);
        }
        if let Way::PastCache(file) = &mut self.way {
            match file.write_all(self.block.stretch()) {
                Ok(()) => {
                    self.written += BLOCK as u64;
                    self.waiting = 0;
                    return Ok(());
                }
                // Some file systems refuse only now.
                Err(e) if e.kind() == ErrorKind::InvalidInput => self.way = Way::Ordinary,
                Err(e) => return Err(e),
            }
        }
        self.put(BLOCK)
    }

    fn put(&mut self, count: usize) -> io::Result<()> {
        self.file.seek(SeekFrom::Start(self.written))?;
        self.file.write_all(&self.block.stretch()[..count])?;
        self.written += count as u64;
        self.waiting = 0;
        Ok(())
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let waiting = self.waiting;
        let count = bytes.len().min(BLOCK - waiting);
        self.block.stretch()[waiting..waiting + count].copy_from_slice(&bytes[..count]);
        self.waiting += count;
        if self.waiting == BLOCK {
            self.full()?;
        }
        Ok(count)
    }

    /// Does nothing: blocks must be whole, and no one sees the file before it is finished.
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A file read past the cache, one block ahead of who uses it: the disk and its reader work side by side.
pub struct Ahead {
    room: usize,
    asked: Sender<(u64, Block)>,
    answered: Receiver<(Block, io::Result<usize>)>,
    /// Place of the block that is under way.
    pending: Option<u64>,
}

impl Ahead {
    /// Blocks with `room` bytes before them; nothing if the system does not do this for the file at `path`.
    pub fn open(path: &Path, room: usize) -> Option<Self> {
        let mut file = open(File::options().read(true), path)?;
        let path = path.to_owned();
        let (asked, questions) = mpsc::channel::<(u64, Block)>();
        let (answers, answered) = mpsc::channel();
        // Ends when its user is dropped, and with it a channel.
        std::thread::spawn(move || {
            for (place, mut block) in questions {
                let result = fill(&mut file, &path, place, block.stretch());
                if answers.send((block, result)).is_err() {
                    break;
                }
            }
        });
        Some(Self {
            room,
            asked,
            answered,
            pending: None,
        })
    }

    /// The block that holds `place`, where it begins, and how many bytes of it are there: fewer than there is
    /// room for at the end of the file only. `done` is the block before, if any, which is filled anew once
    /// `keep` has taken from it what it needs.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn next(
        &mut self,
        place: u64,
        done: Option<Block>,
        keep: impl FnOnce(&Block, &mut Block),
    ) -> io::Result<(Block, u64, usize)> {
        let begin = place - place % PAGE as u64;
        if self.pending != Some(begin) {
            let spare = match self.pending.take() {
                Some(_) => self.answer()?.0,
                None => Block::new(self.room, BLOCK),
            };
            self.ask(begin, spare)?;
        }
        self.pending = None;
        let (mut block, held) = self.answer()?;
        let held = held?;
        let done = done.unwrap_or_else(|| Block::new(self.room, BLOCK));
        keep(&done, &mut block);
        if held == BLOCK {
            self.ask(begin + BLOCK as u64, done)?;
        }
        Ok((block, begin, held))
    }

    fn ask(&mut self, place: u64, block: Block) -> io::Result<()> {
        self.pending = Some(place);
        self.asked.send((place, block)).map_err(|_| ended())
    }

    fn answer(&mut self) -> io::Result<(Block, io::Result<usize>)> {
        self.answered.recv().map_err(|_| ended())
    }
}

fn ended() -> io::Error {
    io::Error::other("the thread that reads ahead has ended")
}

/// Reads the file from `place` on, as much as there is and `out` holds.
fn fill(file: &mut File, path: &Path, place: u64, out: &mut [u8]) -> io::Result<usize> {
    let mut held = 0;
    file.seek(SeekFrom::Start(place))?;
    while held < out.len() {
        match file.read(&mut out[held..]) {
            Ok(0) => break,
            Ok(count) => held += count,
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            // Some file systems refuse only now, and all of them after a short read.
            Err(e) if e.kind() == ErrorKind::InvalidInput => {
                *file = opened_again(file, path)?;
                file.seek(SeekFrom::Start(place + held as u64))?;
            }
            Err(e) => return Err(e),
        }
    }
    Ok(held)
}

/// A file that was opened at `path`, for transfers through the cache.
///
/// # Errors
/// If it cannot be opened, or another one lies there by now: the bytes of two files would be taken for those of one.
fn opened_again(file: &File, path: &Path) -> io::Result<File> {
    let again = File::open(path)?;
    if super::part::is_same(&again, file)? {
        Ok(again)
    } else {
        Err(io::Error::other("the file was replaced while it was read"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(path: &Path, from: usize) -> Option<Vec<u8>> {
        let mut ahead = Ahead::open(path, 8)?;
        let (mut out, mut done) = (Vec::new(), None);
        loop {
            let place = (from + out.len()) as u64;
            let (mut block, begin, held) = ahead.next(place, done, |_, _| {}).unwrap();
            let skip = (place - begin) as usize;
            out.extend_from_slice(&block.stretch()[..held][skip.min(held)..]);
            if held < BLOCK {
                return Some(out);
            }
            done = Some(block);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        /// Whatever the pieces and the length, the bytes are those of one ordinary write, and are read back
        /// the same from any place.
        #[test]
        fn bytes_go_and_come_unchanged(
            length in prop_oneof![0..3 * PAGE, BLOCK - 2..BLOCK + 2, 2 * BLOCK..3 * BLOCK],
            piece in 1..2 * BLOCK,
            place in 0.0..1.0f64,
        ) {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("bytes");
            let bytes = (0..length).map(|i| (i * 7 + i / 251) as u8).collect::<Vec<_>>();
            let mut out = Output::new(File::create(&path).unwrap(), &path);
            for part in bytes.chunks(piece) {
                out.write_all(part).unwrap();
            }
            out.finish().unwrap();
            prop_assert!(std::fs::read(&path).unwrap() == bytes);
            for place in [0, (place * length as f64) as usize] {
                if let Some(rest) = read(&path, place) {
                    prop_assert!(rest == bytes[place..]);
                }
            }
        }
    }

    /// A file that was put in the place of another is not read on in its stead.
    #[cfg(unix)]
    #[test]
    fn a_replaced_file_is_not_opened_again() {
        let folder = tempfile::tempdir().unwrap();
        let [path, other] = ["bytes", "other"].map(|name| folder.path().join(name));
        std::fs::write(&path, b"first").unwrap();
        let file = File::open(&path).unwrap();
        let mut bytes = Vec::new();
        opened_again(&file, &path).unwrap().read_to_end(&mut bytes).unwrap();
        assert_eq!(bytes, b"first");
        std::fs::write(&other, b"second").unwrap();
        std::fs::rename(&other, &path).unwrap();
        // An error of the program's own and none of the operating system, which would have a number.
        let error = opened_again(&file, &path).unwrap_err();
        assert_eq!((error.kind(), error.raw_os_error()), (io::ErrorKind::Other, None));
    }

    /// A reader that leaps gets the block it asks for and not the one that was under way.
    #[test]
    fn leaps_are_followed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bytes");
        let bytes = (0..4 * BLOCK).map(|i| (i / PAGE) as u8).collect::<Vec<_>>();
        std::fs::write(&path, &bytes).unwrap();
        let Some(mut ahead) = Ahead::open(&path, 0) else { return };
        let mut done = None;
        for place in [0, 3 * BLOCK + 5, PAGE, PAGE + BLOCK, 0] {
            let (mut block, begin, held) = ahead.next(place as u64, done, |_, _| {}).unwrap();
            assert_eq!(begin as usize, place - place % PAGE);
            assert!(block.stretch()[..held] == bytes[begin as usize..][..held]);
            done = Some(block);
        }
    }
}
