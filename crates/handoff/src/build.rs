//! Making a hand-off: stage after stage beside its place, and then put there as a whole.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::PathBuf;

use super::contents::{Contents, Handoff, HandoffCheck};
use super::inputs::Sources;
use super::listing::Listing;
use super::manifest::{Manifest, entry_of, files_below};
use super::options::HandoffOptions;
use super::preconditions::{fits, replaceable};
use super::{documents, dose_classes, front_page, layouts, manifest, rules, zip};
use metalith_cell::{Fidelity, cache_folder};
use metalith_core::{AtomicFolder, Error, Progress, Result};
use metalith_design::array::PillarArray;
use metalith_design::cell_models;
use metalith_gds::Layout;
use metalith_optics::AsBuiltChip;
use metalith_report::{Verdict, write_json};
use metalith_verify::{SimulationCases, verify_layout, write_report};

/// Make the hand-off of a design for a process.
///
/// Folder and archive appear together, whole or not at all, whenever the run ends; one run at a time makes a
/// hand-off. An older hand-off at the same place is replaced; any other folder with something in it is left alone.
///
/// # Errors
/// Mistakes in the design or process file; a folder in the way; another run that makes the same hand-off; a file
/// that cannot be written; the user stopped it.
pub fn handoff(options: &HandoffOptions, progress: &dyn Progress) -> Result<Handoff> {
    let sources = Sources::read(options, progress)?;
    fits(&sources.design, &sources.process)?;
    let cell = &sources.design.cell;
    judging(options, &sources).check(cell.shape, cell.lattice)?;
    let archive = archive_of(options);
    replaceable(&options.out, &archive)?;
    let new = AtomicFolder::create(&options.out, &archive)?;
    let mut files = Listing::new(&new.folder());
    let checks = fill(&mut files, &sources, options, progress)?;
    let manifest = seal(&files, &sources, options, progress)?;
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

/// Write everything but the manifest.
fn fill(
    files: &mut Listing,
    sources: &Sources,
    options: &HandoffOptions,
    progress: &dyn Progress,
) -> Result<Vec<HandoffCheck>> {
    let (design, process) = (&sources.design, &sources.process);
    let layouts = layouts::write(files, sources, options.format, progress)?;
    let opened = layouts.paths.open(progress)?;
    let census = opened.census(progress)?;
    let documents = documents::write(files, design, process, &layouts, &census)?;
    let dose_classes = sources.dose_model.as_ref().map(|model| {
        let of = (&layouts.array, model);
        dose_classes::write(files, design, process, of, progress)
    });
    let dose_classes = dose_classes.transpose()?;
    sources.keep(files)?;
    let subjects = rules::subjects(sources, &layouts, &opened);
    let checked = rules::check(files, &subjects, process, sources.waivers.as_ref(), progress)?;
    let mut checks = checked.checks;
    checks.extend(dose_classes.as_ref().map(|classes| HandoffCheck {
        name: "dose classes".into(),
        verdict: Verdict::of(classes.clipped == 0),
        words: classes.words(),
        report: Some("dose/dose_classes.csv".into()),
    }));
    checks.push(verification(
        files,
        options,
        sources,
        &layouts.array,
        &opened.pillars,
        progress,
    )?);
    for (name, purpose) in [
        ("index.html", "this page: start here"),
        ("handoff.json", "all numbers of this page for programs"),
        ("chip.svg", "the chip with origin and orientation"),
        ("tone.svg", "tone of both steps in cross-section"),
    ] {
        files.add(name, purpose);
    }
    let contents = Contents {
        design,
        process,
        command: &options.command,
        design_digest: design.digest(),
        pillars: layouts.array.pillars(),
        census,
        documents,
        blocks: layouts.blocks,
        structures: layouts.structures,
        tests_frame: layouts.tests_frame,
        dose_classes,
        checks,
        rules: checked.reports,
        files: files.files.clone(),
    };
    front_page::write(&files.at(""), &contents)?;
    write_json(&files.at("handoff.json"), "handoff", &contents)?;
    Ok(contents.checks)
}

/// The cell of the pillars as drawn that judges, or that stands beside a chip as fabricated: a compensated layout is
/// right when it is made, not as it is drawn.
fn judging(options: &HandoffOptions, sources: &Sources) -> Fidelity {
    match &sources.model {
        Some(_) => Fidelity::Rigorous,
        None => options.fidelity.unwrap_or(sources.design.verify.fidelity),
    }
}

/// Read the pillar layout back, simulate it, and put the report beside it.
fn verification(
    files: &mut Listing,
    options: &HandoffOptions,
    sources: &Sources,
    array: &PillarArray,
    pillars: &Layout,
    progress: &dyn Progress,
) -> Result<HandoffCheck> {
    let design = &sources.design;
    let judge = judging(options, sources);
    let mut wanted = vec![judge];
    // Polynomials in width and wavelength are of the paper's cell.
    if judge != Fidelity::Published && design.cell.is_of_the_paper() {
        wanted.push(Fidelity::Published);
    }
    let models = cell_models(design, &wanted)?;
    let chip = |model| -> Result<AsBuiltChip> {
        Ok(AsBuiltChip::in_light(&design.lit_stack()?, model)?.cached_in(cache_folder().as_deref()))
    };
    let made = sources.model.as_ref().map(chip).transpose()?;
    let cases = match &made {
        Some(chip) => SimulationCases::judged_by(chip).with_cells(&models),
        None => SimulationCases::of_cells(&models)?,
    };
    let found = verify_layout(design, array, pillars, &cases, options.accuracy, progress)?;
    write_report(design, array, &found, None, &files.at("verification"))?;
    let failed: Vec<_> = found
        .checks
        .iter()
        .filter(|c| !c.passed())
        .map(|c| c.what.as_str())
        .collect();
    let check = HandoffCheck {
        name: "read back and simulated".into(),
        verdict: Verdict::of(failed.is_empty()),
        words: if failed.is_empty() {
            format!(
                "all {} limits of the design hold, {}",
                found.checks.len(),
                match &found.model {
                    Some(model) => format!("as made by the calibrated model of {}", model.set),
                    None => format!("by the {} cell", found.fidelity),
                }
            )
        } else {
            format!(
                "{} of {} limits do not hold: {}",
                failed.len(),
                found.checks.len(),
                failed.join("; ")
            )
        },
        report: Some("verification/report.html".into()),
    };
    files.add(
        "verification/report.html",
        "what was written, read back, compared and simulated",
    );
    files.add("verification/report.json", "all its numbers for programs");
    Ok(check)
}

/// Write the manifest over the files that were listed, which must be the files that are there.
fn seal(files: &Listing, sources: &Sources, options: &HandoffOptions, progress: &dyn Progress) -> Result<Manifest> {
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
        design: sources.design.name.clone(),
        design_digest: sources.design.digest(),
        process: sources.process.name.clone(),
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
