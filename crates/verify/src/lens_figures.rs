//! Figures of the lens in a few lines: the numbers that papers on metalenses give.

use metalith_core::numerical_aperture;
use metalith_design::Design;
use metalith_report::{Cell, Column, counted, exact, sig};
use metalith_wave::psf::{AIRY_FWHM, FocusMetrics, PsfMetrics};

use super::through_focus::focal_length_words;
use super::{DistinctElement, Estimate, PsfPair, SampledElement, SampledSpot, SampledStrehl, Verification};

/// Most PSFs that are named one by one; of more, the best and the worst.
const MOST_NAMED: usize = 3;

/// Relative error of sums over a sample of which all terms are equal.
const ROUNDING: f64 = 1e-9;

/// Strehl ratio below which a target is not diffraction-limited (Marechal).
const LOW_STREHL: f64 = 0.8;

/// Strehl ratio, focusing efficiency and width of each PSF of the layout in words, by the simulation that judges; of many, of the PSFs
/// with the greatest and the least Strehl ratio. Then the focal length found through focus. Of a sample of zones, what it is first.
pub fn lens_figures(design: &Design, found: &Verification) -> Vec<String> {
    if let Some(sample) = found.sampled() {
        return sample.elements.iter().flat_map(sampled).collect();
    }
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

/// Extent of the sample of an element, then its figures in each light; of many, of the greatest and the least Strehl ratio.
fn sampled(element: &SampledElement) -> Vec<String> {
    let mut lines = vec![format!(
        "sample of {} in {}, {} % of the lens; not covered: stray light, shape of the PSF, MTF: element {}",
        counted(element.sites as usize, "site"),
        counted(element.zones, "zone"),
        sig(element.share * 100.0, 2),
        element.element.label()
    )];
    let spots = &element.spots;
    if spots.len() <= MOST_NAMED {
        lines.extend(spots.iter().map(|spot| sampled_words(element, spot)));
        return lines;
    }
    let by_strehl = |a: &&SampledSpot, b: &&SampledSpot| a.strehl.least().total_cmp(&b.strehl.least());
    for (name, spot) in [
        ("greatest", spots.iter().max_by(by_strehl)),
        ("least", spots.iter().min_by(by_strehl)),
    ] {
        let words = spot.map(|spot| format!("{name} of {}: {}", spots.len(), sampled_words(element, spot)));
        lines.extend(words);
    }
    lines
}

fn sampled_words(element: &SampledElement, spot: &SampledSpot) -> String {
    let efficiency = spot.focusing_efficiency.map_or_else(String::new, |share| {
        let per_cent = Estimate {
            value: share.value * 100.0,
            standard_error: share.standard_error * 100.0,
        };
        format!(", focusing efficiency {} %", estimate_words(&per_cent))
    });
    format!(
        "Strehl ratio {} (target phase {}){efficiency}: {}",
        strehl_words(&spot.strehl),
        strehl_words(&spot.target_strehl),
        spot.label(&element.element)
    )
}

/// Strehl ratio of a sample in words.
pub(super) fn strehl_words(strehl: &SampledStrehl) -> String {
    match strehl {
        SampledStrehl::Found(estimate) => estimate_words(estimate),
        SampledStrehl::Below(most) => format!("below {}", sig(*most, 1)),
    }
}

/// Value and standard error in words; without an error that is but rounding.
pub(super) fn estimate_words(estimate: &Estimate) -> String {
    if estimate.standard_error < ROUNDING * estimate.value.abs() {
        return sig(estimate.value, 3);
    }
    format!("{} ± {}", sig(estimate.value, 3), sig(estimate.standard_error, 1))
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
