//! Bytes of the file, and of the CBLOCK that is being read, through one buffer each.

use std::io::{Read, Seek, SeekFrom};

use flate2::{Decompress, FlushDecompress, Status};

use super::{OasisPlace, OasisWarning};
use crate::error::{OasisError, OasisFault, OasisLimit};
use crate::limits::OasisLimits;

/// Bytes of the file that are read at a time.
const FILE_BYTES: usize = 1 << 18;
/// Bytes of a CBLOCK that are unpacked at a time.
const BLOCK_BYTES: usize = 1 << 16;

/// Departures from the format that are listed.
const LISTED: usize = 8;

/// Bits of the longest integer that is padded: all of END.
const PADDED_BITS: u32 = 7 * 256;

/// A stretch of a stream of bytes.
struct Window {
    bytes: Vec<u8>,
    from: usize,
    to: usize,
    /// Place in the stream of the first byte.
    base: u64,
}

impl Window {
    fn new(bytes: usize) -> Self {
        Self {
            bytes: vec![0; bytes],
            from: 0,
            to: 0,
            base: 0,
        }
    }

    fn place(&self) -> u64 {
        self.base + self.from as u64
    }

    fn restart(&mut self, base: u64) {
        (self.from, self.to, self.base) = (0, 0, base);
    }
}

/// The CBLOCK that is being read.
struct Block {
    /// Place of its record in the file.
    record: u64,
    said: u64,
    packed_left: u64,
    unpacked_left: u64,
    done: bool,
}

pub(super) struct Input<R> {
    raw: R,
    file_bytes: u64,
    /// Bytes being parsed: the file, or what a CBLOCK unpacks to; the other waits.
    window: Window,
    waiting: Window,
    block: Option<Block>,
    inflate: Decompress,
    unpacked: u64,
    most_unpacked: u64,
    /// Place where the record that is being read begins.
    record: OasisPlace,
    /// True if departures from the format that can be read over are no errors.
    pub tolerant: bool,
    listed: Vec<OasisWarning>,
    warnings: u64,
}

impl<R: Read + Seek> Input<R> {
    pub(crate) fn new(mut raw: R, limits: &OasisLimits) -> Result<Self, OasisError> {
        let file_bytes = raw.seek(SeekFrom::End(0))?;
        raw.seek(SeekFrom::Start(0))?;
        Ok(Self {
            raw,
            file_bytes,
            window: Window::new(FILE_BYTES.min(file_bytes as usize + 1)),
            waiting: Window::new(BLOCK_BYTES),
            block: None,
            inflate: Decompress::new(false),
            unpacked: 0,
            most_unpacked: limits.unpacked_of(file_bytes),
            record: OasisPlace::default(),
            tolerant: false,
            listed: Vec::new(),
            warnings: 0,
        })
    }

    pub(crate) fn file_bytes(&self) -> u64 {
        self.file_bytes
    }

    /// Hand all bytes of the file to `with`, and be where it was.
    pub(crate) fn whole(&mut self, mut with: impl FnMut(&[u8])) -> Result<(), OasisError> {
        let back = self.window.place();
        self.raw.seek(SeekFrom::Start(0))?;
        loop {
            let count = read_some(&mut self.raw, &mut self.window.bytes)?;
            if count == 0 {
                break;
            }
            with(&self.window.bytes[..count]);
        }
        self.raw.seek(SeekFrom::Start(back))?;
        self.window.restart(back);
        Ok(())
    }

    /// The last bytes of the file, as many as fit in `tail`.
    pub(crate) fn tail(&mut self, tail: &mut [u8]) -> Result<(), OasisError> {
        let back = self.window.place();
        self.raw.seek(SeekFrom::Start(self.file_bytes - tail.len() as u64))?;
        self.raw.read_exact(tail)?;
        self.raw.seek(SeekFrom::Start(back))?;
        self.window.restart(back);
        Ok(())
    }

    /// Place where the record that is being read begins.
    pub(crate) fn record(&self) -> OasisPlace {
        self.record
    }

    /// True if a CBLOCK is being read.
    pub(crate) fn in_block(&self) -> bool {
        self.block.is_some()
    }

    /// Place of the next byte of the file, of the CBLOCK if one is being read.
    pub(crate) fn offset(&self) -> u64 {
        self.place().offset
    }

