//! Figures of the lens in a few lines: the numbers that papers on metalenses give.

use metalith_core::numerical_aperture;
use metalith_design::Design;
use metalith_report::{Cell, Column, exact, sig};
use metalith_wave::psf::{AIRY_FWHM, FocusMetrics, PsfMetrics};

use super::through_focus::focal_length_words;
use super::{DistinctElement, PsfPair, Verification};

/// Most PSFs that are named one by one; of more, the best and the worst.
const MOST_NAMED: usize = 3;

/// Strehl ratio below which a target is not diffraction-limited (Marechal).
const LOW_STREHL: f64 = 0.8;

/// Strehl ratio, focusing efficiency and width of each PSF of the layout in words, by the simulation that judges; of many, of the PSFs
/// with the greatest and the least Strehl ratio. Then the focal length found through focus.
pub fn lens_figures(design: &Design, found: &Verification) -> Vec<String> {
    let spots: Vec<(&DistinctElement, &PsfPair)> = found
        .distinct
        .iter()
        .flat_map(|element| element.spots.iter().map(move |spot| (element, spot)))
        .collect();
    let strehl = |(_, spot): &(&DistinctElement, &PsfPair)| spot.judged().metrics.strehl;
    let mut lines = Vec::new();
    if spots.len() <= MOST_NAMED {
        lines.extend(spots.iter().map(|spot| words(design, *spot)));
        lines.extend(found.distinct.iter().filter_map(through_focus));
        return lines;
    }
    let best = spots.iter().max_by(|a, b| strehl(a).total_cmp(&strehl(b)));
    let worst = spots.iter().min_by(|a, b| strehl(a).total_cmp(&strehl(b)));
    let named = [("greatest", best), ("least", worst)];
    let words =
        |(name, spot): (&str, Option<&_>)| Some(format!("{name} of {} PSFs: {}", spots.len(), words(design, *spot?)));
    lines.extend(named.into_iter().filter_map(words));
    lines.extend(found.distinct.iter().filter_map(through_focus));
    lines
}

/// What an element shows through focus by wavelength, in words.
fn through_focus(element: &DistinctElement) -> Option<String> {
    let all = &element.through_focus;
    let each: Vec<String> = all
        .iter()
        .map(|series| {
            format!(
                "{} at {} nm",
                focal_length_words(series),
                exact(series.wavelength_um * 1e3)
            )
        })
        .collect();
    Some(format!(
        "through focus: {}; design {} um: element {}",
        each.join(", "),
        exact(all.first()?.sensor_um),
        element.element.label()
    ))
}

fn words(design: &Design, (element, spot): (&DistinctElement, &PsfPair)) -> String {
    let metrics = &spot.judged().metrics;
    let focus = focus_words(metrics).map_or_else(
        || "no focus within the window".to_owned(),
        |words| words + &limit(design, element, spot),
    );
    let target = spot.designed.metrics.strehl;
    format!(
        "Strehl ratio {} (target phase {}{}), {focus}: {}",
        sig(metrics.strehl, 3),
        sig(target, 3),
        if target < LOW_STREHL { ", low by design" } else { "" },
        spot.label(&element.element)
    )
}

/// Width of the ideal PSF of a round lens without a wedge, in words; empty for others, whose ideal PSF is no Airy pattern.
fn limit(design: &Design, element: &DistinctElement, spot: &PsfPair) -> String {
    let (lens, wedge) = (design.lens_of(&element.element), element.element.wedge);
    if lens.outline.is_some() || (wedge.sin_x, wedge.sin_y) != (0.0, 0.0) {
        return String::new();
    }
    let aperture = numerical_aperture(lens.radius_um(), lens.focal_length_um);
    format!(
        " (diffraction limit {})",
        sig(AIRY_FWHM * spot.wavelength_um / aperture, 3)
    )
}

/// Focusing efficiency and width of a PSF in words; none if the window does not hold its width.
pub fn focus_words(metrics: &PsfMetrics) -> Option<String> {
    width_words(metrics.focusing_efficiency, metrics.fwhm_um)
}

/// Strehl ratio, focusing efficiency and width of the PSF in a plane along z, in words.
pub fn plane_words(focus: &FocusMetrics) -> String {
    let width = width_words(focus.focusing_efficiency, focus.fwhm_um);
    format!(
        "Strehl ratio {}{}",
        sig(focus.strehl, 3),
        width.map_or_else(String::new, |words| format!(", {words}"))
    )
}

fn width_words(share: Option<f64>, [x, y]: [Option<f64>; 2]) -> Option<String> {
    Some(format!(
        "focusing efficiency {} %, FWHM {} x {} um",
        sig(share? * 100.0, 3),
        sig(x?, 3),
        sig(y?, 3)
    ))
}

/// Columns of a table for [`focus_cells`].
pub(super) fn focus_columns() -> [Column; 3] {
    [
        Column::number("Focusing efficiency", "%"),
        Column::number("FWHM x", "um"),
        Column::number("y", "um"),
    ]
}

/// Focusing efficiency and widths (um) of a PSF in a row of a table.
pub(super) fn focus_cells(share: Option<f64>, fwhm_um: [Option<f64>; 2]) -> [Cell; 3] {
    let width = |um: Option<f64>| um.map_or_else(Cell::none, |um| Cell::sig(um, 3));
    [
        share.map_or_else(Cell::none, |share| Cell::fixed(share * 100.0, 1)),
        width(fwhm_um[0]),
        width(fwhm_um[1]),
    ]
}
