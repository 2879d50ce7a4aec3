//! The front page of a hand-off of a layout.

use std::path::Path;

use super::contents::LayoutContents;
use super::patterns;
use super::read::{LayoutInputs, Pattern};
use crate::front_page::{self, chip, writing};
use crate::kind_words::KindWords;
use metalith_core::Result;
use metalith_report::{Cell, Column, Figure, Page, Plan, Table, count, counted, exact, fixed, sig};

/// Write fields that the picture shows.
const FIELDS: usize = 2500;

/// Write `index.html` and the picture of the layout.
///
/// # Errors
/// If a file cannot be written.
pub(super) fn write(folder: &Path, inputs: &LayoutInputs, c: &LayoutContents<'_>) -> Result<()> {
    let process = c.process;
    let mut page = Page::new(
        format!("Hand-off of {}", inputs.name),
        format!("A layout, without a design. Process: {}.", process.title),
    );
    front_page::verdict(&mut page, &c.checks);
    let [x0, y0, x1, y1] = c.bounds_um;
    page.facts(&[
        ("Exposed", format!("{} x {} um", sig(x1 - x0, 4), sig(y1 - y0, 4))),
        ("Tone of step 1", process.exposed_becomes().to_owned()),
        ("Base dose", format!("{} uC/cm2", process.resist.dose_uc_cm2)),
        (
            "Pillars",
            c.found
                .as_ref()
                .map_or_else(|| "none found".into(), |found| count(found.pillars)),
        ),
        ("Shapes", count(c.exposures[0].1.shapes)),
    ]);
    front_page::broken_rules(&mut page, &c.checks);
    layout(&mut page, inputs, c, folder)?;
    layers(&mut page, c);
    let pads = super::pads(&inputs.pattern);
    let piece = "piece of the layout";
    let words = inputs.pattern.shape().map(KindWords::of);
    let measured = words.map_or("sizes", |words| words.measured);
    writing::doses(&mut page, process, (piece, &pads, measured), (&c.blocks, &c.doses));
    page.paragraph(format!(
        "Each block holds the {} shapes of the layout in a square of {} um about ({}, {}) um{}.",
        count(c.piece.shapes as u64),
        process.dose_matrix.lens_diameter_um,
        exact(c.piece.middle_um[0]),
        exact(c.piece.middle_um[1]),
        if c.piece.left_out == 0 {
            String::new()
        } else {
            format!("; {} more had no room", count(c.piece.left_out))
        }
    ));
    writing::write_time(
        &mut page,
        process,
        words.map_or("a size that is no multiple of it", |w| w.snapped),
        &c.exposures,
    );
    if let (Pattern::Pillars(found), Some(words)) = (&inputs.pattern, words) {
        let lattice = super::central(found).site.lattice;
        let (pitch, row) = (
            lattice.pitch_nm(),
            lattice.kind().row_nm(lattice.pitch_nm(), lattice.unit()),
        );
        writing::snapping(&mut page, words.changed, [pitch.nm(), row], &c.snapping);
    }
    sites(&mut page, inputs, c);
    writing::job_files(&mut page, &patterns(inputs, c), process, &[], &c.snapping);
    front_page::checks(&mut page, &c.checks, &c.rules);
    page.section("Left out");
    page.paragraph("A layout alone does not say these; a hand-off of a design has them.");
    let mut table = Table::new([Column::text("Part"), Column::text("Reason")]);
    for left in &c.left_out {
        table.row([left.part.into(), left.why.as_str().into()]);
    }
    page.table(table);
    chip::cells(&mut page, &c.census);
    front_page::made_by(&mut page, c.command);
    front_page::list(&mut page, &c.files);
    page.write(&folder.join("index.html"))
}

/// The layout: picture, cell, place and density.
fn layout(page: &mut Page, inputs: &LayoutInputs, c: &LayoutContents<'_>, folder: &Path) -> Result<()> {
    page.section("Layout");
    let figure = picture(inputs, c);
    figure.write_svg(&folder.join("chip.svg"))?;
    page.figure(figure);
    let [x, y] = c.middle_um();
    let mut table = Table::new([Column::text("What"), Column::text("Value")]);
    let um = |v: f64| format!("{} um", fixed(v, 3));
    let [x0, y0, x1, y1] = c.bounds_um;
    for (what, value) in [
        ("Cell to expose", c.top.clone()),
        ("Database unit", format!("{} nm", exact(c.database_unit_nm))),
        ("Exposed from", format!("({}, {})", um(x0), um(y0))),
        ("to", format!("({}, {})", um(x1), um(y1))),
        (
            "Middle",
            format!(
                "({}, {}): the middle of the chip, where the writer asks for one",
                um(x),
                um(y)
            ),
        ),
        (
            "Density",
            format!(
                "{} % in windows of {} um that hold something, at most {} %",
                fixed(100.0 * c.density.mean, 1),
                c.density.window_um,
                fixed(100.0 * c.density.greatest, 1)
            ),
        ),
    ] {
        table.row([what.into(), value.as_str().into()]);
    }
    if let Some(found) = &c.found {
        table.row([
            "Pillars".into(),
            format!(
                "{} {} in {}; {} lattice, pitch {} nm",
                count(found.pillars),
                found.shape,
                counted(found.elements, "element"),
                found.lattice,
                exact(found.pitch_nm)
            )
            .as_str()
            .into(),
        ]);
        for (why, n) in &found.others {
            table.row(["Other shapes".into(), format!("{}: {why}", count(*n)).as_str().into()]);
        }
    }
    page.table(table);
    chip::bounds(page, &c.census);
    Ok(())
}

