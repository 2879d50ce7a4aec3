//! What must hold before anything is made.

use std::path::Path;

use super::manifest::{self, files_below};
use super::process::Process;
use metalith_core::{Error, Result};
use metalith_design::Design;

/// Whether the process can make the design at all.
pub(super) fn fits(design: &Design, process: &Process) -> Result<()> {
    if !process.exposes_pillars() {
        return Err(Error::invalid(
            format!(
                "with this resist and transfer {}: the pillars of the layout would become holes",
                process.exposed_becomes()
            ),
            "a positive resist needs `method = \"lift_off\"`, a negative one `method = \"direct_etch\"`",
        ));
    }
    let taken = design.layout.layers.all();
    if let Some((key, layer)) = taken.iter().find(|(_, l)| l.layer == process.dose_matrix.layer) {
        return Err(Error::invalid(
            format!(
                "layer {} of the dose matrix is that of `{key}` in the design",
                layer.layer
            ),
            "choose another `layer` in [dose_matrix] of the process file",
        ));
    }
    Ok(())
}

/// Whether the folder is not there, empty, or holds nothing but an older hand-off.
pub(super) fn replaceable(folder: &Path) -> Result<()> {
    if !folder.exists() {
        return Ok(());
    }
    let (there, other) = files_below(folder)?;
    let known = if there.contains_key(manifest::NAME) {
        manifest::listed(folder)?
    } else {
        Vec::new()
    };
    let strange = there
        .keys()
        .chain(&other)
        .find(|name| *name != manifest::NAME && !known.contains(name));
    match strange {
        None => Ok(()),
        Some(name) => Err(Error::invalid(
            format!("{} holds {name}, which no hand-off put there", folder.display()),
            "choose another folder with --out, or move the file away",
        )),
    }
}
