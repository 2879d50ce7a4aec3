//! The file around the cells: START, CBLOCKs, tables of names, END with the checksum.

use std::collections::HashMap;
use std::io::{self, Write};

use flate2::Crc;

use super::block::CompressedBlock;
use crate::MAGIC;
use crate::number::{put_real, put_signed, put_string, put_unsigned};
use crate::record::{END_BYTES, kind, validation};

/// The box around a cell, references followed, on all layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellBounds {
    Empty,
    /// Not known: nothing is said of it.
    Unknown,
    /// Left, bottom, right, top (grid steps).
    Box([i64; 4]),
}

/// Entry of a cell in the tables.
struct CellEntry {
    name: Vec<u8>,
    written: Option<(u64, CellBounds)>,
}

/// Names of standard properties, in the order of their table.
const PROPERTIES: [&str; 4] = [
    "S_TOP_CELL",
    "S_BOUNDING_BOXES_AVAILABLE",
    "S_BOUNDING_BOX",
    "S_CELL_OFFSET",
];
const TOP_CELL: u64 = 0;
const BOXES_AVAILABLE: u64 = 1;
const BOUNDING_BOX: u64 = 2;
const CELL_OFFSET: u64 = 3;

/// Bounding boxes of all cells are there, and final.
const ALL_BOXES: u64 = 2;

/// Types of property values.
const UNSIGNED: u8 = 8;
const SIGNED: u8 = 9;
const NAME_NUMBER: u8 = 15;

/// Writes a file in strict mode: every name is in a table, every reference by number, the tables are found by their
/// offsets and the cells by theirs. The file ends with a checksum (CRC32) of all its bytes.
///
/// What it was asked to write it writes at once; tables of names are held until the end.
pub struct OasisWriter<W> {
    out: W,
    crc: Crc,
    offset: u64,
    cells: Vec<CellEntry>,
    cell_numbers: HashMap<Vec<u8>, u64>,
    texts: Vec<Vec<u8>>,
    text_numbers: HashMap<Vec<u8>, u64>,
    tops: Vec<Vec<u8>>,
    open: Option<(u64, u64)>,
}

impl<W: Write> OasisWriter<W> {
    /// Begin a file of `grid_per_um` grid steps a micrometre with these cells at the top. `boxes` says whether the
    /// bounds of all cells will be known.
    ///
    /// # Errors
    /// If the bytes cannot be written.
    pub fn new(out: W, grid_per_um: f64, tops: &[impl AsRef<[u8]>], boxes: bool) -> io::Result<Self> {
        let mut writer = Self {
            out,
            crc: Crc::new(),
            offset: 0,
            cells: Vec::new(),
            cell_numbers: HashMap::new(),
            texts: Vec::new(),
            text_numbers: HashMap::new(),
            tops: tops.iter().map(|t| t.as_ref().to_owned()).collect(),
            open: None,
        };
        let mut start = MAGIC.to_vec();
        start.push(kind::START);
        put_string(&mut start, b"1.0");
        put_real(&mut start, grid_per_um);
        // Offsets of the tables stand in END: this is a stream.
        start.push(1);
        for number in 0..tops.len() {
            put_property(&mut start, TOP_CELL, 1);
            start.push(NAME_NUMBER);
            put_unsigned(&mut start, number as u64);
        }
        put_property(&mut start, BOXES_AVAILABLE, 1);
        start.push(UNSIGNED);
        put_unsigned(&mut start, if boxes { ALL_BOXES } else { 0 });
        writer.put(&start)?;
        Ok(writer)
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.crc.update(bytes);
        self.offset += bytes.len() as u64;
        self.out.write_all(bytes)
    }

    /// Number of the cell with this name, to refer to it before or after it is written.
    pub fn cell_number(&mut self, name: impl AsRef<[u8]>) -> u64 {
        let name = name.as_ref();
        if let Some(&number) = self.cell_numbers.get(name) {
            return number;
        }
        let number = self.cells.len() as u64;
        self.cell_numbers.insert(name.to_owned(), number);
        self.cells.push(CellEntry {
            name: name.to_owned(),
            written: None,
        });
        number
    }

    /// Number of a text.
    pub fn text_number(&mut self, text: impl AsRef<[u8]>) -> u64 {
        let text = text.as_ref();
        if let Some(&number) = self.text_numbers.get(text) {
            return number;
        }
        let number = self.texts.len() as u64;
        self.text_numbers.insert(text.to_owned(), number);
        self.texts.push(text.to_owned());
        number
    }

    /// Begin a cell; what is written up to [`OasisWriter::end_cell`] is in it.
    ///
    /// # Errors
    /// If the bytes cannot be written.
    ///
    /// # Panics
    /// If the cell was written before, or the one before was not ended.
    pub fn begin_cell(&mut self, number: u64) -> io::Result<()> {
        assert!(self.open.is_none(), "a cell in a cell");
        assert!(self.cells[number as usize].written.is_none(), "a cell is written once");
        self.open = Some((number, self.offset));
        let mut cell = vec![kind::CELL];
        put_unsigned(&mut cell, number);
        self.put(&cell)
    }

