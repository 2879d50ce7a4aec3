//! Through-focus series in words, a table and pictures.

use metalith_core::part;
use metalith_report::{Cell, Column, Figure, ImageGrid, Table, sig};
use metalith_wave::Window;
use metalith_wave::psf::{LEAST_STREHL, Psf, ThroughFocus};

use super::lens_figures::{focus_cells, focus_columns};

/// Decades of a PSF that are shown.
const DECADES: f64 = 4.0;
/// Edge of a PSF that is shown, in wavelengths over the numerical aperture: an ideal PSF is half of one wide.
const SHOWN_WIDTHS: f64 = 12.0;
/// Width of all pictures of a row together in the drawing.
const ROW_WIDTH: f64 = 940.0;

/// The focal length that a series shows, in words.
pub fn focal_length_words(series: &ThroughFocus) -> String {
    let [first, last] = series.ends_um().map(|um| sig(um, 5));
    match series.focal_length_um {
        Some(um) => format!(
            "focal length {} um (planes {} um apart)",
            sig(um, 5),
            sig(series.plane_spacing_um, 3)
        ),
        None if series.greatest_strehl() < LEAST_STREHL => format!(
            "no focus with a Strehl ratio of {LEAST_STREHL} or more between {first} and {last} um: at most {}",
            sig(series.greatest_strehl(), 2)
        ),
        None => format!("no focus between {first} and {last} um"),
    }
}

/// Table of the planes of some series, each with the name of its element or light.
pub(super) fn table<'a>(name: &str, all: impl IntoIterator<Item = (String, &'a ThroughFocus)>) -> Table {
    let head = [
        Column::text(name),
        Column::number("z", "um"),
        Column::number("Strehl ratio", ""),
    ];
    let tail = [
        Column::number("Peak", ""),
        Column::number("Peak x", "um"),
        Column::number("y", "um"),
    ];
    let mut table = Table::new(head.into_iter().chain(focus_columns()).chain(tail));
    for (name, series) in all {
        for plane in &series.planes {
            let focus = &plane.focus;
            let head = [
                Cell::from(name.as_str()),
                Cell::sig(plane.distance_um, 6),
                Cell::sig(focus.strehl, 3),
            ];
            let tail = [
                Cell::sig(plane.peak, 4),
                Cell::fixed(focus.peak_um[0], 2),
                Cell::fixed(focus.peak_um[1], 2),
            ];
            let focus = focus_cells(focus.focusing_efficiency, focus.fwhm_um);
            table.row(head.into_iter().chain(focus).chain(tail));
        }
    }
    table.caption(format!(
        "Planes along z, counted from the pillar tops. Strehl ratios of all planes are against the ideal PSF in the plane of the sensor. The focal length found through focus is the z of the greatest Strehl ratio, by a parabola through the greatest and its two neighbours. It is known to half of the distance of the planes. The focusing efficiency of every plane is the power in one circle, of three FWHM of the plane of the greatest peak. A Strehl ratio below {LEAST_STREHL} is no focus.",
    ))
}

/// A series whose PSFs are the middles of their windows that are shown.
pub(super) fn shown(mut series: ThroughFocus) -> ThroughFocus {
    let shown_um = series.shown_um(SHOWN_WIDTHS);
    series.psfs = series.psfs.iter().map(|psf| middle(psf, shown_um)).collect();
    series
}

/// The middle of a PSF, of this edge (um).
fn middle(psf: &Psf, shown_um: f64) -> Psf {
    let (window, n) = (psf.window, psf.window.samples);
    let keep = ((shown_um / window.step_um) as usize).clamp(1, n);
    let from = (n - keep) / 2;
    let off = 0.5 * (keep as f64 - 1.0) * window.step_um;
    Psf {
        window: Window {
            centre_um: [0, 1].map(|axis| window.coordinate_um(axis, from) + off),
            samples: keep,
            ..window
        },
        values: part(psf.values.view(), from..from + keep, from..from + keep).to_owned(),
        otf: None,
    }
}

/// The PSFs of a series side by side, the middle of each window.
pub(super) fn row(name: &str, series: &ThroughFocus) -> Figure {
    let count = series.psfs.len().max(1);
    let mut images = ImageGrid::new(format!("Through focus, {name}"), count)
        .values("|E|² / |E inc|²", "")
        .log(DECADES)
        .side(ROW_WIDTH / count as f64 - 14.0);
    for psf in &series.psfs {
        let psf = middle(psf, series.shown_um(SHOWN_WIDTHS));
        images = images.pixel_um(psf.window.step_um);
        images.image(format!("{} um", sig(psf.window.distance_um, 5)), psf.values);
    }
    images.caption(format!(
        "PSFs in planes along z: {}; the sensor is at {} um. {DECADES} decades.",
        focal_length_words(series),
        sig(series.sensor_um, 6)
    ))
}
