//! Figures of the lens in a few lines: the numbers that papers on metalenses give.

use metalith_design::Design;
use metalith_report::{Cell, Column, sig};
use metalith_wave::psf::{AIRY_FWHM, PsfMetrics};

use super::{DistinctElement, PsfPair, Verification};

/// Most PSFs that are named one by one; of more, the best and the worst.
const MOST_NAMED: usize = 4;

/// Strehl ratio, focusing efficiency and width of each PSF of the layout in words, by the simulation that judges; of many, of the PSFs
/// with the greatest and the least Strehl ratio.
pub fn lens_figures(design: &Design, found: &Verification) -> Vec<String> {
    let spots: Vec<(&DistinctElement, &PsfPair)> = found
        .distinct
        .iter()
        .flat_map(|element| element.spots.iter().map(move |spot| (element, spot)))
        .collect();
    let strehl = |(_, spot): &(&DistinctElement, &PsfPair)| spot.judged().metrics.strehl;
    if spots.len() <= MOST_NAMED {
        return spots.iter().map(|spot| words(design, *spot)).collect();
    }
    let best = spots.iter().max_by(|a, b| strehl(a).total_cmp(&strehl(b)));
    let worst = spots.iter().min_by(|a, b| strehl(a).total_cmp(&strehl(b)));
    let named = [("greatest", best), ("least", worst)];
    named
        .into_iter()
        .filter_map(|(name, spot)| Some(format!("{name} of {} PSFs: {}", spots.len(), words(design, *spot?))))
        .collect()
}

fn words(design: &Design, (element, spot): (&DistinctElement, &PsfPair)) -> String {
    let metrics = &spot.judged().metrics;
    let focus = focus_words(metrics).map_or_else(
        || "no focus within the window".to_owned(),
        |words| words + &limit(design, element, spot),
    );
    format!(
        "Strehl ratio {} (target phase {}), {focus}: {}",
        sig(metrics.strehl, 3),
        sig(spot.designed.metrics.strehl, 3),
        spot.label(&element.element)
    )
}

/// Width of the ideal PSF of a round lens without a wedge, in words; empty for others, whose ideal PSF is no Airy pattern.
fn limit(design: &Design, element: &DistinctElement, spot: &PsfPair) -> String {
    let (lens, wedge) = (design.lens_of(&element.element), element.element.wedge);
    if lens.outline.is_some() || (wedge.sin_x, wedge.sin_y) != (0.0, 0.0) {
        return String::new();
    }
    let radius_um = lens.radius_um();
    let aperture = radius_um / radius_um.hypot(lens.focal_length_um);
    format!(
        " (diffraction limit {})",
        sig(AIRY_FWHM * spot.wavelength_um / aperture, 3)
    )
}

/// Focusing efficiency and width of a PSF in words; none if the window does not hold its width.
pub fn focus_words(metrics: &PsfMetrics) -> Option<String> {
    let (share, [x, y]) = (metrics.focusing_efficiency?, metrics.fwhm_um);
    Some(format!(
        "focusing efficiency {} %, FWHM {} x {} um",
        sig(share * 100.0, 3),
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

/// Focusing efficiency and width of a PSF in a row of a table.
pub(super) fn focus_cells(metrics: &PsfMetrics) -> [Cell; 3] {
    let width = |um: Option<f64>| um.map_or_else(Cell::none, |um| Cell::sig(um, 3));
    let share = metrics.focusing_efficiency;
    [
        share.map_or_else(Cell::none, |share| Cell::fixed(share * 100.0, 1)),
        width(metrics.fwhm_um[0]),
        width(metrics.fwhm_um[1]),
    ]
}
