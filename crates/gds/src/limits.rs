//! Limits that keep reading bounded, whatever the bytes say.

/// Limits of one reading. A file of a few hundred bytes can describe more squares than there are atoms
/// in the wafer; past a limit reading ends with an error that says which.
#[derive(Clone, Copy, Debug)]
pub struct ReadLimits {
    /// Cells in the file.
    pub cells: usize,
    /// Bytes of a cell's name; the format says 32.
    pub name_bytes: usize,
    /// Bytes of all names together.
    pub all_name_bytes: usize,
    /// Distinct pairs of (cell, layer) and of (cell, child).
    pub tallies: usize,
    /// Vertices of one element, over all its XY records; the format says 8191 a record.
    pub vertices: usize,
    /// Longest chain of references.
    pub depth: u32,
    /// Copies of cells that are too large to be placed shape by shape; each costs 56 bytes.
    pub placements: u64,
    /// Shapes in the whole layout with every reference followed.
    pub flat_shapes: u64,
    /// Largest number of shapes from a short file, and how many more for each of its bytes: arrays of arrays make of a
    /// few hundred bytes any number of shapes. A lens of elements that share their eighths has 8 shapes a byte.
    pub short_file_shapes: u64,
    pub shapes_per_byte: u64,
    /// Largest number of bytes of all texts from a short file, with every reference followed and 64 for each text, and how many
    /// more for each of its bytes: whoever keeps texts keeps them one by one, and arrays make of a short text any number of texts.
    /// A text takes 36 bytes or more of GDSII, three or more of OASIS.
    pub flat_text_bytes: u64,
    pub flat_text_bytes_per_byte: u64,
}

impl ReadLimits {
    /// Shapes that are read of a file of so many bytes, every reference followed.
    pub(super) fn shapes_of(&self, bytes: u64) -> u64 {
        let in_proportion = self.shapes_per_byte.saturating_mul(bytes);
        self.flat_shapes
            .min(self.short_file_shapes.saturating_add(in_proportion))
    }

    /// Bytes of texts that are read of a file of so many bytes, every reference followed.
    pub(super) fn text_bytes_of(&self, bytes: u64) -> u64 {
        let in_proportion = self.flat_text_bytes_per_byte.saturating_mul(bytes);
        self.flat_text_bytes.saturating_add(in_proportion)
    }
}

/// Memory of a text in addition to its bytes, where texts are kept.
pub(super) const TEXT_BYTES: u64 = 64;

impl Default for ReadLimits {
    /// Room for one lens of 40 mm, 10 billion pillars, if its file is in proportion.
    fn default() -> Self {
        Self {
            cells: 1 << 20,
            name_bytes: 1024,
            all_name_bytes: 1 << 26,
            tallies: 1 << 22,
            vertices: 1 << 20,
            depth: 256,
            placements: 1 << 22,
            flat_shapes: 16_000_000_000,
            short_file_shapes: 1 << 24,
            shapes_per_byte: 64,
            flat_text_bytes: 1 << 26,
            flat_text_bytes_per_byte: 32,
        }
    }
}

/// Largest magnification, and the inverse of the smallest, of a reference and of a chain of them.
pub(super) const MAGNIFICATION: f64 = 1e6;

/// Coordinates of placed shapes are held within this of the origin (database units), so that sums and
/// differences of a few of them cannot overflow. The format's own coordinates end at 2^31.
pub(super) const FARTHEST: i64 = 1 << 50;
