//! The chip, its layers, cells and films.

use std::path::Path;

use super::SHOWN;
use crate::contents::Contents;
use crate::layout_statistics::LayoutStatistics;
use crate::pictures;
use metalith_core::Result;
use metalith_report::{Cell, Column, Page, Table, counted};

pub(super) fn chip(page: &mut Page, c: &Contents<'_>, folder: &Path) -> Result<()> {
    page.section("Chip");
    let figure = pictures::chip(c.design);
    figure.write_svg(&folder.join("chip.svg"))?;
    page.figure(figure);
    bounds(page, &c.census);
    Ok(())
}

/// Bounding boxes of all files.
pub(crate) fn bounds(page: &mut Page, census: &[LayoutStatistics]) {
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
    for file in census {
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
}

pub(super) fn layers(page: &mut Page, c: &Contents<'_>, folder: &Path) -> Result<()> {
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

/// Shapes, areas and cells of all files.
pub(crate) fn cells(page: &mut Page, census: &[LayoutStatistics]) {
    page.section("Cells, shapes, areas");
    let mut table = Table::new([
        Column::text("File"),
        Column::text("Layer"),
        Column::number("Shapes", ""),
        Column::number("Texts", ""),
        Column::number("Area drawn", "um2"),
    ])
    .caption("All references followed, read from the files");
    for file in census {
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
    for file in census {
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

/// Cells, those that hold others first, each with what it holds.
fn tree(file: &LayoutStatistics) -> String {
    let mut cells: Vec<_> = file.cells.iter().collect();
    cells.sort_by(|a, b| a.depth.cmp(&b.depth).then(a.name.cmp(&b.name)));
    let mut text = String::new();
    for cell in cells.iter().take(SHOWN) {
        let indent = "  ".repeat(cell.depth as usize);
        text.push_str(&format!(
            "{indent}{}: {}, {}, placed {}\n",
            cell.name,
            counted(cell.shapes as usize, "shape"),
            counted(cell.references as usize, "reference"),
            counted(cell.placements as usize, "time")
        ));
    }
    if cells.len() > SHOWN {
        text.push_str(&format!("... and {} more\n", cells.len() - SHOWN));
    }
    text
}

pub(super) fn stack(page: &mut Page, c: &Contents<'_>) {
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
    let (film, becomes) = if design.cell.pillar_material == design.cell.substrate_material {
        ("pillars", "etched into the substrate")
    } else {
        ("film", "becomes the pillars")
    };
    table.row([
        film.into(),
        design.cell.pillar_material.as_str().into(),
        design.cell.pillar_height_nm.to_string().into(),
        format!("{becomes}; {}", p.transfer.etch).into(),
    ]);
    // From above: what the etch left of the film first.
    for layer in design.cell.under.iter().rev() {
        let residual = layer.material == design.cell.pillar_material;
        let (name, note) = if residual {
            ("residual film", "the etch stops before its end")
        } else {
            ("spacer", "under the film; not etched")
        };
        table.row([
            name.into(),
            layer.material.as_str().into(),
            layer.height_nm.to_string().into(),
            note.into(),
        ]);
    }
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
