//! The tables and drafts that go with the layouts: doses, times, places to measure at, marks, jobs.

use serde::Serialize;

use super::dose::{Beam, DoseRow, Exposure, WriteTime, doses};
use super::dose_matrix::DoseBlock;
use super::exposure::{exposures, snapping};
use super::job::{self, JobPatterns};
use super::kind_words::KindWords;
use super::layout_statistics::LayoutStatistics;
use super::layouts::Layouts;
use super::listing::Listing;
use super::metrology_sites::{Cross, MetrologySite, crosses, sites};
use super::process::{JobSpec, Process};
use super::tables;
use metalith_core::Result;
use metalith_design::Design;
use metalith_pillars::PillarShape;

/// Content of the tables.
#[derive(Serialize)]
pub(super) struct Documents {
    /// Exposure of each file of the first step, with its time at each current.
    pub exposures: Vec<(String, Exposure, Vec<WriteTime>)>,
    /// Root mean square change of the pillars when snapped to the shots of each beam (nm): see [`snapping`].
    pub snapping: Vec<(Beam, f64)>,
    pub doses: Vec<DoseRow>,
    pub sites: Vec<MetrologySite>,
    pub crosses: Vec<Cross>,
}

/// Write them.
///
/// # Errors
/// If a file cannot be written, or no beam of the process gives its dose.
pub(super) fn write(
    files: &mut Listing,
    design: &Design,
    process: &Process,
    layouts: &Layouts,
    census: &[LayoutStatistics],
) -> Result<Documents> {
    let documents = Documents {
        exposures: exposures(design, process, census)?,
        snapping: snapping(&layouts.array, process)?,
        doses: doses(process),
        sites: sites(design, process, &layouts.array, &layouts.structures),
        crosses: crosses(design),
    };
    let matrix = (&documents.doses[..], &layouts.blocks[..]);
    dose_tables(files, process, Some(design.cell.shape), matrix, &documents.exposures)?;
    measuring_tables(files, design, process, layouts, &documents)?;
    let patterns = JobPatterns::of(design);
    jobs(files, &patterns, process, &documents.crosses, &documents.snapping)?;
    Ok(documents)
}

/// Write the doses of the dose matrix and the times of each file, of pillars of a shape or of none.
pub(super) fn dose_tables(
    files: &mut Listing,
    process: &Process,
    shape: Option<PillarShape>,
    (doses, blocks): (&[DoseRow], &[DoseBlock]),
    exposures: &[(String, Exposure, Vec<WriteTime>)],
) -> Result<()> {
    tables::write_doses(
        &files.add(
            "dose/dose_table.csv",
            "the nine doses, where each is, a column to fill in",
        ),
        doses,
        blocks,
        process.dose_matrix.layer,
        shape,
    )?;
    let times: Vec<_> = exposures
        .iter()
        .map(|(file, _, times)| (file.clone(), times.clone()))
        .collect();
    tables::write_times(
        &files.add("dose/write_time.csv", "time of each file of step 1 at each current"),
        &times,
    )
}

/// Write the places to measure pillars of a shape at.
pub(super) fn site_table(
    files: &mut Listing,
    process: &Process,
    shape: PillarShape,
    sites: &[MetrologySite],
) -> Result<()> {
    let purpose = format!("where to measure {}, columns to fill in", KindWords::of(shape).measured);
    tables::write_sites(&files.add("metrology/cd_table.csv", purpose), sites, process, shape)
}

fn measuring_tables(
    files: &mut Listing,
    design: &Design,
    process: &Process,
    layouts: &Layouts,
    documents: &Documents,
) -> Result<()> {
    tables::write_structures(
        &files.add("tests/structures.csv", "what each test structure is for and where"),
        &layouts.structures,
        design.cell.shape,
    )?;
    site_table(files, process, design.cell.shape, &documents.sites)?;
    let layers = &design.layout.layers;
    let both = format!(
        "{}/{} step 1, {}/{} step 2",
        layers.pillar_marks.layer,
        layers.pillar_marks.datatype,
        layers.aperture_marks.layer,
        layers.aperture_marks.datatype
    );
    tables::write_crosses(
        &files.add("metrology/alignment.csv", "alignment crosses of both steps"),
        &documents.crosses,
        &both,
    )
}

/// Write the drafts of a job for each current, where the process asks for them.
pub(super) fn jobs(
    files: &mut Listing,
    patterns: &JobPatterns<'_>,
    process: &Process,
    crosses: &[Cross],
    beams: &[(Beam, f64)],
) -> Result<()> {
    let JobSpec::Jeol(job) = &process.job else {
        return Ok(());
    };
    for (beam, _) in beams {
        let name = |kind: &str| format!("job/{}.{kind}", job::stem(patterns.name, beam));
        let drafts = [
            (
                "jdf",
                "DRAFT of the job deck, to be reviewed by staff",
                job::job_deck(patterns, process, job, crosses, beam),
            ),
            (
                "sdf",
                "DRAFT of the schedule, to be reviewed by staff",
                job::schedule(patterns, process, job, beam),
            ),
        ];
        for (kind, purpose, text) in drafts {
            // The writer's computer and a PC both read lines that end this way.
            files.write(name(kind), purpose, text.replace('\n', "\r\n").as_bytes())?;
        }
    }
    Ok(())
}
