//! The report on a cell.

use std::path::Path;

use ndarray::Array2;

use super::study::{CellStudy, MappingStudy};
use metalith_cell::{Basis, MappingError};
use metalith_core::{AtomicFile, Result};
use metalith_design::SteeringSteps;
use metalith_report::{Axis, Cell, Chart, Column, HeatMap, Page, Table, count, fixed, sig, write_json};

/// Writes `cells.html`, `cells.json` and the mappings that are not polynomials as CSV into a folder.
///
/// # Errors
/// If a file cannot be written.
pub fn write_cell_report(study: &CellStudy, folder: &Path) -> Result<()> {
    page(study).write(&folder.join("cells.html"))?;
    write_json(&folder.join("cells.json"), "cells", study)?;
    for mapping in study
        .mappings
        .iter()
        .filter(|m| m.coefficients.is_none() && m.name != "design")
    {
        let name: String = mapping
            .name
            .chars()
            .filter(|c| *c != ',')
            .map(|c| if c == ' ' { '_' } else { c })
            .collect();
        AtomicFile::write(
            &folder.join(format!("mapping_{name}.csv")),
            (study.mapped_cell.to_comments() + &mapping.table.to_csv()).as_bytes(),
        )?;
    }
    if !study.steered.is_empty() {
        AtomicFile::write(&folder.join("mapping_steered.toml"), steered_toml(study).as_bytes())?;
    }
    Ok(())
}

/// The wavelengths that mappings are compared at (nm).
fn wavelengths(study: &CellStudy) -> String {
    let each: Vec<String> = study.compared_um.iter().map(|l| format!("{:.0}", l * 1e3)).collect();
    each.join(", ")
}

/// The mappings as a design file takes them.
fn steered_toml(study: &CellStudy) -> String {
    let mut text = format!(
        "# Most light in the first order, mean of {} nm, with dissimilar neighbours:\n# metalith cells --steered\n",
        wavelengths(study)
    );
    for study in &study.steered {
        let coefficients: Vec<String> = study.coefficients.iter().map(|c| format!("{c}")).collect();
        let SteeringSteps(first, second) = study.steps;
        if !study.is_better() {
            text += &format!(
                "\n# Steps [{first}, {second}]: the common mapping stays; with the best mapping of the coupled model supercells find {} times its light.\n",
                fixed(study.gain(), 3)
            );
            continue;
        }
        text += &format!(
            "\n[[mapping.steered]]\nsteps = [{first}, {second}]\ncoefficients = [{}]   # {} times the light of the common mapping\n",
            coefficients.join(", "),
            fixed(study.gain(), 3)
        );
    }
    text
}

fn steered(page: &mut Page, study: &CellStudy) {
    page.section("Mappings of steered elements");
    page.paragraph(
        "Where the phase is steep, dissimilar pillars are neighbours. Each row of the table is for elements at a number of steps from the centre. The mapping of a row sends most light into the first order, for light from the viewing direction. Each cell gives the share of the arriving light with the common mapping, then with the element's own mapping: by supercells of rows of the element's pillars, and by the coupled model that the search used. `mapping_steered.toml` has the coefficients in the form of a design file.",
    );
    let mut columns = vec![
        Column::text("Steps"),
        Column::number("Gain, mean of the wavelengths", ""),
    ];
    for l in &study.compared_um {
        columns.push(Column::text(format!("Supercells at {:.0} nm", l * 1e3)));
    }
    for l in &study.compared_um {
        columns.push(Column::text(format!("Pairs at {:.0} nm", l * 1e3)));
    }
    let mut table = Table::new(columns);
    let pair = |[before, after]: [f64; 2]| Cell::from(format!("{} to {}", fixed(before, 3), fixed(after, 3)));
    for study in &study.steered {
        let mut row = vec![
            Cell::from(format!("{}, {}", study.steps.0, study.steps.1)),
            Cell::from(fixed(study.gain(), 3)),
        ];
        row.extend(study.light.iter().map(|l| pair(l.supercells)));
        row.extend(study.light.iter().map(|l| pair(l.pairs)));
        table.row(row);
    }
    page.table(table);
}

