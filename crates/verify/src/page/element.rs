//! Page of the written file: one distinct element, its PSFs, contrast and orders.

use crate::lens_figures::{focus_cells, focus_columns};
use ndarray::Array2;

use crate::{DistinctElement, PsfResult, Verification, polychromatic_page, through_focus};
use metalith_cell::Fidelity;
use metalith_core::part;
use metalith_design::Design;
use metalith_report::{Axis, Cell, Chart, Column, ImageGrid, Page, Table, counted, exact, sig};
use metalith_wave::psf::PixelFrequencies;

/// Decades of a PSF that are shown: below lies what a camera's noise hides.
const PSF_DECADES: f64 = 4.0;
/// Most of a PSF that is shown, along an axis (um): some ten sensor pixels.
const PSF_SHOWN_UM: f64 = 60.0;

/// PSFs of one distinct element in the middle of its field.
pub(super) fn pictures(page: &mut Page, found: &Verification, element: &DistinctElement) {
    let shown: Vec<_> = element
        .spots
        .iter()
        .filter_map(|spot| Some((spot, spot.images()?)))
        .collect();
    // Designed above extracted, a column for each wavelength.
    let mut images = ImageGrid::new("PSF of the target above the layout", shown.len())
        .values("|E|² / |E inc|²", "")
        .log(PSF_DECADES)
        .side((760.0 / shown.len().max(1) as f64).min(230.0));
    for (spot, seen) in &shown {
        images = images.pixel_um(seen.step_um);
        images.image(format!("target, {}", spot.place()), cut(&seen.designed, seen.step_um));
    }
    for (spot, seen) in &shown {
        images.image(format!("layout, {}", spot.place()), cut(&seen.extracted, seen.step_um));
    }
    let shown_um = shown.first().map_or(PSF_SHOWN_UM, |(_, seen)| {
        shown_samples(&seen.designed, seen.step_um) as f64 * seen.step_um
    });
    page.figure(images.caption(format!(
        "The middle {} um about the chief ray, {PSF_DECADES} decades. The layout is simulated with the model `{}`.",
        sig(shown_um, 3),
        found.fidelity
    )));
}

/// Figures of one distinct element in tables; in polychromatic light too if a band is asked for.
pub(super) fn write(page: &mut Page, design: &Design, found: &Verification, element: &DistinctElement, band: bool) {
    page.paragraph(format!(
        "This element represents {} of {}{}. Phase errors at the wavelength of the mapping: rounding {} rad rms, {} at most; mapping, with the simulation model `{}`, {} rad rms, {} at most. {}",
        element.copies,
        counted(found.elements.len(), "element"),
        match element.copies {
            1 => "",
            _ => ": the others have the same figures, with places, directions and field angles transformed as in the table of elements",
        },
        sig(element.phase.rounding.rms_rad, 3),
        sig(element.phase.rounding.largest_rad, 3),
        found.fidelity.of_width_alone(),
        sig(element.phase.mapping.rms_rad, 3),
        sig(element.phase.mapping.largest_rad, 3),
        steepness(element),
    ));
    page.table(spot_table(element, design.verify.pixel_um));
    if !element.through_focus.is_empty() {
        let series = element.through_focus.iter();
        page.table(through_focus::table(
            "Wavelength",
            series.map(|s| (format!("{} nm", exact(s.wavelength_um * 1e3)), s)),
        ));
    }
    let mut chart = Chart::new(
        "MTF with the sensor's pixel",
        Axis::linear("spatial frequency", "1/mm"),
        Axis::linear("MTF", "").range(0.0, 1.0),
    );
    for spot in element.spots.iter().filter(|spot| spot.images().is_some()) {
        let colour = format!("{} nm", exact(spot.wavelength_um * 1e3));
        chart.line(format!("target, {colour}"), spot.designed.mtf_curve.iter().copied());
        chart.line(format!("layout, {colour}"), spot.judged().mtf_curve.iter().copied());
    }
    page.figure(chart.caption("MTF in the middle of the field, mean of x and y."));
    let converts = element.orders.iter().any(|o| o.unconverted.is_some());
    let diverges = element.orders.iter().any(|o| o.diverging.is_some());
    let mut columns = vec![
        Column::number("Wavelength", "nm"),
        Column::text("Simulation model"),
        Column::number("First order", "%"),
        Column::number("Zeroth order", "%"),
        Column::number("Second order", "%"),
        Column::number("All light in the zeroth order of the lattice", "%"),
    ];
    if converts {
        columns.push(Column::number("Not converted, in addition", "%"));
    }
    if diverges {
        columns.push(Column::number("Diverging, other handedness", "%"));
    }
    let mut orders = Table::new(columns);
    for entry in &element.orders {
        let mut cells = vec![
            Cell::exact(entry.wavelength_um * 1e3),
            Cell::from(entry.fidelity.name()),
            Cell::fixed(entry.first * 100.0, 1),
            Cell::fixed(entry.zero * 100.0, 1),
            Cell::fixed(entry.second * 100.0, 1),
            Cell::fixed(entry.transmitted * 100.0, 1),
        ];
        let share = |of: Option<f64>| of.map_or_else(Cell::none, |share| Cell::fixed(share * 100.0, 1));
        cells.extend(converts.then(|| share(entry.unconverted)));
        cells.extend(diverges.then(|| share(entry.diverging)));
        orders.row(cells);
    }
    let whose = if found.fidelity == Fidelity::Neighbours {
        "the mapping; for `neighbours` by the pillars of the element"
    } else {
        "the mapping"
    };
    let mut beside = String::new();
    if converts {
        beside += " Light that is not converted passes as if the element had no phase. It is in the PSFs, in addition to the orders of the converted light.";
    }
    if diverges {
        beside += " Orders are of the handedness that is focused. Light of the other handedness diverges and is in the PSFs too. All shares are of all light that arrives.";
    }
    page.table(orders.caption(format!(
        "Share of light in each order, computed from {whose}. The first order makes the image. The zeroth order passes the element as if it had no phase.{beside}",
    )));
    if band {
        polychromatic_page::write(page, found, element);
    }
}

