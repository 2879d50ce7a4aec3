//! The hand-off of a design: all layouts are made from it, read back and simulated.

use super::contents::{Contents, HandoffCheck};
use super::inputs::Sources;
use super::listing::Listing;
use super::options::{DesignSource, HandoffOptions};
use super::{documents, dose_classes, front_page, layouts, raith, rules};
use metalith_cell::{Fidelity, cache_folder};
use metalith_core::{Progress, Result};
use metalith_design::array::PillarArray;
use metalith_design::cell_models;
use metalith_gds::Layout;
use metalith_optics::AsBuiltChip;
use metalith_report::{Verdict, write_json};
use metalith_verify::{SimulationCases, verify_layout, write_report};

/// Write everything but the manifest.
pub(super) fn fill(
    files: &mut Listing,
    sources: &Sources,
    (source, options): (&DesignSource, &HandoffOptions),
    progress: &dyn Progress,
) -> Result<Vec<HandoffCheck>> {
    let (design, process) = (&sources.design, &sources.lab.process);
    let layouts = layouts::write(files, sources, options.format, progress)?;
    let opened = layouts.paths.open(progress)?;
    let census = opened.census(progress)?;
    let documents = documents::write(files, design, process, &layouts, &census)?;
    let dose_classes = sources.dose_model.as_ref().map(|model| {
        let of = (&layouts.array, model);
        dose_classes::write(files, design, process, of, progress)
    });
    let dose_classes = dose_classes.transpose()?;
    raith::of_design(files, process, &layouts, dose_classes.as_ref(), design)?;
    sources.lab.keep(files)?;
    let subjects = rules::subjects(sources, &layouts, &opened);
    let checked = rules::check(
        files,
        &subjects,
        &sources.lab,
        Some(design.cell.pitch_nm.nm()),
        progress,
    )?;
    let mut checks = checked.checks;
    checks.extend(dose_classes.as_ref().map(|classes| HandoffCheck {
        name: "dose classes".into(),
        verdict: Verdict::of(classes.clipped == 0),
        words: classes.words(),
        report: Some("dose/dose_classes.csv".into()),
        broken: Vec::new(),
    }));
    checks.push(verification(
        files,
        source,
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
pub(super) fn judging(source: &DesignSource, sources: &Sources) -> Fidelity {
    match &sources.model {
        Some(_) => Fidelity::Rigorous,
        None => source.fidelity.unwrap_or(sources.design.verify.fidelity),
    }
}

/// Read the pillar layout back, simulate it, and put the report beside it.
fn verification(
    files: &mut Listing,
    source: &DesignSource,
    sources: &Sources,
    array: &PillarArray,
    pillars: &Layout,
    progress: &dyn Progress,
) -> Result<HandoffCheck> {
    let design = &sources.design;
    let judge = judging(source, sources);
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
    let found = verify_layout(design, array, pillars, &cases, source.accuracy, progress)?;
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
        broken: Vec::new(),
    };
    files.add(
        "verification/report.html",
        "what was written, read back, compared and simulated",
    );
    files.add("verification/report.json", "all its numbers for programs");
    Ok(check)
}
