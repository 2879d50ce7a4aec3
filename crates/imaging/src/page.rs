//! The page of a picture.

use metalith_core::{FolderLock, Result, part, srgb};
use metalith_report::{Axis, Cell, Chart, Column, HeatMap, Page, PhotoRow, Table, fixed, write_json};
use metalith_sensor::{Camera, ColourFilter};
use ndarray::{Array2, Array3};

use crate::approximation_scores::AssumedScore;
use crate::element_images;
use crate::exposure::Frame;
use crate::files::write_restored;
use crate::point_image;
use crate::report::{Assumption, PictureReport};
use crate::resolution::ContrastCurve;
use crate::score::Zone;
use crate::uncertainty::{Uncertainty, UncertaintyReport, root_mean_square};

/// Pictures beside the numbers.
pub struct PicturePages<'a> {
    pub report: &'a PictureReport,
    /// Linear sRGB.
    pub scene: &'a Array3<f64>,
    pub frame: &'a Frame,
    /// Restored pictures by each method, linear sRGB, in the order of the report; the page shows the first.
    pub restored: &'a [Array3<f64>],
    pub camera: &'a Camera,
    /// Uncertainty from samples, if any were drawn.
    pub uncertainty: Option<&'a Uncertainty>,
}

/// Edge of a zoom (pixels of the scene).
const ZOOM: usize = 96;

/// Write `picture.html` and `picture.json` into the folder of a turn, and the frame and all pictures beside them.
///
/// # Errors
/// If they cannot be written.
pub fn write_pages(pages: &PicturePages<'_>, turn: &FolderLock) -> Result<()> {
    turn.publish("picture", &[], |folder| {
        pages.report.frame.write(pages.frame, folder)?;
        for (restoration, picture) in pages.report.restorations.iter().zip(pages.restored) {
            write_restored(&folder.join(&restoration.picture), picture)?;
        }
        write_json(&folder.join("picture.json"), "picture", pages.report)?;
        page(pages).write(&folder.join("picture.html"))
    })
}

/// Scene and picture in linear sRGB, and the frame between them.
pub fn pictures_side_by_side(
    scene: &Array3<f64>,
    frame: &Frame,
    restored: &Array3<f64>,
    channel_names: &[String],
) -> PhotoRow {
    let mut row = PhotoRow::new("Scene, frame, picture", 250.0);
    row.photo("scene", &scene.mapv(srgb::encoded));
    row.photo("frame as recorded", &shown(frame, channel_names));
    row.photo("picture restored", &restored.mapv(srgb::encoded));
    row
}

/// A frame as a person would look at it: colours of its mosaic, brightness of sRGB.
pub fn shown(frame: &Frame, names: &[String]) -> Array3<f64> {
    let (rows, columns) = frame.planes[0].dim();
    let at = |y: usize, x: usize, c: usize| -> f64 {
        let v = match frame.filter {
            ColourFilter::None => {
                let wanted = ["red", "green", "blue"][c];
                let plane = names.iter().position(|n| n == wanted).unwrap_or(0);
                f64::from(frame.planes[plane.min(frame.planes.len() - 1)][[y, x]]) * frame.gain[0] / frame.gain[plane]
            }
            filter => {
                // The mean of those of the square of two by two pixels that count this colour.
                let (y0, x0) = (y & !1, x & !1);
                let (mut sum, mut count, mut gain) = (0.0, 0.0, 1.0);
                for k in 0..4 {
                    let (py, px) = ((y0 + k / 2).min(rows - 1), (x0 + k % 2).min(columns - 1));
                    let channel = crate::exposure::channel_at(filter, names, py, px);
                    if channel.is_some_and(|c2| names[c2] == ["red", "green", "blue"][c]) {
                        sum += f64::from(frame.planes[0][[py, px]]);
                        count += 1.0;
                        gain = frame.gain[channel.unwrap_or(0)];
                    }
                }
                let most = frame.gain.iter().copied().fold(0.0, f64::max);
                sum / f64::max(count, 1.0) * most / gain
            }
        };
        srgb::encoded(v)
    };
    Array3::from_shape_fn((rows, columns, 3), |(y, x, c)| at(y, x, c))
}

/// Sentence on how [`shown`] presents the channels of a frame.
pub(crate) fn shown_words(frame: &Frame, names: &[String]) -> &'static str {
    match frame.filter {
        ColourFilter::None if names.len() == 1 => "It has one channel and is shown in grey.",
        ColourFilter::None => "Its channels are shown as colours.",
        _ => "Its mosaic is shown as colours.",
    }
}

