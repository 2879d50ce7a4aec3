//! Numbers and pictures from TIFF files.

use std::io::{Read, Seek, SeekFrom};

use tiff::ColorType;
use tiff::decoder::{Decoder, Limits};
use tiff::tags::{SampleFormat, Tag};

/// A page as the file has it.
#[derive(Clone, Debug, PartialEq)]
pub struct Page {
    pub rows: usize,
    pub columns: usize,
    /// Values of a pixel: one of grey, three of colours, and one more if the page has opacity.
    pub channels: usize,
    /// Row by row, and pixel by pixel.
    pub values: Vec<f32>,
    /// Largest number that the page can hold, if it holds whole numbers.
    pub largest: Option<f32>,
}

/// The pages of a file, and what it says of the first as a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Tiff {
    pub pages: Vec<Page>,
    /// The colour profile.
    pub profile: Option<Vec<u8>>,
    /// Orientation, as EXIF numbers it from 1 to 8.
    pub orientation: u16,
}

/// Tag that every DNG has.
const DNG_VERSION: u16 = 50706;

/// Longest colour profile (bytes).
const LONGEST_PROFILE: usize = 1 << 22;

/// Bytes beside those of a page that reading it may take.
const BESIDE: usize = 1 << 20;

fn wrong(error: tiff::TiffError) -> String {
    format!("it is no TIFF file that can be read: {error}")
}

/// Refuse a page whose pixels stand, by its directory, beyond the end of the file: a decoder that stops once it has all pixels would
/// not notice.
fn check_within<R: Read + Seek>(decoder: &mut Decoder<R>, length: u64) -> Result<(), String> {
    for [offsets, counts] in [
        [Tag::StripOffsets, Tag::StripByteCounts],
        [Tag::TileOffsets, Tag::TileByteCounts],
    ] {
        let [Ok(offsets), Ok(counts)] = [offsets, counts].map(|tag| decoder.get_tag_u64_vec(tag)) else {
            continue;
        };
        let ends = offsets
            .iter()
            .zip(&counts)
            .map(|(from, count)| from.saturating_add(*count));
        if ends.max().is_some_and(|end| end > length) {
            return Err("it ends early: its pixels stand beyond its end".into());
        }
    }
    Ok(())
}

fn opened<R: Read + Seek>(from: R) -> Result<Decoder<R>, String> {
    let mut decoder = Decoder::new(from).map_err(wrong)?;
    if decoder
        .find_tag(Tag::Unknown(DNG_VERSION))
        .is_ok_and(|tag| tag.is_some())
    {
        return Err(crate::file_kind::RAW.into());
    }
    Ok(decoder)
}

/// Rows and columns of the first page.
///
/// # Errors
/// What is wrong with the file, in words.
pub fn size(from: impl Read + Seek) -> Result<(usize, usize), String> {
    let (width, height) = opened(from)?.dimensions().map_err(wrong)?;
    Ok((height as usize, width as usize))
}