fn steepness(element: &DistinctElement) -> String {
    let steep = &element.steepness;
    match steep.from_pitches {
        None => format!(
            "The phase of the target steps by at most {} rad from pillar to pillar, less than pi.",
            sig(steep.largest_step_rad, 3)
        ),
        Some(from) => format!(
            "The phase of the target steps by more than pi from pillar to pillar at {} % of the pillars. The first of them is {} pitches from the middle.",
            sig(steep.steep_sites as f64 / steep.sites.max(1) as f64 * 100.0, 3),
            sig(from, 4),
        ),
    }
}

fn spot_table(element: &DistinctElement, pixel_um: f64) -> Table {
    let [half, nyquist] = PixelFrequencies::of(pixel_um).reported().map(exact);
    let mut table = Table::new(
        [
            Column::text("Wavelength, field angle"),
            Column::text("Of"),
            Column::number("Strehl ratio", ""),
        ]
        .into_iter()
        .chain(focus_columns())
        .chain([
            Column::number("Energy in 1 pixel", "%"),
            Column::number("in 2", "%"),
            Column::number(format!("MTF {half}/mm"), ""),
            Column::number(format!("{nyquist}/mm"), ""),
            Column::number("Centroid x", "um"),
            Column::number("y", "um"),
            Column::number("PSF difference", ""),
        ]),
    );
    for spot in &element.spots {
        let mut row = |of: String, spot_of: &PsfResult, difference: Cell| {
            let (m, [half, nyquist]) = (&spot_of.metrics, spot_of.mtf());
            table.row(
                [
                    Cell::from(match spot.copy {
                        None => spot.place(),
                        Some(_) => format!("{}, which is {}", spot.place(), spot.label(&element.element)),
                    }),
                    Cell::from(of),
                    Cell::sig(m.strehl, 3),
                ]
                .into_iter()
                .chain(focus_cells(m.focusing_efficiency, m.fwhm_um))
                .chain([
                    Cell::fixed(m.energy_1_pixel * 100.0, 2),
                    Cell::fixed(m.energy_2_pixels * 100.0, 2),
                    Cell::fixed(half, 3),
                    Cell::fixed(nyquist, 3),
                    Cell::fixed(m.centroid_um[0] - spot.chief_ray_um[0], 2),
                    Cell::fixed(m.centroid_um[1] - spot.chief_ray_um[1], 2),
                    difference,
                ]),
            );
        };
        row("target".into(), &spot.designed, Cell::none());
        for (k, (fidelity, extracted)) in spot.extracted.iter().enumerate() {
            let difference = if k == 0 {
                Cell::sig(spot.psf_difference, 3)
            } else {
                Cell::none()
            };
            row(format!("layout, {fidelity}"), extracted, difference);
        }
    }
    table.caption("The target, and the layout as read back with each simulation model. The focusing efficiency is the power in a circle of three full widths at half maximum (FWHM) about the peak. Focusing efficiency and energies are shares of the power that arrives at the element. The centroid counts from the chief ray.")
}

/// Samples along an axis of a PSF that are shown: a small window is shown whole.
fn shown_samples(values: &Array2<f32>, step_um: f64) -> usize {
    ((PSF_SHOWN_UM / step_um) as usize).clamp(1, values.nrows())
}

/// The middle of a PSF.
fn cut(values: &Array2<f32>, step_um: f64) -> Array2<f64> {
    let n = values.nrows();
    let keep = shown_samples(values, step_um);
    let from = (n - keep) / 2;
    part(values.view(), from..from + keep, from..from + keep).mapv(f64::from)
}
