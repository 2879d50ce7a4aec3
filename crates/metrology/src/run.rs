//! A set from its files to its answer.

use std::path::{Path, PathBuf};

use metalith_attribution::{
    ConditionalEffect, RefitEffect, RefitFinding, RefitModel, RefitPlan, SetVerdict, check_names, select,
};
use metalith_core::document::{Document, KeyTable, Section, load};
use metalith_core::{AtomicFile, Error, FolderLock, Progress, Result};
use metalith_optics::CalibratedModel;
use metalith_report::Page;

use crate::declared::{DeclaredEffect, OF_HEIGHTS, OF_SPECTRA};
use crate::diagnosis::{Diagnosis, SetFacts};
use crate::heights::{self, HeightModel, HeightSet};
use crate::page::page;
use crate::proposal::{Declares, propose};
use crate::psf_stack::{self, StackModel, StackSet};
use crate::spectra::{self, SpectrumModel, SpectrumSet};
use crate::widths::{self, WidthModel, WidthSet};

/// Kind of a measured set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SetKind {
    Heights,
    Spectra,
    Widths,
    PsfStack,
}

/// The files of an answer.
#[derive(Clone, Debug)]
pub struct Answer {
    pub diagnosis: Diagnosis,
    /// `diagnosis.json`.
    pub answer: PathBuf,
    /// `report.html`.
    pub report: PathBuf,
    /// `model.toml` of widths; none where no effect explains the residual.
    pub model: Option<PathBuf>,
}

/// The `measurement.toml` of a set that is named by its folder or by the file.
fn file_of(set: &Path) -> PathBuf {
    if set.is_dir() {
        set.join("measurement.toml")
    } else {
        set.to_owned()
    }
}

/// The keys of a file of effects for a kind of set; none of a kind that has none.
pub fn keys_of_effects(kind: SetKind) -> Option<KeyTable> {
    match kind {
        SetKind::Heights => Some(DeclaredEffect::keys(&OF_HEIGHTS)),
        SetKind::Spectra => Some(DeclaredEffect::keys(&OF_SPECTRA)),
        SetKind::Widths | SetKind::PsfStack => None,
    }
}

