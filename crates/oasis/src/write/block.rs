//! CBLOCKs: records, deflated.

use flate2::{Compress, Compression, FlushCompress, Status};

/// Records of a cell, compressed if that is shorter. Blocks are made side by side and written in order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CompressedBlock {
    /// Length unpacked; none if the bytes are the records themselves.
    pub(super) unpacked: Option<u64>,
    pub(super) bytes: Vec<u8>,
}

impl CompressedBlock {
    /// Compress whole records by deflate at a level from 1 (fast) to 9 (small).
    ///
    /// Blocks of about 4 MB are best: a block of 100 kB costs 20 % of the size, one much larger holds memory.
    pub fn of(records: &[u8], level: u32) -> Self {
        let mut deflate = Compress::new(Compression::new(level.clamp(1, 9)), false);
        let mut bytes = Vec::with_capacity(records.len() / 8 + 64);
        loop {
            let read = deflate.total_in() as usize;
            bytes.reserve(records.len() / 16 + 64);
            let status = deflate.compress_vec(&records[read..], &mut bytes, FlushCompress::Finish);
            match status {
                Ok(Status::StreamEnd) => break,
                Ok(_) => {}
                // Deflate refuses no input; the records as they are would be right too.
                Err(_) => return Self::plain(records),
            }
        }
        if bytes.len() + HEAD >= records.len() {
            return Self::plain(records);
        }
        Self {
            unpacked: Some(records.len() as u64),
            bytes,
        }
    }

    /// The block of these parts, as [`Self::unpacked`] and [`Self::bytes`] give them.
    pub fn from_parts(unpacked: Option<u64>, bytes: Vec<u8>) -> Self {
        Self { unpacked, bytes }
    }

    /// Length of the records (bytes), if they are compressed.
    pub fn unpacked(&self) -> Option<u64> {
        self.unpacked
    }

    /// The records, compressed or as they are.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    fn plain(records: &[u8]) -> Self {
        Self {
            unpacked: None,
            bytes: records.to_vec(),
        }
    }

    /// Bytes it takes in the file, to within a few.
    pub fn length(&self) -> usize {
        self.bytes.len()
    }
}

/// Bytes of the head of a CBLOCK, about.
const HEAD: usize = 8;
