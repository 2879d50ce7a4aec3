//! The check list of a planned session, to print.

use metalith_core::Result;
use metalith_report::{Cell, Column, ImageGrid, Page, Table, Verdict, count, exact, sig};

use crate::MeasurementPlan;
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
pub fn write_page(plan: &MeasurementPlan, set: &MeasuredSet, unseen: usize) -> Result<()> {
    let mut page = Page::new(
        format!("Check list: {}", set.title),
        "what to measure, and what it will tell",
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
        ("Pairs not told apart", count(plan.confusions.len() as u64)),
    ]);
    instructions(&mut page, plan, set);
    measurements(&mut page, plan, set);
    effects(&mut page, plan);
    confusions(&mut page, plan);
    pictures(&mut page, set);
    page.section("How it was planned");
    page.paragraph(format!(
        "{} measurements were considered: every element, colour, angle and distance of the bench{}. Each was simulated with every effect at two sizes; what it tells is its Fisher information at the noise of the camera, with registration, flux and black level free. Measurements were added one by one, each time the one that helps the worst detection most, until every effect is found and told from every other where any measurements of the bench can do so; then measurements that had become needless were taken out, and frames were lowered as far as they can be. Needed is twice the gain that a calibration takes for more than the error of its own model.",
        count(plan.candidates as u64),
        if unseen > 0 { format!(" ({unseen} more leave the element too steeply, or land too far from its axis)") } else { String::new() }
    ));
    page.paragraph("This rests on a simulation of the design as drawn, with effects one at a time and one beside another: a chip that differs by much more than the wanted sizes may need other measurements.");
    page.write(&plan.page)
}

fn instructions(page: &mut Page, plan: &MeasurementPlan, set: &MeasuredSet) {
    let camera = &set.camera;
    page.section("At the bench");
    page.list([
        format!(
            "Save each measurement as the mean of its frames, with its fractions, or as the stack of all: raw digital numbers with the black level ({} DN) in, {} rows of {} pixels, the first row at the lowest y.",
            exact(camera.black_level_dn), camera.rows, camera.cols
        ),
        format!(
            "Place the middle of the window at the stated place from the axis of the element, to {} pixels ({} um a pixel in the plane of the sensor).",
            exact(camera.registration_sigma_px), exact(camera.pixel_um)
        ),
        "Set the exposure by an opening without pillars, or without the chip, as the column “open” says. If the exposure has to be another one, correct `scale_dn` of the measurement in measurement.toml by the same factor.".to_owned(),
        "If dark frames are taken, take one for each exposure time, and name it by `dark_frame` and `dark_frames` beside `file` of the measurements that were exposed so long.".to_owned(),
        format!(
            "Put the frames into `{}`, under their names. A measurement that fails is left out by deleting its section in measurement.toml.",
            plan.folder.join("captures").display()
        ),
        if set.sem.is_empty() {
            "No widths by SEM are part of this plan.".to_owned()
        } else {
            format!("Measure {} widths by SEM, from above, and fill in `measured_nm` in cd_sem.csv; lines without it are left out.", set.sem.len())
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
    .caption("Angles of incidence in air. Distances are from the pillar tops. Open: what light through an opening without pillars adds to the black level, far from its rim. Brightest: the brightest pixel to expect, black level included.");
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
    page.section("What it will find");
    let mut table = Table::new([
        Column::text("Effect"),
        Column::text("Wanted size"),
        Column::number("Gain", "per pixel"),
        Column::text("Half of the 95 % interval"),
        Column::text("Found"),
    ])
    .caption("Wanted sizes are changes from what is stated; where a calibration reports the whole instead, that stands in brackets. Gain: by how much reduced chi-square per pixel falls when the effect is fitted. The interval is that of the effect alone, the error of the model counted in.");
    for e in &plan.effects {
        let with_unit = |v: f64| format!("{} {}", sig(v, 3), e.unit).trim_end().to_owned();
        let wanted = match (e.reported - e.wanted).abs() > SAME * e.wanted {
            true => format!("{} (reported as {})", with_unit(e.wanted), with_unit(e.reported)),
            false => with_unit(e.wanted),
        };
        let words = match (e.detected, e.reachable, e.gain >= e.needed) {
            (true, _, _) => "yes".to_owned(),
            (_, _, true) => "no: its interval includes zero".to_owned(),
            (_, true, _) => format!("no: {} is needed, more measurements would do", sig(e.needed, 2)),
            (_, false, _) => format!(
                "no: {} is needed, no measurement of this bench shows as much",
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
    page.section("What it cannot tell apart");
    if plan.confusions.is_empty() {
        page.paragraph("Every effect that is found is told from every other.");
        return;
    }
    let mut table = Table::new([
        Column::text("Effect"),
        Column::text("looks like"),
        Column::number("Gain", "per pixel"),
        Column::text("Told apart by"),
    ])
    .caption("Gain: what reduced chi-square per pixel keeps of the first effect when the second is fitted to it.");
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

fn pictures(page: &mut Page, set: &MeasuredSet) {
    page.section("What to expect");
    let mut grid = ImageGrid::new("Expected measurements", COLUMNS)
        .pixel_um(set.camera.pixel_um)
        .values("digital number", "DN")
        .log(2.0);
    for c in set.measurements.iter().take(MOST_PICTURES) {
        grid.image(&c.name, c.dn.mapv(|v| f64::from(v) - set.camera.black_level_dn));
    }
    page.figure(grid.caption("Of the chip as drawn, without noise, black level taken out, on one logarithmic scale."));
}
