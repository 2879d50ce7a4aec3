//! The validation for people: `validation.html`, with `validation.txt` and `validation.json` beside it.

use std::path::Path;

use super::chips::NOTHING;
use super::{ClaimedNumber, Validation, ValidationTrial};
use metalith_core::{AtomicFile, Result};
use metalith_report::{Axis, Cell, Column, HeatMap, ImageGrid, Matrix, Page, Table, Verdict, sig, write_json};

/// Largest share of sets without effect in which one may be claimed.
const MOST_FALSE: f64 = 0.05;

/// Range of residual pictures (sigma).
const SIGMAS: f64 = 6.0;

/// Write the validation to a folder.
///
/// # Errors
/// If a file cannot be written.
pub fn write_validation(folder: &Path, validation: &Validation) -> Result<()> {
    AtomicFile::write(&folder.join("validation.txt"), validation.text().as_bytes())?;
    write_json(&folder.join("validation.json"), "calibrate --validate", validation)?;
    let mut page = Page::new(
        "Validation of the calibration",
        format!("Synthetic sets like `{}`; synthetic, not measured", validation.like),
    );
    let share = validation.false_claims as f64 / validation.nulls.max(1) as f64;
    page.verdict(
        if share <= MOST_FALSE {
            Verdict::Pass
        } else {
            Verdict::Fail
        },
        format!(
            "{} false claims in {} sets without effect.",
            validation.false_claims, validation.nulls
        ),
    );
    page.facts(&[
        (
            "Largest gain by chance",
            format!(
                "{} in {} other sets without effect",
                sig(validation.largest_gain_by_chance, 2),
                validation.threshold_nulls
            ),
        ),
        ("Least gain of a claim", sig(validation.least_gain, 2)),
        (
            "Sets with effects of the list",
            format!(
                "{} of {}: all effects named; {}: other effects named in addition",
                validation.with_effects_named, validation.with_effects, validation.with_effects_beside
            ),
        ),
        ("Intervals", validation.coverage.sentence()),
    ]);
    page.paragraph(
        "Each synthetic set has its own registration, flux, black level and noise. Its wavelengths, samples and diffraction orders differ from those of the fits, and single pillars are missing. Which effects can be distinguished depends on these measurements and their noise.",
    );
    page.section("Confusion matrix");
    let mut matrix = Matrix::new("Confusion matrix", validation.claimed.iter().cloned()).axes("claimed", "true");
    for (truth, shares) in &validation.confusion {
        matrix.row(truth.as_str(), shares.iter().copied());
    }
    page.figure(matrix.caption(
        "Percent of the trials of each true effect, all sizes together. Effects that cannot be distinguished share their trial.",
    ));
    limits(&mut page, validation);
    coverage(&mut page, validation);
    off_list(&mut page, validation);
    page.section("Every trial");
    page.details("Trials", |inner| {
        inner.table(trials(validation));
    });
    page.write(&folder.join("validation.html"))
}

fn limits(page: &mut Page, validation: &Validation) {
    page.section("Detection limits");
    let mut table = Table::new([
        Column::text("Effect"),
        Column::text("Named from size"),
        Column::text("Value there"),
        Column::text("Interval there"),
        Column::number("Estimated limit", "typical sizes"),
    ])
    .caption("Detection limit: the smallest size above which the effect was always named, alone or as one of several alternatives. The estimated limit is the size at which the residual of the effect reaches the least gain of a claim.");
    for limit in &validation.limits {
        let at = |t: &&ValidationTrial| t.truth == limit.name && Some(t.size.abs()) == limit.named_from;
        let first = validation.trials.iter().find(at);
        let unit = first.map_or("", |t| t.unit.as_str());
        table.row([
            Cell::code(&limit.name),
            limit.named_from.map_or_else(
                || "not at twice its typical size".into(),
                |s| format!("{} typical", sig(s, 2)).as_str().into(),
            ),
            first.map_or_else(Cell::none, |t| listed(t, unit, |c| sig(c.truth, 4))),
            first.map_or_else(Cell::none, |t| listed(t, "", interval)),
            limit.estimate.map_or_else(Cell::none, |e| Cell::sig(e, 2)),
        ]);
    }
    page.table(table);
}