/// The kind of a set; none of one that other readers read, or that cannot be read.
pub fn kind_of(set: &Path) -> Option<SetKind> {
    let path = file_of(set);
    let text = load(&path).ok()?;
    let kind = Document::read(&path, &text, |root| {
        root.accept_others();
        // The reader of stacks says what is wrong where objects stand under another kind.
        let is_stack = root.has("object") && !root.has("layout");
        let kind = root.optional_text("kind").unwrap_or_else(|| "psf".into());
        if is_stack && kind == "psf" {
            "psf_stack".into()
        } else {
            kind
        }
    });
    match kind.ok()?.as_str() {
        "heights" => Some(SetKind::Heights),
        "spectra" => Some(SetKind::Spectra),
        "widths" => Some(SetKind::Widths),
        "psf_stack" => Some(SetKind::PsfStack),
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
/// are named; those of a file are tried too.
///
/// # Errors
/// Every mistake of a set at once, and unknown names of effects; else if a file cannot be written, or the user stopped it.
pub fn calibrate(
    set: &Path,
    kind: SetKind,
    out: &Path,
    (only, declared): (&[String], Option<&Path>),
    progress: &dyn Progress,
) -> Result<Answer> {
    if let (SetKind::Widths | SetKind::PsfStack, Some(file)) = (kind, declared) {
        return Err(Error::refused(
            "calibrate/kind-has-none",
            format!(
                "{}: no effects are declared for sets of widths and stacks",
                file.display()
            ),
            "leave --declare out: their effects have names of their own, see docs/guide/measure.md",
        ));
    }
    let declared_for = |stages| declared.map_or(Ok(Vec::new()), |file| DeclaredEffect::read(file, stages));
    let path = file_of(set);
    progress.begin("files", 0);
    match kind {
        SetKind::Heights => {
            let set = HeightSet::read(&path)?;
            let mut model = HeightModel::new(&set);
            model.declare(&declared_for(&OF_HEIGHTS)?)?;
            model.effects = tried(&model.effects, &heights::CONDITIONAL, only)?;
            let facts = SetFacts {
                title: &set.title,
                kind: "heights",
                measure: "height (nm rms)",
                names: set.fields.iter().map(|f| f.name.clone()).collect(),
                averages: true,
                remarks: &set.remarks,
            };
            let plan = model.plan();
            answer(model, &plan, &facts, ("nm", out), progress, |model, page, theta| {
                heights::figures(page, &set, model, theta);
            })
        }
        SetKind::Spectra => {
            let set = SpectrumSet::read(&path)?;
            let mut model = SpectrumModel::new(&set);
            model.check()?;
            let remarks = [set.remarks.clone(), model.remarks()].concat();
            model.declare(&declared_for(&OF_SPECTRA)?)?;
            model.effects = tried(&model.effects, &spectra::CONDITIONAL, only)?;
            let facts = SetFacts {
                title: &set.title,
                kind: "spectra",
                measure: if set.is_transmission {
                    "transmission (rms)"
                } else {
                    "reflectance (rms)"
                },
                names: set.spectra.iter().map(|s| s.name.clone()).collect(),
                averages: false,
                remarks: &remarks,
            };
            let plan = model.plan();
            answer(model, &plan, &facts, ("", out), progress, |model, page, theta| {
                spectra::figures(page, &set, model, theta);
            })
        }
        SetKind::Widths => {
            let set = WidthSet::read(&path, progress)?;
            let mut model = WidthModel::new(&set);
            model.effects = tried(&model.effects, &widths::CONDITIONAL, only)?;
            let facts = SetFacts {
                title: &set.title,
                kind: "widths",
                measure: "width (nm rms)",
                names: (1..=set.sites.len()).map(|n| format!("site {n}")).collect(),
                averages: true,
                remarks: &set.remarks,
            };
            let plan = model.plan();
            let (found, mut diagnosis) = found(&model, &plan, &facts, progress)?;
            let learned = diagnosis.verdict != SetVerdict::Unexplained;
            let calibrated = learned.then(|| widths::calibrated(&model, &found, &mut diagnosis));
            let files = (None, calibrated);
            write(diagnosis, files, ("nm", out), progress, |page| {
                widths::figures(page, &set, &model, &found.theta);
            })
        }
        SetKind::PsfStack => {
            let mut set = StackSet::read(&path)?;
            progress.begin("orientation", 0);
            let prepared = psf_stack::prepare(&mut set)?;
            let mut model = StackModel::new(&set, &prepared);
            model.keep(&tried(&model.own.effects, &[], only)?);
            let plan = model.plan();
            let mut found = select(&model, &plan, progress)?;
            let mut remarks = set.remarks.clone();
            remarks.extend(psf_stack::allow_for_samples(
                &set,
                &prepared,
                (&model, &plan),
                &mut found,
            ));
            remarks.extend(psf_stack::equal_scales(&model, &found));
            let facts = SetFacts {
                title: &set.title,
                kind: "psf_stack",
                measure: "residual over measured norm (rms)",
                names: set.planes.iter().map(|p| p.name.clone()).collect(),
                averages: false,
                remarks: &remarks,
            };
            let diagnosis = Diagnosis::new(&facts, &model, &plan, &found);
            write(diagnosis, (None, None), ("", out), progress, |page| {
                psf_stack::figures(page, &set, &model, &found.theta);
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

/// The effects of a set, and what is said of them.
fn found(
    model: &dyn RefitModel,
    plan: &RefitPlan,
    facts: &SetFacts<'_>,
    progress: &dyn Progress,
) -> Result<(RefitFinding, Diagnosis)> {
    let found = select(model, plan, progress)?;
    let diagnosis = Diagnosis::new(facts, model, plan, &found);
    Ok((found, diagnosis))
}

/// The answer of a set whose model takes effects of a file: what no effect explains is proposed as such.
fn answer<M: Declares>(
    mut model: M,
    plan: &RefitPlan,
    facts: &SetFacts<'_>,
    (unit, out): (&str, &Path),
    progress: &dyn Progress,
    figures: impl FnOnce(&M, &mut Page, &[f64]),
) -> Result<Answer> {
    let (found, mut diagnosis) = found(&model, plan, facts, progress)?;
    let (mut theta, mut proposal) = (found.theta.clone(), None);
    if matches!(diagnosis.verdict, SetVerdict::Partly | SetVerdict::Unexplained) {
        let (proposals, text) = propose(&mut model, plan, &found, progress)?;
        proposal = (!proposals.is_empty()).then_some(text);
        diagnosis.proposals = proposals;
        theta.extend(model.parameters().iter().skip(theta.len()).map(|p| p.neutral));
    }
    write(diagnosis, (proposal, None), (unit, out), progress, |page| {
        figures(&model, page, &theta);
    })
}

/// Write the files of an answer: the proposal and the calibrated model where there are any, and none of an earlier run.
fn write(
    diagnosis: Diagnosis,
    (proposal, calibrated): (Option<String>, Option<CalibratedModel>),
    (unit, out): (&str, &Path),
    progress: &dyn Progress,
    figures: impl FnOnce(&mut Page),
) -> Result<Answer> {
    let turn = FolderLock::wait(out, progress, || {
        progress.warn("another run writes into this folder: waiting for it");
    })?;
    let [answer, report, proposed, model] = ["diagnosis.json", "report.html", "proposal.toml", "model.toml"];
    let mut page = page(&diagnosis, unit);
    figures(&mut page);
    turn.publish("calibration", &[proposed, model], |folder| {
        if let Some(text) = &proposal {
            AtomicFile::write(&folder.join(proposed), text.as_bytes())?;
        }
        metalith_report::write_plain_json(&folder.join(answer), &diagnosis)?;
        page.write(&folder.join(report))?;
        calibrated
            .as_ref()
            .map_or(Ok(()), |found| found.write(&folder.join(model)))
    })?;
    Ok(Answer {
        diagnosis,
        answer: out.join(answer),
        report: out.join(report),
        model: calibrated.map(|_| out.join(model)),
    })
}
