//! Numbers in HDF5 files, as far as h5py, h5netcdf, Tidy3D and MATLAB write tables of unit cells: superblocks 0 to 3, groups by symbol
//! tables or by links in their headers, numbers and complex numbers, contiguous or in chunks with deflate and shuffle.
//!
//! After the HDF5 File Format Specification, version 3.0. Lengths and addresses have eight bytes, as all of these programs write them.
//! A damaged file is refused: each object, node and chunk that is visited is counted, and no data set is larger than the table may be.

use std::cell::Cell;
use std::collections::BTreeSet;
use std::io::Read;

use flate2::read::ZlibDecoder;
use num_complex::Complex64;

use super::MOST_CELLS;

/// What is wrong with a file, for a message.
pub(super) type Parsed<T> = Result<T, String>;

pub(super) const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";

/// Objects, nodes and chunks that are visited at most, and groups within groups.
const MOST_VISITS: u32 = 1 << 17;
const DEEPEST: u32 = 8;

/// Longest name (bytes).
const LONGEST_NAME: usize = 1 << 10;

/// Address that names nothing.
const NOWHERE: u64 = u64::MAX;

/// Bytes behind a place.
#[derive(Clone, Copy)]
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, count: usize) -> Parsed<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or("the file ends within an object")?;
        self.0 = rest;
        Ok(taken)
    }

    /// Unsigned number of so many bytes, eight at the most.
    fn number(&mut self, count: usize) -> Parsed<u64> {
        let bytes = self.take(count)?;
        Ok(bytes.iter().rev().fold(0, |sum, byte| sum << 8 | u64::from(*byte)))
    }

    fn is(&mut self, mark: &[u8]) -> Parsed<()> {
        if self.take(mark.len())? == mark {
            Ok(())
        } else {
            Err(format!("no {} where one should be", String::from_utf8_lossy(mark)))
        }
    }

    /// Text up to a zero byte, which is taken too.
    fn text(&mut self) -> Parsed<String> {
        let end = self.0.iter().position(|b| *b == 0).ok_or("a name without an end")?;
        let text = String::from_utf8_lossy(self.take(end)?).into_owned();
        self.take(1)?;
        Ok(text)
    }
}

/// Number of a data set.
#[derive(Clone, Copy)]
struct Real {
    size: usize,
    is_float: bool,
    is_signed: bool,
}

/// Entry of a data set: its size in bytes, and the number there or the two parts of a complex number at their offsets.
#[derive(Clone, Copy)]
struct Entry {
    size: usize,
    parts: [(usize, Real); 2],
    is_complex: bool,
}

/// Filter of chunks.
#[derive(Clone, Copy, PartialEq)]
enum Filter {
    Deflate,
    Shuffle,
}

enum Storage<'a> {
    Bytes(&'a [u8]),
    Nothing,
    /// Chunks of a tree at an address, of so many entries along each axis.
    Chunks(u64, Vec<u64>),
}

/// Data set of numbers.
pub(super) struct DataSet<'a> {
    /// Names of the groups that it is in, and its own.
    pub group: String,
    pub name: String,
    /// Length along each axis.
    pub shape: Vec<u64>,
    entry: Entry,
    /// Errors are those of whoever asks for the values.
    storage: Parsed<Storage<'a>>,
    filters: Parsed<Vec<Filter>>,
}

/// File of which every address counts from its superblock.
pub(super) struct File<'a> {
    bytes: &'a [u8],
    visits: Cell<u32>,
}

/// Message of the header of an object: its number and its data.
type Message<'a> = (u64, Bytes<'a>);

impl<'a> File<'a> {
    /// The data sets of numbers of a file; none if it is no HDF5.
    pub(super) fn data_sets(bytes: &'a [u8]) -> Option<Parsed<(Self, Vec<DataSet<'a>>)>> {
        // MATLAB writes a user block before it.
        let start = [0, 512, 1024, 2048]
            .into_iter()
            .find(|at| bytes.get(*at..).is_some_and(|b| b.starts_with(SIGNATURE)))?;
        let file = Self {
            bytes: &bytes[start..],
            visits: Cell::new(MOST_VISITS),
        };
        let mut found = Vec::new();
        let walked = file.root().and_then(|root| file.walk(root, "", "", 0, &mut found));
        Some(walked.map(|()| (file, found)))
    }

