//! The check list of a planned session, to print.

use std::path::Path;

use metalith_core::Result;
use metalith_report::{Cell, Column, ImageGrid, Page, Table, Verdict, count, counted, exact, sig};

use crate::{CheapMeasurements, MeasurementPlan};
use metalith_calibrate::MeasuredSet;

/// Pictures of a row.
const COLUMNS: usize = 6;

/// Most pictures of the page: more would not be looked at.
const MOST_PICTURES: usize = 36;

/// Sizes that differ by a smaller share are the same, on the way to other units and back.
const SAME: f64 = 1e-6;

/// Write `plan.html`.
///
/// # Errors
/// If the file cannot be written.
pub(crate) fn write_page(path: &Path, plan: &MeasurementPlan, set: &MeasuredSet, unseen: usize) -> Result<()> {
    let mut page = Page::new(
        format!("Check list: {}", set.title),
        "Measurements to take, and the effects that they will find",
    );
    let verdict = if plan.finds_all() { Verdict::Pass } else { Verdict::Fail };
    page.verdict(verdict, format!("{}.", plan.sentence()));
    page.facts(&[
        ("Measurements", count(plan.measurements.len() as u64)),
        (
            "Frames",
            count(plan.measurements.iter().map(|c| u64::from(c.frames)).sum()),
        ),
        ("Widths by SEM", count(set.sem.len() as u64)),
        ("Pairs not distinguished", count(plan.confusions.len() as u64)),
    ]);
    instructions(&mut page, plan, set);
    measurements(&mut page, plan, set);
    effects(&mut page, plan);
    confusions(&mut page, plan);
    if let Some(found) = &plan.cheap {
        cheap(&mut page, found);
    }
    pictures(&mut page, set);
    page.section("Method");
    page.paragraph(format!(
        "{} measurements were considered: every element, colour, angle and distance of the bench{}. Each was simulated with every effect at two sizes. The information of a measurement is its Fisher information at the noise of the camera, with registration, flux and black level free. Measurements were added one by one, each time the one that most improves the weakest detections. This ends when every effect is found and distinguished from every other, as far as measurements of this bench allow. Then measurements that are no longer needed were removed, and each of the others got the fewest frames that suffice. The needed gain is twice the gain that a calibration requires beyond the error of its model.",
        count(plan.candidates as u64),
        if unseen > 0 { format!(" ({unseen} more were left out: their light leaves the element too steeply, or lands too far from its axis)") } else { String::new() }
    ));
    page.paragraph("The plan is based on a simulation of the design as drawn, with single effects and pairs of effects. A chip that differs by much more than the wanted sizes may need other measurements.");
    page.write(path)
}

fn instructions(page: &mut Page, plan: &MeasurementPlan, set: &MeasuredSet) {
    let camera = &set.camera;
    page.section("At the bench");
    page.list([
        format!(
            "Save each measurement as the mean of its frames, without rounding, or as the stack of all frames: raw digital numbers with the black level ({} DN) included, {} rows of {} pixels, the first row at the lowest y.",
            exact(camera.black_level_dn), camera.rows, camera.cols
        ),
        format!(
            "Place the middle of the window at the stated place from the axis of the element, to {} pixels ({} um a pixel in the plane of the sensor).",
            exact(camera.registration_sigma_px), exact(camera.pixel_um)
        ),
        "Set the exposure with an opening without pillars, or without the chip, to the value of the column “open”. If you need another exposure, multiply `scale_dn` of the measurement in measurement.toml by the same factor.".to_owned(),
        "If you take dark frames, take one for each exposure time. Name it with `dark_frame` and `dark_frames` in each measurement of this exposure time.".to_owned(),
        format!(
            "Put the frames into `{}`, with the names of the table. If a measurement fails, delete its section in measurement.toml.",
            plan.folder.join("captures").display()
        ),
        if set.sem.is_empty() {
            "This plan has no widths by SEM.".to_owned()
        } else {
            format!("Measure {} widths by SEM from above, and fill in `measured_nm` in cd_sem.csv. Lines without a value are left out.", set.sem.len())
        },
        format!("Then: `metalith calibrate {}`", plan.folder.display()),
    ]);
}

fn measurements(page: &mut Page, plan: &MeasurementPlan, set: &MeasuredSet) {
    page.section("Measurements");
    let mut table = Table::new([
        Column::text("Done"),
        Column::text("File"),
        Column::text("Element"),
        Column::number("LED", "nm"),
        Column::text("Angle x, y (deg)"),
        Column::number("Distance", "um"),
        Column::text("Window at x, y (um)"),
        Column::number("Frames", ""),
        Column::number("Open", "DN"),
        Column::number("Brightest", "DN"),
    ])
    .caption("Angles of incidence in air. Distances are from the pillar tops. Open: signal above the black level behind an opening without pillars, far from its rim. Brightest: expected value of the brightest pixel, black level included.");
    for c in &plan.measurements {
        let pair = |v: [f64; 2]| format!("{}, {}", exact(v[0]), exact(v[1]));
        let glass = set.stack.cell.substrate.index(c.led_nm * 1e-3).map_or(1.0, |n| n.re);
        let around = set.stack.cell.ambient.index(c.led_nm * 1e-3).map_or(1.0, |n| n.re);
        let open = c.scale_dn * (2.0 * glass / (glass + around)).powi(2);
        table.row([
            Cell::from("☐"),
            Cell::code(&c.file),
            Cell::from(format!("({}, {})", c.element[0], c.element[1]).as_str()),
            Cell::exact(c.led_nm),
            Cell::from(pair(c.aoi_deg).as_str()),
            Cell::exact(c.distance_um),
            Cell::from(pair(c.window_centre_um).as_str()),
            Cell::exact(f64::from(c.frames)),
            Cell::sig(open, 3),
            Cell::sig(c.brightest_dn, 3),
        ]);
    }
    page.table(table);
}

