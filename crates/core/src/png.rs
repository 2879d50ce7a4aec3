//! Numbers and pictures from PNG files, which are whole or refused.

use std::io::{BufRead, Seek, SeekFrom};

use ::png::{BitDepth, ColorType, Decoder, DecodingError, Info, Transformations};

/// Most bytes that one byte of a deflated stream stands for (RFC 1951: 258 bytes by two bits).
const DEFLATED: u64 = 1032;

/// A picture as it is stored.
pub struct Png {
    /// Rows of pixels, each with its own channels, of 8 bits or of 16 bits, highest byte first.
    pub data: Vec<u8>,
    /// Bytes of a row.
    pub row_bytes: usize,
    /// Numbers of a pixel.
    pub channels: usize,
    /// True if numbers have 16 bits.
    pub is_deep: bool,
    /// Properties and texts of the file, those behind the pixels too.
    pub info: Info<'static>,
}

/// Numbers of a grey picture of 8 or 16 bits.
pub struct GreyPng {
    /// Row by row.
    pub numbers: Vec<u16>,
    /// True if numbers have 16 bits.
    pub is_deep: bool,
}

impl GreyPng {
    /// Largest number that the file can hold.
    pub fn largest(&self) -> u16 {
        if self.is_deep { u16::MAX } else { u8::MAX.into() }
    }
}

fn wrong(error: &DecodingError) -> String {
    match error {
        DecodingError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
            "it is no PNG that can be read: it ends early".into()
        }
        other => format!("it is no PNG that can be read: {other}"),
    }
}

/// Rows and columns of a picture.
///
/// # Errors
/// What is wrong with the file, in words.
pub fn size(from: impl BufRead + Seek) -> Result<(usize, usize), String> {
    let reader = Decoder::new(from).read_info().map_err(|e| wrong(&e))?;
    Ok(size_of(reader.info()))
}

fn size_of(info: &Info<'_>) -> (usize, usize) {
    (info.height as usize, info.width as usize)
}

/// A picture in which palettes and numbers of fewer bits are written out. `takes` is asked before room is set aside for the pixels.
///
/// # Errors
/// What is wrong with the file, in words, and what `takes` says; if it has fewer bytes than its pixels need, or ends early.
pub fn read(from: impl BufRead + Seek, takes: impl FnOnce(&Info<'_>) -> Result<(), String>) -> Result<Png, String> {
    decoded(from, Transformations::EXPAND, takes)
}

fn decoded(
    mut from: impl BufRead + Seek,
    transformations: Transformations,
    takes: impl FnOnce(&Info<'_>) -> Result<(), String>,
) -> Result<Png, String> {
    let unreadable = |e: std::io::Error| format!("it cannot be read: {e}");
    let begin = from.stream_position().map_err(unreadable)?;
    let length = from.seek(SeekFrom::End(0)).map_err(unreadable)? - begin;
    from.seek(SeekFrom::Start(begin)).map_err(unreadable)?;
    let mut decoder = Decoder::new(from);
    decoder.set_transformations(transformations);
    let mut reader = decoder.read_info().map_err(|e| wrong(&e))?;
    takes(reader.info())?;
    check_palette(reader.info())?;
    let size = reader.output_buffer_size().ok_or("it is too large")?;
    let (rows, columns) = size_of(reader.info());
    if reader.info().raw_bytes() as u64 / DEFLATED > length {
        return Err(format!(
            "{length} bytes are too few for {columns} x {rows} pixels: it ends early"
        ));
    }
    let mut data = vec![0; size];
    let frame = reader.next_frame(&mut data).map_err(|e| wrong(&e))?;
    // What is said of the pixels may stand behind them. What is damaged there is no fault of the pixels, but a file that does not end
    // may lack it.
    if let Err(error @ DecodingError::IoError(_)) = reader.finish() {
        return Err(wrong(&error));
    }
    Ok(Png {
        data,
        row_bytes: frame.line_size,
        channels: frame.color_type.samples(),
        is_deep: frame.bit_depth == BitDepth::Sixteen,
        info: reader.info().clone(),
    })
}

/// Refuse a palette that is no list of colours: the decoder takes three bytes for each without a look.
fn check_palette(info: &Info<'_>) -> Result<(), String> {
    /// Bytes of a colour, and most colours.
    const COLOUR: usize = 3;
    const MOST: usize = 256;
    let bytes = info.palette.as_ref().map_or(0, |palette| palette.len());
    let is_indexed = info.color_type == ColorType::Indexed;
    let transparent = info.trns.as_ref().map_or(0, |of_each| of_each.len());
    if !bytes.is_multiple_of(COLOUR) || bytes > COLOUR * MOST || is_indexed && transparent > bytes / COLOUR {
        return Err(format!(
            "its palette has {bytes} bytes for colours and {transparent} for their opacity"
        ));
    }
    Ok(())
}

/// A grey picture of 8 or 16 bits. `takes` is asked for rows and columns.
///
/// # Errors
/// As [`read`]; if the pixels are others.
pub fn read_grey(
    from: impl BufRead + Seek,
    takes: impl FnOnce(usize, usize) -> Result<(), String>,
) -> Result<GreyPng, String> {
    let png = decoded(from, Transformations::IDENTITY, |info| {
        let (rows, columns) = size_of(info);
        takes(rows, columns)?;
        match (info.color_type, info.bit_depth) {
            (ColorType::Grayscale, BitDepth::Eight | BitDepth::Sixteen) => Ok(()),
            (colour, depth) => Err(format!(
                "its pixels are {colour:?} of {depth:?} bits, not grey of 8 or 16 bits"
            )),
        }
    })?;
    Ok(GreyPng {
        numbers: if png.is_deep {
            png.data.as_chunks().0.iter().map(|b| u16::from_be_bytes(*b)).collect()
        } else {
            png.data.iter().map(|b| u16::from(*b)).collect()
        },
        is_deep: png.is_deep,
    })
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    fn file(depth: BitDepth, data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = ::png::Encoder::new(&mut bytes, 3, 2);
        encoder.set_color(ColorType::Grayscale);
        encoder.set_depth(depth);
        encoder.write_header().unwrap().write_image_data(data).unwrap();
        bytes
    }

    fn grey(bytes: &[u8]) -> Result<GreyPng, String> {
        read_grey(Cursor::new(bytes), |rows, columns| {
            assert_eq!((rows, columns), (2, 3));
            Ok(())
        })
    }

    #[test]
    fn numbers_are_those_of_the_file() {
        let narrow = grey(&file(BitDepth::Eight, &[1, 2, 3, 4, 5, 255])).unwrap();
        assert_eq!(
            (&narrow.numbers[..], narrow.largest()),
            (&[1, 2, 3, 4, 5, 255][..], 255)
        );
        let wide = grey(&file(BitDepth::Sixteen, &[0, 1, 1, 0, 0, 3, 0, 4, 0, 5, 255, 255])).unwrap();
        assert_eq!(
            (&wide.numbers[..], wide.largest()),
            (&[1, 256, 3, 4, 5, 65535][..], 65535)
        );
        assert!(grey(&file(BitDepth::One, &[0, 0])).is_err());
    }

    #[test]
    fn a_file_without_its_end_is_refused() {
        let whole = file(BitDepth::Sixteen, &[7; 12]);
        for end in 0..whole.len() {
            assert!(grey(&whole[..end]).is_err(), "{end} of {}", whole.len());
        }
    }
}
