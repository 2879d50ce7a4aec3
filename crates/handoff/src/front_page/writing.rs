//! Doses, times and jobs of the writer.

use crate::contents::Contents;
use crate::dose::{Beam, DOSE_FORMULA, DoseRow, Exposure, FORMULA, WriteTime, duration};
use crate::dose_matrix::DoseBlock;
use crate::job::{self, JobPatterns};
use crate::metrology_sites::Cross;
use crate::pad::PadPillar;
use crate::pictures;
use crate::process::{JobSpec, Process};
use metalith_report::{Cell, Column, Page, Table, fixed};

/// The dose matrix: words for the piece above the pads, the pads, words for what is measured on them; blocks and doses.
pub(crate) fn doses(
    page: &mut Page,
    process: &Process,
    (piece, pads, measured): (&str, &[PadPillar], &str),
    (blocks, doses): (&[DoseBlock], &[DoseRow]),
) {
    page.section("Dose matrix");
    let range = process.resist.dose_range_uc_cm2;
    page.paragraph(format!(
        "Labs differ: {} is written with {} to {} uC/cm2 at {} kV. Write the matrix first, choose the dose whose {} have \
         the {measured} drawn, and change the base dose.",
        process.resist.name,
        range[0],
        range[1],
        process.writer.acceleration_kv,
        if pads.is_empty() { "shapes" } else { "pads" }
    ));
    page.figure(pictures::dose_matrix(process, (piece, pads), blocks, doses));
    let mut table = Table::new([
        Column::number("Dose", ""),
        Column::number("Factor", ""),
        Column::number("Dose", "uC/cm2"),
        Column::number("Modulation", "%"),
        Column::text("Layer"),
    ]);
    for d in doses {
        table.row([
            d.number.into(),
            Cell::fixed(d.factor, 2),
            Cell::fixed(d.dose_uc_cm2, 1),
            Cell::fixed(d.modulation_percent, 1),
            Cell::code(format!("{}/{}", process.dose_matrix.layer, d.number)),
        ]);
    }
    page.table(table);
}

/// Classes of a layout that is corrected by dose.
pub(super) fn dose_classes(page: &mut Page, c: &Contents<'_>) {
    let Some(classes) = &c.dose_classes else { return };
    page.section("Dose classes");
    page.paragraph(format!(
        "Write these layouts in place of the pillar layout, each with its dose, and the marks with the base dose. {}.",
        classes.words()
    ));
    let mut table = Table::new([
        Column::number("Class", ""),
        Column::number("Factor", ""),
        Column::number("Dose", "uC/cm2"),
        Column::number("Pillars", ""),
        Column::number("Area", "um2"),
        Column::text("File"),
    ]);
    for class in &classes.classes {
        table.row([
            class.number.into(),
            Cell::fixed(class.factor, 4),
            Cell::fixed(class.dose_uc_cm2, 1),
            class.pillars.into(),
            Cell::fixed(class.area_um2, 1),
            Cell::code(&class.file),
        ]);
    }
    page.table(table);
}

/// Time of each file at each current; `snapped` are words for what the shots round.
pub(crate) fn write_time(
    page: &mut Page,
    process: &Process,
    snapped: &str,
    exposures: &[(String, Exposure, Vec<WriteTime>)],
) {
    page.section("Write time");
    let w = &process.writer;
    page.code(format!("{FORMULA}\n{DOSE_FORMULA}"));
    page.paragraph(format!(
        "{}, {}: fields of {} um, grid {} nm, at most {} MHz. Overheads: {} us a shape, {} s a field, {} s a job. The shot \
         step is the finest that the clock can follow; {} is snapped.",
        w.name, w.mode, w.field_used_um, w.grid_nm, w.clock_max_mhz, w.shape_overhead_us, w.field_overhead_s, w.job_overhead_s, snapped
    ));
    let mut table = Table::new([
        Column::text("File"),
        Column::number("Area", "um2"),
        Column::number("Shapes", ""),
        Column::number("Fields", ""),
        Column::number("Current", "nA"),
        Column::number("Beam", "s"),
        Column::number("Shapes", "s"),
        Column::number("Fields", "s"),
        Column::number("Total", "h, min"),
    ]);
    for (file, exposure, times) in exposures {
        for t in times {
            table.row([
                Cell::code(file),
                Cell::fixed(exposure.area_um2, 0),
                exposure.shapes.into(),
                exposure.fields.into(),
                t.beam.current_na.to_string().into(),
                Cell::fixed(t.beam_s, 0),
                Cell::fixed(t.shapes_s, 1),
                Cell::fixed(t.fields_s, 1),
                duration(t.total_s()).into(),
            ]);
        }
    }
    page.table(table);
}

/// What the shots of each beam do to pillars on a lattice with these distances along x and y (nm); `changed` are words for what is
/// rounded.
pub(crate) fn snapping(page: &mut Page, changed: &'static str, steps_nm: [f64; 2], snapping: &[(Beam, f64)]) {
    let mut snap = Table::new([
        Column::number("Current", "nA"),
        Column::number("Shot step", "nm"),
        Column::number("Clock", "MHz"),
        Column::number(changed, "nm"),
        Column::text("Pitch"),
    ])
    .caption("What the shots of each beam do to the pillars of the array");
    for (beam, rms) in snapping {
        let fits = |nm: f64| nm % beam.shot_step_nm == 0.0;
        let pitch = if steps_nm.into_iter().all(fits) {
            "a multiple of the step".to_owned()
        } else {
            format!(
                "no multiple: centres move by up to {} nm",
                fixed(beam.shot_step_nm / 2.0, 1)
            )
        };
        snap.row([
            beam.current_na.to_string().into(),
            beam.shot_step_nm.to_string().into(),
            Cell::fixed(beam.clock_mhz, 2),
            Cell::fixed(*rms, 2),
            pitch.into(),
        ]);
    }
    page.table(snap);
}

/// The files for the writer.
pub(crate) fn job_files(
    page: &mut Page,
    patterns: &JobPatterns<'_>,
    process: &Process,
    crosses: &[Cross],
    beams: &[(Beam, f64)],
) {
    page.section("Job");
    match &process.job {
        JobSpec::Jeol(job) => {
            page.note(
                "The job files are drafts. They are to be reviewed and completed by the staff of the writer before any use.",
            );
            if let Some((beam, _)) = beams.last() {
                page.code(job::job_deck(patterns, process, job, crosses, beam));
            }
        }
        JobSpec::Raith(_) => {
            page.note(format!(
                "The layouts in `job/` are for a writer of Raith: the datatype of each exposed shape is its dose factor times 1000, \
                 so that 1000 is the base dose of {} uC/cm2, which is set at the writer. Position lists and working areas are \
                 made there.",
                process.resist.dose_uc_cm2
            ));
        }
    }
}