fn effects(page: &mut Page, plan: &MeasurementPlan) {
    page.section("Effects that will be found");
    let mut table = Table::new([
        Column::text("Effect"),
        Column::text("Wanted size"),
        Column::number("Gain", "per pixel"),
        Column::text("Half of the 95 % interval"),
        Column::text("Found"),
    ])
    .caption("Wanted sizes are changes from the stated values. If a calibration reports the whole value instead, it is in brackets. Gain: decrease of the reduced chi-square per pixel when the effect is fitted. The interval is for the effect alone and includes the error of the model.");
    for e in &plan.effects {
        let with_unit = |v: f64| format!("{} {}", sig(v, 3), e.unit).trim_end().to_owned();
        let wanted = if (e.reported - e.wanted).abs() > SAME * e.wanted {
            format!("{} (reported as {})", with_unit(e.wanted), with_unit(e.reported))
        } else {
            with_unit(e.wanted)
        };
        let words = match (e.detected, e.reachable, e.gain >= e.needed) {
            (true, _, _) => "yes".to_owned(),
            (_, _, true) => "no: its interval includes zero".to_owned(),
            (_, true, _) => format!("no: {} is needed; more measurements would suffice", sig(e.needed, 2)),
            (_, false, _) => format!(
                "no: {} is needed; no measurements of this bench reach this gain",
                sig(e.needed, 2)
            ),
        };
        table.row([
            Cell::code(&e.name),
            Cell::from(wanted.as_str()),
            Cell::sig(e.gain, 3),
            Cell::from(with_unit(e.half_interval).as_str()),
            Cell::from(words.as_str()),
        ]);
    }
    page.table(table);
}

fn confusions(page: &mut Page, plan: &MeasurementPlan) {
    page.section("Effects that cannot be distinguished");
    if plan.confusions.is_empty() {
        page.paragraph("Every effect that is found is distinguished from every other.");
        return;
    }
    let mut table = Table::new([
        Column::text("Effect"),
        Column::text("Resembles"),
        Column::number("Gain", "per pixel"),
        Column::text("Distinguished by"),
    ])
    .caption("Gain: part of the gain of the first effect that remains when the second effect is fitted to it, in reduced chi-square per pixel.");
    for c in &plan.confusions {
        let first = format!("{} {} of ", sig(c.size, 3), c.unit);
        let at: Vec<String> = c.at.iter().map(|v| sig(*v, 2)).collect();
        let second = format!("{} {} of ", at.join(", "), c.looks_like_unit);
        let spaced = |text: String| text.replace("  ", " ");
        table.row([
            Cell::from(spaced(format!("{first}{}", c.effect)).as_str()),
            Cell::from(spaced(format!("{second}{}", c.looks_like)).as_str()),
            Cell::sig(c.gain, 2),
            Cell::from(c.remedy().as_str()),
        ]);
    }
    page.table(table);
}

fn cheap(page: &mut Page, found: &CheapMeasurements) {
    page.section("Cheaper measurements first");
    let widths: Vec<String> = found.pad_widths_nm.iter().map(|w| exact(*w)).collect();
    let sem = match found.sem_widths {
        Some(widths) => format!("Measure {} by SEM.", counted(widths, "width")),
        None => "No number of widths by SEM of this bench determines the bias.".into(),
    };
    page.list([
        "Measure the reflectance of the film before it is etched, against a mirror.".to_owned(),
        format!(
            "Measure the reflectance of {}: {} nm.",
            counted(widths.len(), "pad"),
            widths.join(", ")
        ),
        sem,
    ]);
    let mut table = Table::new([
        Column::text("Effect"),
        Column::text("Wanted size"),
        Column::text("Spectrum of the film"),
        Column::text("Spectra of these pads"),
        Column::text("Widths by SEM"),
        Column::text("Determined by"),
    ])
    .caption("Half of the 95 % interval that noise alone makes, all effects of a column fitted together with the gain of the reference; computed from the sensitivities of the model that `calibrate` fits to spectra. An error of the model makes intervals wider.");
    for e in &found.effects {
        let with_unit = |v: &Option<f64>| v.map(|v| format!("{} {}", sig(v, 2), e.unit));
        table.row([
            Cell::code(&e.name),
            with_unit(&e.wanted).as_deref().into(),
            with_unit(&e.film).as_deref().into(),
            with_unit(&e.pads).as_deref().into(),
            with_unit(&e.sem).as_deref().into(),
            e.determined_by.unwrap_or("none of these").into(),
        ]);
    }
    page.table(table);
}

fn pictures(page: &mut Page, set: &MeasuredSet) {
    page.section("Expected pictures");
    let mut grid = ImageGrid::new("Expected measurements", COLUMNS)
        .pixel_um(set.camera.pixel_um)
        .values("digital number", "DN")
        .log(2.0);
    for c in set.measurements.iter().take(MOST_PICTURES) {
        grid.image(&c.name, c.dn.mapv(|v| f64::from(v) - set.camera.black_level_dn));
    }
    page.figure(
        grid.caption("Expected images of the chip as drawn, without noise and black level, on one logarithmic scale."),
    );
}
