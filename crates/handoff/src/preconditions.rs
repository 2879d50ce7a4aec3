//! Preconditions that are checked before anything is written.

use std::collections::BTreeSet;
use std::io::ErrorKind;
use std::path::Path;

use super::manifest::{self, files_below};
use super::process::Process;
use super::zip;
use metalith_core::{Error, Result};
use metalith_design::Design;
use metalith_pillars::PillarShape;

/// Checks that the process can make the design at all.
pub(super) fn fits(design: &Design, process: &Process) -> Result<()> {
    makes_pillars(process)?;
    etches(design, process)?;
    has_rules(design.cell.shape, process)?;
    let layers = design.layout.layers.all();
    let taken = layers
        .iter()
        .map(|(key, l)| (l.layer, format!("that of `{key}` in the design")));
    layer_is_free(taken, process)
}

/// Checks that what the first step exposes stays as a pillar.
pub(super) fn makes_pillars(process: &Process) -> Result<()> {
    if process.exposes_pillars() {
        return Ok(());
    }
    Err(Error::refused(
        "handoff/tone-inverted",
        format!(
            "with resist and transfer of {} {}: the pillars of the layout would become holes",
            process.words(),
            process.exposed_becomes()
        ),
        "a positive resist needs `method = \"lift_off\"`, a negative one `method = \"direct_etch\"`",
    ))
}

/// Checks that the etch of the process is for the film of the design.
fn etches(design: &Design, process: &Process) -> Result<()> {
    let film = design.cell.pillar_material.as_str();
    if !process.transfer.etches(film) {
        return Err(Error::refused(
            "handoff/film-material-differs",
            format!(
                "the film of the design is \"{film}\"; `films` in [transfer] of {} has {} ({}), and {}",
                process.words(),
                process.transfer.films.join(", "),
                process.transfer.etch,
                if Process::any_etches(film) {
                    "another shipped process has it: leave out --process"
                } else {
                    "no shipped process has it"
                }
            ),
            format!(
                "copy {} within its folder, set `films = [\"{film}\"]` and `etch` in [transfer] to what the lab does, and give the \
                 copy to --process: its limits count as assumed until the lab confirms them",
                Process::template(design.cell.shape)
            ),
        ));
    }
    let thickness_nm = design.cell.pillar_height_nm;
    if let (false, Some([low, high])) = (process.transfer.reaches(thickness_nm), process.transfer.film_nm) {
        return Err(Error::refused(
            "handoff/film-thickness-differs",
            format!(
                "the film of the design is {thickness_nm} nm thick; `film_nm` in [transfer] of {} is {low} to {high} nm, for which \
                 its etch and its rules are",
                process.words()
            ),
            "use a process file for this thickness; if its etch and its rules are right for it, change `film_nm` in [transfer]",
        ));
    }
    Ok(())
}

/// Checks that the process has rules for pillars of this shape.
pub(super) fn has_rules(shape: PillarShape, process: &Process) -> Result<()> {
    if process.checks.of_shape(shape).is_some() {
        return Ok(());
    }
    let shapes = shape.plural();
    Err(Error::refused(
        "handoff/no-rules-for-pillars",
        format!(
            "the pillars are {shapes}, and [checks] of {} has no decks of rules for them",
            process.words()
        ),
        if shape.is_square() {
            "add `pillar_rules`, `dose_rules` and `test_rules` to [checks]".to_owned()
        } else {
            let file = process.source().0.file_name().unwrap_or_default();
            format!(
                "copy {} within its folder, add a section [checks.{shapes}] with `pillar_rules = \"../rules/{shapes}.toml\"`, \
                 `dose_rules = \"../rules/dose_{shapes}.toml\"` and `test_rules = \"../rules/test_{shapes}.toml\"`, and give the \
                 copy to --process",
                file.to_string_lossy()
            )
        },
    ))
}

/// Checks that the layer of the dose matrix is none of these, each with words for what it is.
pub(super) fn layer_is_free(taken: impl IntoIterator<Item = (i16, String)>, process: &Process) -> Result<()> {
    let Some((layer, words)) = taken.into_iter().find(|(layer, _)| *layer == process.dose_matrix.layer) else {
        return Ok(());
    };
    Err(Error::refused(
        "handoff/layer-taken",
        format!("layer {layer} of the dose matrix is {words}"),
        "choose another `layer` in [dose_matrix] of the process file",
    ))
}

/// Checks that a hand-off may be put at this place: nothing is there, or an empty folder, or nothing but an older
/// hand-off with its archive.
///
/// # Errors
/// If something else is there, with the name of the first such file.
pub(super) fn replaceable(folder: &Path, archive: &Path) -> Result<()> {
    let hint = "choose another folder with --out, or move it away";
    for (path, kind, id) in [
        (folder, "folder", "handoff/not-a-folder"),
        (archive, "file", "handoff/not-a-file"),
    ] {
        match std::fs::symlink_metadata(path) {
            Ok(found) if (kind == "folder" && found.is_dir()) || (kind == "file" && found.is_file()) => {}
            Ok(_) => {
                return Err(Error::refused(
                    id,
                    format!("{} exists and is not a {kind}", path.display()),
                    hint,
                ));
            }
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => return Err(Error::io("read", path)(error)),
        }
    }
    let there = if folder.exists() {
        Some(files_below(folder)?)
    } else {
        None
    };
    let handed_off = there.as_ref().is_some_and(|t| t.files.contains_key(manifest::NAME));
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    if !handed_off && archive.exists() && !zip::is_packed_here(archive, &name)? {
        return Err(Error::refused(
            "handoff/foreign-archive",
            format!("{} exists and is not the archive of a hand-off", archive.display()),
            hint,
        ));
    }
    let Some(there) = there else { return Ok(()) };
    let known = if handed_off {
        manifest::listed(folder)?
    } else {
        BTreeSet::new()
    };
    let listed = |name: &str| name == manifest::NAME || known.contains(name);
    let strange = there.files.keys().find(|name| !listed(name));
    match strange.or(there.other.first()) {
        None => Ok(()),
        Some(name) => Err(Error::refused(
            "handoff/foreign-file",
            format!(
                "{} contains {name}, which is not a file of a hand-off",
                folder.display()
            ),
            hint,
        )),
    }
}
