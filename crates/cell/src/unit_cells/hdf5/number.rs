//! Numbers of a data set, real or complex.

use num_complex::Complex64;

use super::Parsed;
use super::bytes::Bytes;

/// Largest entry (bytes): two numbers of eight bytes, and room that a program leaves around them. It bounds the memory of a chunk.
const LARGEST_ENTRY: usize = 64;

/// Number of a data set.
#[derive(Clone, Copy)]
struct Real {
    size: usize,
    is_float: bool,
    is_signed: bool,
}

/// Entry of a data set: its size in bytes, and the number there or the two parts of a complex number at their offsets.
#[derive(Clone, Copy)]
pub(super) struct Entry {
    pub(super) size: usize,
    parts: [(usize, Real); 2],
    pub(super) is_complex: bool,
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
pub(super) fn entry(at: Bytes<'_>) -> Parsed<Option<Entry>> {
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
    if bits & 0xffff != 2 || !(1..=LARGEST_ENTRY).contains(&size) {
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
    pub(super) fn value(&self, bytes: &[u8]) -> Complex64 {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Class 6 of version 3 with two members, `r` and `i`, of no or of many bytes.
    #[test]
    fn entries_of_no_or_of_many_bytes_are_no_numbers() {
        for size in [0_u32, 1 << 31] {
            let mut bytes = vec![0x36, 2, 0, 0];
            bytes.extend(size.to_le_bytes());
            bytes.extend([b'r', 0, 0, 0, 0, 0]);
            assert!(entry(Bytes(&bytes)).unwrap().is_none(), "{size}");
        }
    }
}
