//! A ZIP archive of a folder: the same files give the same bytes.
//!
//! Written from the format (PKWARE APPNOTE 6.3): deflated entries with sizes behind their data, ZIP64
//! records where a size or place needs more than 32 bits. No dates, owners or other traces of a machine.

use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;

use flate2::write::DeflateEncoder;
use flate2::{Compression, Crc};

use metalith_core::{AtomicFile, Progress};
use metalith_core::{Error, Result};

/// 1 January 1980, the earliest date of the format.
const DATE: u16 = 0x0021;
/// Sizes follow the data; names are UTF-8.
const FLAGS: u16 = 0x0808;
const DEFLATED: u16 = 8;
/// Version 4.5 of the format, which has ZIP64.
const VERSION: u16 = 45;
/// Marks a number that is in the ZIP64 record.
const ELSEWHERE: u32 = u32::MAX;
/// Fast, and within a few per cent of the smallest for layouts.
const LEVEL: u32 = 4;
const BLOCK: usize = 1 << 20;

struct PackedFile {
    name: String,
    crc: u32,
    size: u64,
    packed: u64,
    offset: u64,
}

/// True if this program packed the archive, with files of a folder of this name. The beginning of its first entry
/// decides: other programs date their entries.
///
/// # Errors
/// If the file cannot be read.
pub(super) fn is_packed_here(path: &Path, folder: &str) -> Result<bool> {
    let begin = format!("{folder}/");
    let mut head = vec![0; LOCAL + begin.len()];
    let mut file = File::open(path).map_err(Error::io("read", path))?;
    match file.read_exact(&mut head) {
        Err(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => return Ok(false),
        read => read.map_err(Error::io("read", path))?,
    }
    let word = |at: usize| u16::from_le_bytes([head[at], head[at + 1]]);
    let numbers = [word(4), word(6), word(8), word(12)];
    Ok(head.starts_with(b"PK\x03\x04")
        && numbers == [VERSION, FLAGS, DEFLATED, DATE]
        && head[LOCAL..] == *begin.as_bytes())
}

/// Bytes of the head of an entry before its name.
const LOCAL: usize = 30;

/// Pack files, each given as its name in the archive and where it lies, into the archive at `path`.
///
/// # Errors
/// If a file cannot be read or the archive not written, or the user stopped it.
pub(super) fn pack(path: &Path, files: &[(String, std::path::PathBuf)], progress: &dyn Progress) -> Result<()> {
    let mut total = 0;
    for (_, file) in files {
        total += std::fs::metadata(file).map_err(Error::io("read", file))?.len();
    }
    progress.begin("packing", total);
    let mut out = Counted {
        inner: AtomicFile::create(path)?,
        written: 0,
    };
    let mut entries = Vec::with_capacity(files.len());
    for (name, file) in files {
        entries.push(pack_one(&mut out, path, name, file, progress)?);
    }
    let start = out.written;
    let mut directory = Vec::new();
    for entry in &entries {
        central(&mut directory, entry);
    }
    end(&mut directory, entries.len() as u64, start);
    out.write_all(&directory).map_err(Error::io("write", path))?;
    out.inner.commit()
}

fn pack_one(out: &mut Counted, path: &Path, name: &str, file: &Path, progress: &dyn Progress) -> Result<PackedFile> {
    let offset = out.written;
    let mut header = Vec::with_capacity(64 + name.len());
    header.extend(0x0403_4b50u32.to_le_bytes());
    fields(&mut header, &[VERSION, FLAGS, DEFLATED, 0, DATE]);
    header.extend([0; 4]);
    header.extend(ELSEWHERE.to_le_bytes());
    header.extend(ELSEWHERE.to_le_bytes());
    fields(&mut header, &[name.len() as u16, 20]);
    header.extend(name.as_bytes());
    // ZIP64 sizes, unknown yet: they make the numbers behind the data 64 bits wide.
    fields(&mut header, &[1, 16]);
    header.extend([0; 16]);
    out.write_all(&header).map_err(Error::io("write", path))?;

    let begin = out.written;
    let mut input = File::open(file).map_err(Error::io("read", file))?;
    let mut crc = Crc::new();
    let mut size = 0u64;
    let mut encoder = DeflateEncoder::new(&mut *out, Compression::new(LEVEL));
    let mut block = vec![0; BLOCK];
    loop {
        let n = input.read(&mut block).map_err(Error::io("read", file))?;
        if n == 0 {
            break;
        }
        progress.check_stopped()?;
        crc.update(&block[..n]);
        size += n as u64;
        encoder.write_all(&block[..n]).map_err(Error::io("write", path))?;
        progress.advance(n as u64);
    }
    encoder.finish().map_err(Error::io("write", path))?;
    let packed = out.written - begin;
    let mut behind = Vec::with_capacity(24);
    behind.extend(0x0807_4b50u32.to_le_bytes());
    behind.extend(crc.sum().to_le_bytes());
    behind.extend(packed.to_le_bytes());
    behind.extend(size.to_le_bytes());
    out.write_all(&behind).map_err(Error::io("write", path))?;
    Ok(PackedFile {
        name: name.to_owned(),
        crc: crc.sum(),
        size,
        packed,
        offset,
    })
}

fn central(out: &mut Vec<u8>, entry: &PackedFile) {
    out.extend(0x0201_4b50u32.to_le_bytes());
    fields(out, &[VERSION, VERSION, FLAGS, DEFLATED, 0, DATE]);
    out.extend(entry.crc.to_le_bytes());
    out.extend(ELSEWHERE.to_le_bytes());
    out.extend(ELSEWHERE.to_le_bytes());
    fields(out, &[entry.name.len() as u16, 28, 0, 0, 0]);
    out.extend([0; 4]);
    out.extend(ELSEWHERE.to_le_bytes());
    out.extend(entry.name.as_bytes());
    fields(out, &[1, 24]);
    for number in [entry.size, entry.packed, entry.offset] {
        out.extend(number.to_le_bytes());
    }
}

fn end(out: &mut Vec<u8>, entries: u64, start: u64) {
    let size = out.len() as u64;
    out.extend(0x0606_4b50u32.to_le_bytes());
    out.extend(44u64.to_le_bytes());
    fields(out, &[VERSION, VERSION]);
    out.extend([0; 8]);
    for number in [entries, entries, size, start] {
        out.extend(number.to_le_bytes());
    }
    out.extend(0x0706_4b50u32.to_le_bytes());
    out.extend([0; 4]);
    out.extend((start + size).to_le_bytes());
    out.extend(1u32.to_le_bytes());
    out.extend(0x0605_4b50u32.to_le_bytes());
    fields(out, &[0, 0]);
    let few = u16::try_from(entries).unwrap_or(u16::MAX);
    fields(out, &[few, few]);
    out.extend(u32::try_from(size).unwrap_or(ELSEWHERE).to_le_bytes());
    out.extend(u32::try_from(start).unwrap_or(ELSEWHERE).to_le_bytes());
    fields(out, &[0]);
}

fn fields(out: &mut Vec<u8>, numbers: &[u16]) {
    for number in numbers {
        out.extend(number.to_le_bytes());
    }
}

/// A file that counts the bytes written.
struct Counted {
    inner: AtomicFile,
    written: u64,
}

impl Write for Counted {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let n = self.inner.write(bytes)?;
        self.written += n as u64;
        Ok(n)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.inner.flush()
    }
}
