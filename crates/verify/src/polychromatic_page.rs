//! The part of a report that shows a point of the scene in white light.

use metalith_core::part;
use metalith_report::{Axis, Cell, Chart, Column, ImageGrid, Page, Table, exact, fixed};
use ndarray::Array2;

use super::{CameraStatement, DistinctElement, PsfResult, Verification, WhiteChannel};

/// Decades of a PSF that are shown.
const DECADES: f64 = 4.0;
/// Most of a window that is shown (um): the spread of a channel of 100 nm by a wedge of 15 degrees, and its image.
const SHOWN_UM: f64 = 240.0;
/// Most pixels an axis of a picture.
const MOST_PIXELS: usize = 240;

/// Pictures, contrast and numbers of one element.
pub(super) fn write(page: &mut Page, found: &Verification, element: &DistinctElement) {
    let Some(camera) = &found.camera else { return };
    page.subsection(format!("Element {}: polychromatic figures", element.element.label()));
    page.paragraph(format!(
        "A point of the scene in the viewing direction of the element at {} nm, simulated with the model `{}`.",
        exact(element.element.wedge.wavelength_um * 1e3),
        found.fidelity,
    ));
    let alone: Vec<(String, &PsfResult)> = element
        .spots
        .iter()
        .filter(|s| s.images().is_some())
        .map(|s| (format!("{} nm alone", exact(s.wavelength_um * 1e3)), s.judged()))
        .collect();
    channels(page, camera, &element.white, &alone);
}

/// Figure of the channels of any element, beside contrasts of single wavelengths.
pub(super) fn channels(
    page: &mut Page,
    camera: &CameraStatement,
    channels: &[WhiteChannel],
    alone: &[(String, &PsfResult)],
) {
    page.paragraph(format!(
        "{}Camera: {}; illuminant: {}; pixels of {} um.",
        if channels.iter().any(|c| c.spread_direction_deg.is_some()) {
            "A wedge sends each wavelength to another place. "
        } else {
            ""
        },
        camera.name,
        camera.illuminant,
        exact(camera.pixel_um),
    ));
    page.table(table(camera, channels));
    let mut images = ImageGrid::new("PSF of each channel", channels.len())
        .values("share of arriving light", "1/um²")
        .log(DECADES)
        .side((760.0 / channels.len().max(1) as f64).min(230.0));
    let samples = channels.iter().map(|w| w.image.nrows()).min().unwrap_or(1);
    for white in channels {
        let (picture, step_um) = shown(white, samples);
        images = images.pixel_um(step_um);
        images.image(format!("channel {}", white.channel), picture);
    }
    let mut chart = Chart::new(
        "MTF with the sensor's pixel",
        Axis::linear("spatial frequency", "1/mm"),
        Axis::linear("MTF", "").range(0.0, 1.0),
    );
    for white in channels {
        chart.line(format!("polychromatic, {}", white.channel), white.curve());
    }
    for (name, psf) in alone {
        chart.line(name.as_str(), psf.mtf_curve.iter().copied());
    }
    page.figure(images.caption(format!("Middle of the window of each channel, {DECADES} decades.")));
    page.figure(chart.caption(if alone.is_empty() {
        "Mean of x and y."
    } else {
        "Mean of x and y. Polychromatic light comes from one direction. Each single wavelength comes from the viewing direction at this wavelength."
    }));
}

fn table(camera: &CameraStatement, channels: &[WhiteChannel]) -> Table {
    let reported = camera.frequencies().reported();
    let [half, nyquist] = reported.map(exact);
    let mut table = Table::new([
        Column::text("Channel"),
        Column::number("Light from 10 to 90 %", "nm"),
        Column::number("Spread of the chief ray", "um"),
        Column::number("Direction of the spread", "°"),
        Column::number("Energy in 1 pixel", "%"),
        Column::number("in 2", "%"),
        Column::number("Transmitted", "%"),
        Column::number(format!("MTF {half}/mm along x"), ""),
        Column::number("y", ""),
        Column::number(format!("{nyquist}/mm along x"), ""),
        Column::number("y", ""),
        Column::number("Error of sampling", ""),
    ]);
    for white in channels {
        let [half, nyquist] = reported.map(|lp_mm| white.contrast_at(lp_mm));
        let [from, _, to] = white.wavelengths_nm;
        table.row([
            Cell::from(white.channel.as_str()),
            Cell::from(format!("{} to {}", fixed(from, 0), fixed(to, 0))),
            Cell::sig(white.spread_um, 3),
            white
                .spread_direction_deg
                .map_or_else(Cell::none, |d| Cell::fixed(d, 1)),
            Cell::fixed(white.energy_1_pixel * 100.0, 2),
            Cell::fixed(white.energy_2_pixels * 100.0, 2),
            Cell::fixed(white.energy_passed * 100.0, 1),
            Cell::fixed(half[0], 3),
            Cell::fixed(half[1], 3),
            Cell::fixed(nyquist[0], 3),
            Cell::fixed(nyquist[1], 3),
            Cell::sig(white.sampling_mtf, 2),
        ]);
    }
    let least = channels.iter().map(|w| w.counted).fold(1.0, f64::min);
    table.caption(format!(
        "Energies are shares of the light that arrives at the element, in squares about the brightest place. The error of sampling is the largest change of an MTF if every second wavelength is left out. {}",
        simulated_words(least)
    ))
}

/// Words for the share of what channels count that is simulated, from the least share of one: rounded down, since no
/// less is simulated.
fn simulated_words(least: f64) -> String {
    if least < 1.0 {
        let percent = fixed((least * 1000.0).floor() / 10.0, 1);
        format!("At least {percent} % of what each channel counts is simulated.")
    } else {
        "All that each channel counts is simulated.".into()
    }
}

/// The middle of a window of so many samples, in squares of whole samples.
fn shown(white: &WhiteChannel, samples: usize) -> (Array2<f64>, f64) {
    let n = white.image.nrows();
    let keep = ((SHOWN_UM / white.step_um) as usize).clamp(1, samples.min(n));
    let square = keep.div_ceil(MOST_PIXELS);
    let pixels = keep / square;
    let from = (n - pixels * square) / 2;
    let middle = part(
        white.image.view(),
        from..from + pixels * square,
        from..from + pixels * square,
    );
    let mut picture = Array2::zeros((pixels, pixels));
    for ((iy, ix), v) in middle.indexed_iter() {
        picture[[iy / square, ix / square]] += f64::from(*v) / (square * square) as f64;
    }
    (picture, white.step_um * square as f64)
}

#[cfg(test)]
mod tests {
    use super::simulated_words;

    #[test]
    fn a_share_that_is_simulated_is_not_rounded_up() {
        for (least, words) in [
            (1.0, "All that each channel counts is simulated."),
            (0.9999, "At least 99.9 % of what each channel counts is simulated."),
            (0.954, "At least 95.4 % of what each channel counts is simulated."),
        ] {
            assert_eq!(simulated_words(least), words);
        }
    }
}
