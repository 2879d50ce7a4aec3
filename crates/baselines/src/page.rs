//! The page of a comparison.

use metalith_core::{FolderLock, Result, srgb};
use metalith_imaging::{Zone, shown};
use metalith_report::{Axis, Cell, Chart, Column, Page, PhotoRow, Table, write_json};
use metalith_sensor::ColourFilter;

use crate::compare::{ComparedCamera, ComparisonResult};

/// Write `compare.html` and `compare.json` into the folder of a turn.
///
/// # Errors
/// If they cannot be written.
pub fn write_comparison(comparison: &ComparisonResult, turn: &FolderLock) -> Result<()> {
    turn.publish("compare", &[], |folder| {
        write_json(&folder.join("compare.json"), "comparison", comparison)?;
        page(comparison).write(&folder.join("compare.html"))
    })
}

fn page(comparison: &ComparisonResult) -> Page {
    let mut page = Page::new(
        "Cameras side by side",
        format!(
            "{} of {} x {} pixels{}, sensor and light of {}",
            comparison.counted(),
            comparison.size[1],
            comparison.size[0],
            comparison.averaged(),
            comparison.camera
        ),
    );
    if let Some(words) = &comparison.unequal_times {
        page.note(words);
    }
    let mut best = PhotoRow::new("Scene, and the picture of each camera", 220.0);
    if let Some(first) = comparison.cameras.iter().find_map(|c| c.shown.as_ref()) {
        best.photo("scene", &first.scene.mapv(srgb::encoded));
    }
    for camera in &comparison.cameras {
        if let Some((_, picture)) = camera.best() {
            best.photo(camera.name.as_str(), &picture.mapv(srgb::encoded));
        }
    }
    page.figure(best.caption(format!(
        "The first photograph, {}, restored from the frame of each camera by the method with the best score over all photographs. The photograph fills the field of each camera.",
        comparison.photographs.first().map_or("", String::as_str)
    )));
    page.section("Scores");
    table(&mut page, comparison, "PSNR", "dB", 2, |s| s.psnr_db);
    table(&mut page, comparison, "SSIM", "", 3, |s| s.ssim);
    table(&mut page, comparison, "PSNR of linear light", "dB", 2, |s| {
        s.psnr_linear_db
    });
    let timed = if comparison.is_timed() {
        "CPU seconds are for one picture. "
    } else {
        ""
    };
    let is_scored = comparison.cameras.iter().flat_map(|camera| &camera.ways);
    let lpips = if is_scored.into_iter().any(|way| way.one_less_lpips.is_some()) {
        ""
    } else {
        "Without `--lpips` there is no LPIPS, which needs its weights."
    };
    page.paragraph(format!(
        "Means over the photographs: PSNR of the mean squared error, SSIM the mean. Zones are the middle, the four edges and the four corners of a division by three. PSNR and SSIM are of sRGB values unless stated otherwise. {timed}Frames of cameras without a lens are not pictures and have no scores. {lpips}"
    ));
    curves(&mut page, comparison);
    for camera in &comparison.cameras {
        one(&mut page, camera);
    }
    page.section("Photographs");
    page.list(&comparison.photographs);
    page
}

/// PSNR of each camera over the light of the scene, if it was asked for.
fn curves(page: &mut Page, comparison: &ComparisonResult) {
    if comparison.cameras.iter().all(|c| c.curve.is_empty()) {
        return;
    }
    page.section("Light");
    let mut chart = Chart::new(
        "PSNR of linear light over illuminance",
        Axis::log("illuminance", "lux"),
        Axis::linear("PSNR", "dB"),
    );
    for camera in &comparison.cameras {
        let points = camera.curve.iter().map(|[lux, db]| (*lux, *db));
        // A line through one point would not be seen.
        match camera.curve.len() {
            1 => chart.points(camera.name.as_str(), points),
            _ => chart.line(camera.name.as_str(), points),
        };
    }
    page.figure(chart.caption(
        "The first photograph by the first method of each camera, noise and full scale included. With `auto` the time follows the light, up to the longest.",
    ));
}

impl ComparedCamera {
    /// Name of the way with the highest PSNR, and its picture of the first photograph.
    pub fn best(&self) -> Option<(String, &ndarray::Array3<f64>)> {
        let restored = self.ways.iter().filter(|w| w.way.is_some());
        let both = restored.zip(&self.shown.as_ref()?.pictures);
        let best = both.max_by(|a, b| a.0.mean[0].psnr_db.total_cmp(&b.0.mean[0].psnr_db))?;
        Some((best.0.words(), best.1))
    }
}