/// The values of each page: whole numbers of 1 to 32 bits, packed or not, and numbers with a decimal point of 16, 32 or 64 bits,
/// in one plane or in several. `takes` is asked for each page, by its number, rows, columns and channels, before room is
/// set aside for it.
///
/// # Errors
/// What is wrong with the file, in words, and what `takes` says.
pub fn read<R: Read + Seek>(
    mut from: R,
    mut takes: impl FnMut(usize, [usize; 3]) -> Result<(), String>,
) -> Result<Tiff, String> {
    let unreadable = |e: std::io::Error| format!("it cannot be read: {e}");
    let length = from.seek(SeekFrom::End(0)).map_err(unreadable)?;
    from.rewind().map_err(unreadable)?;
    let mut decoder = opened(from)?;
    let mut limits = Limits::default();
    // A colour profile is the longest value of a tag.
    limits.ifd_value_size = limits.ifd_value_size.max(LONGEST_PROFILE);
    decoder = decoder.with_limits(limits.clone());
    let profile = decoder.find_tag(Tag::IccProfile).ok().flatten();
    let profile = profile
        .and_then(|value| value.into_u8_vec().ok())
        .filter(|bytes| bytes.len() <= LONGEST_PROFILE);
    let orientation = decoder.find_tag_unsigned::<u16>(Tag::Orientation).ok().flatten();
    let mut pages = Vec::new();
    loop {
        let (width, height) = decoder.dimensions().map_err(wrong)?;
        let (rows, columns) = (height as usize, width as usize);
        let colour = decoder.colortype().map_err(wrong)?;
        let channels = match colour {
            ColorType::Gray(_) => 1,
            ColorType::GrayA(_) => 2,
            ColorType::RGB(_) => 3,
            ColorType::RGBA(_) => 4,
            _ => return Err(format!("its pixels are {colour:?}, neither grey nor RGB")),
        };
        takes(pages.len(), [rows, columns, channels])?;
        let samples = rows.checked_mul(columns).and_then(|n| n.checked_mul(channels));
        let bytes = samples.and_then(|n| n.checked_mul(8)).ok_or("it is too large")?;
        limits.decoding_buffer_size = bytes;
        limits.intermediate_buffer_size = bytes + BESIDE;
        decoder = decoder.with_limits(limits.clone());
        check_within(&mut decoder, length)?;
        pages.push(page(&mut decoder, [rows, columns, channels], colour.bit_depth())?);
        if !decoder.more_images() {
            break;
        }
        decoder.next_image().map_err(wrong)?;
    }
    Ok(Tiff {
        pages,
        profile,
        orientation: orientation.unwrap_or(1),
    })
}

fn page<R: Read + Seek>(
    decoder: &mut Decoder<R>,
    [rows, columns, channels]: [usize; 3],
    bits: u8,
) -> Result<Page, String> {
    let layout = decoder.image_buffer_layout().map_err(wrong)?;
    let of = Samples::of(layout.sample_format, bits)?;
    if matches!(of, Samples::Whole(9..=15)) {
        let mut values = Vec::with_capacity(rows * columns * channels);
        for row in packed_rows(decoder, [rows, columns, channels], bits)? {
            let mut own = vec![0.0; columns * channels];
            of.read(&row, own.iter_mut());
            values.extend(own);
        }
        let largest = of.largest();
        return Ok(Page {
            rows,
            columns,
            channels,
            values,
            largest,
        });
    }
    let planes = layout.planes.max(1);
    let in_row = columns * channels / planes;
    let row = (in_row * usize::from(bits)).div_ceil(8);
    let stride = layout.row_stride.map_or(row, std::num::NonZeroUsize::get);
    let plane = layout.plane_stride.map_or(layout.len, std::num::NonZeroUsize::get);
    let fits =
        channels % planes == 0 && stride >= row && plane >= stride * rows && layout.complete_len >= plane * planes;
    if !fits || layout.complete_len > 8 * rows * columns * channels {
        return Err("its size is not that of its pixels".into());
    }
    let mut bytes = vec![0; layout.complete_len];
    decoder.read_image_bytes(&mut bytes).map_err(wrong)?;
    let mut values = vec![0.0; rows * columns * channels];
    for y in 0..rows {
        for k in 0..planes {
            let own = &bytes[k * plane + y * stride..][..row];
            let to = values[y * columns * channels..].iter_mut().skip(k).step_by(planes);
            of.read(own, to.take(in_row));
        }
    }
    Ok(Page {
        rows,
        columns,
        channels,
        values,
        largest: of.largest(),
    })
}