fn page(study: &CellStudy) -> Page {
    let mut page = Page::new(
        format!("The cell of {}", study.design),
        "Transmission by rigorous coupled-wave analysis, and polynomials fitted to it",
    );
    page.facts(&[
        ("Film", study.film.clone()),
        ("Substrate", study.substrate.clone()),
        ("Diffraction orders", format!("{0} x {0}", study.orders)),
        ("Cells solved", count(study.points as u64)),
        ("Between their wavelengths", study.interpolation.words()),
        (
            "Wavelength of the mapping",
            format!("{} nm", sig(study.mapping_um * 1e3, 4)),
        ),
        (
            "Phase between narrowest and widest pillar at this wavelength",
            format!("{} waves", fixed(study.span_waves, 2)),
        ),
    ]);
    maps(&mut page, study);
    mappings(&mut page, study);
    if !study.steered.is_empty() {
        steered(&mut page, study);
    }
    inverse(&mut page, study);
    forward(&mut page, study);
    bad(&mut page, study);
    page
}

fn maps(page: &mut Page, study: &CellStudy) {
    let curves = &study.curves;
    let widths = &curves[0].widths_nm;
    let shape = (curves.len(), widths.len());
    let (first, last) = (widths[0], widths[widths.len() - 1]);
    let (short, long) = (
        curves[0].wavelength_um * 1e3,
        curves[curves.len() - 1].wavelength_um * 1e3,
    );
    let x = || (Axis::linear("width", "nm"), f64::from(first), f64::from(last));
    let y = || (Axis::linear("wavelength", "nm"), short, long);
    let power = Array2::from_shape_fn(shape, |(i, j)| curves[i].t[j].norm_sqr());
    let turns = Array2::from_shape_fn(shape, |(i, j)| {
        (curves[i].t[j].arg() / std::f64::consts::TAU).rem_euclid(1.0)
    });
    page.section("Over width and wavelength");
    page.paragraph(
        "Light arrives along the normal through the substrate. Light that is not in the zeroth order is reflected, or leaves in orders of the lattice in the substrate at wavelengths short enough for such orders. The narrow dark lines are guided-mode resonances. There the phase changes by up to one wave within a few nanometres of width or wavelength.",
    );
    let mut zero = HeatMap::new("Power of the zeroth order", power, x(), y())
        .values("zeroth order", "of the incident")
        .range(0.0, 1.0);
    for dip in dips(study) {
        zero = zero.mark(dip.0, dip.1, dip.2);
    }
    page.figure(zero.caption(
        "Share of the incident power in the zeroth order. Marked: the deepest point of each dip below \
         the threshold, by its width.",
    ));
    page.figure(
        HeatMap::new("Phase", turns, x(), y())
            .values("phase", "waves")
            .range(0.0, 1.0)
            .cyclic()
            .caption("Phase of the zeroth order from the foot of the pillar to its top, modulo one wave."),
    );
}

/// Places where a resonance takes most light: width, wavelength (nm), label. Local minima in width every 20 nm of
/// wavelength.
fn dips(study: &CellStudy) -> Vec<(f64, f64, String)> {
    let mut found = Vec::new();
    for curve in study.curves.iter().step_by(10) {
        let powers: Vec<f64> = curve.zero_order().collect();
        for j in 2..powers.len().saturating_sub(2) {
            let least = powers[j - 2..=j + 2].iter().copied().fold(f64::INFINITY, f64::min);
            let around = powers[j.saturating_sub(8)].min(powers[(j + 8).min(powers.len() - 1)]);
            // A line, not the slow fall of power below the diffraction edge of the glass.
            if powers[j] == least && powers[j] < study.options.threshold && around > 2.0 * powers[j] {
                found.push((f64::from(curve.widths_nm[j]), curve.wavelength_um * 1e3, String::new()));
            }
        }
    }
    found
}