fn table(
    page: &mut Page,
    comparison: &ComparisonResult,
    what: &str,
    unit: &str,
    digits: usize,
    of: fn(&metalith_imaging::ZoneScore) -> f64,
) {
    let mut columns = vec![Column::text("Camera"), Column::text("Picture")];
    columns.extend(Zone::ALL.map(|z| Column::number(format!("{what}, {}", z.name()), unit)));
    let scored = what == "SSIM";
    if scored {
        columns.push(Column::number("1 - LPIPS", ""));
    }
    let timed = scored && comparison.is_timed();
    if timed {
        columns.push(Column::number("CPU time", "s"));
    }
    let mut table = Table::new(columns);
    for camera in &comparison.cameras {
        for way in &camera.ways {
            let mut row = vec![Cell::from(camera.name.as_str()), Cell::from(way.words())];
            row.extend(way.mean.iter().map(|s| Cell::fixed(of(s), digits)));
            if scored {
                let optional = |v: Option<f64>, digits| v.map_or_else(Cell::none, |v| Cell::fixed(v, digits));
                row.push(optional(way.one_less_lpips, 3));
                if timed {
                    row.push(optional(way.cpu_s, 0));
                }
            }
            table.row(row);
        }
    }
    page.table(table);
}

fn one(page: &mut Page, camera: &ComparedCamera) {
    page.section(camera.name.as_str());
    page.paragraph(format!(
        "{} Its scenes fill {} degrees.",
        camera.words, camera.field_deg
    ));
    if let Some(light) = &camera.light {
        page.paragraph(light.sentence());
    }
    if let Some(limits) = &camera.limits {
        page.note(limits);
    }
    let Some(pictures) = &camera.shown else {
        return;
    };
    let mut row = PhotoRow::new(format!("Pictures of {}", camera.name), 220.0);
    row.photo("scene", &pictures.scene.mapv(srgb::encoded));
    row.photo("frame as recorded", &shown(&pictures.frame, &pictures.channel_names));
    let restored = camera.ways.iter().filter(|w| w.way.is_some());
    for (way, picture) in restored.zip(&pictures.pictures) {
        row.photo(way.words(), &picture.mapv(srgb::encoded));
    }
    let mosaic = match pictures.frame.filter {
        ColourFilter::None => "",
        _ => " The mosaic of the colour filter array is shown as colours.",
    };
    page.figure(row.caption(format!("The first photograph.{mosaic}")));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_limits_a_camera_is_on_its_page() {
        let camera = |limits: Option<&str>| ComparedCamera {
            name: "array".into(),
            words: "Nine lenses.".into(),
            field_deg: 60.0,
            ways: Vec::new(),
            frame_cpu_s: None,
            limits: limits.map(str::to_owned),
            light: None,
            curve: Vec::new(),
            shown: None,
        };
        let comparison = |camera: ComparedCamera| ComparisonResult {
            unequal_times: Some(TIMES.into()),
            photographs: vec!["a".into()],
            size: [64, 64],
            averaged_from: None,
            camera: "sensor".into(),
            seed: 1,
            cameras: vec![camera],
        };
        let folder = tempfile::tempdir().unwrap();
        let written = |camera: ComparedCamera| {
            write_comparison(&comparison(camera), &FolderLock::of(folder.path()).unwrap()).unwrap();
            ["compare.html", "compare.json"].map(|name| std::fs::read_to_string(folder.path().join(name)).unwrap())
        };
        const TIMES: &str = "times differ: a 10 ms, b 3 ms";
        const NOTE: &str = "the restoration is limited by its operator";
        assert!(written(camera(Some(NOTE))).iter().all(|text| text.contains(NOTE)));
        // Unequal times stand before all scores.
        let [html, json] = written(camera(None));
        let table = comparison(camera(None)).markdown();
        assert!(json.contains(TIMES));
        for (text, later) in [(html, "The first photograph"), (table, "pixels")] {
            let (times, scores) = text.split_once(later).unwrap();
            assert!(times.contains(TIMES) && !scores.contains(TIMES), "{text}");
        }
        assert!(!written(camera(None)).iter().any(|text| text.contains(NOTE)));
    }
}