/// Rows of numbers of 9 to 15 bits one behind the other, each row from a new byte, which the decoder does not read.
fn packed_rows<R: Read + Seek>(
    decoder: &mut Decoder<R>,
    [rows, columns, channels]: [usize; 3],
    bits: u8,
) -> Result<Vec<Vec<u8>>, String> {
    let mut number = |tag, default: usize| match decoder.find_tag_unsigned::<u32>(tag) {
        Ok(found) => Ok(found.map_or(default, |v| v as usize)),
        Err(error) => Err(wrong(error)),
    };
    let compressed = number(Tag::Compression, 1)? != 1;
    if compressed || number(Tag::FillOrder, 1)? != 1 || channels > 1 && number(Tag::PlanarConfiguration, 1)? != 1 {
        return Err(format!(
            "its numbers of {bits} bits are compressed, in several planes or in reverse order: write them as 16 bits"
        ));
    }
    let in_strip = number(Tag::RowsPerStrip, rows)?.clamp(1, rows.max(1));
    let strips = decoder.get_tag_u64_vec(Tag::StripOffsets).map_err(wrong)?;
    if strips.len() < rows.div_ceil(in_strip) {
        return Err("its size is not that of its pixels".into());
    }
    let row = (columns * channels * usize::from(bits)).div_ceil(8);
    let early = |e: std::io::Error| format!("it ends early: {e}");
    let mut out = Vec::with_capacity(rows);
    for y in 0..rows {
        if y % in_strip == 0 {
            let place = SeekFrom::Start(strips[y / in_strip]);
            decoder.inner().seek(place).map_err(early)?;
        }
        let mut own = vec![0; row];
        decoder.inner().read_exact(&mut own).map_err(early)?;
        out.push(own);
    }
    Ok(out)
}

/// Form of the numbers.
#[derive(Clone, Copy)]
enum Samples {
    Whole(u8),
    Signed(u8),
    Half,
    Single,
    Double,
}

impl Samples {
    fn of(format: SampleFormat, bits: u8) -> Result<Self, String> {
        match (format, bits) {
            (SampleFormat::Uint, 1..=16 | 32) => Ok(Self::Whole(bits)),
            (SampleFormat::Int, 8 | 16 | 32) => Ok(Self::Signed(bits)),
            (SampleFormat::IEEEFP, 16) => Ok(Self::Half),
            (SampleFormat::IEEEFP, 32) => Ok(Self::Single),
            (SampleFormat::IEEEFP, 64) => Ok(Self::Double),
            _ => Err(format!(
                "its pixels are {format:?} of {bits} bits; 1 to 16 and 32 bits are read, or 16, 32 and 64 with a decimal point"
            )),
        }
    }

    fn largest(self) -> Option<f32> {
        match self {
            Self::Whole(bits) => Some((f64::from(bits).exp2() - 1.0) as f32),
            Self::Signed(bits) => Some((f64::from(bits - 1).exp2() - 1.0) as f32),
            _ => None,
        }
    }

    /// Put the numbers of a row into places.
    fn read<'v>(self, bytes: &[u8], to: impl Iterator<Item = &'v mut f32>) {
        match self {
            Self::Whole(8) => put(bytes, to, |[a]: [u8; 1]| f32::from(a)),
            Self::Whole(16) => put(bytes, to, |b| f32::from(u16::from_ne_bytes(b))),
            Self::Whole(32) => put(bytes, to, |b| u32::from_ne_bytes(b) as f32),
            Self::Signed(8) => put(bytes, to, |b| f32::from(i8::from_ne_bytes(b))),
            Self::Signed(16) => put(bytes, to, |b| f32::from(i16::from_ne_bytes(b))),
            Self::Signed(_) => put(bytes, to, |b| i32::from_ne_bytes(b) as f32),
            Self::Half => put(bytes, to, |b| half(u16::from_ne_bytes(b))),
            Self::Single => put(bytes, to, f32::from_ne_bytes),
            Self::Double => put(bytes, to, |b| f64::from_ne_bytes(b) as f32),
            Self::Whole(bits) => {
                let bits = usize::from(bits);
                for (k, to) in to.enumerate() {
                    // The highest bit comes first.
                    let bit = |at: usize| u16::from(bytes[at / 8] >> (7 - at % 8) & 1);
                    *to = f32::from((k * bits..(k + 1) * bits).fold(0, |sum, at| sum << 1 | bit(at)));
                }
            }
        }
    }
}

fn put<'v, const N: usize>(bytes: &[u8], to: impl Iterator<Item = &'v mut f32>, value: impl Fn([u8; N]) -> f32) {
    for (own, to) in bytes.chunks_exact(N).zip(to) {
        *to = value(own.try_into().unwrap_or([0; N]));
    }
}

