//! What the lens does, in a few lines: the numbers that papers on metalenses give.

use metalith_design::Design;
use metalith_report::sig;
use metalith_wave::psf::AIRY_FWHM;

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
    let light = metrics.focusing_efficiency.map_or_else(
        || "no focus within the window".to_owned(),
        |share| format!("focusing efficiency {} %", sig(share * 100.0, 3)),
    );
    let width = match metrics.fwhm_um {
        [Some(x), Some(y)] => format!(
            ", FWHM {} x {} um{}",
            sig(x, 3),
            sig(y, 3),
            limit(design, element, spot)
        ),
        _ => String::new(),
    };
    format!(
        "Strehl ratio {} (target phase {}), {light}{width}: {}",
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
