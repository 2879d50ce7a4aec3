//! Doses, times and jobs of the writer.

use crate::contents::Contents;
use crate::dose::{DOSE_FORMULA, FORMULA, duration};
use crate::kind_words::KindWords;
use crate::pad::dose_pads;
use crate::{job, pictures};
use metalith_report::{Cell, Column, Page, Table, fixed};

pub(super) fn doses(page: &mut Page, c: &Contents<'_>) {
    page.section("Dose matrix");
    let range = c.process.resist.dose_range_uc_cm2;
    page.paragraph(format!(
        "Labs differ: {} is written with {} to {} uC/cm2 at {} kV. Write the matrix first, choose the dose whose pads have \
         the {} drawn, and change the base dose.",
        c.process.resist.name,
        range[0],
        range[1],
        c.process.writer.acceleration_kv,
        KindWords::of(c.design.cell.shape).measured
    ));
    page.figure(pictures::dose_matrix(
        c.process,
        &dose_pads(c.design, c.process),
        &c.blocks,
        &c.documents.doses,
    ));
    let mut table = Table::new([
        Column::number("Dose", ""),
        Column::number("Factor", ""),
        Column::number("Dose", "uC/cm2"),
        Column::number("Modulation", "%"),
        Column::text("Layer"),
    ]);
    for d in &c.documents.doses {
        table.row([
            d.number.into(),
            Cell::fixed(d.factor, 2),
            Cell::fixed(d.dose_uc_cm2, 1),
            Cell::fixed(d.modulation_percent, 1),
            Cell::code(format!("{}/{}", c.process.dose_matrix.layer, d.number)),
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

pub(super) fn write_time(page: &mut Page, c: &Contents<'_>) {
    page.section("Write time");
    let w = &c.process.writer;
    let KindWords { snapped, changed, .. } = KindWords::of(c.design.cell.shape);
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
    for (file, exposure, times) in &c.documents.exposures {
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
    let cell = &c.design.cell;
    let row_nm = cell.lattice.row_nm(cell.pitch_nm, cell.database_unit);
    let mut snap = Table::new([
        Column::number("Current", "nA"),
        Column::number("Shot step", "nm"),
        Column::number("Clock", "MHz"),
        Column::number(*changed, "nm"),
        Column::text("Pitch"),
    ])
    .caption("What the shots of each beam do to the pillars of the array");
    for (beam, rms) in &c.documents.snapping {
        let fits = |nm: f64| nm % beam.shot_step_nm == 0.0;
        let pitch = if fits(cell.pitch_nm.nm()) && fits(row_nm) {
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

pub(super) fn job_files(page: &mut Page, c: &Contents<'_>) {
    page.section("Job");
    page.note(
        "The job files are drafts. They are to be reviewed and completed by the staff of the writer before any use.",
    );
    if let Some((beam, _)) = c.documents.snapping.last() {
        page.code(job::job_deck(c.design, c.process, &c.documents.crosses, beam));
    }
}
