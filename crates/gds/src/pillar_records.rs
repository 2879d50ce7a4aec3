//! The two elements that a pillar layout consists of, recognised by their bytes: the upright square and
//! the plain reference. Anything else, however close, goes through [`super::element`].

use super::shape::Point;
use metalith_core::LayerNumber;

/// Bytes of a BOUNDARY with five points and no optional record.
pub(super) const BOUNDARY_BYTES: usize = 64;

/// Longest name that [`reference`] takes.
pub(super) const NAME_BYTES: usize = 8;

#[inline]
fn word(bytes: &[u8; BOUNDARY_BYTES], at: usize) -> u32 {
    u32::from_be_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

/// A BOUNDARY of exactly LAYER, DATATYPE, XY with five points, ENDEL.
#[inline]
pub(super) fn boundary(bytes: &[u8; BOUNDARY_BYTES]) -> Option<(LayerNumber, [Point; 5])> {
    let heads = word(bytes, 0) == 0x0004_0800
        && word(bytes, 4) == 0x0006_0D02
        && word(bytes, 10) == 0x0006_0E02
        && word(bytes, 16) == 0x002C_1003
        && word(bytes, 60) == 0x0004_1100;
    if !heads {
        return None;
    }
    let layer = LayerNumber::new(
        u16::from_be_bytes([bytes[8], bytes[9]]),
        u16::from_be_bytes([bytes[14], bytes[15]]),
    );
    let points = std::array::from_fn(|k| {
        Point::new(
            i64::from(word(bytes, 20 + 8 * k) as i32),
            i64::from(word(bytes, 24 + 8 * k) as i32),
        )
    });
    Some((layer, points))
}

/// A reference of exactly SNAME with a name of up to eight bytes, XY, ENDEL.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlainReference {
    /// The name as the record has it, zeros after it: without its padding, a key of the name.
    pub key: u64,
    pub at: Point,
    pub bytes: usize,
}

/// Longest reference: head, name of eight bytes, one point, end.
pub(super) const REFERENCE_BYTES: usize = 4 + 4 + NAME_BYTES + 12 + 4;

#[inline]
pub(super) fn reference(bytes: &[u8; REFERENCE_BYTES]) -> Option<PlainReference> {
    let word = |at: usize| u32::from_be_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
    if word(0) != 0x0004_0A00 || bytes[4] != 0 || bytes[6] != 0x12 || bytes[7] != 0x06 {
        return None;
    }
    let name = usize::from(bytes[5]).wrapping_sub(4);
    if !(2..=NAME_BYTES).contains(&name) || name % 2 != 0 {
        return None;
    }
    let after = 8 + name;
    if word(after) != 0x000C_1003 || word(after + 12) != 0x0004_1100 {
        return None;
    }
    let all = u64::from_le_bytes(bytes[8..16].try_into().expect("eight bytes"));
    let key = if name == 8 { all } else { all & ((1 << (8 * name)) - 1) };
    // A zero byte inside the name, or nothing but zeros: the general reader decides.
    let length = 8 - key.leading_zeros() as usize / 8;
    if length == 0 || length + 1 < name || bytes[8..8 + length].contains(&0) {
        return None;
    }
    Some(PlainReference {
        key,
        at: Point::new(i64::from(word(after + 4) as i32), i64::from(word(after + 8) as i32)),
        bytes: after + 16,
    })
}
