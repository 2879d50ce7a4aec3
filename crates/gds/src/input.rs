//! Source of the bytes: a file read through one buffer, or bytes in memory.

use std::fs::File;
use std::io::{Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::cells::FileFormat;
use super::dxf;
use super::gzip;
use super::oasis::ReadSeek;
use super::read_warnings::Tolerance;
use super::record::{self, Record};
use crate::error::{Error, LayoutError, Result};
use metalith_core::file::{Ahead, Block};
use tempfile::TempPath;

/// Bytes read at a time: enough that the kernel's copy is the cost, not the call. No mapping of the file:
/// mapped pages count as memory of the process.
const BLOCK: usize = 1 << 20;

/// A file of this size is read past the page cache: it would fill it and be read once.
const LARGE: u64 = 1 << 28;

/// Longest record: the length field has 16 bits.
const LONGEST: usize = 1 << 16;

/// A layout that can be read again and again.
#[derive(Clone, Debug)]
pub(super) enum Source {
    File {
        path: PathBuf,
        bytes: u64,
        /// The file that is read instead: what a compressed one holds, or what a drawing is.
        unpacked: Option<Arc<TempPath>>,
        /// Result of reading a drawing.
        drawing: Option<Arc<dxf::Remarks>>,
    },
    Memory {
        name: PathBuf,
        bytes: Arc<[u8]>,
    },
}

enum Stream {
    Plain(Box<dyn ReadSeek>),
    Large(Ahead),
}

impl Source {
    pub(crate) fn file(path: &Path) -> Result<Self> {
        let meta = std::fs::metadata(path).map_err(Error::io("read", path))?;
        if !meta.is_file() {
            return Err(Error::NotAFile { path: path.to_owned() });
        }
        let mut unpacked = gzip::unpacked(path, meta.len())?;
        let mut drawing = None;
        if let Some((file, mut remarks)) = dxf::unpacked(path, unpacked.as_deref().unwrap_or(path))? {
            remarks.gzip = unpacked.is_some();
            (unpacked, drawing) = (Some(file), Some(Arc::new(remarks)));
        }
        let bytes = match &unpacked {
            Some(file) => std::fs::metadata(&**file).map_err(Error::io("read", path))?.len(),
            None => meta.len(),
        };
        Ok(Self::File {
            path: path.to_owned(),
            bytes,
            unpacked: unpacked.map(Arc::new),
            drawing,
        })
    }

    pub(crate) fn path(&self) -> &Path {
        match self {
            Self::File { path, .. } => path,
            Self::Memory { name, .. } => name,
        }
    }

    /// What was made of a drawing, if it is one.
    pub(crate) fn drawing(&self) -> Option<&dxf::Remarks> {
        match self {
            Self::File { drawing, .. } => drawing.as_deref(),
            Self::Memory { .. } => None,
        }
    }

    /// Path of the file that is read.
    fn read_path(&self) -> &Path {
        match self {
            Self::File {
                unpacked: Some(file), ..
            } => file,
            _ => self.path(),
        }
    }

    pub(crate) fn is_gzip(&self) -> bool {
        match self {
            Self::File {
                drawing: Some(drawing), ..
            } => drawing.gzip,
            Self::File { unpacked, .. } => unpacked.is_some(),
            Self::Memory { .. } => false,
        }
    }

    pub(crate) fn bytes(&self) -> u64 {
        match self {
            Self::File { bytes, .. } => *bytes,
            Self::Memory { bytes, .. } => bytes.len() as u64,
        }
    }

    /// The file as it is, to be read in OASIS.
    pub(crate) fn raw(&self) -> Result<Box<dyn ReadSeek>> {
        Ok(match self {
            Self::File { bytes, .. } => Box::new(unchanged(self.read_path(), *bytes)?),
            Self::Memory { bytes, .. } => Box::new(Cursor::new(bytes.clone())),
        })
    }

    /// Format that the first bytes are of; GDSII has no mark of its own.
    pub(crate) fn format(&self) -> Result<FileFormat> {
        let mut first = Vec::new();
        let most = metalith_oasis::MAGIC.len() as u64;
        let read = self.raw()?.take(most).read_to_end(&mut first);
        read.map_err(Error::io("read", self.path()))?;
        Ok(if first == metalith_oasis::MAGIC {
            FileFormat::Oasis
        } else {
            FileFormat::Gds
        })
    }

    /// Start reading at the first byte.
    pub(crate) fn open(&self) -> Result<Input> {
        let stream = match self {
            Self::File { bytes, .. } => {
                let path = self.read_path();
                let file = unchanged(path, *bytes)?;
                let large = (*bytes >= LARGE).then(|| Ahead::open(path, LONGEST)).flatten();
                large.map_or_else(|| Stream::Plain(Box::new(file)), Stream::Large)
            }
            Self::Memory { bytes, .. } => Stream::Plain(Box::new(Cursor::new(bytes.clone()))),
        };
        let block = Block::new(LONGEST, BLOCK.min(self.bytes() as usize + 1));
        Ok(Input {
            stream,
            path: self.path().to_owned(),
            from: block.start,
            to: block.start,
            block,
            begin: 0,
            ended: false,
            tolerance: Tolerance::Known,
        })
    }
}

/// Open a file that must be as long as it was.
fn unchanged(path: &Path, bytes: u64) -> Result<File> {
    let file = File::open(path).map_err(Error::io("open", path))?;
    let now = file.metadata().map_err(Error::io("read", path))?.len();
    if now == bytes {
        return Ok(file);
    }
    Err(Error::Changed {
        path: path.to_owned(),
        before: bytes,
        now,
    })
}

/// A place in the bytes, and a buffer that holds at least the record that begins there.
pub(super) struct Input {
    stream: Stream,
    path: PathBuf,
    block: Block,
    /// The bytes not yet consumed are `block.bytes[from..to]`.
    from: usize,
    to: usize,
    /// Place in the file of the block's stretch; before it is what was left of the one before.
    begin: u64,
    ended: bool,
    /// Treatment of warnings from the format.
    pub tolerance: Tolerance,
}

impl Input {
    /// Place of the next byte.
    pub(crate) fn offset(&self) -> u64 {
        self.place(self.from)
    }

    /// An error at a place of this file.
    pub(crate) fn fault(&self, offset: u64, cause: LayoutError) -> Error {
        Error::Layout {
            path: self.path.clone(),
            offset,
            cause,
        }
    }

    /// Read over a departure from the format at a place, if they are read over.
    #[cold]
    pub(crate) fn odd(&mut self, offset: u64, cause: LayoutError, taken: &'static str) -> Result<()> {
        let path = &self.path;
        self.tolerance.meet(offset, cause, taken, |cause| Error::Layout {
            path: path.clone(),
            offset,
            cause,
        })
    }

    /// The bytes at hand: at least one whole record, unless the file ends before.
    pub(crate) fn window(&mut self) -> Result<&[u8]> {
        if self.to - self.from < LONGEST && !self.ended {
            self.fill()?;
        }
        Ok(&self.block.bytes[self.from..self.to])
    }

    /// Step over bytes of the window.
    pub(crate) fn consume(&mut self, count: usize) {
        debug_assert!(self.from + count <= self.to);
        self.from += count;
    }

    /// Place in the file of a byte of the block.
    fn place(&self, at: usize) -> u64 {
        self.begin + at as u64 - self.block.start as u64
    }

    fn fill(&mut self) -> Result<()> {
        let (from, to, left) = (self.from, self.to, self.to - self.from);
        let next = self.place(to);
        let io = Error::io("read", &self.path);
        match &mut self.stream {
            Stream::Plain(stream) => {
                let block = &mut self.block;
                block.bytes.copy_within(from..to, block.start - left);
                let mut held = 0;
                let room = block.stretch();
                while held < room.len() && !self.ended {
                    match stream.read(&mut room[held..]) {
                        Ok(0) => self.ended = true,
                        Ok(count) => held += count,
                        Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
                        Err(e) => return Err(io(e)),
                    }
                }
                self.begin = next;
                (self.from, self.to) = (block.start - left, block.start + held);
            }
            Stream::Large(ahead) => {
                let done = std::mem::take(&mut self.block);
                (self.from, self.to) = (self.block.start, self.block.start);
                let keep = |done: &Block, block: &mut Block| {
                    block.bytes[block.start - left..block.start].copy_from_slice(&done.bytes[from..to]);
                };
                let (mut block, begin, held) = ahead.next(next, Some(done), keep).map_err(io)?;
                // After a leap the stretch begins before the byte that is asked for.
                let skip = (next - begin) as usize;
                self.ended = held < block.stretch().len();
                (self.from, self.to) = (block.start + skip.min(held) - left, block.start + held);
                (self.begin, self.block) = (begin, block);
            }
        }
        Ok(())
    }

    /// Go to a place of the file; free if it is in the block.
    pub(crate) fn seek(&mut self, offset: u64) -> Result<()> {
        let start = self.block.start as u64;
        if offset >= self.begin && offset <= self.place(self.to) {
            self.from = (start + offset - self.begin) as usize;
            return Ok(());
        }
        if let Stream::Plain(stream) = &mut self.stream {
            stream
                .seek(SeekFrom::Start(offset))
                .map_err(Error::io("read", &self.path))?;
        }
        (self.begin, self.from, self.to, self.ended) = (offset, self.block.start, self.block.start, false);
        Ok(())
    }

    /// The next record.
    ///
    /// # Errors
    /// If the file ends before it is complete, its length is impossible, or its type is not of the format.
    #[inline]
    pub(crate) fn next(&mut self) -> Result<Record> {
        let record = self.next_of_any()?;
        if record.kind > record::kind::LAST {
            return Err(self.unknown(record));
        }
        Ok(record)
    }

    /// Error for a record type that is not of the format.
    #[cold]
    pub(crate) fn unknown(&self, record: Record) -> Error {
        self.fault(record.offset, LayoutError::RecordKind { kind: record.kind })
    }

    /// The next record, of whatever type.
    ///
    /// # Errors
    /// If the file ends before it is complete, or its length is impossible.
    pub(crate) fn next_of_any(&mut self) -> Result<Record> {
        let offset = self.offset();
        let window = self.window()?;
        let held = window.len();
        let &[high, low, kind, data, ..] = window else {
            return Err(self.fault(offset, LayoutError::EndsEarly { held }));
        };
        let length = usize::from(u16::from_be_bytes([high, low]));
        let first = offset == 0;
        if length < 4 {
            return Err(self.fault(offset, LayoutError::RecordLength { length, first }));
        }
        if length > held {
            return Err(self.fault(offset, LayoutError::EndsInRecord { kind, length, held }));
        }
        if length % 2 != 0 {
            self.odd(
                offset,
                LayoutError::RecordLength { length, first },
                "its bytes were taken as they are",
            )?;
        }
        let from = self.from + 4;
        self.from += length;
        Ok(Record {
            offset,
            kind,
            data,
            from,
            to: self.from,
        })
    }

    /// The bytes of a record read last.
    pub(crate) fn body(&self, record: Record) -> &[u8] {
        &self.block.bytes[record.from..record.to]
    }

    /// The body of a record that must have this data type and be a whole number of `unit` bytes long. Bytes behind are
    /// read over.
    pub(crate) fn checked(&mut self, record: Record, data: u8, unit: usize) -> Result<&[u8]> {
        let bytes = self.body(record).len();
        let whole = bytes - bytes % unit;
        if record.data != data || whole != bytes || bytes == 0 {
            let cause = LayoutError::RecordBody {
                kind: record.kind,
                data: record.data,
                bytes,
                wanted: data,
                unit,
            };
            if record.data != data || whole == 0 {
                return Err(self.fault(record.offset, cause));
            }
            self.odd(record.offset, cause, "the bytes behind were left out")?;
        }
        Ok(&self.block.bytes[record.from..record.from + whole])
    }

    /// Go back before a record that was read last.
    pub(crate) fn again(&mut self, record: Record) {
        self.from = record.from - 4;
    }

    /// The one two-byte integer of a record.
    pub(crate) fn int2(&mut self, record: Record) -> Result<i16> {
        let body = self.checked(record, record::data::INT2, 2)?;
        Ok(i16::from_be_bytes([body[0], body[1]]))
    }

    /// The one four-byte integer of a record.
    pub(crate) fn int4(&mut self, record: Record) -> Result<i32> {
        let body = self.checked(record, record::data::INT4, 4)?;
        Ok(i32::from_be_bytes([body[0], body[1], body[2], body[3]]))
    }

    /// Real number `k` of a record of `count`.
    pub(crate) fn real8(&mut self, record: Record, k: usize, count: usize) -> Result<f64> {
        let body = self.checked(record, record::data::REAL8, 8 * count)?;
        let bytes = body[8 * k..8 * k + 8].try_into().expect("eight bytes");
        Ok(super::real::decode(bytes))
    }

    /// The text of a record up to the zero that pads it to an even length, or that ends it before.
    pub(crate) fn text(&self, record: Record) -> Result<&[u8]> {
        let body = self.body(record);
        if record.data != record::data::ASCII {
            let cause = LayoutError::NotText {
                kind: record.kind,
                data: record.data,
            };
            return Err(self.fault(record.offset, cause));
        }
        // What begins with a zero is no text of C, and kept as it is.
        let end = match body.iter().position(|&b| b == 0) {
            Some(end @ 1..) => end,
            Some(0) => body.iter().rposition(|&b| b != 0).map_or(0, |last| last + 1),
            None => body.len(),
        };
        Ok(&body[..end])
    }
}