    fn place(&self) -> OasisPlace {
        match &self.block {
            None => OasisPlace {
                offset: self.window.place(),
                inner: None,
            },
            Some(block) => OasisPlace {
                offset: block.record,
                inner: Some(self.window.place()),
            },
        }
    }

    /// An error in the record that is being read.
    #[cold]
    pub(crate) fn fault(&self, fault: OasisFault) -> OasisError {
        OasisError::Fault {
            offset: self.record.offset,
            inner: self.record.inner,
            fault,
        }
    }

    /// Read over a departure from the format in the record that is being read, or make it an error.
    #[cold]
    pub(crate) fn odd(&mut self, fault: OasisFault, taken: &'static str) -> Result<(), OasisError> {
        if !self.tolerant {
            return Err(self.fault(fault));
        }
        self.warnings += 1;
        if self.listed.len() < LISTED {
            let offset = self.record.offset;
            self.listed.push(OasisWarning { offset, fault, taken });
        }
        Ok(())
    }

    /// The first departures from the format that were read over, and the number of all.
    pub(crate) fn warnings(&self) -> (&[OasisWarning], u64) {
        (&self.listed, self.warnings)
    }

    /// Begin a record: leave a CBLOCK that is at its end. None at the end of the file.
    pub(crate) fn begin_record(&mut self) -> Result<Option<u64>, OasisError> {
        self.record = self.place();
        while self.window.from == self.window.to && !self.fill()? {
            if self.block.is_none() {
                return Ok(None);
            }
            self.leave_block();
            self.record = self.place();
        }
        self.unsigned().map(Some)
    }

    /// More bytes into the window, which is used up. False at the end of the file or of the CBLOCK.
    #[cold]
    fn fill(&mut self) -> Result<bool, OasisError> {
        let base = self.window.place();
        self.window.restart(base);
        if self.block.is_some() {
            self.unpack()
        } else {
            self.window.to = read_some(&mut self.raw, &mut self.window.bytes)?;
            Ok(self.window.to > 0)
        }
    }