fn mappings(page: &mut Page, study: &CellStudy) {
    page.section("Diffraction orders of the mappings");
    page.paragraph(format!(
        "A lens is nearly everywhere a ramp of the phase, on which all phases occur equally often. The first order of the ramp makes the image. The zeroth order is stray light. Powers are shares of the incident light, by RCWA. `fitted` is the inverse polynomial of degree three, `exact` takes the width whose phase is nearest, and `most light` is the mapping of any form with most light in the first order from {:.0} to {:.0} nm.",
        study.best_band_um.0 * 1e3,
        study.best_band_um.1 * 1e3,
    ));
    let mut columns = vec![Column::text("Mapping"), Column::number("Phase error, rms", "rad")];
    for l in &study.compared_um {
        columns.push(Column::number(format!("First at {:.0} nm", l * 1e3), ""));
    }
    for l in &study.compared_um {
        columns.push(Column::number(format!("Zeroth at {:.0} nm", l * 1e3), ""));
    }
    columns.push(Column::number("First, mean of the band", ""));
    let mut table = Table::new(columns);
    for m in &study.mappings {
        let mut row = vec![Cell::from(m.name), Cell::fixed(m.phase.rms_rad, 3)];
        row.extend(m.led.iter().map(|o| Cell::fixed(o.first, 3)));
        row.extend(m.led.iter().map(|o| Cell::fixed(o.zero, 3)));
        row.push(Cell::fixed(m.mean(|o| o.first), 3));
        table.row(row);
    }
    page.table(table);
    for (title, of) in [
        (
            "First order over the band",
            (|o| o.first) as fn(&metalith_cell::RampOrders) -> f64,
        ),
        ("Zeroth order over the band", |o| o.zero),
    ] {
        let mut chart = Chart::new(
            title,
            Axis::linear("wavelength", "nm"),
            Axis::linear("share of the incident power", "").range(0.0, 1.0),
        );
        for m in study
            .mappings
            .iter()
            .filter(|m| m.name != "design" || !same_as_published(study))
        {
            chart.line(m.name, m.band.iter().map(|o| (o.wavelength_um * 1e3, of(o))));
        }
        page.figure(chart.caption("By RCWA, for the widths as written."));
    }
    avoidance(page, study);
    for m in &study.mappings {
        if let Some(c) = &m.coefficients {
            let list: Vec<_> = c.iter().map(|v| format!("{v:.4}")).collect();
            page.paragraph(format!("Coefficients of `{}`, lowest power first:", m.name));
            page.code(format!("coefficients = [{}]", list.join(", ")));
        }
    }
    page.paragraph("Cell of the mappings on this page. A design states it after the keys of `[mapping]`:");
    page.code(study.mapped_cell.to_toml());
}

fn named<'a>(study: &'a CellStudy, name: &str) -> Option<&'a MappingStudy> {
    study.mappings.iter().find(|m| m.name == name)
}

fn same_as_published(study: &CellStudy) -> bool {
    match (named(study, "design"), named(study, "published")) {
        (Some(a), Some(b)) => a.table == b.table,
        _ => false,
    }
}

fn avoidance(page: &mut Page, study: &CellStudy) {
    if let (Some(exact), Some(wary)) = (named(study, "exact"), named(study, "exact, bad widths avoided")) {
        page.note(format!(
            "Avoiding widths that are bad at {} nm increases the phase error by {} rad (rms {} instead of {}). The first order, as the mean over the band, changes from {} to {}.",
            wavelengths(study),
            fixed(wary.phase.rms_rad - exact.phase.rms_rad, 3),
            fixed(wary.phase.rms_rad, 3),
            fixed(exact.phase.rms_rad, 3),
            fixed(exact.mean(|o| o.first), 3),
            fixed(wary.mean(|o| o.first), 3),
        ));
    }
}

fn error_cells(error: &MappingError) -> [Cell; 2] {
    [Cell::fixed(error.rms_rad, 3), Cell::fixed(error.worst_rad, 3)]
}