fn page(pages: &PicturePages<'_>) -> Page {
    let report = pages.report;
    let mut page = Page::new(
        format!("The picture that {} will take", report.of_frame.design),
        format!(
            "{} through {}, behind the bytes of {}",
            report.scene, report.of_frame.camera, report.of_frame.layout
        ),
    );
    for note in &report.of_frame.notes {
        page.note(note);
    }
    let names = pages.camera.channel_names();
    let head = pictures_side_by_side(pages.scene, pages.frame, &pages.restored[0], &names);
    page.figure(head.caption(format!(
        "The frame is the recorded signal of the sensor. It includes stray light and the overlapping light of other elements. {} The picture is restored from this frame alone.",
        shown_words(pages.frame, &names)
    )));
    let first = &report.restorations[0];
    let whole = &first.scores[0];
    // Of a frame that is all white the picture is white, as the scene seems to be.
    let score = |words: String| {
        if pages.frame.is_lost() {
            "says nothing: the frame is lost".into()
        } else {
            words
        }
    };
    let linear = fixed(whole.psnr_linear_db, 1);
    let of_linear_light = match first.forecast_of_scene_db.first() {
        Some(forecast) => (
            "PSNR of linear light, forecast from the spectrum of this scene",
            format!("{linear} dB, {} dB", fixed(*forecast, 1)),
        ),
        None => ("PSNR of linear light", format!("{linear} dB")),
    };
    page.facts(&[
        ("Method of the picture", first.method.clone()),
        ("PSNR", score(format!("{} dB", fixed(whole.psnr_db, 1)))),
        ("SSIM", score(fixed(whole.ssim, 3))),
        of_linear_light,
        (
            "Light in images, of all arriving light",
            report
                .budget
                .iter()
                .map(|b| format!("{} %", fixed(100.0 * b.shares.in_kernels / b.shares.arrives, 0)))
                .collect::<Vec<_>>()
                .join(", "),
        ),
        ("Pixels at full scale", report.of_frame.saturated_words()),
        ("Light and exposure", report.of_frame.light.words()),
        (
            "Electrons of a white pixel",
            report.of_frame.light.each(|w| Some(w.electrons), 0),
        ),
        ("SNR of a white pixel", report.of_frame.light.each(|w| w.snr, 1)),
        (
            "Dynamic range used (dB)",
            report.of_frame.light.each(|w| w.dynamic_range_db, 1),
        ),
    ]);
    zooms(&mut page, pages);
    errors(&mut page, pages);
    if let (Some(found), Some(numbers)) = (pages.uncertainty, &report.uncertainty) {
        uncertainty(&mut page, found, numbers);
    }
    contrast(&mut page, &report.contrast);
    scores(&mut page, report);
    point_image::section(&mut page, &report.points, pages.camera.sensor.pixel_um);
    budget(&mut page, report);
    element_images::section(&mut page, &report.elements);
    geometry(&mut page, report);
    worth(&mut page, &report.worth);
    list_assumptions(&mut page, &report.of_frame.assumptions);
    page
}

fn zooms(page: &mut Page, pages: &PicturePages<'_>) {
    page.section("Centre, edge and corner");
    let (rows, columns, _) = pages.scene.dim();
    let side = ZOOM.min(rows / 3).min(columns / 3);
    for (name, row, column) in [
        ("Centre", (rows - side) / 2, (columns - side) / 2),
        ("Edge", (rows - side) / 2, columns - side),
        ("Corner", rows - side, columns - side),
    ] {
        let cut = |picture: &Array3<f64>| {
            let zoom = part(picture.view(), row..row + side, column..column + side);
            zoom.mapv(srgb::encoded)
        };
        let mut zoom = PhotoRow::new(name, 240.0);
        zoom.photo("scene", &cut(pages.scene))
            .photo("picture", &cut(&pages.restored[0]));
        page.figure(zoom.caption(format!("{side} x {side} pixels of the scene.")));
    }
}

fn errors(page: &mut Page, pages: &PicturePages<'_>) {
    let error = root_mean_square(&pages.restored[0].mapv(srgb::encoded), &pages.scene.mapv(srgb::encoded));
    page.section("Errors");
    let map = map("Error of the picture", &error, "error");
    page.figure(map.caption("Root mean square over the colours, of sRGB values from 0 to 1."));
}

/// A map of a picture's pixels.
fn map(title: &str, values: &Array2<f64>, what: &str) -> HeatMap {
    let (rows, columns) = values.dim();
    // The first row of a map is at the bottom, that of a picture at the top.
    let upwards = Array2::from_shape_fn((rows, columns), |(y, x)| values[[rows - 1 - y, x]]);
    let axis = |name: &str, n: usize| (Axis::linear(name, ""), 0.0, n as f64);
    HeatMap::new(title, upwards, axis("column", columns), axis("row from below", rows)).values(what, "")
}

