//! The front page of a hand-off.

use std::path::Path;

use super::build::Contents;
use super::dose::{DOSE_FORMULA, FORMULA, duration};
use super::pictures;
use metalith_core::Result;
use metalith_report::{Cell, Column, Page, Table, Verdict, count, fixed, sig};

/// Rows of long tables that the page shows; all are in the CSV files.
const SHOWN: usize = 40;

/// Write `index.html` and the pictures that stand alone.
///
/// # Errors
/// If a file cannot be written.
pub(super) fn write(folder: &Path, c: &Contents<'_>) -> Result<()> {
    let mut page = Page::new(
        format!("Hand-off of {}", c.design.name),
        format!("{}. Process: {}.", c.design.title, c.process.title),
    );
    verdict(&mut page, c);
    let (w, h) = c.design.layout.chip.size_nm;
    page.facts(&[
        ("Pillars", count(c.pillars)),
        ("Elements", count(c.design.elements().len() as u64)),
        (
            "Chip",
            format!("{} x {} mm", sig(w as f64 * 1e-6, 3), sig(h as f64 * 1e-6, 3)),
        ),
        ("Base dose", format!("{} uC/cm2", c.process.resist.dose_uc_cm2)),
    ]);
    page.section("Files");
    page.paragraph(
        "`metalith handoff --verify FOLDER` says whether this folder is whole and unaltered; `manifest.json` holds the \
         SHA-256 of every file.",
    );
    let mut files = Table::new([Column::text("File"), Column::text("What it is")]);
    for (file, purpose) in &c.files {
        files.row([Cell::code(file), purpose.as_str().into()]);
    }
    page.table(files);
    chip(&mut page, c, folder)?;
    layers(&mut page, c, folder)?;
    cells(&mut page, c);
    stack(&mut page, c);
    doses(&mut page, c);
    write_time(&mut page, c);
    tests(&mut page, c);
    metrology(&mut page, c);
    job(&mut page, c);
    checks(&mut page, c);
    page.section("Made by");
    page.code(c.command);
    page.write(&folder.join("index.html"))
}

fn verdict(page: &mut Page, c: &Contents<'_>) {
    let failed: Vec<_> = c.checks.iter().filter(|k| k.verdict == Verdict::Fail).collect();
    let open: Vec<_> = c.checks.iter().filter(|k| k.verdict == Verdict::NotRun).collect();
    if let Some(first) = failed.first() {
        page.verdict(Verdict::Fail, format!("{}: {}", first.name, first.words));
    } else if let Some(first) = open.first() {
        page.verdict(Verdict::NotRun, format!("{}: {}", first.name, first.words));
    } else if !c.checks.is_empty() {
        page.verdict(Verdict::Pass, "All checks of the layout passed; see the last section.");
    }
}

fn chip(page: &mut Page, c: &Contents<'_>, folder: &Path) -> Result<()> {
    page.section("Chip");
    let figure = pictures::chip(c.design);
    figure.write_svg(&folder.join("chip.svg"))?;
    page.figure(figure);
    let mut table = Table::new([
        Column::text("File"),
        Column::text("Top cell"),
        Column::number("Size", "MB"),
        Column::number("x from", "um"),
        Column::number("to", "um"),
        Column::number("y from", "um"),
        Column::number("to", "um"),
    ])
    .caption("Bounding boxes, read from the files");
    for file in &c.census {
        let bounds = file.layers.iter().filter_map(|l| l.bounds_um);
        let Some(b) = bounds.reduce(|a, b| [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])]) else {
            continue;
        };
        table.row([
            Cell::code(&file.file),
            Cell::code(&file.top),
            Cell::fixed(file.bytes as f64 * 1e-6, 2),
            Cell::fixed(b[0], 3),
            Cell::fixed(b[2], 3),
            Cell::fixed(b[1], 3),
            Cell::fixed(b[3], 3),
        ]);
    }
    page.table(table);
    Ok(())
}