fn inverse(page: &mut Page, study: &CellStudy) {
    page.section("Phase to width");
    page.paragraph(
        "Duty cycle over phase, fitted by least squares to widths whose phase rises. The error is the phase by RCWA of the width that the polynomial gives, minus the phase that was asked for and a constant.",
    );
    let mut table = Table::new([
        Column::text("Powers"),
        Column::number("Degree", ""),
        Column::number("rms", "rad"),
        Column::number("worst", "rad"),
        Column::text("Coefficients"),
    ]);
    let mut row = |powers: &str, degree: Cell, error: Option<&MappingError>, coefficients: &[f64]| {
        let list: Vec<_> = coefficients.iter().map(|v| format!("{v:.4}")).collect();
        let [rms, worst] = error.map_or_else(|| [Cell::none(), Cell::none()], error_cells);
        table.row([Cell::from(powers), degree, rms, worst, Cell::from(list.join(", "))]);
    };
    let (design, coefficients) = match named(study, "design").and_then(|m| m.coefficients.as_deref()) {
        Some(coefficients) => ("of the design", coefficients),
        None => ("table of the design", &[][..]),
    };
    row(design, Cell::none(), Some(&study.design_round_trip), coefficients);
    for trial in &study.inverse {
        let powers = match trial.basis {
            Basis::AllPowers => "all",
            Basis::EvenPowers => "even",
        };
        let fit = trial.fit.as_ref();
        row(
            powers,
            Cell::fixed(trial.degree as f64, 0),
            fit.map(|f| &f.round_trip),
            fit.map_or(&[], |f| f.polynomial.coefficients.as_slice()),
        );
    }
    page.table(
        table.caption("A row has no numbers if no polynomial of this degree stays within the widths of the cell."),
    );
}

fn forward(page: &mut Page, study: &CellStudy) {
    page.section("Width to phase");
    let mut table = Table::new([
        Column::text("Polynomial"),
        Column::number("rms over the band", "rad"),
        Column::number("worst", "rad"),
    ]);
    let mut lines = Chart::new(
        "Error of the forward polynomials",
        Axis::linear("wavelength", "nm"),
        Axis::linear("rms phase error", "rad"),
    );
    let mut add = |name: String, each: &[(f64, MappingError)], overall: &MappingError| {
        let [rms, worst] = error_cells(overall);
        table.row([Cell::from(name.clone()), rms, worst]);
        lines.line(name, each.iter().map(|(l, e)| (l * 1e3, e.rms_rad)));
    };
    if let Some((each, overall)) = &study.forward_published {
        add("published".into(), each, overall);
    }
    for (i, fit) in study.forward.iter().enumerate() {
        add(format!("degree {}", i + 2), &fit.errors, &fit.overall);
    }
    page.table(table);
    page.figure(lines.caption(
        "Phase by RCWA minus a polynomial in duty cycle and wavelength, and minus a constant for each wavelength. No degree follows the resonances.",
    ));
}

fn bad(page: &mut Page, study: &CellStudy) {
    page.section("Widths to avoid");
    page.paragraph(format!(
        "At these widths the zeroth order is below {}, or the phase falls with the width. Wavelengths are every 10 nm.",
        sig(study.options.threshold, 2)
    ));
    let mut table = Table::new([Column::number("Wavelength", "nm"), Column::text("Widths [nm]")]);
    for cells in study.bad.chunk_by(|a, b| a.wavelength_um == b.wavelength_um) {
        let widths: Vec<_> = cells
            .iter()
            .map(|b| {
                if b.backwards {
                    format!("{} (backwards)", b.width_nm)
                } else {
                    b.width_nm.to_string()
                }
            })
            .collect();
        table.row([
            Cell::fixed(cells[0].wavelength_um * 1e3, 0),
            Cell::from(widths.join(", ")),
        ]);
    }
    page.details("All bad widths", |page| {
        page.table(table);
    });
}