    /// Records of the cell that was begun.
    ///
    /// # Errors
    /// If the bytes cannot be written.
    pub fn block(&mut self, block: &CompressedBlock) -> io::Result<()> {
        debug_assert!(self.open.is_some(), "records outside of cells");
        if let Some(unpacked) = block.unpacked {
            let mut head = vec![kind::CBLOCK, 0];
            put_unsigned(&mut head, unpacked);
            put_unsigned(&mut head, block.bytes.len() as u64);
            self.put(&head)?;
        }
        self.put(&block.bytes)
    }

    /// End a cell, with the box around all that it holds.
    ///
    /// # Panics
    /// If none was begun.
    pub fn end_cell(&mut self, bounds: CellBounds) {
        let (number, offset) = self.open.take().expect("a cell was begun");
        self.cells[number as usize].written = Some((offset, bounds));
    }

    /// Write the tables and the end. Returns where it was written to, and the length of the file.
    ///
    /// # Errors
    /// If the bytes cannot be written.
    pub fn finish(mut self) -> io::Result<(W, u64)> {
        let mut end = vec![kind::END];
        let cells = std::mem::take(&mut self.cells);
        self.table(&mut end, cells.iter(), put_cell)?;
        let texts = std::mem::take(&mut self.texts);
        self.table(&mut end, texts.iter(), |out, text| {
            out.push(kind::TEXTSTRING);
            put_string(out, text);
        })?;
        self.table(&mut end, PROPERTIES.iter(), |out, name| {
            out.push(kind::PROPNAME);
            put_string(out, name.as_bytes());
        })?;
        let tops = std::mem::take(&mut self.tops);
        self.table(&mut end, tops.iter(), |out, name| {
            out.push(kind::PROPSTRING);
            put_string(out, name);
        })?;
        // No LAYERNAME and no XNAME.
        end.extend([1, 0, 1, 0]);
        put_padding(&mut end);
        put_unsigned(&mut end, validation::CRC32);
        self.put(&end)?;
        let crc = self.crc.sum().to_le_bytes();
        self.put(&crc)?;
        Ok((self.out, self.offset))
    }

    /// Write a table, and where it begins (nowhere, if it is empty) into END.
    fn table<T>(
        &mut self,
        end: &mut Vec<u8>,
        entries: impl ExactSizeIterator<Item = T>,
        put: impl Fn(&mut Vec<u8>, T),
    ) -> io::Result<()> {
        // All records of the kind are in the table.
        end.push(1);
        put_unsigned(end, if entries.len() == 0 { 0 } else { self.offset });
        let mut bytes = Vec::new();
        for entry in entries {
            bytes.clear();
            put(&mut bytes, entry);
            self.put(&bytes)?;
        }
        Ok(())
    }
}

/// The head of a PROPERTY record of a standard property by its number, with so many values.
fn put_property(out: &mut Vec<u8>, property: u64, values: u8) {
    out.extend([kind::PROPERTY, values << 4 | 0b0111]);
    put_unsigned(out, property);
}

fn put_cell(out: &mut Vec<u8>, cell: &CellEntry) {
    out.push(kind::CELLNAME);
    put_string(out, &cell.name);
    let Some((offset, bounds)) = cell.written else { return };
    if bounds != CellBounds::Unknown {
        put_bounds(out, bounds);
    }
    put_property(out, CELL_OFFSET, 1);
    out.push(UNSIGNED);
    put_unsigned(out, offset);
}

fn put_bounds(out: &mut Vec<u8>, bounds: CellBounds) {
    put_property(out, BOUNDING_BOX, 5);
    let (empty, [x0, y0, x1, y1]) = match bounds {
        CellBounds::Box(corners) => (0, corners),
        CellBounds::Empty | CellBounds::Unknown => (2, [0; 4]),
    };
    for (unsigned, value) in [
        (true, empty),
        (false, x0),
        (false, y0),
        (true, x1 - x0),
        (true, y1 - y0),
    ] {
        if unsigned {
            out.push(UNSIGNED);
            put_unsigned(out, value.unsigned_abs());
        } else {
            out.push(SIGNED);
            put_signed(out, value);
        }
    }
}

/// The string that makes END 256 bytes long, before scheme and checksum.
fn put_padding(end: &mut Vec<u8>) {
    let behind = 1 + 4;
    let room = END_BYTES - end.len() - behind;
    // Lengths from 128 take two bytes, and offsets of tables never leave as little as that.
    let padding = room - 2;
    debug_assert!(padding >= 128);
    put_unsigned(end, padding as u64);
    end.resize(END_BYTES - behind, 0);
}