/// Section of the samples: where they differ, detail is invented.
fn uncertainty(page: &mut Page, uncertainty: &Uncertainty, report: &UncertaintyReport) {
    page.section("Uncertainty of the picture");
    let mut row = PhotoRow::new("Mean of samples", 250.0);
    row.photo("mean", &uncertainty.mean.mapv(srgb::encoded));
    page.figure(row.caption(format!(
        "The learnt prior drew {} pictures that agree with the frame. The PSNR of their mean is {} dB.",
        uncertainty.samples,
        fixed(report.scores[0].psnr_db, 2)
    )));
    let map = map("Uncertainty", &uncertainty.spread, "deviation");
    page.figure(map.caption(format!(
        "Standard deviation of the samples, in sRGB values. Where it is large, detail is invented. The rank correlation of this uncertainty with the true error is {}. The map shows where errors are, but not their size: samples deviate by {} on average, and the error of their mean is {}.",
        fixed(report.rank_correlation, 2),
        fixed(report.spread, 3),
        fixed(report.error, 3)
    )));
}

fn scores(page: &mut Page, report: &PictureReport) {
    page.section("Scores");
    let zones = |what: &str, unit: &str| Zone::ALL.map(|z| Column::number(format!("{what}, {}", z.name()), unit));
    let way = |joint: bool| Cell::from(if joint { "joint" } else { "each alone" });
    let mut columns = vec![Column::text("Method"), Column::text("Elements")];
    columns.extend(zones("PSNR", "dB"));
    columns.extend(zones("SSIM", ""));
    let mut table = Table::new(columns);
    for found in &report.restorations {
        let mut row = vec![Cell::from(found.method.as_str()), way(found.joint)];
        row.extend(found.scores.iter().map(|s| Cell::fixed(s.psnr_db, 2)));
        row.extend(found.scores.iter().map(|s| Cell::fixed(s.ssim, 3)));
        table.row(row);
    }
    page.table(table.caption(
        "Zones are the middle, the four edges and the four corners of a division by three. PSNR and SSIM compare sRGB values with the picture of an ideal camera that has the same channels.",
    ));
    let mut columns = vec![Column::text("Linear light"), Column::text("Elements")];
    columns.extend(zones("PSNR", "dB"));
    let mut table = Table::new(columns);
    for found in &report.restorations {
        let mut row = vec![Cell::from(found.method.as_str()), way(found.joint)];
        row.extend(found.scores.iter().map(|s| Cell::fixed(s.psnr_linear_db, 2)));
        table.row(row);
        let mut forecast = |of: String, cells: Vec<Cell>| {
            let mut row = vec![Cell::from(format!("{}, {of}", found.method)), way(found.joint)];
            row.extend(cells);
            table.row(row);
        };
        if !found.forecast_of_scene_db.is_empty() {
            let cells = found.forecast_of_scene_db.iter().map(|db| Cell::fixed(*db, 2));
            forecast("forecast from the spectrum of this scene".into(), cells.collect());
        }
        for natural in &found.forecast_natural {
            let ranges = natural.low_db.iter().zip(&natural.high_db);
            let cells = ranges.map(|(low, high)| Cell::from(format!("{} to {}", fixed(*low, 1), fixed(*high, 1))));
            forecast(
                format!("forecast for eight of ten {}", natural.scenes.words()),
                cells.collect(),
            );
        }
    }
    let forecasts = if report.restorations.iter().any(|r| !r.forecast_of_scene_db.is_empty()) {
        "The forecasts come from a random scene. It shows the share of detail of each size that is lost in each zone, and the error that the light makes whatever the detail. The first forecast is for the detail and the light of this scene, zone by zone: it holds for this picture. The ranges are for other photographs (mean of GB82, and the spread of twelve photographs); one in ten is below, one in ten above. "
    } else {
        ""
    };
    page.table(table.caption(format!(
        "{forecasts}The restoration uses a coarser operator than the simulation. On a random scene its error is {} of the light of a pixel (root mean square), channel by channel. This error counts as noise.",
        report.of_frame.error_words()
    )));
}

