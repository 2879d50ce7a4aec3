//! What a compensation is worth: intended, as it would be made uncorrected, as it would be made corrected.

use std::path::Path;

use num_complex::Complex64;

use super::line::{Line, bias_of};
use super::{Compensated, CompensationSummary};
use metalith_calibrate::CalibratedModel;
use metalith_core::{Error, Progress, Result, WidthMap};
use metalith_design::Design;
use metalith_design::array::PillarArray;
use metalith_gds::extract::Extraction;
use metalith_report::{Axis, Cell, Chart, Column, Figure, ImageGrid, Page, Table, count, sig, write_json};
use metalith_verify::{Spot, read_back};
use metalith_wave::propagation::{incident, landing_um};
use metalith_wave::{Accuracy, Fold, Matched, PhaseFunction, Pillars, Propagator, Psf, Scratch, Window};

/// Decades of a PSF that are shown.
const DECADES: f64 = 4.0;

/// One case at one wavelength.
#[derive(serde::Serialize)]
struct Case {
    element: String,
    wavelength_um: f64,
    pillars: &'static str,
    spot: Spot,
}

#[derive(serde::Serialize)]
struct Numbers<'a> {
    model: &'a CalibratedModel,
    summary: &'a CompensationSummary,
    cases: &'a [Case],
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
    let found = read_back(design, intended, layout, progress)?;
    let work = intended.classes.len() * line.colours.len();
    progress.begin("simulating elements", work as u64);
    let mut cases = Vec::new();
    let mut figures = Vec::new();
    for class in 0..intended.classes.len() {
        let of_element = element(design, intended, &found, class, line, progress)?;
        cases.extend(of_element.0);
        figures.extend(of_element.1);
    }
    let mut page = Page::new(
        format!("{}, compensated", design.title),
        format!("for {}: {}", model.set, model.finding),
    );
    let s = &compensated.summary;
    page.facts(&[
        ("Widths moved, rms", format!("{} nm", sig(s.moved_rms_nm, 3))),
        ("Error as made, uncorrected", sig(s.error[0], 3)),
        ("Error as made, corrected", sig(s.error[1], 3)),
        ("Newly at an end of the range", count(s.at_limit)),
    ]);
    page.paragraph(
        "Error: rms difference of the complex transmission of the pillars as made from that intended, over the rms of the latter, at all wavelengths of the design together, one phase a wavelength free. Corrected pillars are those of the file that was read back.",
    );
    page.section("In the middle of the field").table(table(&cases));
    for row in figures.chunks(2) {
        page.row(row.iter().cloned());
    }
    let numbers = Numbers {
        model,
        summary: s,
        cases: &cases,
    };
    write_json(&folder.join("compensation.json"), "compensation", &numbers)?;
    page.write(&folder.join("compensation.html"))
}

fn table(cases: &[Case]) -> Table {
    let mut table = Table::new([
        Column::text("Element"),
        Column::number("Wavelength", "nm"),
        Column::text("Pillars"),
        Column::number("Strehl", ""),
        Column::number("Energy in 1 pixel", "%"),
        Column::number("MTF 42.7/mm", ""),
        Column::number("85.3/mm", ""),
    ]);
    for case in cases {
        let (m, [half, nyquist]) = (&case.spot.measures, case.spot.mtf());
        table.row([
            Cell::from(case.element.as_str()),
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

/// The first element of a class, at all wavelengths.
fn element(
    design: &Design,
    intended: &PillarArray,
    found: &Extraction,
    class: usize,
    line: &Line,
    progress: &dyn Progress,
) -> Result<(Vec<Case>, Vec<Figure>)> {
    let place = intended.placed.iter().position(|p| p.class == class).unwrap_or(0);
    let element = intended.placed[place].element;
    let (plain, corrected) = (&intended.widths(&intended.placed[place]), &found.elements[place].widths);
    let lens = &design.lens;
    let open = PhaseFunction {
        lattice: plain.lattice,
        radius_um: lens.radius_um(),
        amplitude: 1.0,
        phase_rad: |_, _| 0.0,
    };
    let mut scratch = Scratch::default();
    let (mut cases, mut figures) = (Vec::new(), Vec::new());
    for colour in 0..line.colours.len() {
        if progress.stopped() {
            return Err(Error::Interrupted);
        }
        let um = line.colours[colour].wavelength_um;
        let wave = incident(&element.wedge, um, [0.0, 0.0])?;
        let chief = landing_um(&element.wedge, &wave, lens.focal_length_um)?;
        let window = Window::about(
            chief,
            plain.lattice.pitch_um(),
            design.verify.window_samples,
            lens.focal_length_um,
        );
        let fold = Fold::plan(plain.lattice, lens.radius_um(), um, window, Accuracy::Accurate)?;
        let full = line.colours[colour].full;
        let matched = Matched::of(&open, [0.0, 0.0, lens.focal_length_um], um, full);
        let title = format!("element {}, {:.0} nm", element.label(), um * 1e3);
        let mut images = ImageGrid::new(format!("PSF, {title}"), 3)
            .pixel_um(window.step_um)
            .values("|E|² / |E inc|²", "")
            .log(DECADES);
        let mut curves = Chart::new(
            format!("MTF with the sensor's pixel, {title}"),
            Axis::linear("spatial frequency", "1/mm"),
            Axis::linear("MTF", "").range(0.0, 1.0),
        );
        for (pillars, widths, as_made) in [
            ("intended", plain, false),
            ("made, uncorrected", plain, true),
            ("made, corrected", corrected, true),
        ] {
            let (kinds, table) = realised(line, colour, widths, as_made);
            let psf = Psf::of(&fold.field(&Pillars::new(&kinds, &table)?, &wave, &mut scratch)?);
            let spot = Spot::of(&psf, &matched, design.verify.pixel_um);
            curves.line(pillars, spot.mtf_curve.iter().copied());
            images.image(pillars, psf.values);
            cases.push(Case {
                element: element.label(),
                wavelength_um: um,
                pillars,
                spot,
            });
        }
        figures.push(images.caption("About the chief ray, one logarithmic scale."));
        figures.push(curves.caption("Mean of x and y."));
        progress.advance(1);
    }
    Ok((cases, figures))
}

/// Pillars as a map of kinds, and the transmission of each kind.
fn realised(line: &Line, colour: usize, widths: &WidthMap, as_made: bool) -> (WidthMap, Vec<Complex64>) {
    let colour = &line.colours[colour];
    if !as_made {
        return (widths.clone(), colour.stated.clone());
    }
    let mut table = vec![Complex64::ZERO];
    let mut known = std::collections::BTreeMap::new();
    let mut kinds = widths.clone();
    for (w, level) in kinds.width_nm.iter_mut().zip(line.levels(widths)) {
        if *w > 0 {
            *w = *known.entry((*w, level)).or_insert_with(|| {
                table.push(colour.made(f64::from(*w) + bias_of(level)));
                (table.len() - 1) as u16
            });
        }
    }
    (kinds, table)
}
