//! Values of a data set: contiguous, or in chunks that were filtered.

use std::collections::BTreeSet;
use std::io::Read;

use flate2::read::ZlibDecoder;
use num_complex::Complex64;

use super::bytes::Bytes;
use super::{DataSet, File, Parsed, Storage};
use crate::unit_cells::MOST_CELLS;

/// Filter of chunks.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Filter {
    Deflate,
    Shuffle,
}

impl<'a> File<'a> {
    /// The numbers of a data set.
    pub(in super::super) fn values(&self, set: &DataSet<'a>) -> Parsed<Vec<Complex64>> {
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

/// Product of lengths, if it is a size.
fn product(lengths: &[u64]) -> Option<usize> {
    let product = lengths.iter().try_fold(1_u64, |product, n| product.checked_mul(*n))?;
    usize::try_from(product).ok()
}

/// The bytes of a chunk before they were filtered.
fn unfiltered(stored: &[u8], set: &DataSet<'_>, skipped: u64, size: usize) -> Parsed<Vec<u8>> {
    let mut bytes = stored.to_vec();
    for (k, filter) in set.filters.as_ref().map_err(Clone::clone)?.iter().enumerate().rev() {
        if skipped.checked_shr(k as u32).is_some_and(|mask| mask & 1 == 1) {
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

pub(super) fn filters(mut at: Bytes<'_>) -> Parsed<Vec<Filter>> {
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