/// Elements and write fields.
fn picture(inputs: &LayoutInputs, c: &LayoutContents<'_>) -> Figure {
    let mut plan = Plan::new(format!("Layout {}", c.layout)).width(640.0);
    let fields = plan.outlines("write fields");
    let elements = plan.layer("elements");
    let bounds = plan.outlines("bounding box of what is exposed");
    let origin = plan.solid("origin");
    for [x, y] in c.places.fields_um.iter().take(FIELDS) {
        plan.rectangle(fields, (*x, *y), (x + c.places.field_um, y + c.places.field_um));
    }
    if let Pattern::Pillars(found) = &inputs.pattern {
        for element in &found.elements {
            // The box around an element that stands at an angle.
            let [x, y] = element.site.ends_nm().map(|ends| ends.map(|nm| nm as f64));
            let corners = [0, 1, 2, 3].map(|k| found.in_layout_nm([x[k % 2], y[k / 2]]).map(|nm| nm * 1e-3));
            let ends = |pick: fn(f64, f64) -> f64, from: f64| {
                let [x, y] = corners
                    .iter()
                    .fold([from; 2], |[x, y], c| [pick(x, c[0]), pick(y, c[1])]);
                (x, y)
            };
            plan.rectangle(
                elements,
                ends(f64::min, f64::INFINITY),
                ends(f64::max, f64::NEG_INFINITY),
            );
        }
    }
    let [x0, y0, x1, y1] = c.bounds_um;
    plan.rectangle(bounds, (x0, y0), (x1, y1));
    let arm = 0.05 * (x1 - x0).max(y1 - y0);
    plan.cross(origin, (0.0, 0.0), arm, 0.1 * arm);
    plan.caption(
        "The layout seen from the side of the pillars, x to the right, y up. Write fields begin at the lower left corner of what is \
         exposed.",
    )
}

/// The layers, and the tone.
fn layers(page: &mut Page, c: &LayoutContents<'_>) {
    page.section("Layers and tone");
    page.note(format!(
        "Step 1, {} ({}): {}.",
        c.process.resist.name,
        c.process.words(),
        c.process.exposed_becomes()
    ));
    let mut table = Table::new([
        Column::text("Layer"),
        Column::text("Exposed"),
        Column::number("Shapes", ""),
        Column::number("Texts", ""),
    ]);
    for layer in &c.census[0].layers {
        let number = format!("{}/{}", layer.layer, layer.datatype);
        let exposed = match c.exposed.iter().position(|l| *l == number) {
            Some(0) => "step 1: pillars",
            Some(_) => "step 1",
            None => "never",
        };
        table.row([
            Cell::code(&number),
            exposed.into(),
            layer.shapes.into(),
            layer.texts.into(),
        ]);
    }
    table.row([
        Cell::code(format!("{}/1 to 9", c.process.dose_matrix.layer)),
        "step 1, dose matrix alone: the datatype is the number of the dose".into(),
        c.census[1].layers.iter().map(|l| l.shapes).sum::<u64>().into(),
        Cell::none(),
    ]);
    page.table(table);
}

/// Places to measure at.
fn sites(page: &mut Page, inputs: &LayoutInputs, c: &LayoutContents<'_>) {
    let Some(shape) = inputs.pattern.shape() else { return };
    page.section(format!("Where to measure {}", KindWords::of(shape).measured));
    page.paragraph(format!(
        "Pillars whose neighbours differ least from them, in the coordinates of the layout. Expected: the drawn size within two \
         standard deviations of {} nm. `metrology/cd_table.csv` has columns to fill in.",
        c.process.metrology.width_tolerance_nm
    ));
    let mut table = Table::new([
        Column::text("Site"),
        Column::text("Place"),
        Column::number("x", "um"),
        Column::number("y", "um"),
        Column::text("Drawn"),
    ]);
    for site in &c.sites {
        let mut drawn = format!("{} nm", site.drawn.width_nm);
        if let Some(length) = site.drawn.length_nm {
            drawn = format!("{} by {length} nm", site.drawn.width_nm);
        }
        if let Some(deg) = site.drawn.rotation_deg {
            drawn.push_str(&format!(", rotated by {} degrees", exact(deg)));
        }
        table.row([
            Cell::code(&site.id),
            site.place.as_str().into(),
            Cell::fixed(site.x_um, 3),
            Cell::fixed(site.y_um, 3),
            drawn.as_str().into(),
        ]);
    }
    page.table(table);
}