    fn unpack(&mut self) -> Result<bool, OasisError> {
        let Some(block) = &mut self.block else { return Ok(false) };
        let wrong = |fault| OasisError::Fault {
            offset: block.record,
            inner: None,
            fault,
        };
        while !block.done {
            let packed = &mut self.waiting;
            if packed.from == packed.to && block.packed_left > 0 {
                let base = packed.place();
                packed.restart(base);
                packed.to = read_some(&mut self.raw, &mut packed.bytes)?;
                if packed.to == 0 {
                    return Err(wrong(OasisFault::EndsEarly));
                }
            }
            let held = ((packed.to - packed.from) as u64).min(block.packed_left) as usize;
            // One byte more than it says shows that it holds more.
            let room = (block.unpacked_left + 1).min(self.window.bytes.len() as u64) as usize;
            let (read, written) = (self.inflate.total_in(), self.inflate.total_out());
            let status = self
                .inflate
                .decompress(
                    &packed.bytes[packed.from..packed.from + held],
                    &mut self.window.bytes[..room],
                    FlushDecompress::None,
                )
                .map_err(|e| wrong(OasisFault::Deflate(e.to_string())))?;
            let read = self.inflate.total_in() - read;
            let written = self.inflate.total_out() - written;
            packed.from += read as usize;
            block.packed_left -= read;
            let (said, more) = (block.said, written > block.unpacked_left);
            let short = status == Status::StreamEnd && written < block.unpacked_left;
            let stuck = read == 0 && written == 0 && status != Status::StreamEnd;
            if more || short || stuck {
                return Err(wrong(OasisFault::BlockLength { said, more }));
            }
            block.unpacked_left -= written;
            if status == Status::StreamEnd {
                block.done = true;
                if block.packed_left > 0 {
                    return Err(wrong(OasisFault::Deflate(format!(
                        "{} bytes are left over",
                        block.packed_left
                    ))));
                }
            }
            if written > 0 {
                self.window.to = written as usize;
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Go on with what the CBLOCK whose head was read unpacks to.
    pub(crate) fn enter_block(&mut self, unpacked: u64, packed: u64) -> Result<(), OasisError> {
        self.unpacked = self.unpacked.saturating_add(unpacked);
        if self.unpacked > self.most_unpacked {
            return Err(self.fault(OasisFault::Limit {
                limit: OasisLimit::Unpacked,
                found: self.unpacked,
                most: self.most_unpacked,
            }));
        }
        if packed > self.file_bytes.saturating_sub(self.window.place()) {
            return Err(self.fault(OasisFault::EndsEarly));
        }
        self.block = Some(Block {
            record: self.record.offset,
            said: unpacked,
            packed_left: packed,
            unpacked_left: unpacked,
            done: false,
        });
        self.inflate.reset(false);
        std::mem::swap(&mut self.window, &mut self.waiting);
        self.window.restart(0);
        Ok(())
    }

    fn leave_block(&mut self) {
        if self.block.take().is_some() {
            std::mem::swap(&mut self.window, &mut self.waiting);
        }
    }

    /// Go to a place of the file outside of CBLOCKs; free if it is in the window.
    pub(crate) fn seek(&mut self, offset: u64) -> Result<(), OasisError> {
        self.leave_block();
        let held = self.window.base..=self.window.base + self.window.to as u64;
        if held.contains(&offset) {
            self.window.from = (offset - self.window.base) as usize;
        } else {
            self.raw.seek(SeekFrom::Start(offset))?;
            self.window.restart(offset);
        }
        Ok(())
    }

    /// Go forward to a place of the CBLOCK at `offset` if that is being read and not past it.
    pub(crate) fn skip_in_block(&mut self, offset: u64, inner: u64) -> Result<bool, OasisError> {
        if self.block.as_ref().is_none_or(|b| b.record != offset) || self.window.place() > inner {
            return Ok(false);
        }
        self.record = self.place();
        loop {
            let wanted = inner - self.window.place();
            let held = (self.window.to - self.window.from) as u64;
            self.window.from += wanted.min(held) as usize;
            if wanted <= held {
                return Ok(true);
            }
            if !self.fill()? {
                return Err(self.fault(OasisFault::EndsInRecord));
            }
        }
    }

    /// Make sure that there is a byte in the window.
    #[cold]
    fn need(&mut self) -> Result<(), OasisError> {
        if self.fill()? {
            return Ok(());
        }
        let inside = self.block.is_some();
        Err(self.fault(if inside {
            OasisFault::EndsInRecord
        } else {
            OasisFault::EndsEarly
        }))
    }

    #[inline]
    pub(crate) fn byte(&mut self) -> Result<u8, OasisError> {
        if self.window.from == self.window.to {
            self.need()?;
        }
        let byte = self.window.bytes[self.window.from];
        self.window.from += 1;
        Ok(byte)
    }

    /// Append so many bytes to `out`.
    pub(crate) fn bytes(&mut self, mut count: usize, out: &mut Vec<u8>) -> Result<(), OasisError> {
        while count > 0 {
            if self.window.from == self.window.to {
                self.need()?;
            }
            let here = count.min(self.window.to - self.window.from);
            out.extend_from_slice(&self.window.bytes[self.window.from..self.window.from + here]);
            self.window.from += here;
            count -= here;
        }
        Ok(())
    }

    /// An unsigned integer in its shortest form.
    #[inline]
    pub(crate) fn unsigned(&mut self) -> Result<u64, OasisError> {
        let first = self.byte()?;
        if first < 0x80 {
            return Ok(u64::from(first));
        }
        self.longer(first, false)
    }

    /// An unsigned integer that may have zeros above: counts and offsets that a writer fills in afterwards, and the
    /// length of an empty padding of END, which some writers pad instead.
    pub(crate) fn unsigned_padded(&mut self) -> Result<u64, OasisError> {
        let first = self.byte()?;
        if first < 0x80 {
            return Ok(u64::from(first));
        }
        self.longer(first, true)
    }

    fn longer(&mut self, first: u8, padded: bool) -> Result<u64, OasisError> {
        let mut value = u64::from(first & 0x7F);
        let mut shift = 7u32;
        loop {
            let byte = self.byte()?;
            let bits = u64::from(byte & 0x7F);
            let fits = shift < 63 || (shift == 63 && bits <= 1) || (padded && bits == 0 && shift < PADDED_BITS);
            if !fits {
                return Err(self.fault(OasisFault::IntegerSize));
            }
            if shift <= 63 {
                value |= bits << shift;
            }
            if byte < 0x80 {
                if byte == 0 && !padded {
                    return Err(self.fault(OasisFault::IntegerPadded));
                }
                return Ok(value);
            }
            shift += 7;
        }
    }
}

fn read_some(raw: &mut impl Read, room: &mut [u8]) -> Result<usize, OasisError> {
    loop {
        match raw.read(room) {
            Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
            other => return Ok(other?),
        }
    }
}
