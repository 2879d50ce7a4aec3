//! Test structures, places to measure at, marks.

use super::SHOWN;
use crate::contents::Contents;
use crate::kind_words::KindWords;
use crate::pictures;
use metalith_report::{Cell, Column, Page, Table};

pub(super) fn tests(page: &mut Page, c: &Contents<'_>) {
    page.section("Test structures");
    page.figure(pictures::tests(&c.structures, c.tests_frame.0, c.tests_frame.1));
    let mut table = Table::new([
        Column::text("Structure"),
        Column::number("x", "um"),
        Column::number("y", "um"),
        Column::text("What is measured on it"),
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
        c.process.reference_wavelength_nm(c.design),
        f64::from(c.design.lens.diameter_nm) * 1e-3
    ));
}

pub(super) fn metrology(page: &mut Page, c: &Contents<'_>) {
    let shape = c.design.cell.shape;
    let words = KindWords::of(shape);
    page.section(format!("Where to measure {}", words.measured));
    let KindWords { similar, expected, .. } = words;
    page.paragraph(format!(
        "Sites on the lenses are those whose neighbours have {similar}, so that a miscount by one pillar changes the result little. \
         Expected: {expected} within two standard deviations of {} nm. `metrology/cd_table.csv` has columns to fill in.",
        c.process.metrology.width_tolerance_nm
    ));
    let mut columns = vec![
        Column::text("Site"),
        Column::text("Place"),
        Column::number("x", "um"),
        Column::number("y", "um"),
        Column::number("in the element x", "um"),
        Column::number("y", "um"),
        Column::number("Drawn", "nm"),
    ];
    columns.extend((!shape.has_width()).then(|| Column::number("by", "nm")));
    columns.extend(shape.has_one_size().then(|| Column::number("Rotation", "degrees")));
    columns.push(Column::text("Neighbours"));
    let mut table = Table::new(columns);
    for s in c.documents.sites.iter().filter(|s| s.file == "pillars") {
        let mut cells = vec![
            Cell::code(&s.id),
            s.place.as_str().into(),
            Cell::fixed(s.x_um, 3),
            Cell::fixed(s.y_um, 3),
            s.element_x_um.map_or(Cell::none(), |x| Cell::fixed(x, 3)),
            s.element_y_um.map_or(Cell::none(), |y| Cell::fixed(y, 3)),
            u64::from(s.drawn.width_nm).into(),
        ];
        cells.extend(s.drawn.length_nm.map(|nm| Cell::from(u64::from(nm))));
        cells.extend(s.drawn.rotation_deg.map(|deg| Cell::fixed(deg, 1)));
        let nm = s.around_nm.map(|(low, high)| format!("{low} to {high} nm"));
        let deg = s.around_deg.map(|(low, high)| format!("{low} to {high} degrees"));
        let by = s.around_by_nm.map(|nm| format!("edges within {nm} nm"));
        cells.push(nm.or(deg).or(by).unwrap_or_default().into());
        table.row(cells);
    }
    page.table(table);
    page.section("Alignment");
    if c.documents.crosses.is_empty() {
        page.note(
            "The design has no crosses: nothing tells the writer of step 2 where step 1 lies. Add sets of [[mark]] to the design, \
             or use marks of the lab that the substrate has.",
        );
        return;
    }
    let mut table = Table::new([
        Column::text("Set"),
        Column::text("Name at the writer"),
        Column::number("x", "um"),
        Column::number("y", "um"),
        Column::number("Arm", "um"),
        Column::number("Width", "um"),
    ]);
    for k in c.documents.crosses.iter().take(SHOWN) {
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
