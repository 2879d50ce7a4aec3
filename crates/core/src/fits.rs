//! Frames from FITS files (Pence et al., Astron. Astrophys. 524, A42 (2010)).

use std::io::Read;

/// Length of a block, and of a card of a header.
const BLOCK: usize = 2880;
const CARD: usize = 80;

/// Most blocks of a header: 36 cards each.
const MOST_BLOCKS: usize = 1 << 10;

/// Most parts of a file that are passed over before one with frames.
const MOST_PARTS: usize = 16;

/// Frames of one size.
#[derive(Clone, Debug, PartialEq)]
pub struct Frames {
    pub rows: usize,
    pub columns: usize,
    /// The first row of the file comes first.
    pub values: Vec<Vec<f32>>,
    /// Largest number that the file can hold, if it holds whole numbers.
    pub largest: Option<f32>,
}

/// Header of a part: what its cards say.
#[derive(Debug, Default)]
struct Header(Vec<(String, String)>);

impl Header {
    fn read(from: &mut impl Read) -> Result<Self, String> {
        let mut cards = Vec::new();
        for _ in 0..MOST_BLOCKS {
            let mut block = [0; BLOCK];
            from.read_exact(&mut block)
                .map_err(|_| "it is no FITS file that can be read: it ends in a header")?;
            for card in block.chunks_exact(CARD) {
                let card = String::from_utf8_lossy(card);
                let key = card.get(..8).unwrap_or_default().trim_end().to_owned();
                if key == "END" {
                    return Ok(Self(cards));
                }
                if let Some(value) = card.get(8..).and_then(|rest| rest.strip_prefix("= ")) {
                    let value = value.split(" /").next().unwrap_or_default();
                    cards.push((key, value.trim().trim_matches('\'').trim_end().to_owned()));
                }
            }
        }
        Err("it is no FITS file that can be read: its header does not end".into())
    }

    fn text(&self, key: &str) -> Option<&str> {
        self.0.iter().find(|(own, _)| own == key).map(|(_, value)| &value[..])
    }

    fn number(&self, key: &str, default: f64) -> Result<f64, String> {
        let Some(text) = self.text(key) else {
            return Ok(default);
        };
        let number = text.replace('D', "E").parse().ok().filter(|v: &f64| v.is_finite());
        number.ok_or_else(|| format!("{key} of its header is no number"))
    }

    fn whole(&self, key: &str, default: u64) -> Result<u64, String> {
        match self.text(key) {
            Some(text) => text
                .parse()
                .map_err(|_| format!("{key} of its header is no whole number")),
            None => Ok(default),
        }
    }

    /// Entries along each axis, the fastest first.
    fn axes(&self) -> Result<Vec<u64>, String> {
        let count = self.whole("NAXIS", 0)?;
        if count > 8 {
            return Err(format!("it has {count} axes"));
        }
        (1..=count).map(|k| self.whole(&format!("NAXIS{k}"), 0)).collect()
    }
}

/// Read the frames of the first part of a file that has any, whole numbers of 8 to 32 bits or numbers with a decimal point, with
/// BZERO and BSCALE. `takes` is asked for the number of frames, rows and columns before anything is set aside for them.
///
/// # Errors
/// What is wrong with the file, in words, and what `takes` says.
pub fn read(mut from: impl Read, takes: impl FnOnce([usize; 3]) -> Result<(), String>) -> Result<Frames, String> {
    for part in 0..MOST_PARTS {
        let header = match Header::read(&mut from) {
            // The end of the file.
            Err(_) if part > 0 => break,
            header => header?,
        };
        if header.text("ZIMAGE") == Some("T") {
            return Err("its frames are compressed: write it without, by `funpack`".into());
        }
        let axes = header.axes()?;
        let bits = header.number("BITPIX", 8.0)?;
        let is_image = header.text("XTENSION").is_none_or(|kind| kind == "IMAGE");
        if is_image && axes.len() >= 2 && axes.iter().all(|n| *n > 0) {
            return frames(&header, &axes, bits, from, takes);
        }
        let entries = axes
            .iter()
            .try_fold(u64::from(!axes.is_empty()), |all, n| all.checked_mul(*n));
        let entries = entries.and_then(|n| n.checked_add(header.whole("PCOUNT", 0).ok()?));
        let bytes = entries.and_then(|n| n.checked_mul((bits.abs() / 8.0) as u64));
        let bytes = bytes.ok_or("a part of it is too large")?.next_multiple_of(BLOCK as u64);
        let passed = std::io::copy(&mut from.by_ref().take(bytes), &mut std::io::sink());
        if passed.map_err(|e| e.to_string())? < bytes {
            break;
        }
    }
    Err("it has no frame".into())
}

