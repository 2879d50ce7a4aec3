//! Where the bytes come from: a file read through one buffer, or bytes in memory.

use std::fs::File;
use std::io::{Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::record::{self, Record};
use crate::error::{Error, Result};

/// Bytes read at a time: enough that the kernel's copy is the cost, not the call. No mapping of the file:
/// mapped pages count as memory of the process.
const BLOCK: usize = 1 << 20;

/// Longest record: the length field has 16 bits.
const LONGEST: usize = 1 << 16;

/// A layout that can be read again and again.
#[derive(Clone, Debug)]
pub(super) enum Source {
    File { path: PathBuf, bytes: u64 },
    Memory { name: PathBuf, bytes: Arc<[u8]> },
}

trait ReadSeek: Read + Seek + Send {}
impl<T: Read + Seek + Send> ReadSeek for T {}

impl Source {
    pub fn file(path: &Path) -> Result<Self> {
        let meta = std::fs::metadata(path).map_err(Error::io("read", path))?;
        if !meta.is_file() {
            return Err(Error::invalid(
                format!("{} is not a file", path.display()),
                "name a GDSII file (.gds)",
            ));
        }
        Ok(Self::File {
            path: path.to_owned(),
            bytes: meta.len(),
        })
    }

    pub fn path(&self) -> &Path {
        match self {
            Self::File { path, .. } => path,
            Self::Memory { name, .. } => name,
        }
    }

    pub fn bytes(&self) -> u64 {
        match self {
            Self::File { bytes, .. } => *bytes,
            Self::Memory { bytes, .. } => bytes.len() as u64,
        }
    }

    /// Start reading at the first byte.
    pub fn open(&self) -> Result<Input> {
        let stream: Box<dyn ReadSeek> = match self {
            Self::File { path, bytes } => {
                let file = File::open(path).map_err(Error::io("open", path))?;
                let now = file.metadata().map_err(Error::io("read", path))?.len();
                if now != *bytes {
                    return Err(Error::invalid(
                        format!(
                            "{} changed from {bytes} to {now} bytes while it was read",
                            path.display()
                        ),
                        "wait until whoever writes it is done",
                    ));
                }
                Box::new(file)
            }
            Self::Memory { bytes, .. } => Box::new(Cursor::new(bytes.clone())),
        };
        let room = (BLOCK + LONGEST).min(self.bytes() as usize + LONGEST);
        Ok(Input {
            stream,
            path: self.path().to_owned(),
            buffer: vec![0; room],
            from: 0,
            to: 0,
            base: 0,
            ended: false,
        })
    }
}

/// A place in the bytes, and a buffer that holds at least the record that begins there.
pub(super) struct Input {
    stream: Box<dyn ReadSeek>,
    path: PathBuf,
    buffer: Vec<u8>,
    /// The bytes not yet consumed are `buffer[from..to]`.
    from: usize,
    to: usize,
    /// Place in the file of `buffer[0]`.
    base: u64,
    ended: bool,
}

impl Input {
    /// Place of the next byte.
    pub fn offset(&self) -> u64 {
        self.base + self.from as u64
    }

    /// An error at a place of this file.
    pub fn fault(&self, offset: u64, what: impl Into<String>, hint: impl Into<String>) -> Error {
        Error::Layout {
            path: self.path.clone(),
            offset,
            what: what.into(),
            hint: hint.into(),
        }
    }

    /// The bytes at hand: at least one whole record, unless the file ends before.
    pub fn window(&mut self) -> Result<&[u8]> {
        if self.to - self.from < LONGEST && !self.ended {
            self.fill()?;
        }
        Ok(&self.buffer[self.from..self.to])
    }

    /// Step over bytes of the window.
    pub fn consume(&mut self, count: usize) {
        debug_assert!(self.from + count <= self.to);
        self.from += count;
    }

    fn fill(&mut self) -> Result<()> {
        self.buffer.copy_within(self.from..self.to, 0);
        self.base += self.from as u64;
        self.to -= self.from;
        self.from = 0;
        while self.to < self.buffer.len() {
            match self.stream.read(&mut self.buffer[self.to..]) {
                Ok(0) => {
                    self.ended = true;
                    break;
                }
                Ok(count) => self.to += count,
                Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
                Err(e) => return Err(Error::io("read", &self.path)(e)),
            }
        }
        Ok(())
    }

    /// Go to a place of the file; free if it is in the buffer.
    pub fn seek(&mut self, offset: u64) -> Result<()> {
        if offset >= self.base && offset <= self.base + self.to as u64 {
            self.from = (offset - self.base) as usize;
            return Ok(());
        }
        self.stream
            .seek(SeekFrom::Start(offset))
            .map_err(Error::io("read", &self.path))?;
        (self.base, self.from, self.to, self.ended) = (offset, 0, 0, false);
        Ok(())
    }

    /// The next record.
    ///
    /// # Errors
    /// If the file ends before it is complete, or its length is impossible.
    pub fn next(&mut self) -> Result<Record> {
        let offset = self.offset();
        let window = self.window()?;
        let &[high, low, kind, data, ..] = window else {
            let left = window.len();
            let what = format!("the file ends {left} bytes into a record, before ENDLIB");
            return Err(self.fault(offset, what, "the file is cut short: copy or write it again"));
        };
        let length = usize::from(u16::from_be_bytes([high, low]));
        let held = window.len();
        if length < 4 || length % 2 != 0 {
            return Err(self.fault(
                offset,
                format!("a record of length {length}; it must be even and at least 4"),
                if offset == 0 {
                    "this does not begin like GDSII; is it another format, or compressed?"
                } else {
                    "the file is damaged from here on, or was changed by a text tool: write it again"
                },
            ));
        }
        if length > held {
            return Err(self.fault(
                offset,
                format!(
                    "the file ends inside a {} record of {length} bytes, {held} of them there",
                    record::name(kind)
                ),
                "the file is cut short: copy or write it again",
            ));
        }
        if kind > record::kind::LAST {
            return Err(self.fault(
                offset,
                format!("record type 0x{kind:02X} is not GDSII"),
                "the file is damaged from here on, or is another format",
            ));
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
    pub fn body(&self, record: Record) -> &[u8] {
        &self.buffer[record.from..record.to]
    }

    /// The body of a record that must have this data type and be a whole number of `unit` bytes long.
    pub fn checked(&self, record: Record, data: u8, unit: usize) -> Result<&[u8]> {
        let body = self.body(record);
        if record.data != data || body.is_empty() || !body.len().is_multiple_of(unit) {
            return Err(self.fault(
                record.offset,
                format!(
                    "a {} record of data type {} and {} bytes; it must be of type {data} in steps of {unit} bytes",
                    record::name(record.kind),
                    record.data,
                    body.len()
                ),
                "the tool that wrote this file breaks the format: report it there",
            ));
        }
        Ok(body)
    }

    /// The one two-byte integer of a record.
    pub fn int2(&self, record: Record) -> Result<i16> {
        let body = self.checked(record, record::data::INT2, 2)?;
        Ok(i16::from_be_bytes([body[0], body[1]]))
    }

    /// The one four-byte integer of a record.
    pub fn int4(&self, record: Record) -> Result<i32> {
        let body = self.checked(record, record::data::INT4, 4)?;
        Ok(i32::from_be_bytes([body[0], body[1], body[2], body[3]]))
    }

    /// Real number `k` of a record that has at least `k + 1`.
    pub fn real8(&self, record: Record, k: usize) -> Result<f64> {
        let body = self.checked(record, record::data::REAL8, 8 * (k + 1))?;
        let bytes = body[8 * k..8 * k + 8].try_into().expect("eight bytes");
        Ok(super::real::decode(bytes))
    }

    /// The text of a record without the zero that pads it to an even length.
    pub fn text(&self, record: Record) -> Result<&[u8]> {
        let body = self.body(record);
        if record.data != record::data::ASCII {
            return Err(self.fault(
                record.offset,
                format!("a {} record of data type {}", record::name(record.kind), record.data),
                "it must be text (data type 6): the tool that wrote this file breaks the format",
            ));
        }
        let end = body.iter().rposition(|&b| b != 0).map_or(0, |last| last + 1);
        Ok(&body[..end])
    }
}
