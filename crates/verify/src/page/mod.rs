//! The report of a run: what was designed, what was written, and what the written file does.

mod designed;
mod element;
mod written;

use std::path::Path;

use super::{PsfResult, Sense, Verification, assumptions, lens_figures, model_page, verdict_words};
use metalith_cell::Fidelity;
use metalith_core::Result;
use metalith_design::array::PillarArray;
use metalith_design::{CellIncidence, Design};
use metalith_report::{Cell, Column, Figure, Page, Table, Verdict, count, exact, sig, write_json};
use metalith_wave::psf::PixelFrequencies;

/// Write `report.html` and `report.json` into a folder; the page shows the picture that a camera of the chip will take, if
/// there is one.
///
/// # Errors
/// If they cannot be written.
pub fn write_report(
    design: &Design,
    array: &PillarArray,
    found: &Verification,
    picture: Option<Figure>,
    folder: &Path,
) -> Result<()> {
    write_json(&folder.join("report.json"), "verification", found)?;
    page(design, array, found, picture).write(&folder.join("report.html"))
}

fn page(design: &Design, array: &PillarArray, found: &Verification, picture: Option<Figure>) -> Page {
    let mut page = Page::new(
        &design.title,
        format!("{}, computed from the bytes of {}", design.name, found.layout.file),
    );
    if let Some(why) = &found.not_simulated {
        page.paragraph(format!(
            "Every pillar was compared with the design. Nothing was simulated: {why}."
        ));
    }
    page.verdict(Verdict::of(found.passed()), format!("{}.", verdict_words(found)));
    for line in lens_figures(design, found) {
        page.paragraph(format!("Lens: {line}."));
    }
    for warning in &found.warnings {
        page.note(format!("Warning: {}. {}. `{}`", warning.what, warning.hint, warning.id));
    }
    let half = exact(PixelFrequencies::of(design.verify.pixel_um).half_nyquist_lp_mm);
    let contrast_at = format!("MTF at {half} lp/mm, one wavelength");
    let mut facts = vec![
        ("Pillars", count(found.layout.pillars)),
        ("Elements", found.elements.len().to_string()),
        ("Distinct elements", found.distinct.len().to_string()),
        ("Strehl ratio, least to greatest", strehl(found)),
        (contrast_at.as_str(), contrast(found)),
    ];
    let white_contrast_at = found.camera.as_ref().map(|camera| {
        let half = exact(camera.frequencies().half_nyquist_lp_mm);
        format!("MTF at {half} lp/mm, polychromatic, one channel")
    });
    // Without a camera there is no channel.
    facts.extend(white_contrast_at.as_deref().map(|what| (what, white_contrast(found))));
    facts.push(("File", format!("{} MB", sig(found.layout.bytes as f64 * 1e-6, 3))));
    page.facts(&facts);
    if let Some(picture) = picture {
        page.figure(picture);
    }
    limits(&mut page, found);
    assumptions::write(&mut page, design, found);
    designed::write(&mut page, design, array);
    written::write(&mut page, design, found);
    // From the middle outwards: the plainest element first.
    let mut elements = found.distinct.iter().collect::<Vec<_>>();
    elements.sort_by_key(|e| e.element.index.0.abs() + e.element.index.1.abs());
    for element in elements {
        element::write(&mut page, design, found, element);
    }
    method(&mut page, design, found);
    page
}

/// Range of the Strehl ratios of the case that judges.
fn strehl(found: &Verification) -> String {
    range(found, |psf| psf.metrics.strehl)
}

/// Range of its contrast at half the frequency of the sensor, pixel included.
fn contrast(found: &Verification) -> String {
    range(found, |psf| psf.mtf()[0])
}

/// Contrast in the light of each channel of the camera, along both axes.
fn white_contrast(found: &Verification) -> String {
    let half = found.camera.as_ref().map(|c| c.frequencies().half_nyquist_lp_mm);
    let channels = found.distinct.iter().flat_map(|d| &d.white);
    let contrasts = channels.flat_map(|channel| &channel.contrast);
    between(contrasts.filter(|c| Some(c.lp_mm) == half).flat_map(|c| c.mtf))
}

fn range(found: &Verification, of: impl Fn(&PsfResult) -> f64) -> String {
    between(found.distinct.iter().flat_map(|d| &d.spots).map(|s| of(s.judged())))
}

/// Least and greatest in words; one number where they read the same.
fn between(values: impl Iterator<Item = f64>) -> String {
    let ends = values.fold(None, |ends: Option<(f64, f64)>, v| {
        Some(ends.map_or((v, v), |(a, b)| (a.min(v), b.max(v))))
    });
    ends.map_or_else(|| "none".into(), |(least, most)| span(sig(least, 2), sig(most, 2)))
}

/// Span from one number to another, or the one number that both are.
pub(crate) fn span(least: String, most: String) -> String {
    if least == most {
        least
    } else {
        format!("{least} to {most}")
    }
}

fn limits(page: &mut Page, found: &Verification) {
    page.section("Limits");
    let mut table = Table::new([
        Column::text("Quantity, and place of its worst value"),
        Column::number("Reached", ""),
        Column::number("Limit", ""),
        Column::verdict(),
    ]);
    for check in &found.checks {
        let sign = match check.sense {
            Sense::AtMost => "≤",
            Sense::AtLeast => "≥",
        };
        table.row([
            Cell::from(check.what.as_str()),
            Cell::sig(check.reached, 4),
            Cell::from(format!("{sign} {}", exact(check.limit))),
            Cell::from(Verdict::of(check.passed())),
        ]);
    }
    page.table(table.caption(
        "Limits are from `[verify.limits]` of the design file. A limit that the file does not set has its default value or is not checked.",
    ));
}

fn method(page: &mut Page, design: &Design, found: &Verification) {
    page.section("Method");
    if let Some(model) = &found.model {
        model_page::write(page, model);
    }
    let relabelled = found
        .distinct
        .iter()
        .flat_map(|d| &d.spots)
        .map(|s| s.relabelled)
        .max()
        .unwrap_or(0);
    page.paragraph(format!(
        "Design `{}`, digest `{}`. All figures of the layout are computed from the file that was read back. Field: sum over the sites of the lattice, each weighted by the area of its cell, by the folded propagator ({} mode). Each frequency is weighted by the place where its ray lands; at most {} frequency bins were shifted towards the mean ray. PSF: |E|² over |E|² of the incident wave. Strehl ratio: against the same aperture, sites without a pillar included, that transmits all power in the zeroth order with the perfect phase for the place where the chief ray lands. MTF: transform of the PSF over all light that the element transmits in the simulation model; light outside of the window is stray light. Field angles count from the viewing direction of the element at each wavelength.",
        found.design, found.design_digest, found.accuracy, count(relabelled),
    ));
    page.paragraph(format!(
        "Simulation model: `{}`, for light {}. Wavelengths: {} nm. Windows: {} x {} samples, one pitch apart, about the chief ray. Sensor pixels: {} um.",
        found.fidelity,
        match design.verify.incidence {
            CellIncidence::Normal if found.fidelity == Fidelity::Neighbours => {
                "from the viewing direction of each element"
            }
            CellIncidence::Normal => "along the normal at all field angles",
            CellIncidence::Oblique => "at its angle of arrival, both polarisations",
        },
        design.verify.wavelengths_um.iter().map(|w| exact(w * 1e3)).collect::<Vec<_>>().join(", "),
        design.verify.window_samples,
        design.verify.window_samples,
        design.verify.pixel_um,
    ));
}