fn layers(page: &mut Page, c: &Contents<'_>, folder: &Path) -> Result<()> {
    page.section("Layers and tone");
    page.note(format!(
        "Step 1, {}: {}. Step 2, {}: {}.",
        c.process.resist.name,
        c.process.exposed_becomes(),
        c.process.apertures.writer,
        c.process.apertures.tone
    ));
    let figure = pictures::tone(c.design, c.process);
    figure.write_svg(&folder.join("tone.svg"))?;
    page.figure(figure);
    let mut table = Table::new([
        Column::text("Layer"),
        Column::text("Name"),
        Column::text("Exposed"),
        Column::text("Purpose"),
    ]);
    let exposed = |key: &str| match key {
        "pillars" | "pillar_marks" => "step 1",
        "apertures" | "aperture_marks" => "step 2",
        _ => "never",
    };
    for (key, layer) in c.design.layout.layers.all() {
        table.row([
            Cell::code(format!("{}/{}", layer.layer, layer.datatype)),
            key.into(),
            exposed(key).into(),
            layer.purpose.as_str().into(),
        ]);
    }
    table.row([
        Cell::code(format!("{}/1 to 9", c.process.dose_matrix.layer)),
        "dose_matrix".into(),
        "step 1".into(),
        "dose matrix alone: the datatype is the number of the dose".into(),
    ]);
    page.table(table);
    Ok(())
}

fn cells(page: &mut Page, c: &Contents<'_>) {
    page.section("Cells, shapes, areas");
    let mut table = Table::new([
        Column::text("File"),
        Column::text("Layer"),
        Column::number("Shapes", ""),
        Column::number("Texts", ""),
        Column::number("Area drawn", "um2"),
    ])
    .caption("All references followed, read from the files");
    for file in &c.census {
        for l in &file.layers {
            table.row([
                Cell::code(&file.file),
                Cell::code(format!("{}/{}", l.layer, l.datatype)),
                l.shapes.into(),
                l.texts.into(),
                if l.shapes == 0 {
                    Cell::none()
                } else {
                    Cell::fixed(l.area_um2, 1)
                },
            ]);
        }
    }
    page.table(table);
    for file in &c.census {
        page.details(
            format!(
                "Cell tree of `{}`: {}, {}",
                file.file,
                counted(file.cells.len(), "cell"),
                counted(file.depth as usize + 1, "level")
            ),
            |inner| {
                inner.code(tree(file));
            },
        );
    }
}

