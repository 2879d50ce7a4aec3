//! Folders of images.

use std::path::{Path, PathBuf};

use metalith_core::{Error, Result};

/// PNG, JPEG, TIFF, EXR and NPY images of a folder, by name.
///
/// # Errors
/// If it cannot be read, or holds none.
pub fn images_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder).map_err(Error::io("read", folder))?;
    let known = |path: &PathBuf| {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        extension.is_some_and(|e| ["png", "jpg", "jpeg", "tif", "tiff", "exr", "npy"].contains(&e.as_str()))
    };
    let mut images: Vec<PathBuf> = entries.filter_map(|e| Some(e.ok()?.path())).filter(known).collect();
    images.sort();
    if images.is_empty() {
        return Err(Error::refused(
            "scene/no-images",
            format!("{} holds no image", folder.display()),
            "give a folder of PNG, JPEG, TIFF, EXR or NPY files",
        ));
    }
    Ok(images)
}
