//! The validation for people: `validation.html`, with `validation.txt` and `validation.json` beside it.

use std::path::Path;

use super::{NOTHING, Validation, ValidationTrial};
use crate::page::round_json;
use metalith_core::{Result, WholeFile};
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
    WholeFile::write(&folder.join("validation.txt"), validation.text().as_bytes())?;
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
            "Intervals that include the true value",
            format!("{} of {}", validation.intervals_inside, validation.intervals),
        ),
    ]);
    page.paragraph(
        "Each synthetic set has its own registration, flux, black level and noise. Its wavelengths, samples and diffraction orders differ from those of the fits, and single pillars are missing. Which effects can be distinguished depends on these captures and their noise.",
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
    .caption("The smallest size from which on an effect was named, alone or as one of several alternatives; the estimated limit is the size at which its residual would reach the least gain of a claim.");
    for limit in &validation.limits {
        let at = |t: &&ValidationTrial| t.truth == limit.name && Some(t.size) == limit.named_from;
        let first = validation.trials.iter().find(at);
        let unit = first.map_or("", |t| t.unit.as_str());
        table.row([
            Cell::code(&limit.name),
            limit.named_from.map_or_else(
                || "not at twice its typical size".into(),
                |s| format!("{} typical", sig(s, 2)).as_str().into(),
            ),
            first
                .and_then(|t| t.value)
                .map_or_else(Cell::none, |v| format!("{} {unit}", sig(v, 4)).as_str().into()),
            first
                .and_then(|t| t.interval.as_ref())
                .map_or_else(Cell::none, |v| round_json(v).as_str().into()),
            limit.estimate.map_or_else(Cell::none, |e| Cell::sig(e, 2)),
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
        picture.image(left.capture.as_str(), left.residual.clone());
        page.row([
            map.caption("Smooth optical path over the lens, fitted to the residual."),
            picture.caption("Residual of the capture with the largest error."),
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
        let json =
            |v: &Option<serde_json::Value>| v.as_ref().map_or_else(Cell::none, |v| round_json(v).as_str().into());
        table.row([
            Cell::code(&t.truth),
            Cell::sig(t.size, 2),
            t.value
                .map_or_else(Cell::none, |v| format!("{} {}", sig(v, 4), t.unit).as_str().into()),
            t.verdict_name().as_str().into(),
            t.found.join(", ").as_str().into(),
            json(&t.found_value),
            json(&t.interval),
            match t.inside {
                None => Cell::none(),
                Some(true) => "yes".into(),
                Some(false) => "no".into(),
            },
            Cell::sig(t.held_out_before, 4),
            Cell::sig(t.held_out_after, 4),
        ]);
    }
    table
}
