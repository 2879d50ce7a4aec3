//! END, and the checksum in it.

use std::io::{Read, Seek};

use flate2::Crc;

use super::input::Input;
use super::table::Tables;
use crate::error::{OasisError, OasisFault};
use crate::record::{END_BYTES, kind, validation};

/// Bytes of a checksum.
const CHECKSUM: usize = 4;

/// Read the rest of END, which must end the file. Returns its validation scheme.
pub(super) fn read<R: Read + Seek>(
    input: &mut Input<R>,
    with_offsets: bool,
    tables: &mut Tables,
) -> Result<u64, OasisError> {
    let begin = input.record().offset;
    let before_end = input.file_bytes().saturating_sub(begin);
    if before_end < END_BYTES as u64 {
        return Err(input.fault(OasisFault::EndPlace { before_end }));
    }
    if before_end > END_BYTES as u64 {
        let fault = OasisFault::EndPlace { before_end };
        input.odd(fault, "the bytes behind it were not read")?;
    }
    if with_offsets {
        tables.read_offsets(input)?;
    }
    tables.check_offsets(input)?;
    let padding = input.unsigned_padded()?;
    if padding > END_BYTES as u64 {
        return Err(input.fault(OasisFault::EndLength));
    }
    input.bytes(padding as usize, &mut Vec::new())?;
    let scheme = input.unsigned()?;
    match scheme {
        validation::NONE => {}
        validation::CRC32 | validation::CHECKSUM32 => drop(input.array::<CHECKSUM>()?),
        other => return Err(input.fault(OasisFault::Validation(other))),
    }
    if input.offset() != begin + END_BYTES as u64 {
        return Err(input.fault(OasisFault::EndLength));
    }
    Ok(scheme)
}

/// Compare the file with the checksum in its last bytes. A file whose end is not whole is left to the reading, which
/// names the place where it breaks.
pub(super) fn verify_checksum<R: Read + Seek>(input: &mut Input<R>, with_offsets: bool) -> Result<(), OasisError> {
    let bytes = input.file_bytes();
    if bytes < END_BYTES as u64 {
        return Ok(());
    }
    let mut tail = [0; END_BYTES];
    input.tail(&mut tail)?;
    let Some(scheme) = scheme(&tail, with_offsets) else {
        return Ok(());
    };
    let summed = bytes - CHECKSUM as u64;
    let (mut crc, mut sum, mut done) = (Crc::new(), 0u32, 0);
    input.whole(|stretch| {
        let count = (stretch.len() as u64).min(summed - done) as usize;
        done += count as u64;
        if scheme == validation::CRC32 {
            crc.update(&stretch[..count]);
        } else {
            sum = stretch[..count].iter().fold(sum, |sum, &b| sum.wrapping_add(b.into()));
        }
    })?;
    let found = if scheme == validation::CRC32 { crc.sum() } else { sum };
    let (_, said) = tail.split_at(END_BYTES - CHECKSUM);
    let said = u32::from_le_bytes([said[0], said[1], said[2], said[3]]);
    if found != said {
        return Err(OasisError::Fault {
            offset: summed,
            inner: None,
            fault: OasisFault::Checksum { found, said },
        });
    }
    Ok(())
}

/// The validation scheme of an END record with a checksum; none if it has none or is no END record.
fn scheme(tail: &[u8; END_BYTES], with_offsets: bool) -> Option<u64> {
    let mut rest = tail.strip_prefix(&[kind::END])?;
    let unsigned = |rest: &mut &[u8]| {
        let length = rest.iter().position(|b| *b < 0x80)? + 1;
        let value = rest[..length]
            .iter()
            .rev()
            .try_fold(0u64, |value, b| Some(value.checked_mul(0x80)? | u64::from(b & 0x7F)));
        *rest = &rest[length..];
        value
    };
    if with_offsets {
        for _ in 0..12 {
            unsigned(&mut rest)?;
        }
    }
    let padding = usize::try_from(unsigned(&mut rest)?).ok()?;
    rest = rest.get(padding..)?;
    let scheme = unsigned(&mut rest)?;
    (matches!(scheme, validation::CRC32 | validation::CHECKSUM32) && rest.len() == CHECKSUM).then_some(scheme)
}
