//! Limits that keep reading bounded, whatever the bytes say.

/// Limits of one reading. A thousand bytes can describe a list of a million places; past a limit reading ends with
/// an error that says which.
#[derive(Clone, Copy, Debug)]
pub struct OasisLimits {
    /// Bytes of one name or text.
    pub string_bytes: usize,
    /// Points of one polygon or path.
    pub points: usize,
    /// Places in one list of a repetition; each costs 8 bytes.
    pub list_places: usize,
    /// Values of one property.
    pub values: u64,
    /// Farthest coordinate of anything, copies included (grid steps).
    pub farthest: i64,
    /// Bytes that all CBLOCKs of a short file may unpack to, and how many more for each byte of the file. Deflate
    /// reaches 1032; layouts of lenses reach 10, regular arrays drawn one by one some hundred.
    pub short_file_unpacked: u64,
    pub unpacked_per_byte: u64,
}

impl OasisLimits {
    /// Bytes that all CBLOCKs of a file of so many bytes may unpack to.
    pub(crate) fn unpacked_of(&self, bytes: u64) -> u64 {
        self.short_file_unpacked
            .saturating_add(self.unpacked_per_byte.saturating_mul(bytes))
    }
}

impl Default for OasisLimits {
    /// A lens of 1 mm as one list of equal pillars is 6.4 million places; coordinates are those of GDSII.
    fn default() -> Self {
        Self {
            string_bytes: 1 << 20,
            points: 1 << 20,
            list_places: 1 << 24,
            values: 1 << 16,
            farthest: i64::from(i32::MAX),
            short_file_unpacked: 1 << 26,
            unpacked_per_byte: 512,
        }
    }
}
