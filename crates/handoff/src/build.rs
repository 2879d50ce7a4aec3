//! Making a hand-off: stage after stage beside its place, and then put there as a whole.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::PathBuf;

use super::contents::{Handoff, HandoffCheck};
use super::from_design;
use super::from_layout::{self, LayoutInputs};
use super::inputs::Sources;
use super::listing::Listing;
use super::manifest::{Manifest, entry_of, files_below};
use super::options::{HandoffOptions, HandoffSource};
use super::preconditions::{fits, replaceable};
use super::{manifest, zip};
use metalith_core::{AtomicFolder, Error, Progress, Result};

/// Make the hand-off of a design or of a layout for a process.
///
/// Folder and archive appear together, whole or not at all, whenever the run ends; one run at a time makes a
/// hand-off. An older hand-off at the same place is replaced; any other folder with something in it is left alone.
///
/// # Errors
/// Mistakes in the design, the layout or the process file; a folder in the way; another run that makes the same hand-off; a
/// file that cannot be written; the user stopped it.
pub fn handoff(options: &HandoffOptions, progress: &dyn Progress) -> Result<Handoff> {
    match &options.source {
        HandoffSource::Design(source) => {
            let sources = Sources::read(source, options, progress)?;
            let design = &sources.design;
            fits(design, &sources.lab.process)?;
            from_design::judging(source, &sources).check(design.cell.shape, design.cell.lattice)?;
            let identity = Identity {
                name: &design.name,
                digest: design.digest(),
                process: &sources.lab.process.name,
            };
            publish(options, &identity, progress, |files| {
                from_design::fill(files, &sources, (source, options), progress)
            })
        }
        HandoffSource::Layout(source) => {
            let inputs = LayoutInputs::read(source, options, progress)?;
            let identity = Identity {
                name: &inputs.name,
                digest: inputs.digest.clone(),
                process: &inputs.lab.process.name,
            };
            publish(options, &identity, progress, |files| {
                from_layout::fill(files, &inputs, options, progress)
            })
        }
    }
}

/// What a manifest says of the source.
struct Identity<'a> {
    name: &'a str,
    digest: String,
    process: &'a str,
}

/// Make the folder beside its place by `fill`, seal and pack it, and put it there.
fn publish(
    options: &HandoffOptions,
    identity: &Identity<'_>,
    progress: &dyn Progress,
    fill: impl FnOnce(&mut Listing) -> Result<Vec<HandoffCheck>>,
) -> Result<Handoff> {
    let archive = archive_of(options);
    replaceable(&options.out, &archive)?;
    let new = AtomicFolder::create(&options.out, &archive)?;
    let mut files = Listing::new(&new.folder());
    let checks = fill(&mut files)?;
    let manifest = seal(&files, identity, options, progress)?;
    pack(&new, &manifest, options, progress)?;
    // Making it may have taken hours: what was put there since is not to be lost.
    replaceable(&options.out, &archive)?;
    new.publish()?;
    Ok(Handoff {
        folder: options.out.clone(),
        archive,
        manifest,
        checks,
    })
}

fn archive_of(options: &HandoffOptions) -> PathBuf {
    let mut name = OsString::from(options.out.file_name().unwrap_or_default());
    name.push(".zip");
    options.out.with_file_name(name)
}

/// Write the manifest over the files that were listed, which must be the files that are there.
fn seal(
    files: &Listing,
    identity: &Identity<'_>,
    options: &HandoffOptions,
    progress: &dyn Progress,
) -> Result<Manifest> {
    let there = files_below(&files.at(""))?;
    let listed: BTreeSet<&String> = files.files.iter().map(|(name, _)| name).collect();
    let present: BTreeSet<&String> = there.files.keys().collect();
    let mut differ: Vec<&str> = listed
        .symmetric_difference(&present)
        .map(|name| name.as_str())
        .collect();
    differ.extend(there.other.iter().map(String::as_str));
    differ.extend(there.empty.iter().map(String::as_str));
    if let Some(first) = differ.first() {
        return Err(Error::refused(
            "handoff/folder-changed",
            format!("{first} was added or removed while the hand-off was written"),
            "make sure that no other program writes into its folder, and try again",
        ));
    }
    let mut digests = std::collections::BTreeMap::new();
    progress.begin("digests", there.files.len() as u64);
    for (name, path) in there.files {
        digests.insert(name, entry_of(&path, &metalith_core::Silent)?);
        progress.check_stopped()?;
        progress.advance(1);
    }
    let manifest = Manifest {
        metalith: env!("CARGO_PKG_VERSION").into(),
        command: options.command.clone(),
        design: identity.name.to_owned(),
        design_digest: identity.digest.clone(),
        process: identity.process.to_owned(),
        files: digests,
        seal: String::new(),
    }
    .sealed();
    manifest.write(&files.at(""))?;
    Ok(manifest)
}

/// Pack the files of the manifest, and the manifest.
fn pack(new: &AtomicFolder, manifest: &Manifest, options: &HandoffOptions, progress: &dyn Progress) -> Result<()> {
    let name = options.out.file_name().unwrap_or_default().to_string_lossy();
    let folder = new.folder();
    let packed: BTreeSet<&str> = manifest
        .files
        .keys()
        .map(String::as_str)
        .chain([manifest::NAME])
        .collect();
    let packed: Vec<_> = packed
        .into_iter()
        .map(|file| (format!("{name}/{file}"), folder.join(file)))
        .collect();
    zip::pack(&new.archive(), &packed, progress)
}