fn counted(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

/// Cells, those that hold others first, each with what it holds.
fn tree(file: &super::Census) -> String {
    let mut cells: Vec<_> = file.cells.iter().collect();
    cells.sort_by(|a, b| a.depth.cmp(&b.depth).then(a.name.cmp(&b.name)));
    let mut text = String::new();
    for cell in cells.iter().take(SHOWN) {
        let indent = "  ".repeat(cell.depth as usize);
        text.push_str(&format!(
            "{indent}{}: {} shapes, {} references, placed {} times\n",
            cell.name,
            count(cell.shapes),
            count(cell.references),
            count(cell.placements)
        ));
    }
    if cells.len() > SHOWN {
        text.push_str(&format!("... and {} more\n", cells.len() - SHOWN));
    }
    text
}

fn stack(page: &mut Page, c: &Contents<'_>) {
    page.section("Stack and film");
    let (design, process) = (c.design, c.process);
    let mut table = Table::new([
        Column::text("From above"),
        Column::text("Material"),
        Column::number("Thickness", "nm"),
        Column::text("Note"),
    ]);
    let p = &process;
    table.row([
        "metal".into(),
        p.apertures.metal.as_str().into(),
        p.apertures.metal_thickness_nm.to_string().into(),
        format!("step 2, outside the openings; {}", p.apertures.resist).into(),
    ]);
    table.row([
        "resist".into(),
        p.resist.name.as_str().into(),
        p.resist.thickness_nm.to_string().into(),
        format!("gone at the end; developed in {}", p.resist.developer).into(),
    ]);
    table.row([
        "mask".into(),
        p.transfer.mask.as_str().into(),
        p.transfer.mask_thickness_nm.to_string().into(),
        "on the pillars until it is stripped".into(),
    ]);
    table.row([
        "film".into(),
        design.cell.pillar_material.as_str().into(),
        design.cell.pillar_height_nm.to_string().into(),
        format!("becomes the pillars; {}", p.transfer.etch).into(),
    ]);
    table.row([
        "substrate".into(),
        design.cell.substrate_material.as_str().into(),
        Cell::none(),
        "light comes through it".into(),
    ]);
    page.table(table);
    page.paragraph(format!(
        "Backscatter for proximity correction: range {} um ({} to {}), ratio {} ({} to {}). Source: {}.",
        p.proximity.range_um,
        p.proximity.range_limits_um[0],
        p.proximity.range_limits_um[1],
        p.proximity.ratio,
        p.proximity.ratio_limits[0],
        p.proximity.ratio_limits[1],
        p.proximity.source
    ));
}

fn doses(page: &mut Page, c: &Contents<'_>) {
    page.section("Dose matrix");
    let range = c.process.resist.dose_range_uc_cm2;
    page.paragraph(format!(
        "Labs differ: {} is written with {} to {} uC/cm2 at {} kV. Write the matrix first, choose the dose whose pads have \
         the widths drawn, and change the base dose.",
        c.process.resist.name, range[0], range[1], c.process.writer.acceleration_kv
    ));
    page.figure(pictures::dose_matrix(c.process, &c.blocks, &c.doses));
    let mut table = Table::new([
        Column::number("Dose", ""),
        Column::number("Factor", ""),
        Column::number("Dose", "uC/cm2"),
        Column::number("Modulation", "%"),
        Column::text("Layer"),
    ]);
    for d in &c.doses {
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

fn write_time(page: &mut Page, c: &Contents<'_>) {
    page.section("Write time");
    let w = &c.process.writer;
    page.code(format!("{FORMULA}\n{DOSE_FORMULA}"));
    page.paragraph(format!(
        "{}, {}: fields of {} um, grid {} nm, at most {} MHz. Overheads: {} us a shape, {} s a field, {} s a job. The shot \
         step is the finest that the clock can follow; widths that are no multiple of it are snapped.",
        w.name, w.mode, w.field_used_um, w.grid_nm, w.clock_max_mhz, w.shape_overhead_us, w.field_overhead_s, w.job_overhead_s
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
    for (file, exposure, times) in &c.exposures {
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
    let pitch = f64::from(c.design.cell.pitch_nm);
    let mut snap = Table::new([
        Column::number("Current", "nA"),
        Column::number("Shot step", "nm"),
        Column::number("Clock", "MHz"),
        Column::number("rms change of width", "nm"),
        Column::text("Pitch"),
    ])
    .caption("What the shots of each beam do to the widths of the array");
    for (beam, rms) in &c.snapping {
        let rest = pitch % beam.shot_step_nm;
        let pitch = if rest == 0.0 {
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

fn tests(page: &mut Page, c: &Contents<'_>) {
    page.section("Test structures");
    page.figure(pictures::tests(&c.structures, c.tests_frame.0, c.tests_frame.1));
    let mut table = Table::new([
        Column::text("Structure"),
        Column::number("x", "um"),
        Column::number("y", "um"),
        Column::text("What it tells"),
    ]);
    for s in &c.structures {
        let (x, y) = s.bounds.centre();
        table.row([
            Cell::code(&s.id),
            Cell::fixed(x as f64 * 1e-3, 1),
            Cell::fixed(y as f64 * 1e-3, 1),
            s.purpose.as_str().into(),
        ]);
    }
    page.details("All structures", |inner| {
        inner.table(table);
    });
    page.paragraph(format!(
        "The hyperbolic reference lens for {} nm, {} um across like the elements, is a file of its own: place it beside the array.",
        c.process.tests.reference_wavelength_nm,
        f64::from(c.design.lens.diameter_nm) * 1e-3
    ));
}

fn metrology(page: &mut Page, c: &Contents<'_>) {
    page.section("Where to measure widths");
    page.paragraph(format!(
        "Sites on the lenses are those whose neighbours are most like them, so that counting wrong by one does little harm. \
         Expected: drawn width within two standard deviations of {} nm. `metrology/cd_table.csv` has columns to fill in.",
        c.process.metrology.width_tolerance_nm
    ));
    let mut table = Table::new([
        Column::text("Site"),
        Column::text("Place"),
        Column::number("x", "um"),
        Column::number("y", "um"),
        Column::number("in the element x", "um"),
        Column::number("y", "um"),
        Column::number("Drawn", "nm"),
        Column::text("Neighbours"),
    ]);
    for s in c.sites.iter().filter(|s| s.file == "pillars") {
        table.row([
            Cell::code(&s.id),
            s.place.as_str().into(),
            Cell::fixed(s.x_um, 3),
            Cell::fixed(s.y_um, 3),
            s.element_x_um.map(|x| Cell::fixed(x, 3)).unwrap_or(Cell::none()),
            s.element_y_um.map(|y| Cell::fixed(y, 3)).unwrap_or(Cell::none()),
            u64::from(s.width_nm).into(),
            format!("{} to {} nm", s.around_nm.0, s.around_nm.1).into(),
        ]);
    }
    page.table(table);
    page.section("Alignment");
    let mut table = Table::new([
        Column::text("Set"),
        Column::text("Name at the writer"),
        Column::number("x", "um"),
        Column::number("y", "um"),
        Column::number("Arm", "um"),
        Column::number("Width", "um"),
    ]);
    for k in c.crosses.iter().take(SHOWN) {
        table.row([
            k.set.as_str().into(),
            if k.role.is_empty() {
                Cell::none()
            } else {
                Cell::code(&k.role)
            },
            Cell::fixed(k.x_um, 1),
            Cell::fixed(k.y_um, 1),
            Cell::fixed(k.length_um, 1),
            Cell::fixed(k.width_um, 2),
        ]);
    }
    page.table(table);
    page.paragraph(format!(
        "The same crosses are drawn in both steps, on layers of their own. Overlay of step 2 to step 1 expected: {} nm; of \
         neighbouring fields: {} nm.",
        c.process.apertures.overlay_nm, c.process.writer.stitching_nm
    ));
}

fn job(page: &mut Page, c: &Contents<'_>) {
    page.section("Job");
    page.note(
        "The job files are drafts. They are to be reviewed and completed by the staff of the writer before any use.",
    );
    if let Some((beam, _)) = c.snapping.last() {
        page.code(super::job::job_deck(c.design, c.process, &c.crosses, beam));
    }
}

fn checks(page: &mut Page, c: &Contents<'_>) {
    page.section("Checks");
    let mut table = Table::new([
        Column::text("Check"),
        Column::verdict(),
        Column::text("What came out"),
        Column::text("Report"),
    ]);
    for check in &c.checks {
        table.row([
            check.name.as_str().into(),
            check.verdict.into(),
            check.words.as_str().into(),
            check.report.as_deref().map_or_else(Cell::none, Cell::link),
        ]);
    }
    page.table(table);
    for (name, report) in &c.rules {
        let mut table = Table::new([
            Column::text("Rule"),
            Column::text("What must hold"),
            Column::text("Came out"),
            Column::number("Violations", ""),
            Column::number("Waived", ""),
        ])
        .caption(format!("Design rules of the {name}: {}", report.deck));
        for rule in &report.rules {
            table.row([
                Cell::code(&rule.id),
                rule.words.as_str().into(),
                rule.status.word().into(),
                rule.violations.into(),
                rule.waived.into(),
            ]);
        }
        page.table(table);
        page.list(&report.warnings);
    }
}
