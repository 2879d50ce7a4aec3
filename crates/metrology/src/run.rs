//! A set from its files to its answer.

use std::path::{Path, PathBuf};

use metalith_attribution::{ConditionalEffect, RefitEffect, RefitModel, RefitPlan, check_names, select};
use metalith_core::document::{Document, Section, load};
use metalith_core::{AtomicFile, FolderLock, Progress, Result};

use crate::diagnosis::{Diagnosis, SetFacts};
use crate::heights::{self, HeightModel, HeightSet};
use crate::page::page;
use crate::spectra::{self, SpectrumModel, SpectrumSet};

/// Kind of a measured set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SetKind {
    Heights,
    Spectra,
}

/// The files of an answer.
#[derive(Clone, Debug)]
pub struct Answer {
    pub diagnosis: Diagnosis,
    /// `diagnosis.json`.
    pub answer: PathBuf,
    /// `report.html`.
    pub report: PathBuf,
}

/// The `measurement.toml` of a set that is named by its folder or by the file.
fn file_of(set: &Path) -> PathBuf {
    if set.is_dir() {
        set.join("measurement.toml")
    } else {
        set.to_owned()
    }
}

/// The kind of a set; none of one that other readers read, or that cannot be read.
pub fn kind_of(set: &Path) -> Option<SetKind> {
    let path = file_of(set);
    let text = load(&path).ok()?;
    let kind = Document::read(&path, &text, |root| {
        root.accept_others();
        root.optional_text("kind")
    });
    match kind.ok()??.as_str() {
        "heights" => Some(SetKind::Heights),
        "spectra" => Some(SetKind::Spectra),
        _ => None,
    }
}

/// The folder that paths of a set count from: the key `folder`, which itself counts from the file.
pub(crate) fn folder_of(path: &Path, root: &Section<'_, '_>) -> PathBuf {
    let own = path.parent().unwrap_or(Path::new(""));
    root.optional_text("folder")
        .map_or_else(|| own.to_owned(), |folder| own.join(folder))
}

/// Read a set, find the effects that its model lacks, and write the answer to a folder. Only some effects are tried if these
/// are named.
///
/// # Errors
/// Every mistake of a set at once, and unknown names of effects; else if a file cannot be written, or the user stopped it.
pub fn calibrate(set: &Path, kind: SetKind, out: &Path, only: &[String], progress: &dyn Progress) -> Result<Answer> {
    let path = file_of(set);
    progress.begin("files", 0);
    match kind {
        SetKind::Heights => {
            let set = HeightSet::read(&path)?;
            let mut model = HeightModel::new(&set);
            model.effects = tried(&model.effects, &heights::CONDITIONAL, only)?;
            let facts = SetFacts {
                title: &set.title,
                kind: "heights",
                measure: "height (nm rms)",
                names: set.fields.iter().map(|f| f.name.clone()).collect(),
                noise_floor: None,
            };
            let plan = model.plan();
            answer(&model, &plan, &facts, ("nm", out), progress, |page, theta| {
                heights::figures(page, &set, &model, theta);
            })
        }
        SetKind::Spectra => {
            let set = SpectrumSet::read(&path)?;
            let mut model = SpectrumModel::new(&set);
            model.effects = tried(&model.effects, &spectra::CONDITIONAL, only)?;
            let facts = SetFacts {
                title: &set.title,
                kind: "spectra",
                measure: "reflectance (rms)",
                names: set.spectra.iter().map(|s| s.name.clone()).collect(),
                noise_floor: set.repeat_rms(),
            };
            let plan = model.plan();
            answer(&model, &plan, &facts, ("", out), progress, |page, theta| {
                spectra::figures(page, &set, &model, theta);
            })
        }
    }
}

/// The effects that are tried: all, or those that are named with those that they change.
fn tried(all: &[RefitEffect], conditional: &[ConditionalEffect], only: &[String]) -> Result<Vec<RefitEffect>> {
    let known: Vec<String> = all.iter().map(|e| e.name.clone()).collect();
    check_names(&known, conditional, only)?;
    let mut kept: Vec<bool> = all.iter().map(|e| only.is_empty() || only.contains(&e.name)).collect();
    for e in (0..all.len()).rev() {
        if kept[e] {
            all[e].after.iter().for_each(|&b| kept[b] = true);
        }
    }
    let place = |e: usize| kept[..e].iter().filter(|k| **k).count();
    let effects = all.iter().zip(&kept).filter(|(_, k)| **k).map(|(e, _)| RefitEffect {
        after: e.after.iter().map(|&b| place(b)).collect(),
        ..e.clone()
    });
    Ok(effects.collect())
}

fn answer(
    model: &dyn RefitModel,
    plan: &RefitPlan,
    facts: &SetFacts<'_>,
    (unit, out): (&str, &Path),
    progress: &dyn Progress,
    figures: impl FnOnce(&mut metalith_report::Page, &[f64]),
) -> Result<Answer> {
    let found = select(model, plan, progress)?;
    let diagnosis = Diagnosis::new(facts, model, plan, &found);
    let _turn = FolderLock::wait(out, progress, || {
        progress.warn("another run writes into this folder: waiting for it");
    })?;
    let (answer, report) = (out.join("diagnosis.json"), out.join("report.html"));
    for earlier in ["model.toml", "proposal.toml"] {
        AtomicFile::discard(&out.join(earlier))?;
    }
    metalith_report::write_plain_json(&answer, &diagnosis)?;
    let mut page = page(&diagnosis, unit);
    figures(&mut page, &found.theta);
    page.write(&report)?;
    Ok(Answer {
        diagnosis,
        answer,
        report,
    })
}