    fn at(&self, address: u64) -> Parsed<Bytes<'a>> {
        let start = usize::try_from(address).ok().filter(|at| *at < self.bytes.len());
        Ok(Bytes(&self.bytes[start.ok_or("an address beyond the end")?..]))
    }

    fn visit(&self) -> Parsed<()> {
        let left = self
            .visits
            .get()
            .checked_sub(1)
            .ok_or("more objects than a table has")?;
        self.visits.set(left);
        Ok(())
    }

    /// Address of the header of the root group.
    fn root(&self) -> Parsed<u64> {
        let mut at = Bytes(&self.bytes[SIGNATURE.len()..]);
        let version = at.number(1)?;
        at.take(if version < 2 { 4 } else { 0 })?;
        let sizes = [at.number(1)?, at.number(1)?];
        if sizes != [8, 8] || version > 3 {
            return Err(format!("superblock {version} with addresses of {} bytes", sizes[0]));
        }
        // Before the address: orders of trees, flags, four addresses and a name; or flags and three addresses.
        at.take(match version {
            0 => 9 + 4 * 8 + 8,
            1 => 13 + 4 * 8 + 8,
            _ => 1 + 3 * 8,
        })?;
        at.number(8)
    }

    /// Adds the data sets of numbers at and under an object.
    fn walk(&self, address: u64, group: &str, name: &str, depth: u32, found: &mut Vec<DataSet<'a>>) -> Parsed<()> {
        self.visit()?;
        let messages = self.messages(address)?;
        if let Some(set) = self.data_set(&messages, group, name)? {
            found.push(set);
        }
        let group = if name.is_empty() {
            String::new()
        } else {
            format!("{group}/{name}")
        };
        for (name, child) in self.links(&messages)? {
            if depth >= DEEPEST {
                return Err("groups within groups without end".into());
            }
            self.walk(child, &group, &name, depth + 1, found)?;
        }
        Ok(())
    }

    /// Messages of the header of an object.
    fn messages(&self, address: u64) -> Parsed<Vec<Message<'a>>> {
        let mut at = self.at(address)?;
        let is_new = at.0.starts_with(b"OHDR");
        let (flags, mut blocks);
        if is_new {
            at.take(5)?;
            flags = at.number(1)?;
            at.take(if flags & 0x20 > 0 { 16 } else { 0 })?;
            at.take(if flags & 0x10 > 0 { 4 } else { 0 })?;
            let size = at.number(1 << (flags & 3))?;
            blocks = vec![at.take(size as usize)?];
        } else {
            flags = 0;
            if at.number(1)? != 1 {
                return Err("an object with an unknown header".into());
            }
            at.take(7)?;
            let size = at.number(4)?;
            at.take(4)?;
            blocks = vec![at.take(size as usize)?];
        }
        let mut found = Vec::new();
        let mut next = 0;
        while let Some(block) = blocks.get(next) {
            let mut at = Bytes(block);
            let head = if is_new { 4 + (flags >> 1 & 2) as usize } else { 8 };
            while at.0.len() >= head {
                self.visit()?;
                let (kind, size, rest) = if is_new { (1, 2, head - 3) } else { (2, 2, 4) };
                let (kind, size) = (at.number(kind)?, at.number(size)?);
                at.take(rest)?;
                let mut data = Bytes(at.take(size as usize)?);
                if kind == 0x10 {
                    let (address, size) = (data.number(8)?, data.number(8)?);
                    let mut more = self.at(address)?;
                    let size = usize::try_from(size)
                        .ok()
                        .and_then(|size| size.checked_sub(if is_new { 8 } else { 0 }));
                    if is_new {
                        more.is(b"OCHK")?;
                    }
                    blocks.push(more.take(size.ok_or("a header that goes on nowhere")?)?);
                } else {
                    found.push((kind, data));
                }
            }
            next += 1;
        }
        Ok(found)
    }

    /// Names and addresses of the members of a group.
    fn links(&self, messages: &[Message<'a>]) -> Parsed<Vec<(String, u64)>> {
        let mut found = Vec::new();
        for (kind, mut at) in messages.iter().copied() {
            match kind {
                0x11 => {
                    let (tree, heap) = (at.number(8)?, at.number(8)?);
                    let mut heap = self.at(heap)?;
                    heap.is(b"HEAP")?;
                    heap.take(20)?;
                    let names = self.at(heap.number(8)?)?;
                    self.symbols(tree, names, 0, &mut found)?;
                }
                0x02 => {
                    at.take(1)?;
                    let flags = at.number(1)?;
                    at.take(if flags & 1 > 0 { 8 } else { 0 })?;
                    if at.number(8)? != NOWHERE {
                        return Err("a group with more members than its header holds".into());
                    }
                }
                0x06 => {
                    at.take(1)?;
                    let flags = at.number(1)?;
                    let kind = if flags & 0x08 > 0 { at.number(1)? } else { 0 };
                    at.take(if flags & 0x04 > 0 { 8 } else { 0 })?;
                    at.take(usize::from(flags & 0x10 > 0))?;
                    let length = at.number(1 << (flags & 3))?;
                    let name = String::from_utf8_lossy(at.take((length as usize).min(LONGEST_NAME))?).into_owned();
                    // Links to other files and by name lead to no data of this one.
                    if kind == 0 {
                        found.push((name, at.number(8)?));
                    }
                }
                _ => {}
            }
        }
        Ok(found)
    }

    /// Adds the members of a tree of symbol tables.
    fn symbols(&self, address: u64, names: Bytes<'a>, depth: u32, found: &mut Vec<(String, u64)>) -> Parsed<()> {
        self.visit()?;
        let mut at = self.at(address)?;
        if at.0.starts_with(b"SNOD") {
            at.take(6)?;
            for _ in 0..at.number(2)? {
                self.visit()?;
                let (name, header) = (at.number(8)?, at.number(8)?);
                at.take(24)?;
                let name = names.0.get(name as usize..).ok_or("a name beyond the end")?;
                found.push((Bytes(&name[..name.len().min(LONGEST_NAME)]).text()?, header));
            }
            return Ok(());
        }
        let count = Self::node(&mut at, 0, depth)?;
        for _ in 0..count {
            at.take(8)?;
            self.symbols(at.number(8)?, names, depth + 1, found)?;
        }
        Ok(())
    }

    /// Head of a node of a tree: number of its children.
    fn node(at: &mut Bytes<'a>, kind: u64, depth: u32) -> Parsed<u64> {
        at.is(b"TREE")?;
        if at.number(1)? != kind || depth > DEEPEST {
            return Err("a tree of another kind".into());
        }
        at.take(1)?;
        let count = at.number(2)?;
        at.take(16)?;
        Ok(count)
    }

    /// The data set of numbers of a header, if it is one.
    fn data_set(&self, messages: &[Message<'a>], group: &str, name: &str) -> Parsed<Option<DataSet<'a>>> {
        let of = |kind: u64| messages.iter().find(|(k, _)| *k == kind).map(|(_, at)| *at);
        let (Some(space), Some(kind), Some(layout)) = (of(0x01), of(0x03), of(0x08)) else {
            return Ok(None);
        };
        let (Some(shape), Some(entry)) = (shape(space)?, entry(kind)?) else {
            return Ok(None);
        };
        Ok(Some(DataSet {
            group: group.to_owned(),
            name: name.to_owned(),
            storage: self.storage(layout, shape.len()),
            filters: of(0x0b).map_or(Ok(Vec::new()), filters),
            shape,
            entry,
        }))
    }

    fn storage(&self, mut at: Bytes<'a>, rank: usize) -> Parsed<Storage<'a>> {
        let (version, class) = (at.number(1)?, at.number(1)?);
        if !(3..=4).contains(&version) {
            return Err(format!("data in a layout of version {version}"));
        }
        Ok(match class {
            1 => match (at.number(8)?, at.number(8)?) {
                (NOWHERE, _) => Storage::Nothing,
                (address, size) => Storage::Bytes(self.at(address)?.take(usize::try_from(size).unwrap_or(usize::MAX))?),
            },
            2 if version == 3 => {
                if at.number(1)? as usize != rank + 1 {
                    return Err("chunks of another number of axes".into());
                }
                let tree = at.number(8)?;
                let sides = (0..rank).map(|_| at.number(4)).collect::<Parsed<Vec<_>>>()?;
                Storage::Chunks(tree, sides)
            }
            _ => return Err(format!("chunks in a layout of version {version}")),
        })
    }

    /// The numbers of a data set.
    pub(super) fn values(&self, set: &DataSet<'a>) -> Parsed<Vec<Complex64>> {
        let count = product(&set.shape)
            .filter(|count| *count <= MOST_CELLS)
            .ok_or("a data set that is too large")?;
        let entry = &set.entry;
        let all = |bytes: &[u8]| {
            Ok(bytes
                .chunks_exact(entry.size)
                .take(count)
                .map(|bytes| entry.value(bytes))
                .collect())
        };
        let (tree, sides) = match set.storage.as_ref().map_err(Clone::clone)? {
            Storage::Bytes(bytes) if bytes.len() / entry.size >= count => return all(bytes),
            Storage::Chunks(tree, sides) => (*tree, sides),
            _ => return Err("a data set without all of its data".into()),
        };
        let counts: Vec<u64> = set
            .shape
            .iter()
            .zip(sides)
            .map(|(n, side)| n.div_ceil((*side).max(1)))
            .collect();
        let padded: Vec<u64> = counts
            .iter()
            .zip(sides)
            .map(|(n, side)| n.saturating_mul(*side))
            .collect();
        // At the rim chunks reach over the data.
        if sides.contains(&0) || product(&padded).is_none_or(|padded| padded > 8 * MOST_CELLS) {
            return Err("chunks that are larger than their data".into());
        }
        let mut values = vec![Complex64::ZERO; count];
        let mut seen = BTreeSet::new();
        self.chunks(tree, set, sides, 0, &mut seen, &mut values)?;
        if product(&counts) == Some(seen.len()) {
            Ok(values)
        } else {
            Err("a data set without all of its chunks".into())
        }
    }

    fn chunks(
        &self,
        address: u64,
        set: &DataSet<'a>,
        sides: &[u64],
        depth: u32,
        seen: &mut BTreeSet<Vec<u64>>,
        values: &mut [Complex64],
    ) -> Parsed<()> {
        self.visit()?;
        let mut at = self.at(address)?;
        let level = at.0.get(5).copied().unwrap_or(0);
        for _ in 0..Self::node(&mut at, 1, depth)? {
            let (size, skipped) = (at.number(4)? as usize, at.number(4)?);
            let first = (0..sides.len()).map(|_| at.number(8)).collect::<Parsed<Vec<_>>>()?;
            at.take(8)?;
            let child = at.number(8)?;
            if level > 0 {
                self.chunks(child, set, sides, depth + 1, seen, values)?;
                continue;
            }
            self.visit()?;
            let is_place = first
                .iter()
                .zip(&set.shape)
                .zip(sides)
                .all(|((at, n), side)| at < n && at % side == 0);
            if !is_place || !seen.insert(first.clone()) {
                return Err("a chunk beside its place".into());
            }
            let entries = product(sides).ok_or("a chunk that is too large")?;
            let bytes = unfiltered(self.at(child)?.take(size)?, set, skipped, entries * set.entry.size)?;
            for (k, bytes) in bytes.chunks_exact(set.entry.size).enumerate() {
                let (mut rest, mut place, mut step, mut inside) = (k as u64, 0, 1, true);
                for axis in (0..sides.len()).rev() {
                    let index = first[axis] + rest % sides[axis];
                    rest /= sides[axis];
                    inside &= index < set.shape[axis];
                    place += index * step;
                    step *= set.shape[axis];
                }
                if inside {
                    values[place as usize] = set.entry.value(bytes);
                }
            }
        }
        Ok(())
    }
}

impl DataSet<'_> {
    pub(super) fn is_complex(&self) -> bool {
        self.entry.is_complex
    }
}

/// Product of lengths, if it is a size.
fn product(lengths: &[u64]) -> Option<usize> {
    let product = lengths.iter().try_fold(1_u64, |product, n| product.checked_mul(*n))?;
    usize::try_from(product).ok()
}

/// The bytes of a chunk before they were filtered.
fn unfiltered(stored: &[u8], set: &DataSet<'_>, skipped: u64, size: usize) -> Parsed<Vec<u8>> {
    let mut bytes = stored.to_vec();
    for (k, filter) in set.filters.as_ref().map_err(Clone::clone)?.iter().enumerate().rev() {
        if skipped >> k & 1 == 1 {
            continue;
        }
        match filter {
            Filter::Deflate => {
                let mut plain = Vec::new();
                let room = size as u64 + 4;
                let done = ZlibDecoder::new(&bytes[..]).take(room).read_to_end(&mut plain);
                done.map_err(|_| "a chunk that cannot be inflated")?;
                bytes = plain;
            }
            Filter::Shuffle => {
                let (entry, count) = (set.entry.size, bytes.len() / set.entry.size);
                bytes = (0..count * entry)
                    .map(|at| bytes[at % entry * count + at / entry])
                    .collect();
            }
        }
    }
    if bytes.len() == size {
        Ok(bytes)
    } else {
        Err(format!("a chunk of {} bytes in place of {size}", bytes.len()))
    }
}

/// Lengths along the axes; none where there is no data.
fn shape(mut at: Bytes<'_>) -> Parsed<Option<Vec<u64>>> {
    let (version, rank) = (at.number(1)?, at.number(1)?);
    let rest = if version == 1 { at.take(6)? } else { at.take(2)? };
    let is_null = version == 2 && rest[1] == 2;
    let lengths = (0..rank).map(|_| at.number(8)).collect::<Parsed<Vec<_>>>()?;
    Ok((!is_null).then_some(lengths))
}

/// Head of a kind of entries: class, version, its bits and its size.
fn head(at: &mut Bytes<'_>) -> Parsed<(u64, u64, u64, usize)> {
    let (class, bits, size) = (at.number(1)?, at.number(3)?, at.number(4)?);
    Ok((class & 15, class >> 4, bits, size as usize))
}

fn real(at: &mut Bytes<'_>) -> Parsed<Option<Real>> {
    let (class, _, bits, size) = head(at)?;
    let is_float = class == 1;
    // All of these programs write the least byte first.
    let is_known =
        bits & 1 == 0 && ((is_float && [4, 8].contains(&size)) || (class == 0 && [1, 2, 4, 8].contains(&size)));
    at.take(if is_float { 12 } else { 4 })?;
    Ok(is_known.then_some(Real {
        size,
        is_float,
        is_signed: bits & 8 > 0,
    }))
}

/// Numbers of a data set; none if it has other entries.
fn entry(at: Bytes<'_>) -> Parsed<Option<Entry>> {
    let mut own = at;
    let (class, version, bits, size) = head(&mut own)?;
    if class != 6 {
        let number = if class < 2 { real(&mut { at })? } else { None };
        return Ok(number.map(|number| Entry {
            size: number.size,
            parts: [(0, number); 2],
            is_complex: false,
        }));
    }
    if bits & 0xffff != 2 {
        return Ok(None);
    }
    let mut parts = Vec::new();
    for names in [["r", "real", "re"], ["i", "imag", "im"]] {
        let before = own.0.len();
        let name = own.text()?;
        if version < 3 {
            let padding = (before - own.0.len()).next_multiple_of(8) - (before - own.0.len());
            own.take(padding)?;
        }
        let width = if version < 3 {
            4
        } else {
            (size.ilog2() / 8 + 1) as usize
        };
        let offset = own.number(width)? as usize;
        own.take(if version == 1 { 28 } else { 0 })?;
        match real(&mut own)? {
            Some(number)
                if names.contains(&name.as_str()) && offset.checked_add(number.size).is_some_and(|end| end <= size) =>
            {
                parts.push((offset, number));
            }
            _ => return Ok(None),
        }
    }
    Ok(Some(Entry {
        size,
        parts: [parts[0], parts[1]],
        is_complex: true,
    }))
}

impl Entry {
    /// The number in the bytes of an entry.
    fn value(&self, bytes: &[u8]) -> Complex64 {
        let [re, im] = self
            .parts
            .map(|(at, number)| number.value(&bytes[at..at + number.size]));
        Complex64::new(re, if self.is_complex { im } else { 0.0 })
    }
}

impl Real {
    fn value(self, bytes: &[u8]) -> f64 {
        let bits = bytes.iter().rev().fold(0, |sum: u64, byte| sum << 8 | u64::from(*byte));
        let unused = 64 - 8 * self.size as u32;
        match (self.is_float, self.is_signed) {
            (true, _) if self.size == 4 => f64::from(f32::from_bits(bits as u32)),
            (true, _) => f64::from_bits(bits),
            (false, true) => ((bits << unused) as i64 >> unused) as f64,
            (false, false) => bits as f64,
        }
    }
}

fn filters(mut at: Bytes<'_>) -> Parsed<Vec<Filter>> {
    let (version, count) = (at.number(1)?, at.number(1)?);
    at.take(if version == 1 { 6 } else { 0 })?;
    let each = (0..count).map(|_| {
        let number = at.number(2)?;
        let length = if version == 1 || number >= 256 {
            at.number(2)?
        } else {
            0
        };
        at.take(2)?;
        let values = at.number(2)?;
        at.take(length as usize)?;
        at.take(4 * (values + if version == 1 { values % 2 } else { 0 }) as usize)?;
        match number {
            1 => Ok(Filter::Deflate),
            2 => Ok(Filter::Shuffle),
            other => Err(format!("data by filter {other}")),
        }
    });
    each.collect()
}