fn frames(
    header: &Header,
    axes: &[u64],
    bits: f64,
    mut from: impl Read,
    takes: impl FnOnce([usize; 3]) -> Result<(), String>,
) -> Result<Frames, String> {
    let count = axes[2..].iter().try_fold(1u64, |all, n| all.checked_mul(*n));
    let count = count.ok_or("it is too large")? as usize;
    let (rows, columns) = (axes[1] as usize, axes[0] as usize);
    takes([count, rows, columns])?;
    let (zero, scale) = (header.number("BZERO", 0.0)?, header.number("BSCALE", 1.0)?);
    let value: fn(&[u8]) -> f64 = match bits {
        8.0 => |b| f64::from(b[0]),
        16.0 => |b| f64::from(i16::from_be_bytes([b[0], b[1]])),
        32.0 => |b| f64::from(i32::from_be_bytes([b[0], b[1], b[2], b[3]])),
        -32.0 => |b| f64::from(f32::from_be_bytes([b[0], b[1], b[2], b[3]])),
        -64.0 => |b| f64::from_be_bytes(b.try_into().unwrap_or_default()),
        _ => return Err(format!("its BITPIX is {bits}; 8, 16, 32, -32 and -64 are read")),
    };
    let width = (bits.abs() / 8.0) as usize;
    let mut row = vec![0; columns * width];
    let mut values = Vec::with_capacity(count);
    for _ in 0..count {
        let mut frame = Vec::with_capacity(rows * columns);
        for _ in 0..rows {
            from.read_exact(&mut row).map_err(|e| format!("it ends early: {e}"))?;
            frame.extend(row.chunks_exact(width).map(|own| (zero + scale * value(own)) as f32));
        }
        values.push(frame);
    }
    let highest = match bits {
        8.0 => Some(255.0),
        16.0 => Some(32_767.0),
        32.0 => Some(2_147_483_647.0),
        _ => None,
    };
    Ok(Frames {
        rows,
        columns,
        values,
        largest: highest.filter(|_| scale == 1.0).map(|v: f64| (zero + v) as f32),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(cards: &[&str], data: &[u8]) -> Vec<u8> {
        let mut bytes: Vec<u8> = cards
            .iter()
            .chain(&["END"])
            .flat_map(|c| format!("{c:<80}").into_bytes())
            .collect();
        bytes.resize(bytes.len().next_multiple_of(BLOCK), b' ');
        bytes.extend(data);
        bytes.resize(bytes.len().next_multiple_of(BLOCK), 0);
        bytes
    }

    const HEAD: [&str; 5] = [
        "SIMPLE  =                    T / conforms",
        "BITPIX  =                   16",
        "NAXIS   =                    2",
        "NAXIS1  =                    3",
        "NAXIS2  =                    2",
    ];

    #[test]
    fn whole_numbers_have_their_zero() {
        let data: Vec<u8> = [-32768i16, 0, 1, 2, 3, 32767]
            .iter()
            .flat_map(|v| v.to_be_bytes())
            .collect();
        let cards = [
            &HEAD[..],
            &["BZERO   =                32768", "BSCALE  =                  1.0"],
        ]
        .concat();
        let bytes = file(&cards, &data);
        let found = read(&bytes[..], |_| Ok(())).unwrap();
        assert_eq!((found.rows, found.columns, found.largest), (2, 3, Some(65535.0)));
        assert_eq!(found.values, [[0.0, 32768.0, 32769.0, 32770.0, 32771.0, 65535.0]]);
        // Behind a part without frames, as other programs write it.
        let empty = file(
            &[
                "SIMPLE  =                    T",
                "BITPIX  =                    8",
                "NAXIS   =                    0",
            ],
            &[],
        );
        assert_eq!(read(&[empty, bytes].concat()[..], |_| Ok(())).unwrap(), found);
    }

    #[test]
    fn several_frames_and_numbers_with_a_point_are_read() {
        let data: Vec<u8> = (0..12).flat_map(|k| (0.5 * k as f32).to_be_bytes()).collect();
        let mut cards = HEAD.to_vec();
        cards[1] = "BITPIX  =                  -32";
        cards[2] = "NAXIS   =                    3";
        cards.push("NAXIS3  =                    2");
        let found = read(&file(&cards, &data)[..], |_| Ok(())).unwrap();
        assert_eq!((found.values.len(), found.values[1][0], found.largest), (2, 3.0, None));
    }

    #[test]
    fn damaged_files_are_named() {
        let cause = |bytes: &[u8]| read(bytes, |_| Ok(())).unwrap_err();
        assert!(cause(b"SIMPLE").contains("no FITS"));
        assert!(cause(&file(&HEAD, &[])[..BLOCK]).contains("ends early"));
        assert!(cause(&file(&HEAD[..1], &[])).contains("no frame"));
        let mut cards = HEAD.to_vec();
        cards[3] = "NAXIS1  =                  3.5";
        assert!(cause(&file(&cards, &[])).contains("NAXIS1"));
        let refused = read(&file(&HEAD, &[])[..], |shape| Err(format!("{shape:?}")));
        assert_eq!(refused.unwrap_err(), "[1, 2, 3]");
    }
}