/// Something of each number that was claimed.
fn listed(t: &ValidationTrial, unit: &str, of: impl Fn(&ClaimedNumber) -> String) -> Cell {
    if t.numbers.is_empty() {
        return Cell::none();
    }
    let all: Vec<String> = t.numbers.iter().map(of).collect();
    format!("{} {unit}", all.join(", ")).trim().into()
}

fn interval(c: &ClaimedNumber) -> String {
    format!("{} to {}", sig(c.interval[0], 4), sig(c.interval[1], 4))
}

fn coverage(page: &mut Page, validation: &Validation) {
    if validation.coverage_by_effect.is_empty() {
        return;
    }
    page.section("Intervals");
    let mut table = Table::new([
        Column::text("Effect"),
        Column::number("Numbers", ""),
        Column::number("Inside", "%"),
        Column::number("Error, rms", "standard deviations"),
        Column::number("Error, rms", "of the true value"),
    ])
    .caption("Claimed values compared with the true values. A standard deviation is half of one side of the interval. Correct intervals have an rms error of one standard deviation; a smaller error means that the intervals are too wide.");
    for own in &validation.coverage_by_effect {
        table.row([
            Cell::code(&own.effect),
            Cell::sig(own.numbers as f64, 4),
            Cell::sig(own.percent(), 3),
            Cell::sig(own.rms_sigmas, 2),
            Cell::sig(own.rms_relative, 2),
        ]);
    }
    page.table(table);
}

fn off_list(page: &mut Page, validation: &Validation) {
    let odd: Vec<&ValidationTrial> = validation.trials.iter().filter(|t| t.off_list).collect();
    if odd.is_empty() {
        return;
    }
    page.section("Effects that are not listed");
    for t in odd {
        page.subsection(&t.truth);
        let said = if t.found.is_empty() {
            String::new()
        } else {
            format!(", {}", t.found.join(", "))
        };
        page.paragraph(format!("Verdict: {}{said}.", t.verdict_name()));
        let Some(left) = &t.left else { continue };
        let strongest = left
            .path_nm
            .iter()
            .max_by(|a, b| (a.1.abs() / a.2).total_cmp(&(b.1.abs() / b.2)));
        if let Some((noll, value, sigma)) = strongest {
            page.paragraph(format!(
                "Strongest term of the smooth path: Noll {noll}, {} +- {} nm. Smooth blur: {} um^2 along x, {} along y, {} across.",
                sig(*value, 3),
                sig(*sigma, 1),
                sig(left.blur_um2[0].0, 2),
                sig(left.blur_um2[2].0, 2),
                sig(left.blur_um2[1].0, 2)
            ));
        }
        let r = left.radius_um;
        let map = HeatMap::new(
            format!("{}: smooth path", t.truth),
            left.path.clone(),
            (Axis::linear("x", "um"), -r, r),
            (Axis::linear("y", "um"), -r, r),
        )
        .values("optical path", "nm")
        .diverging()
        .to_scale()
        .size(380.0, 340.0);
        let mut picture = ImageGrid::new(format!("{}: residual", t.truth), 1)
            .values("residual", "sigma")
            .range(-SIGMAS, SIGMAS)
            .diverging()
            .side(280.0);
        picture.image(left.measurement.as_str(), left.residual.clone());
        page.row([
            map.caption("Smooth optical path over the lens, fitted to the residual."),
            picture.caption("Residual of the measurement with the largest error."),
        ]);
    }
}

fn trials(validation: &Validation) -> Table {
    let mut table = Table::new([
        Column::text("True"),
        Column::number("Size", "typical"),
        Column::text("Value"),
        Column::text("Verdict"),
        Column::text("Claimed"),
        Column::text("Found"),
        Column::text("Interval"),
        Column::text("Includes the true value"),
        Column::number("Held out, before", ""),
        Column::number("after", ""),
    ]);
    for t in validation
        .trials
        .iter()
        .filter(|t| t.truth != NOTHING || !t.found.is_empty())
    {
        table.row([
            Cell::code(&t.truth),
            Cell::sig(t.size, 2),
            listed(t, &t.unit, |c| sig(c.truth, 4)),
            t.verdict_name().as_str().into(),
            t.found.join(", ").as_str().into(),
            listed(t, "", |c| sig(c.found, 4)),
            listed(t, "", interval),
            listed(t, "", |c| if c.is_inside() { "yes" } else { "no" }.into()),
            Cell::sig(t.held_out_before, 4),
            Cell::sig(t.held_out_after, 4),
        ]);
    }
    table
}