/// A number of IEEE 754 of 16 bits.
pub fn half(bits: u16) -> f32 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f32::from(bits & 1023));
    sign * match exponent {
        0 => fraction * (-24f32).exp2(),
        31 if fraction == 0.0 => f32::INFINITY,
        31 => f32::NAN,
        _ => (1024.0 + fraction) * ((exponent - 25) as f32).exp2(),
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    /// A file of one strip in the byte order of `order`: 4 columns, 2 rows.
    fn file(order: &[u8; 2], tags: &[(u16, u32)], data: &[u8]) -> Vec<u8> {
        let little = order == b"II";
        let short = |v: u16| if little { v.to_le_bytes() } else { v.to_be_bytes() };
        let long = |v: u32| if little { v.to_le_bytes() } else { v.to_be_bytes() };
        let mut all = vec![
            (256, 4),
            (257, 2),
            (259, 1),
            (273, 8),
            (278, 2),
            (279, data.len() as u32),
        ];
        all.extend(tags);
        all.sort_unstable();
        let mut out = [&order[..], &short(42), &long(8 + data.len() as u32), data].concat();
        out.extend(short(all.len() as u16));
        for (tag, value) in all {
            out.extend([short(tag), short(4)].concat());
            out.extend([long(1), long(value)].concat());
        }
        out.extend([0; 4]);
        out
    }

    fn values(bytes: Vec<u8>) -> Result<(Vec<f32>, Option<f32>), String> {
        let read = read(Cursor::new(bytes), |_, _| Ok(()))?;
        Ok((read.pages[0].values.clone(), read.pages[0].largest))
    }

    const GREY: (u16, u32) = (262, 1);

    #[test]
    fn packed_numbers_are_read_in_both_orders() {
        // Rows of 4 numbers of 12 bits have 6 bytes.
        let packed = [0x00, 0x10, 0x02, 0xFF, 0xF8, 0x00, 0x12, 0x34, 0x56, 0x78, 0x9A, 0xBC];
        let want = [0x001, 0x002, 0xFFF, 0x800, 0x123, 0x456, 0x789, 0xABC].map(|v: u16| f32::from(v));
        for order in [b"II", b"MM"] {
            let (found, largest) = values(file(order, &[(258, 12), GREY], &packed)).unwrap();
            assert_eq!((&found[..], largest), (&want[..], Some(4095.0)), "{order:?}");
        }
        let nibbles = values(file(b"II", &[(258, 4), GREY], &[0x12, 0x34, 0x56, 0x78])).unwrap();
        assert_eq!(nibbles.0, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
    }

    #[test]
    fn wide_signed_and_half_numbers_are_read() {
        let wide: Vec<u8> = (0..8u32).flat_map(|k| (k << 29).to_be_bytes()).collect();
        let (found, largest) = values(file(b"MM", &[(258, 32), GREY], &wide)).unwrap();
        assert_eq!((found[7], largest), (7.0 * 29f32.exp2(), Some(32f32.exp2())));
        let signed: Vec<u8> = (-4..4i16).flat_map(i16::to_le_bytes).collect();
        let (found, largest) = values(file(b"II", &[(258, 16), GREY, (339, 2)], &signed)).unwrap();
        assert_eq!((found[0], largest), (-4.0, Some(32767.0)));
        let halves = [0x3C00u16, 0xC000, 0x0001, 0x7BFF, 0x3555, 0, 0x0400, 0x8000].map(u16::to_le_bytes);
        let (found, largest) = values(file(b"II", &[(258, 16), GREY, (339, 3)], &halves.concat())).unwrap();
        assert_eq!(found[..4], [1.0, -2.0, (-24f32).exp2(), 65504.0]);
        assert_eq!((found[6], largest), ((-14f32).exp2(), None));
    }

    #[test]
    fn other_files_are_named() {
        let dng = file(b"II", &[(258, 16), GREY, (50706, 4)], &[0; 16]);
        assert!(values(dng).unwrap_err().contains("DNG"));
        let refuses = read(Cursor::new(file(b"II", &[(258, 8), GREY], &[0; 8])), |page, size| {
            Err(format!("{page} {size:?}"))
        });
        assert_eq!(refuses.unwrap_err(), "0 [2, 4, 1]");
        assert!(values(b"II*\0nothing".to_vec()).is_err());
    }
}
