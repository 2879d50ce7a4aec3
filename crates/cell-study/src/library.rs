//! The cell of upright rectangles: what each size does to light along both axes, and the library that a mapping of two phases
//! chooses from.

use std::path::Path;

use ndarray::Array2;
use serde::Serialize;

use metalith_cell::{LibraryErrors, MappedCell, PillarLibrary, PolarisationAxis, UPRIGHT_ORDERS};
use metalith_core::{AtomicFile, Error, Progress, Result};
use metalith_design::Design;
use metalith_pillars::UprightRectangles;
use metalith_report::{Axis, Cell, Chart, Column, HeatMap, Page, Table, fixed, sig, write_json};

/// Study of the pillars of a design at the wavelength of the mapping.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LibraryStudy {
    pub name: String,
    pub wavelength_um: f64,
    /// The cell that the mapping is for.
    pub mapped_cell: MappedCell,
    /// The lengths that edges may have.
    pub pillars: UprightRectangles,
    /// Phase of light along x (turns) and share of its power that passes, by number less one; light along y has those of the
    /// mirror image.
    pub turns_x: Vec<f64>,
    pub passed_x: Vec<f64>,
    /// Library of the sizes, of all, that are the nearest to any pair of phases.
    #[serde(rename = "library")]
    pub nearest: PillarLibrary,
    pub errors: LibraryErrors,
    /// Errors of the library of the design, if it has one already.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub design: Option<LibraryErrors>,
}

impl LibraryStudy {
    /// Solve the cell of a design, or read it from the folder `cache`.
    ///
    /// # Errors
    /// If the pillars are no upright rectangles, the cell cannot be solved, or the user stopped it.
    pub fn new(design: &Design, cache: Option<&Path>, progress: &dyn Progress) -> Result<Self> {
        let pillars = design.cell.shape.upright().ok_or_else(|| {
            Error::refused(
                "cells/wrong-pillar-shape",
                format!("the pillars of {} are {}", design.name, design.cell.shape.plural()),
                "this study is of upright rectangles",
            )
        })?;
        let wavelength_um = design.mapping.wavelength_um;
        let stack = design.cell_stack()?;
        let full = stack.full_transmission(wavelength_um)?;
        let (library, along) = PillarLibrary::solve(&stack, pillars, wavelength_um, cache, progress)?;
        let of_x = |number: u16| along[0][usize::from(number)] / full;
        Ok(Self {
            name: design.name.clone(),
            wavelength_um,
            mapped_cell: design.cell.mapped(wavelength_um),
            pillars,
            turns_x: (1..=pillars.count())
                .map(|n| of_x(n).arg() / std::f64::consts::TAU)
                .collect(),
            passed_x: (1..=pillars.count()).map(|n| of_x(n).norm_sqr()).collect(),
            errors: library.errors(),
            nearest: library,
            design: design.mapping.pillar_library.as_deref().map(PillarLibrary::errors),
        })
    }
}

/// Writes `cells.html`, `cells.json` and `library.csv` into a folder.
///
/// # Errors
/// If a file cannot be written.
pub fn write_library_report(study: &LibraryStudy, folder: &Path) -> Result<()> {
    page(study).write(&folder.join("cells.html"))?;
    write_json(&folder.join("cells.json"), "cells", study)?;
    let csv = study.mapped_cell.to_comments() + &study.nearest.to_csv(study.pillars);
    AtomicFile::write(&folder.join("library.csv"), csv.as_bytes())
}

fn page(study: &LibraryStudy) -> Page {
    let nm = sig(study.wavelength_um * 1e3, 4);
    let mut page = Page::new(
        format!("Cells of {}", study.name),
        format!(
            "Upright rectangles by their widths at {nm} nm, each in a lattice of equal pillars, by rigorous coupled-wave analysis with {UPRIGHT_ORDERS} \
             diffraction orders an axis."
        ),
    );
    page.section("Transmission of each size for light along x");
    page.paragraph("For light along y both widths are exchanged. No light is converted to the other polarisation.");
    let lengths = usize::from(study.pillars.lengths);
    let over_sizes = |of: &[f64]| Array2::from_shape_fn((lengths, lengths), |(y, x)| of[y * lengths + x]);
    let ends = [study.pillars.shortest_nm, study.pillars.longest_nm()].map(f64::from);
    let axis = |name: &str| (Axis::linear(format!("width along {name}"), "nm"), ends[0], ends[1]);
    let map = |title: &str, of: &[f64]| HeatMap::new(title, over_sizes(of), axis("x"), axis("y")).size(420.0, 330.0);
    page.row([
        map("Phase", &study.turns_x)
            .values("phase", "waves")
            .range(-0.5, 0.5)
            .cyclic()
            .caption("Phase of light along x, up to a constant."),
        map("Power", &study.passed_x)
            .values("transmitted share", "")
            .range(0.0, 1.0)
            .caption("Share of the power of light along x in the zeroth order."),
    ]);
    page.section("The library");
    page.paragraph(format!(
        "{} of {} sizes are the nearest to some pair of phases. A site gets the pillar whose fields along x and y, in phase and amplitude, are nearest to both target phases without loss. Both phases count from a constant. The constants have the smallest error and change no image.",
        study.nearest.pillars().len(),
        study.pillars.count()
    ));
    let mut phases = Chart::new(
        "Phases that pillars have",
        Axis::linear("phase along x", "waves"),
        Axis::linear("phase along y", "waves"),
    )
    .size(420.0, 330.0);
    phases.points(
        "library",
        study.nearest.pillars().iter().map(|p| (p.turns[0], p.turns[1])),
    );
    let mut table = Table::new([
        Column::text("Library"),
        Column::text("Light along"),
        Column::number("rms", "rad"),
        Column::number("largest", "rad"),
        Column::number("follows the phase", "%"),
        Column::number("transmitted", "%"),
    ]);
    for (name, errors) in [
        ("of all sizes", Some(&study.errors)),
        ("of the design", study.design.as_ref()),
    ] {
        for (k, axis) in errors
            .iter()
            .flat_map(|_| PolarisationAxis::ALL.into_iter().enumerate())
        {
            let Some(errors) = errors else { continue };
            table.row([
                Cell::from(name),
                Cell::from(axis.to_string()),
                Cell::fixed(errors.phase[k].rms_rad, 3),
                Cell::fixed(errors.phase[k].worst_rad, 2),
                Cell::from(fixed(errors.first[k] * 100.0, 1)),
                Cell::from(fixed(errors.passed[k] * 100.0, 1)),
            ]);
        }
    }
    page.row([phases.caption("Empty regions have a large error, because the nearest pillar is far. Smaller steps or taller pillars fill them.")]);
    page.table(table.caption(
        "Errors over all pairs of phases: phase of the pillar minus target phase; share of the arriving power that follows the target phase (first order of a blazed grating); transmitted share.",
    ));
    page.note("`library.csv` in the folder of this page is the file for `library` in [mapping] of a design.");
    page
}
