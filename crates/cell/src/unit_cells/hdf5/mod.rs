//! Numbers in HDF5 files, as far as h5py, h5netcdf, Tidy3D and MATLAB write tables of unit cells: superblocks 0 to 3, groups by symbol
//! tables or by links in their headers, numbers and complex numbers, contiguous or in chunks with deflate and shuffle.
//!
//! After the HDF5 File Format Specification, version 3.0. Lengths and addresses have eight bytes, as all of these programs write them.
//! A damaged file is refused: each object, node and chunk that is visited is counted, and no data set is larger than the table may be.

mod bytes;
mod header;
mod number;
mod values;

use std::cell::Cell;

use bytes::Bytes;
use header::{Message, NOWHERE};
use number::{Entry, entry};
use values::{Filter, filters};

/// What is wrong with a file, for a message.
pub(super) type Parsed<T> = Result<T, String>;

pub(super) const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";

/// Objects, nodes and chunks that are visited at most, and groups within groups.
const MOST_VISITS: u32 = 1 << 17;
const DEEPEST: u32 = 8;

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
}

impl DataSet<'_> {
    pub(super) fn is_complex(&self) -> bool {
        self.entry.is_complex
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
