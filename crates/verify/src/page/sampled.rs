//! Page of a sample of zones, in place of that of simulated elements.

use crate::lens_figures::{estimate_words, strehl_words};
use crate::{NotSimulated, Sample, SampledElement, SampledZones};
use metalith_cell::Fidelity;
use metalith_report::{Cell, Column, Page, Table, counted, sig};

/// Scope of a report without a full simulation: it is said first.
pub(super) fn first(page: &mut Page, none: &NotSimulated) {
    let why = &none.why;
    page.paragraph(match &none.sample {
        Sample::Sampled(zones) => format!(
            "Every pillar was compared with the design. The lens was not simulated in full: {why}. The optical figures are estimates from a sample of zones. Not covered: {}",
            lower(zones.not_covered)
        ),
        Sample::NotSampled(unsampled) => format!(
            "Every pillar was compared with the design. Nothing was simulated: {why}. No zones were sampled: {unsampled}."
        ),
    });
}

/// The sections of the sampled elements.
pub(super) fn write(page: &mut Page, sample: &SampledZones, fidelity: Fidelity) {
    for element in &sample.elements {
        page.section(format!("Sample of element {}", element.element.label()));
        page.paragraph(format!(
            "{} of the lens, {} % of all: {} patches of {} x {} sites in each of {}. Simulation model: `{fidelity}`. This element represents {}.",
            counted(element.sites as usize, "site"),
            sig(element.share * 100.0, 2),
            sample.patches_per_zone,
            sample.patch_sites,
            sample.patch_sites,
            counted(element.zones, "zone"),
            counted(element.copies, "element"),
        ));
        page.paragraph(format!(
            "Phase errors of the sampled pillars at the wavelength of the mapping, with standard errors: rounding {} rad rms; mapping, with the simulation model `{}`, {} rad rms.",
            estimate_words(&element.rounding_rms_rad),
            fidelity.of_width_alone(),
            estimate_words(&element.mapping_rms_rad),
        ));
        page.table(spots(element));
    }
}

fn spots(element: &SampledElement) -> Table {
    let mut table = Table::new([
        Column::text("Light"),
        Column::number("Strehl ratio", ""),
        Column::number("of the target", ""),
        Column::number("Layout over target", ""),
        Column::number("Focusing efficiency", ""),
        Column::number("Chief ray x", "um"),
        Column::number("y", "um"),
    ]);
    for spot in &element.spots {
        let estimate = |of: &Option<_>| of.as_ref().map_or_else(Cell::none, |e| Cell::from(estimate_words(e)));
        table.row([
            Cell::from(spot.label(&element.element)),
            Cell::from(strehl_words(&spot.strehl)),
            Cell::from(strehl_words(&spot.target_strehl)),
            estimate(&spot.strehl_ratio),
            estimate(&spot.focusing_efficiency),
            Cell::sig(spot.chief_ray_um[0], 5),
            Cell::sig(spot.chief_ray_um[1], 5),
        ]);
    }
    let windows: Vec<f64> = element.spots.iter().map(|spot| spot.window_um).collect();
    let [least, most] = [
        windows.iter().copied().fold(f64::INFINITY, f64::min),
        windows.iter().copied().fold(0.0, f64::max),
    ];
    table.caption(format!(
        "Estimates for the whole lens, each with its standard error (68 %; limits are judged with three). The peak is the brightest sample of a square of {} um about the chief ray, the ideal lens has the sampled sites. A Strehl ratio is \"below\" a number where as many patches without any relation could have that much. Focusing efficiency: power in a circle of three full widths at half maximum, over the power incident on the aperture.",
        super::span(sig(least, 3), sig(most, 3))
    ))
}

/// Way in which a sample was chosen and its light computed.
pub(super) fn method(page: &mut Page, none: &NotSimulated) {
    if let Sample::Sampled(zones) = &none.sample {
        page.paragraph(format!(
            "Sample: {} Field: Rayleigh-Sommerfeld sum over the sampled sites, each weighted by the area that it stands for. Strehl ratio: against the same sites, those without a pillar included, that transmit all power in the zeroth order with the perfect phase for the place where the chief ray lands.",
            lower(zones.chosen)
        ));
    }
}

/// Text with a small first letter, to go on a sentence.
fn lower(text: &str) -> String {
    let mut letters = text.chars();
    letters
        .next()
        .map_or_else(String::new, |first| first.to_lowercase().chain(letters).collect())
}