fn budget(page: &mut Page, report: &PictureReport) {
    page.section("Light budget");
    let mut table = Table::new([
        Column::text("Channel"),
        Column::number("Images", "%"),
        Column::number("Stray light on the sensor", "%"),
        Column::number("Outside the sensor", "%"),
        Column::number("Not transmitted", "%"),
        Column::number("Evanescent", "%"),
        Column::number("Sum", "%"),
        Column::number("Undiffracted", "%"),
    ]);
    for channel in &report.budget {
        let s = &channel.shares;
        let share = |v: f64| 100.0 * v / s.arrives;
        let sum = s.in_kernels + s.stray_light + s.beyond + s.evanescent + s.not_passed;
        table.row([
            Cell::from(channel.channel.as_str()),
            Cell::fixed(share(s.in_kernels), 2),
            Cell::fixed(share(s.stray_light), 2),
            Cell::fixed(share(s.beyond), 2),
            Cell::fixed(share(s.not_passed), 2),
            Cell::fixed(share(s.evanescent), 2),
            Cell::fixed(share(sum), 2),
            Cell::fixed(share(s.zero_order), 2),
        ]);
    }
    page.table(table.caption(
        "Shares of the light that arrives from a white scene at the openings of all elements. Images: light within the windows of the kernels. Undiffracted light is a part of the stray light and of the light outside the sensor. Light that is not transmitted is reflected, absorbed, stays in the substrate, or leaves at a sine beyond half the wavelength over the pitch.",
    ));
}

fn geometry(page: &mut Page, report: &PictureReport) {
    if report.homographies.is_empty() {
        return;
    }
    page.section("Error of a homography");
    let channels: Vec<&str> = report.budget.iter().map(|b| b.channel.as_str()).collect();
    let mut columns = vec![Column::text("Element")];
    for channel in &channels {
        columns.push(Column::number(format!("{channel}, rms"), "pixels"));
        columns.push(Column::number(format!("{channel}, largest"), "pixels"));
    }
    let mut table = Table::new(columns);
    for own in report.homographies.chunk_by(|a, b| a.element == b.element) {
        let mut row = vec![Cell::from(own[0].element.as_str())];
        for channel in &channels {
            let found = own.iter().find(|h| h.channel == *channel);
            row.push(found.map_or_else(Cell::none, |h| Cell::sig(h.rms_pixels, 2)));
            row.push(found.map_or_else(Cell::none, |h| Cell::sig(h.largest_pixels, 2)));
        }
        table.row(row);
    }
    page.table(table.caption("Distance of the chief rays from the best homography between scene and sub-image."));
}

/// List what was assumed.
pub(crate) fn list_assumptions(page: &mut Page, all: &[Assumption]) {
    page.section("Assumptions");
    page.list(all.iter().map(|a| format!("{}: {}", a.what, a.value)));
}

fn worth(page: &mut Page, cases: &[AssumedScore]) {
    let Some(physics) = cases.first() else { return };
    page.section("Effect of simplified models");
    let mut columns = vec![Column::text("Approximation")];
    for zone in Zone::ALL {
        columns.push(Column::number(format!("PSNR, {}", zone.name()), "dB"));
    }
    columns.push(Column::number("Gain, whole", "dB"));
    columns.push(Column::number("SSIM, whole", ""));
    columns.push(Column::number("Linear light, whole", "dB"));
    let mut table = Table::new(columns);
    for case in cases {
        let mut row = vec![Cell::from(case.assumption)];
        row.extend(case.scores.iter().map(|s| Cell::fixed(s.psnr_db, 2)));
        row.push(Cell::fixed(case.scores[0].psnr_db - physics.scores[0].psnr_db, 2));
        row.push(Cell::fixed(case.scores[0].ssim, 3));
        row.push(Cell::fixed(case.scores[0].psnr_linear_db, 2));
        table.row(row);
    }
    page.table(table.caption(
        "The same scene, recorded and restored with the simplifications of Chakravarthula et al. (2023), by Tikhonov and all elements. The first row has all of the physics. A better score in another row comes from the simplification, not from the chip.",
    ));
}

fn contrast(page: &mut Page, curves: &[ContrastCurve]) {
    if curves.is_empty() {
        return;
    }
    page.section("Contrast of fine detail");
    let mut chart = Chart::new(
        "Contrast over the contrast of the scene",
        Axis::linear("frequency", "cycles a degree"),
        Axis::linear("contrast", ""),
    );
    for curve in curves {
        chart.line(curve.of.as_str(), curve.points.iter().copied());
    }
    page.figure(chart.caption(
        "Contrast in the middle of the field. Frame: recorded values behind the element whose viewing direction is the normal, pixels of one channel, noise included. Picture: mean of the colours in linear light. A restoration may raise contrast above one. Detail that the restoration invents counts too.",
    ));
}
