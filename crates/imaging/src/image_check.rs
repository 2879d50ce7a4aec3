//! Check that frames can be recorded of all images of a set, made before any work.

use std::path::{Path, PathBuf};

use metalith_core::text::printable;
use metalith_core::{Error, Progress, Result};
use rayon::prelude::*;

use crate::scene::read_picture;

/// Images that are read at once: the largest take 400 MB each.
const AT_ONCE: usize = 4;
/// Most images that an error names.
const NAMED: usize = 10;

/// Read all images of a set, which must be pictures of one size: one that cannot be used would stop the work in the middle.
///
/// # Errors
/// If images cannot be read or differ in size from most, the first ten by name, each with its reason; if the user stopped it.
pub fn check_images(images: &[PathBuf], progress: &dyn Progress) -> Result<()> {
    progress.begin("reading the images", images.len() as u64);
    let mut sizes = Vec::new();
    for some in images.chunks(AT_ONCE) {
        progress.check_stopped()?;
        let found: Vec<Result<[usize; 2]>> = some.par_iter().map(|image| size_of(image)).collect();
        sizes.extend(found);
        progress.advance(some.len() as u64);
    }
    let usual = most_frequent(sizes.iter().flatten()).unwrap_or_default();
    let mut bad = Vec::new();
    for (image, size) in images.iter().zip(sizes) {
        let why = match size {
            Ok(size) if size == usual => continue,
            Ok([rows, columns]) => format!(
                "it has {columns} x {rows} pixels, most have {} x {}",
                usual[1], usual[0]
            ),
            Err(error) => reason(error),
        };
        bad.push(format!("\n  {}: {why}", printable(&image.to_string_lossy())));
    }
    if bad.is_empty() {
        return Ok(());
    }
    let count = bad.len();
    if count > NAMED {
        bad.truncate(NAMED);
        bad.push(format!("\n  and {} more", count - NAMED));
    }
    Err(Error::refused(
        "scene/images-unusable",
        format!("{count} of {} images cannot be used:{}", images.len(), bad.concat()),
        "remove or replace them: PNG (8 or 16 bits, opaque), JPEG or NPY, all of one size",
    ))
}

/// Rows and columns of a picture, all of which is read.
fn size_of(image: &Path) -> Result<[usize; 2]> {
    let (rows, columns, _) = read_picture(image)?.dim();
    Ok([rows, columns])
}

/// The size that most have; of several, the first.
fn most_frequent<'a>(sizes: impl Iterator<Item = &'a [usize; 2]>) -> Option<[usize; 2]> {
    let mut counts: Vec<([usize; 2], usize)> = Vec::new();
    for size in sizes {
        match counts.iter_mut().find(|(known, _)| known == size) {
            Some((_, count)) => *count += 1,
            None => counts.push((*size, 1)),
        }
    }
    counts.into_iter().rev().max_by_key(|(_, count)| *count).map(|c| c.0)
}

/// Reason why an image cannot be used, without its path and the remedy.
fn reason(error: Error) -> String {
    match error {
        Error::Table { what, .. } | Error::Invalid { what, .. } => what,
        Error::Io { source, .. } => source.to_string(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::png16::write_picture;
    use metalith_core::Silent;
    use ndarray::Array3;

    #[test]
    fn all_bad_images_are_named_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let picture = |name: &str, rows: usize| {
            write_picture(&at(name), &Array3::from_elem((rows, 20, 3), 0.4)).unwrap();
            at(name)
        };
        // The first is not of the usual size, and one is cut off.
        let images = [picture("a.png", 24), picture("b.png", 16), picture("c.png", 16)];
        assert!(check_images(&images[1..], &Silent).is_ok());
        let cut = std::fs::read(&images[1]).unwrap();
        std::fs::write(at("d.png"), &cut[..cut.len() / 2]).unwrap();
        std::fs::write(at("e.png"), "no picture").unwrap();
        let more = ["d.png", "e.png", "none.png"].map(at);
        let error = check_images(&[&images[..], &more].concat(), &Silent)
            .unwrap_err()
            .to_string();
        for words in [
            "4 of 6 images",
            "a.png: it has 20 x 24 pixels, most have 20 x 16",
            "d.png: ",
            "e.png: it is neither",
            "none.png: ",
        ] {
            assert!(error.contains(words), "{error}");
        }
        assert!(!error.contains("b.png"), "{error}");
        let many = vec![at("e.png"); NAMED + 3];
        let error = check_images(&many, &Silent).unwrap_err().to_string();
        assert!(error.contains("13 of 13") && error.contains("and 3 more"), "{error}");
    }
}
