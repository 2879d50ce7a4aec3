//! Page of the gain by a compensation: as intended, as fabricated without correction, as fabricated with it.

use std::path::Path;

use super::cases::{CHIPS, CompensationCase, compensation_cases};
use super::{Compensated, CompensationSummary};
use metalith_core::{Progress, Result};
use metalith_design::Design;
use metalith_design::array::PillarArray;
use metalith_optics::{CalibratedModel, NotApplied};
use metalith_report::{Axis, Cell, Chart, Column, Figure, ImageGrid, Page, Table, count, exact, sig, write_json};
use metalith_wave::psf::PixelFrequencies;

/// Decades of a PSF that are shown.
const DECADES: f64 = 4.0;

#[derive(serde::Serialize)]
struct CompensationNumbers<'a> {
    model: &'a CalibratedModel,
    summary: &'a CompensationSummary,
    /// Parts of the model that were not simulated.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    not_applied: Vec<NotApplied>,
    cases: &'a [CompensationCase],
}

/// Read the compensated layout at `layout` back, simulate it as it would be made, beside the intended pillars
/// as stated and as they would be made, and write `compensation.html` and `compensation.json` into a folder.
///
/// # Errors
/// If the layout cannot be read, a file cannot be written, or the user stopped it.
pub fn write_compensation_report(
    design: &Design,
    intended: &PillarArray,
    compensated: &Compensated,
    model: &CalibratedModel,
    layout: &Path,
    folder: &Path,
    progress: &dyn Progress,
) -> Result<()> {
    let line = &compensated.line;
    let cases = compensation_cases(design, intended, compensated, layout, progress)?;
    let mut page = Page::new(
        format!("{}, compensated", design.title),
        format!("for {}: {}", model.set, model.finding),
    );
    let s = &compensated.summary;
    page.facts(&[
        ("Widths moved, rms", format!("{} nm", sig(s.moved_rms_nm, 3))),
        ("Error as fabricated, uncorrected", sig(s.error[0], 3)),
        ("Error as fabricated, corrected", sig(s.error[1], 3)),
        ("Pillars moved to an end of the range", count(s.at_limit)),
    ]);
    page.paragraph(
        "Error: rms difference of the complex transmissions of fabricated and intended pillars, over the rms transmission of the intended pillars. It is over all wavelengths of the design, and for upright rectangles over both polarisations, with one free phase for each of these. Corrected pillars are read back from the file.",
    );
    page.paragraph(
        "Fabricated elements include the whole model: pillars, apertures, light and sensor. A change of widths can correct the pillars only.",
    );
    for quantity in line.chip.statement().not_applied {
        page.note(quantity.to_string());
    }
    let reported = PixelFrequencies::of(design.verify.pixel_um).reported();
    page.section("In the middle of the field")
        .table(table(&cases, reported));
    for row in cases.chunks(CHIPS).filter_map(figures) {
        page.row(row);
    }
    let numbers = CompensationNumbers {
        model,
        summary: s,
        not_applied: line.chip.statement().not_applied,
        cases: &cases,
    };
    write_json(&folder.join("compensation.json"), "compensation", &numbers)?;
    page.write(&folder.join("compensation.html"))
}

/// The element of a case, and the light that it is seen in where it distinguishes polarisations.
fn named(case: &CompensationCase) -> String {
    match case.axis {
        None => case.element.clone(),
        Some(axis) => format!("{}, light along {axis}", case.element),
    }
}

/// Contrasts are at these frequencies (line pairs a millimetre).
fn table(cases: &[CompensationCase], reported: [f64; 2]) -> Table {
    let [half, nyquist] = reported.map(exact);
    let mut table = Table::new([
        Column::text("Element"),
        Column::number("Wavelength", "nm"),
        Column::text("Pillars"),
        Column::number("Strehl", ""),
        Column::number("Energy in 1 pixel", "%"),
        Column::number(format!("MTF {half}/mm"), ""),
        Column::number(format!("{nyquist}/mm"), ""),
    ]);
    for case in cases {
        let (m, [half, nyquist]) = (&case.spot.metrics, case.spot.mtf());
        table.row([
            Cell::from(named(case)),
            Cell::exact(case.wavelength_um * 1e3),
            Cell::from(case.pillars),
            Cell::sig(m.strehl, 3),
            Cell::fixed(m.energy_1_pixel * 100.0, 2),
            Cell::fixed(half, 3),
            Cell::fixed(nyquist, 3),
        ]);
    }
    table
}

/// PSFs and contrast of one element at one wavelength, the three chips side by side.
fn figures(of_one: &[CompensationCase]) -> Option<[Figure; 2]> {
    let first = of_one.first()?;
    let title = format!("element {}, {:.0} nm", named(first), first.wavelength_um * 1e3);
    let mut images = ImageGrid::new(format!("PSF, {title}"), of_one.len())
        .pixel_um(first.psf.window.step_um)
        .values("|E|² / |E inc|²", "")
        .log(DECADES);
    let mut curves = Chart::new(
        format!("MTF with the sensor's pixel, {title}"),
        Axis::linear("spatial frequency", "1/mm"),
        Axis::linear("MTF", "").range(0.0, 1.0),
    );
    for case in of_one {
        curves.line(case.pillars, case.spot.mtf_curve.iter().copied());
        images.image(case.pillars, case.psf.values.clone());
    }
    Some([
        images.caption("About the chief ray, one logarithmic scale."),
        curves.caption("Mean of x and y."),
    ])
}
