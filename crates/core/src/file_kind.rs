//! Formats of pictures and frames, named by their first bytes.

/// Word on the raw file of a camera, and how to bring it over.
pub const RAW: &str = "it is DNG or another raw file of a camera: write its numbers as TIFF of 16 bits, by `dcraw -D -4 -T` or `rawpy` \
    (`raw_image` to `tifffile`)";

/// Word on what a file of another format is, and what to do with it.
pub fn words(first: &[u8]) -> Option<&'static str> {
    let brand = first.get(4..12).unwrap_or_default();
    Some(match first {
        [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => {
            "it is WebP: write it as PNG, by `dwebp FILE -o FILE.png` or any program for pictures"
        }
        _ if brand.starts_with(b"ftypavi") => {
            "it is AVIF: write it as PNG, by `avifdec FILE FILE.png` or any program for pictures"
        }
        _ if brand.starts_with(b"ftypcrx") || first.starts_with(b"FUJIFILMCCD-RAW") => RAW,
        _ if brand.starts_with(b"ftyp") => {
            "it is HEIF (HEIC): write it as JPEG or PNG, by `heif-convert FILE FILE.png` or any program for pictures"
        }
        [0, 0, 0, 12, b'J', b'X', b'L', ..] | [0xFF, 0x0A, ..] => {
            "it is JPEG XL: write it as PNG, by `djxl FILE FILE.png` or any program for pictures"
        }
        [0, 0, 0, 12, b'j', b'P', ..] => "it is JPEG 2000: write it as PNG, by any program for pictures",
        [b'G', b'I', b'F', b'8', ..] => "it is GIF: write it as PNG, by any program for pictures",
        [b'B', b'M', ..] => "it is BMP: write it as PNG, by any program for pictures",
        [b'#', b'?', b'R', ..] => "it is Radiance HDR: write it as EXR, by any program for pictures",
        [b'P', b'1'..=b'7', b'\n' | b' ', ..] => "it is PNM: write it as PNG, by any program for pictures",
        [0x89, b'H', b'D', b'F', ..] => "it is HDF5: write its frames as NPY, by `h5py` and `numpy.save`",
        [b'P', b'K', 3, 4, ..] => "it is a ZIP archive, such as NPZ: write its arrays as NPY, by `numpy.save`",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::words;

    #[test]
    fn formats_are_named() {
        let named = |first: &[u8], word: &str| assert!(words(first).is_some_and(|w| w.contains(word)), "{word}");
        named(b"RIFF\0\0\0\0WEBPVP8 ", "WebP");
        named(b"\0\0\0\x1cftypavif", "AVIF");
        named(b"\0\0\0\x1cftypheic", "HEIF");
        named(b"\0\0\0\x18ftypcrx ", "raw");
        named(b"GIF89a", "GIF");
        assert!(
            [&b"\x93NUMPY"[..], b"", b"\x89PNG", b"II*\0"]
                .iter()
                .all(|b| words(b).is_none())
        );
    }
}
