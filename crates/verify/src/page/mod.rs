//! The report of a run: what was designed, what was written, and what the written file does.

mod designed;
mod element;
mod sampled;
mod written;

use std::path::Path;

use super::{
    CameraStatement, PsfResult, Sense, Verification, assumptions, lens_figures, model_page, through_focus,
    verdict_words,
};
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
    if let Some(none) = &found.not_simulated {
        sampled::first(&mut page, none);
    }
    page.verdict(Verdict::of(found.passed()), format!("{}.", verdict_words(found)));
    for line in lens_figures(design, found) {
        page.paragraph(format!("Lens: {line}."));
    }
    for warning in &found.warnings {
        page.note(warning.paragraph());
    }
    let half = exact(PixelFrequencies::of(design.verify.pixel_um).half_nyquist_lp_mm);
    let contrast_at = format!("MTF at {half} lp/mm, one wavelength");
    let mut facts = vec![
        ("Pillars", count(found.layout.pillars)),
        ("Elements", found.elements.len().to_string()),
    ];
    if found.not_simulated.is_none() {
        facts.extend([
            ("Distinct elements", found.distinct.len().to_string()),
            ("Strehl ratio", range(found, |psf| psf.metrics.strehl)),
            (contrast_at.as_str(), range(found, |psf| psf.mtf()[0])),
        ]);
    }
    let band = band_of(design, found);
    let white_contrast_at = band.map(|camera| {
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
    designed::write(&mut page, design, array);
    // From the middle outwards: the plainest element first.
    let mut elements = found.distinct.iter().collect::<Vec<_>>();
    elements.sort_by_key(|e| e.element.index.0.abs() + e.element.index.1.abs());
    if let Some(central) = elements.first() {
        page.section(format!("PSFs of element {}", central.element.label()));
        element::pictures(&mut page, found, central);
        for series in &central.through_focus {
            page.row([through_focus::row(
                &format!("{} nm", exact(series.wavelength_um * 1e3)),
                series,
            )]);
        }
    }
    limits(&mut page, found);
    if let Some(sample) = found.sampled() {
        sampled::write(&mut page, sample, found.fidelity);
    }
    for (k, element) in elements.into_iter().enumerate() {
        page.section(format!("Element {}", element.element.label()));
        if k > 0 {
            element::pictures(&mut page, found, element);
        }
        element::write(&mut page, design, found, element, band.is_some());
    }
    written::write(&mut page, design, found);
    page.section("Assumptions and method");
    if found.not_simulated.is_none() {
        page.details("Assumptions, each with its size for this design", |page| {
            assumptions::write(page, design, found);
        });
    }
    page.details("Method", |page| method(page, design, found));
    page
}

/// The camera of polychromatic figures, where the design asks for a band: by a camera, several wavelengths, or a limit.
fn band_of<'f>(design: &Design, found: &'f Verification) -> Option<&'f CameraStatement> {
    let (spec, limits) = (&design.verify, &design.verify.limits);
    let limited = limits.polychromatic_mtf_min > 0.0 || limits.polychromatic_energy_2_pixels_min > 0.0;
    let asked = spec.camera.is_some() || spec.wavelengths_um.len() > 1 || limited;
    found.camera.as_ref().filter(|_| asked)
}

/// Contrast in the light of each channel of the camera, along both axes.
fn white_contrast(found: &Verification) -> String {
    let half = found.camera.as_ref().map(|c| c.frequencies().half_nyquist_lp_mm);
    let channels = found.distinct.iter().flat_map(|d| {
        let name = move |channel: &str| format!("element {}, channel {channel}", d.element.label());
        d.white.iter().map(move |white| (white, name(&white.channel)))
    });
    between(channels.flat_map(|(white, name)| {
        let contrasts = white.contrast.iter().filter(move |c| Some(c.lp_mm) == half);
        contrasts.flat_map(move |c| c.mtf.map(|mtf| (mtf, name.clone())))
    }))
}

/// Least and greatest of a number of the case that judges, each with its element and light.
fn range(found: &Verification, of: impl Fn(&PsfResult) -> f64) -> String {
    let many = found.distinct.len() > 1;
    let each = found.distinct.iter().flat_map(|d| {
        d.spots
            .iter()
            .map(move |s| if many { (s, s.label(&d.element)) } else { (s, s.place()) })
    });
    between(each.map(|(spot, name)| (of(spot.judged()), name)))
}

/// Least and greatest in words, each with its name; one number where they read the same.
fn between(values: impl Iterator<Item = (f64, String)>) -> String {
    let values: Vec<_> = values.collect();
    let by_value = |a: &&(f64, String), b: &&(f64, String)| a.0.total_cmp(&b.0);
    let ends = [values.iter().min_by(by_value), values.iter().max_by(by_value)];
    let [Some((least, at_least)), Some((most, at_most))] = ends else {
        return "none".into();
    };
    match (sig(*least, 2), sig(*most, 2)) {
        (least, most) if least == most => least,
        (least, most) => format!("{least} ({at_least}) to {most} ({at_most})"),
    }
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
            Cell::from(check.reached_words()),
            Cell::from(format!("{sign} {}", exact(check.limit))),
            Cell::from(Verdict::of(check.passed())),
        ]);
    }
    page.table(table.caption(
        "Limits are from `[verify.limits]` of the design file. A limit that the file does not set has its default value or is not checked.",
    ));
}

fn method(page: &mut Page, design: &Design, found: &Verification) {
    if let Some(none) = &found.not_simulated {
        page.paragraph(format!(
            "Design `{}`, digest `{}`. All figures are computed from the file that was read back.",
            found.design, found.design_digest
        ));
        sampled::method(page, none);
        return;
    }
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
        "Simulation model: `{}`, for light {}. Wavelengths: {} nm. Windows: {} x {} pitches about the chief ray; samples are a pitch apart, or an equal part of one that is at most lambda / (4 NA). Sensor pixels: {} um.",
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
