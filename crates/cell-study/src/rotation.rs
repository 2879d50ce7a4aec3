//! The cell of rotated rectangles: what a lattice does to light by the rotation of its pillars, and the mapping from phase to
//! rotation that takes it back.

use std::path::Path;

use serde::Serialize;

use metalith_cell::{MappedCell, MappingError, RotatedCell, RotationCurve, RotationFit, RotationMapping};
use metalith_core::{Error, Progress, Result};
use metalith_design::Design;
use metalith_report::{Axis, Cell, Chart, Column, Page, Table, counted, fixed, sig, write_json};

/// Terms that mappings are fitted with; designs take no more.
const TERMS: [usize; 4] = [1, 2, 3, 4];

/// Response at one rotation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RotationPoint {
    pub number: u16,
    /// Rotation as drawn (degrees).
    pub rotation_deg: f64,
    /// Phase that the lattice adds to twice the rotation, in the converted light (rad).
    pub added_rad: f64,
    /// Power of the converted and of the unconverted light over the arriving.
    pub converted: f64,
    pub unconverted: f64,
}

/// Study of a cell of rectangles at the wavelength of the mapping.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RotationStudy {
    pub name: String,
    pub wavelength_um: f64,
    /// The cell that the mapping is for.
    pub mapped_cell: MappedCell,
    /// All rotations that the design may write.
    pub points: Vec<RotationPoint>,
    /// Error of the mapping of the design, and of half of the phase.
    pub design: MappingError,
    pub half: MappingError,
    /// Mappings by the number of their terms.
    pub fits: Vec<RotationFit>,
}

impl RotationStudy {
    /// Solve the cell of a design.
    ///
    /// # Errors
    /// If the pillars are no rectangles, the cell cannot be solved, or the user stopped it.
    pub fn new(design: &Design, progress: &dyn Progress) -> Result<Self> {
        let pillars = design.cell.shape.rotated().ok_or_else(|| {
            Error::refused(
                "cells/wrong-pillar-shape",
                format!("the pillars of {} are {}", design.name, design.cell.shape.plural()),
                "this study is of rotated rectangles",
            )
        })?;
        let arriving = design.cell.arriving.unwrap_or_default();
        let wavelength_um = design.mapping.wavelength_um;
        let stack = design.cell_stack()?;
        let full = stack.full_transmission(wavelength_um)?.powi(2);
        let response = RotatedCell::new(stack, pillars, arriving).at_with(wavelength_um, progress)?;
        let curve = RotationCurve::new(response.clone());
        let point = |number: u16| {
            let rotation = pillars.drawn_rotation(number);
            let [converted, unconverted] = response.at(rotation);
            RotationPoint {
                number,
                rotation_deg: rotation.to_degrees(),
                added_rad: curve.added(arriving.geometric_phase(rotation) / 2.0),
                converted: converted.norm_sqr() / full,
                unconverted: unconverted.norm_sqr() / full,
            }
        };
        Ok(Self {
            name: design.name.clone(),
            wavelength_um,
            mapped_cell: design.cell.mapped(wavelength_um),
            points: (1..=pillars.steps).map(point).collect(),
            design: curve.error(&design.mapping.rotation),
            half: curve.error(&RotationMapping::default()),
            fits: TERMS.into_iter().map(|terms| curve.fit(terms)).collect(),
        })
    }

    /// Least and greatest share of the light that is converted.
    pub fn converted(&self) -> [f64; 2] {
        let each = self.points.iter().map(|p| p.converted);
        each.fold([f64::INFINITY, 0.0], |[low, high], c| [low.min(c), high.max(c)])
    }
}

/// The keys of `[mapping]` for a fit.
pub fn rotation_keys(fit: &RotationFit, cell: &MappedCell) -> String {
    let list = |terms: &[f64]| {
        let each: Vec<String> = terms.iter().map(|c| format!("{:.4}", c.to_degrees())).collect();
        format!("[{}]", each.join(", "))
    };
    format!(
        "rotation_sines_deg = {}\nrotation_cosines_deg = {}\n\n{}",
        list(&fit.mapping.sines),
        list(&fit.mapping.cosines),
        cell.to_toml()
    )
}

/// Writes `cells.html` and `cells.json` into a folder.
///
/// # Errors
/// If a file cannot be written.
pub fn write_rotation_report(study: &RotationStudy, folder: &Path) -> Result<()> {
    let nm = sig(study.wavelength_um * 1e3, 4);
    let mut page = Page::new(
        format!("Cells of {}", study.name),
        format!(
            "Rectangles by their rotation at {nm} nm, each in a lattice of equal pillars, by rigorous coupled-wave analysis."
        ),
    );
    page.section("Phase by rotation");
    page.paragraph(
        "A rotated pillar converts light to the other circular polarisation and adds twice its rotation to the phase. The lattice does not rotate with the pillar. It adds a phase that repeats every 90 degrees. Rotations are the rotations of outlines as drawn, with corners on the grid of 1 nm.",
    );
    let chart = |title: &str, unit: &'static str, name: &'static str| {
        Chart::new(title, Axis::linear("rotation", "°"), Axis::linear(name, unit)).size(420.0, 260.0)
    };
    let mut added = chart("Phase of the lattice", "rad", "phase");
    added.points("drawn", study.points.iter().map(|p| (p.rotation_deg, p.added_rad)));
    let mut light = chart("Light", "", "share of the arriving power");
    light.points("converted", study.points.iter().map(|p| (p.rotation_deg, p.converted)));
    light.points(
        "unconverted",
        study.points.iter().map(|p| (p.rotation_deg, p.unconverted)),
    );
    page.row([
        added.caption("Phase of the converted light minus twice the rotation and a constant."),
        light.caption("Zeroth order, both circular polarisations."),
    ]);
    page.section("Mappings from phase to rotation");
    page.paragraph(
        "A mapping is half of the phase plus a Fourier series in twice the phase. The table gives its residual: the phase of pillars as drawn minus the phase that the mapping assigns to them. The error of rounding to the nearest rotation is additional.",
    );
    let mut table = Table::new([
        Column::text("Mapping"),
        Column::number("rms", "rad"),
        Column::number("largest", "rad"),
    ]);
    let mut row = |name: String, error: &MappingError| {
        table.row([
            Cell::from(name),
            Cell::fixed(error.rms_rad, 4),
            Cell::fixed(error.worst_rad, 4),
        ]);
    };
    row("half of the phase".into(), &study.half);
    row("of the design".into(), &study.design);
    for fit in &study.fits {
        row(counted(fit.mapping.sines.len(), "term"), &fit.error);
    }
    page.table(table);
    for fit in &study.fits {
        page.details(
            format!(
                "{}, in the form of a design file",
                counted(fit.mapping.sines.len(), "term")
            ),
            |inner| {
                inner.code(rotation_keys(fit, &study.mapped_cell));
            },
        );
    }
    let [low, high] = study.converted();
    page.note(format!(
        "{} to {} of the light is converted.",
        fixed(low, 3),
        fixed(high, 3)
    ));
    page.write(&folder.join("cells.html"))?;
    write_json(&folder.join("cells.json"), "cells", study)
}
